/* One look at a time at what is read in rows. */
#ifndef PSABENCH_TESTS_LOOKS_H
#define PSABENCH_TESTS_LOOKS_H

#include "base/looks.h"

/* board_io.accel from a function of one instant, double one(void *ctx, unsigned axis, int64_t t_ns). */
#define LOOKS_ROW(row, one)                                                                                            \
    static inline void row(void *ctx, unsigned axis, const struct looks *at, double *out)                              \
    {                                                                                                                  \
        for (unsigned i = 0; i < at->n; i++) out[i] = one(ctx, axis, at->t_ns[i]);                                     \
    }                                                                                                                  \
    struct looks /* so that a semicolon has to follow */

#endif
