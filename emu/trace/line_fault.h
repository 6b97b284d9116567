/* Line faults, a filter between a board's trace and its sinks.
 *
 * The board is not touched: what it does, counts and sends over other ways stays as it is; the VCD file and the line port
 * see the fault. Steps stay in order of time and are real changes. Several faults of a line add up, stuck ones win. Without
 * a fault the trace has no filter. Fixed storage, one thread. */
#ifndef PSABENCH_TRACE_LINE_FAULT_H
#define PSABENCH_TRACE_LINE_FAULT_H

#include "base/rng.h"
#include "trace/trace.h"

#define LINE_FAULTS_MAX 64u /* of one board: as many as the fault engine keeps */

enum line_fault_kind {
    LINE_STUCK_HIGH,
    LINE_STUCK_LOW,
    LINE_INVERTED,      /* wires A and B of the pair swapped */
    LINE_GLITCH,        /* one pulse of width_ns, inverted level, at from_ns */
    LINE_MISSING_PULSE, /* the pulse-th high pulse of each frame does not come */
    LINE_EXTRA_PULSE,   /* width_ns after the end of that pulse comes another one, of width_ns */
    LINE_NOISE          /* pulses of width_ns, inverted level, at random */
};

struct line_fault {
    enum line_fault_kind kind;
    unsigned line;             /* number of the signal in the trace */
    int64_t from_ns, until_ns; /* until: excluded; INT64_MAX: line_fault_end() */
    int64_t width_ns;          /* GLITCH, EXTRA_PULSE, NOISE: at least 1 */
    unsigned pulse;            /* MISSING_PULSE, EXTRA_PULSE: number in the frame, from 1 */
    unsigned frame_line;       /* signal whose falls begin a frame */
    double rate_hz;            /* NOISE: mean number of pulses a second, above 0, below 1e9 */
    struct rng rng;            /* NOISE */
};

#define LINE_FAULT_SEEDS 4u /* that come within TRACE_LAG_NS; one more replaces the last */

struct line_fault_seed {
    int64_t from_ns;
    uint64_t seed;
};

struct line_fault_slot { /* a fault and where it is */
    struct line_fault f;
    uint32_t id;     /* 0: free */
    bool began;      /* from_ns has passed */
    bool flip;       /* the level is inverted now */
    int64_t next_ns; /* when flip changes; INT64_MAX: with a step, or never */
    unsigned pulses; /* of the frame so far */
    struct line_fault_seed later[LINE_FAULT_SEEDS];
    unsigned laters;
};

struct line_faults {
    struct trace *trace;
    struct trace_filter filter;
    struct line_fault_slot slot[LINE_FAULTS_MAX];
    uint32_t last_id;
    uint64_t level; /* true levels up to done_ns; those shown are filter.level */
    int64_t done_ns;
};

void line_faults_init(struct line_faults *l, struct trace *t);

/* Begins at f->from_ns, which is not before the trace's done_ns; the present instant is valid. Returns its number; 0: no room. */
uint32_t line_fault_add(struct line_faults *l, const struct line_fault *f);

/* It ends at t_ns; harmless for one that has ended. */
void line_fault_end(struct line_faults *l, uint32_t id, int64_t t_ns);

/* From t_ns on draws are another seed's; a pulse or a pause that has begun keeps its end. Harmless for one that has ended. */
void line_fault_reseed(struct line_faults *l, uint32_t id, uint64_t seed, int64_t t_ns);

#endif
