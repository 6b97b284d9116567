/* Who listens to a board's lines and asserts what it is given: real changes, in order of time. */
#ifndef PSABENCH_FUZZ_LISTENER_H
#define PSABENCH_FUZZ_LISTENER_H

#include "trace/trace.h"

#include <assert.h>

struct listener {
    struct trace_sink sink;
    uint64_t level, known; /* of the lines, as it was given; cleared by who attaches it again */
    int64_t edge_ns;       /* last told */
};

static inline void listener_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct listener *l = ctx;
    const uint64_t bit = TRACE_BIT(sig);
    assert(l->sink.mask & bit && t_ns >= l->edge_ns);
    assert(!(l->known & bit) || level != ((l->level & bit) != 0));
    l->edge_ns = t_ns;
    l->known |= bit;
    l->level = level ? l->level | bit : l->level & ~bit;
}

static inline void listener_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct listener *l = ctx;
    for (unsigned i = 1; i < n; i++) assert(s[i].t_ns >= s[i - 1].t_ns);
    trace_each(s, n, l->sink.mask, listener_change, l);
}

#endif
