/* Writer of Value Change Dump (IEEE 1364-2005 clause 18): a trace sink that sigrok, PulseView, GTKWave and Surfer open.
 *
 * 1-bit wires, and on request real-valued channels (real.h); no date, so that the same run gives the same bytes.
 * Times are rounded down to the file's unit: order is
 * kept and an edge is less than one unit early. The default unit is 10 ns: a half period of CLK (250 ns)
 * is then exact and of SClk (244.14 ns) within 4 %, no datasheet's set-up time (50 ns) collapses into one sample, and
 * sigrok, which makes a sample of every unit, still loads 10 s in seconds (docs/waveforms.md has the figures).
 *
 * The caller owns the struct and the FILE. A failed write is remembered, reported once, and everything after it is dropped: a
 * full disk ends the recording, not the run. Fixed buffer, no allocation, one thread. */
#ifndef PSABENCH_TRACE_VCD_H
#define PSABENCH_TRACE_VCD_H

#include "trace/real.h"
#include "trace/trace.h"

#include <stddef.h>
#include <stdio.h>

#define VCD_UNIT_NS 10u
#define VCD_BUF     65536u
#define VCD_REALS   1024u /* that wait for the edges before them */

struct vcd_cfg {
    FILE *out;          /* open for writing; not closed here */
    const char *scope;  /* no spaces; sigrok drops it, viewers show it */
    uint32_t unit_ns;   /* 1, 10, 100, 1000 ..., 100000000 */
    uint64_t mask;      /* bit i: signal i; the signals must have been added before */
    uint64_t max_bytes; /* a longer file ends with EFBIG, at a time before which it is whole; 0: any length */
    int64_t from_ns;    /* the file begins here, or at the trace's done_ns when later: see vcd_open() */
    bool reals;         /* with the real-valued channels of the trace, if it has any */
};

struct vcd { /* read-only outside vcd.c */
    struct trace_sink sink;
    struct trace *trace;
    FILE *out;
    int64_t from_ns;    /* of the first levels in the file; until the trace has come there: */
    uint64_t before;    /* levels before from_ns, as far as delivered */
    uint64_t level;     /* and with what has happened at from_ns */
    uint64_t found;     /* levels at from_ns when the recording was asked for */
    uint64_t moved;     /* lines that had moved at that instant already */
    int64_t t_units;    /* last time written */
    int64_t edge_units; /* time of the last change */
    int64_t seen_units; /* nothing will change before this */
    struct vcd_chunk {
        int64_t unit_ns;
        uint64_t units_per_ns_q50; /* times 2^50, rounded up; 0: the unit is too long for it */
        int64_t units;             /* times from here on ... */
        int64_t ns;
        uint64_t span_ns;
        unsigned prefix_len;
        char prefix[16]; /* ... have these digits and four more */
    } chunk;
    struct vcd_real {
        int64_t t_ns;
        unsigned channel;
        double value;
    } real[VCD_REALS]; /* in order of time, a ring */
    unsigned real_first, real_count;
    bool reals;   /* requested, and the board has them */
    int error;    /* errno of the first write that failed */
    bool limited; /* EFBIG, at max_bytes */
    bool reported;
    uint64_t changes;
    uint64_t bytes, max_bytes; /* handed to out */
    size_t len;
    char buf[VCD_BUF];
};

/* Writes the header, the levels at from_ns and every change after it; what a board does before, without observers, need
 * not be known. False, and nothing written, when unit_ns is no unit of VCD. A write that fails is reported by vcd_error(). */
bool vcd_open(struct vcd *v, const struct vcd_cfg *cfg, struct trace *t);

/* Puts all that was delivered into the file, with a closing time, so that it can be looked at while it grows. Before
 * the trace has come to from_ns that is the header alone. */
void vcd_flush(struct vcd *v);

/* Detaches and writes a closing time later than the last change (sigrok loses that change otherwise): t_ns, the end of the
 * run up to which the trace has been advanced, or one unit after the change. Then flushes. */
void vcd_close(struct vcd *v, int64_t t_ns);

/* errno of the first failed write, once; 0 if there is none, or none since. */
int vcd_error(struct vcd *v);

/* From outside: its file is lost, or large enough. Nothing more is written. */
void vcd_fail(struct vcd *v, int error);

#endif
