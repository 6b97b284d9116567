/* Real-valued channels beside the lines of a trace: voltages at the nodes of an analog board, as a probe would show them.
 *
 * The board reports a value where its model has one anyhow, in order of time and never for a time to come; the voltage
 * between two values is not said. There is one observer or none, and without one nothing is computed. */
#ifndef PSABENCH_TRACE_REAL_H
#define PSABENCH_TRACE_REAL_H

#include <stdbool.h>
#include <stdint.h>

#define TRACE_REALS_MAX 8u

struct trace_reals {
    const char *name[TRACE_REALS_MAX]; /* kept by pointer */
    unsigned count;
    void (*value)(void *ctx, unsigned channel, double value, int64_t t_ns); /* of the observer; NULL: there is none */
    void *ctx;
};

static inline bool trace_real_watched(const struct trace_reals *r)
{
    return r->value != 0;
}

static inline void trace_real(const struct trace_reals *r, unsigned channel, double value, int64_t t_ns)
{
    if (r->value) r->value(r->ctx, channel, value, t_ns);
}

#endif
