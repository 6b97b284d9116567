/* The ring capture of a running emulator: probe.arm and its files. */
#ifndef PSABENCH_APP_CAPTURE_JOB_H
#define PSABENCH_APP_CAPTURE_JOB_H

#include "trace/capture.h"

#define CAPTURE_FILES_SHOWN 16u
#define CAPTURE_PATH_MAX    4096 /* Linux takes no longer path */

struct capture_file {
    char path[CAPTURE_PATH_MAX];
    uint64_t number; /* from 1; 0: none */
    int64_t trigger_ns, from_ns, end_ns;
    uint64_t bytes, lost;
    char why[96]; /* why it has ended early; "": it has not */
};

struct capture_job {
    struct capture core;
    char path[CAPTURE_PATH_MAX]; /* as given */
    unsigned unit;
    uint32_t files, done;
    uint64_t max_bytes;
    uint64_t number;                               /* files begun since the start */
    FILE *out;                                     /* being written */
    struct capture_file file[CAPTURE_FILES_SHOWN]; /* number n is at n % CAPTURE_FILES_SHOWN */
};

#endif
