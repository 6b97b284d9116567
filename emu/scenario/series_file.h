/* The signals of a scenario that come from files: read once, checked line by line, then mapped. */
#ifndef PSABENCH_SCENARIO_SERIES_FILE_H
#define PSABENCH_SCENARIO_SERIES_FILE_H

#include "base/sha256.h"
#include "phys/sensor/series.h"

/* Column of a CSV file (series_csv.h) into s->sample and s->count. The samples lie in an unnamed temporary file that is mapped for as
 * long as the process lives: 16 bytes each, in pages that the kernel may take back. hex gets the file's SHA-256. False with
 * `FILE:LINE: ...` in why. */
bool series_file_open(const char *path, const char *column, struct series *s, char hex[SHA256_HEX], char *why,
                      size_t cap);

#endif
