/* What targets share that run two boards by the same script, one watched and one not: what they say is the same at all times. */
#ifndef PSABENCH_TESTS_TWIN_H
#define PSABENCH_TESTS_TWIN_H

#include "base/sched.h"
#include "trace/trace.h"

#include <assert.h>
#include <string.h>

enum { TWIN_COUNTERS_MAX = 64 };

/* Into the trail of what a board has said. */
static inline void twin_mix(uint64_t *trail, uint64_t v)
{
    *trail = (*trail ^ v) * UINT64_C(0x9E3779B97F4A7C15);
    *trail ^= *trail >> 29;
}

/* Counters, a struct of uint32_t, never fall; and the trace has lost nothing. */
static inline void twin_counters(void *seen, const void *counters, size_t size, const struct trace *t)
{
    uint32_t was[TWIN_COUNTERS_MAX], now[TWIN_COUNTERS_MAX];
    assert(size <= sizeof was);
    memcpy(was, seen, size);
    memcpy(now, counters, size);
    for (size_t i = 0; i < size / sizeof *now; i++) assert(now[i] >= was[i]);
    memcpy(seen, counters, size);
    assert(t->late == 0 && t->dropped == 0);
}

/* As the main loop does: the trace lags behind. */
static inline void twin_run_until(struct sched *s, struct trace *t, int64_t t_ns, int64_t step_ns)
{
    while (s->now_ns < t_ns) {
        const int64_t left_ns = t_ns - s->now_ns;
        sched_run_until(s, s->now_ns + (left_ns < step_ns ? left_ns : step_ns));
        trace_advance(t, s->now_ns - TRACE_LAG_NS);
    }
}

/* All of a world (size bytes) but the storage of edges that no one has reported, which lies at `at` in it. */
static inline void twin_restore(void *to, const void *from, size_t size, size_t at)
{
    const size_t tail = at + sizeof((struct trace *)0)->pending;
    memcpy(to, from, at);
    memcpy((char *)to + tail, (const char *)from + tail, size - tail);
}

#endif
