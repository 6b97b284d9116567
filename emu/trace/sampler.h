/* A trace sink that turns the levels of up to sixteen lines into samples of one or two bytes, the way a logic analyser or
 * a bit-bang adapter captures them with its own clock. The line port and the virtual logic analyser are its users.
 *
 * Sample k is the levels at clk_edge_ns(clock, k), levels valid from that instant on. Between edges the samples are one
 * fill. They wait in a bounded ring for the reader; a slow reader loses the newest samples, in whole blocks, which are
 * counted. Where the lines leave bits of a byte free, the first sample after the hole may carry a mark. Attach it only while
 * there is a reader: the lines are computed for it. The ring is the caller's; no allocation, one thread. */
#ifndef PSABENCH_TRACE_SAMPLER_H
#define PSABENCH_TRACE_SAMPLER_H

#include "base/clk.h"
#include "trace/trace.h"

#include <stddef.h>

/* Of the line port: one byte a sample, bit 7 the mark. */
#define SAMPLER_HZ   8000000    /* 4 samples a period of a 2 MHz CLK */
#define SAMPLER_RING (1u << 20) /* bytes: 131 ms at 8 MHz */
#define SAMPLER_GAP  0x80u      /* samples were lost before this one */

#define SAMPLER_LINES_MAX 16u

struct sampler_cfg {
    struct clk clock;         /* t0_ns not later than the instant of sampler_start() */
    const char *const *names; /* of the lines in the trace, bit 0 first, up to NULL */
    unsigned bytes;           /* of a sample: 1, 2 (little-endian) */
    uint8_t gap;              /* added to the first sample after a hole, of one byte; 0: none */
    uint32_t block;           /* samples: a hole is a multiple of it; 1: as many as found no room */
    uint8_t *ring;
    size_t ring_bytes; /* a multiple of bytes */
};

struct sampler { /* read-only outside sampler.c; clock may be set for the next start */
    struct trace_sink sink;
    struct trace *trace;
    struct clk clock;
    unsigned bytes;
    uint16_t bit[TRACE_SIGNALS_MAX]; /* of each line of the trace in a sample */
    uint16_t level;                  /* now */
    uint8_t mark;                    /* cfg.gap */
    uint8_t gap;                     /* mark the next sample with this */
    bool hole;                       /* no sample was kept since the last that was lost */
    uint32_t block, skip;            /* samples that are still to be lost */
    int64_t next;                    /* count of the first sample not yet made */
    uint64_t kept, dropped, holes;   /* samples, samples, runs of them */
    uint8_t *ring;
    size_t cap, head, len; /* bytes; oldest, waiting */
};

/* Bits of the lines in a sample: 8 or 16, 7 where bit 7 is the mark. */
unsigned sampler_lines_max(const struct sampler_cfg *cfg);

/* Starts sampling at the first clock edge at or after the trace's done_ns, with an empty ring. False when the trace has no
 * such lines or there are too many. A sampler that was stopped may be started again. */
bool sampler_start(struct sampler *s, struct trace *t, const struct sampler_cfg *cfg);

/* The line port's: one byte, with mark, in a ring of SAMPLER_RING bytes. */
struct sampler_cfg sampler_line_port(const struct clk *clock, const char *const *names, uint8_t *ring);

/* Detaches; what waits can still be taken. */
void sampler_stop(struct sampler *s);

/* Moves up to cap of the oldest bytes, whole samples, to buf; returns how many bytes. */
size_t sampler_take(struct sampler *s, uint8_t *buf, size_t cap);

#endif
