/* The line port's sampler: a trace sink that turns the levels of up to seven lines into sampled bytes, the way a bit-bang
 * adapter captures them with its own clock. The board selects the lines (PSA-2: INT, DATA, CLK).
 *
 * Sample k is the levels at clk_edge_ns(clock, k), levels valid from that instant on. Between edges the bytes are one
 * memset. They wait in a bounded ring for the reader; a slow reader loses the newest samples, which are
 * counted, and the first byte after the hole carries SAMPLER_GAP. Attach it only while there is a reader: the lines
 * are computed for it. Plain struct owned by the caller, no allocation, one thread. */
#ifndef PSABENCH_TRACE_SAMPLER_H
#define PSABENCH_TRACE_SAMPLER_H

#include "base/clk.h"
#include "trace/trace.h"

#include <stddef.h>

#define SAMPLER_HZ   8000000    /* 4 samples a period of a 2 MHz CLK */
#define SAMPLER_RING (1u << 20) /* bytes: 131 ms at 8 MHz; a power of two */

#define SAMPLER_LINES 7u    /* bits 0 to 6 of a byte, as many as there are; the others are 0 */
#define SAMPLER_GAP   0x80u /* samples were lost before this one */

struct sampler { /* read-only outside sampler.c */
    struct trace_sink sink;
    struct trace *trace;
    struct clk clock;
    unsigned lines;
    uint8_t sig[SAMPLER_LINES]; /* their numbers in the trace */
    uint8_t level;              /* now */
    uint8_t gap;                /* SAMPLER_GAP: mark the next byte */
    int64_t next;               /* count of the first sample not yet made */
    uint64_t dropped;           /* samples that found the ring full */
    size_t head, len;           /* oldest byte, bytes waiting */
    uint8_t ring[SAMPLER_RING];
};

/* Starts sampling the lines of these names, up to NULL, at the first clock edge at or after the trace's done_ns (the clock's
 * t0_ns must not be later), with an empty ring. False when the trace has no such lines. A sampler that was stopped may be started again, with
 * &s->clock for the same clock. */
bool sampler_start(struct sampler *s, struct trace *t, const char *const *names, const struct clk *clock);

/* Detaches; what waits can still be taken. */
void sampler_stop(struct sampler *s);

/* Moves up to cap of the oldest bytes to buf; returns how many. */
size_t sampler_take(struct sampler *s, uint8_t *buf, size_t cap);

#endif
