/* Line faults and differential pairs, a filter between a board's trace and its sinks.
 *
 * The board is not touched: what it does, counts and sends over other ways stays as it is; the VCD file and the line port
 * see the fault. Steps stay in order of time and are real changes. Several faults of a line add up, stuck ones win, an open pair
 * wins over these. A line with a pair (pair.h) is seen behind its receiver; its wires A and B are signals of their own, at the
 * drivers: swapped and open wires are at the receiver's end, all other faults at the driver's input. Without a fault, a delay of a
 * receiver and a recording of the wires the trace has no filter. Fixed storage, one thread. */
#ifndef PSABENCH_TRACE_LINE_FAULT_H
#define PSABENCH_TRACE_LINE_FAULT_H

#include "base/rng.h"
#include "trace/pair.h"
#include "trace/trace.h"

#define LINE_FAULTS_MAX 64u /* of one board: as many as the fault engine keeps */
#define LINE_PAIRS_MAX  3u

enum line_fault_kind {
    LINE_STUCK_HIGH,
    LINE_STUCK_LOW,
    LINE_INVERTED,      /* wires A and B of the pair swapped */
    LINE_OPEN,          /* a wire of the pair is open at the receiver, which is fail-safe: high */
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
    unsigned top; /* slots from here on are free: an edge looks at none of them */
    uint32_t last_id;
    uint64_t level; /* true levels up to done_ns; those shown are filter.level */
    int64_t done_ns;
    struct pair pair[LINE_PAIRS_MAX];
    unsigned pairs;
};

void line_faults_init(struct line_faults *l, struct trace *t);

/* Before the first step: a line leaves by a pair, whose wires are added to the trace under these names. */
void line_pair_add(struct line_faults *l, const struct pair_cfg *cfg, const char *name_a, const char *name_b);

/* The wires are recorded from now on: without this their levels stay as they are. */
void line_pairs_show(struct line_faults *l);

bool line_has_pair(const struct line_faults *l, unsigned line);

/* Begins at f->from_ns, which is not before the trace's done_ns; the present instant is valid. Returns its number; 0: no room. */
uint32_t line_fault_add(struct line_faults *l, const struct line_fault *f);

/* It ends at t_ns; harmless for one that has ended. */
void line_fault_end(struct line_faults *l, uint32_t id, int64_t t_ns);

/* From t_ns on draws are another seed's; a pulse or a pause that has begun keeps its end. Harmless for one that has ended. */
void line_fault_reseed(struct line_faults *l, uint32_t id, uint64_t seed, int64_t t_ns);

#endif
