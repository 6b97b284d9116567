/* A row of looks at a signal: n instants in order, and the interval of each. White noise of a one-sided density d has the
 * variance d^2 / (2 every) at a look: what the converter's filter passes then does not depend on how often it looks. */
#ifndef PSABENCH_BASE_LOOKS_H
#define PSABENCH_BASE_LOOKS_H

#include <math.h>
#include <stdint.h>

#define LOOKS_MAX 64u /* in a row */

struct looks {
    const int64_t *t_ns;
    unsigned n; /* 1 .. LOOKS_MAX */
    int64_t every_ns;
};

/* What a signal stays within: mid - off to mid + off. */
struct looks_range {
    double mid, off;
};

/* Standard deviation at a look of white noise of a one-sided density, units/rtHz. */
static inline double looks_white_rms(double density_rthz, int64_t every_ns)
{
    return density_rthz * sqrt(1e9 / (2.0 * (double)every_ns));
}

#endif
