/* One column of a CSV file as samples (phys/sensor/series.h), line by line. Pure, bounded, no allocation.
 *
 *     # lines like this one are passed over
 *     t_s,x_mps2,y_mps2
 *     0.000,9.80665,0.01
 *     0.001,9.80671,0.02
 *
 * The first column is the time, t_s or t_ns: a decimal number without exponent, whole nanoseconds, rising. The others have names with
 * their unit at the end. Times are read exactly, values as the nearest double. */
#ifndef PSABENCH_SCENARIO_SERIES_CSV_H
#define PSABENCH_SCENARIO_SERIES_CSV_H

#include "phys/sensor/series.h"

enum {
    SERIES_CSV_LINE = 4096,   /* longest line, bytes */
    SERIES_CSV_COLUMNS = 256, /* most columns */
    SERIES_CSV_NAME = 48,     /* longest name of a column and its NUL */
    SERIES_CSV_VALUE_MAX = 1000000,
};
#define SERIES_CSV_MOST_NS INT64_C(1000000000000000) /* of a time, either sign: 11 days */

struct series_csv { /* read-only outside series_csv.c */
    char column[SERIES_CSV_NAME];
    unsigned index; /* of the column; 0: the header has not come */
    unsigned columns;
    bool in_s; /* times are seconds, else nanoseconds */
    bool any;  /* a sample has come */
    int64_t last_ns;
};

enum series_csv_line { SERIES_CSV_NONE, SERIES_CSV_SAMPLE, SERIES_CSV_BAD };

void series_csv_init(struct series_csv *c, const char *column);

/* A line without its LF. BAD: with what was expected and what came in why, without file and line. */
enum series_csv_line series_csv_line(struct series_csv *c, const char *line, size_t n, struct series_sample *out,
                                     char *why, size_t cap);

#endif
