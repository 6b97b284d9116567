/* A signal given by samples: what a sensor felt, or put out, at recorded instants.
 *
 * The value at an instant is that of the sample before it (hold), or lies on the straight line to the next one (linear). Before the
 * first sample it is the first one's. The samples are the caller's and never change. Pure but for the place of the last
 * look, from which the next one is found in a step; one thread. */
#ifndef PSABENCH_PHYS_SENSOR_SERIES_H
#define PSABENCH_PHYS_SENSOR_SERIES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum series_between { SERIES_LINEAR, SERIES_HOLD };

/* After the last sample: its value from then on; the first one again, after an interval as long as the last; no signal. */
enum series_end { SERIES_END_HOLD, SERIES_END_REPEAT, SERIES_END_STOP };

struct series_sample {
    int64_t t_ns; /* rising from sample to sample, never equal */
    double value; /* of the signal, in its own unit */
};

struct series {
    const struct series_sample *sample; /* NULL: no series */
    size_t count;                       /* 1 or more; 2 for SERIES_END_REPEAT */
    int64_t start_ns;                   /* added to the samples' times */
    enum series_between between;
    enum series_end end;
    size_t place; /* read-only outside series.c: sample of the last look */
};

/* The signal's value; false when it has ended. Any t_ns; the nearer to the last look, the quicker. */
bool series_value(struct series *s, int64_t t_ns, double *value);

#endif
