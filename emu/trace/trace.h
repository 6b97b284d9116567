/* Named 1-bit signals and their observers (sinks).
 *
 * A board asks trace_watched() before it computes an edge; without a sink nothing is computed. Edges may be reported out
 * of order within TRACE_LAG_NS (a byte's edges are known when it ends, a frame's when it begins); sinks get them in
 * order of time, then of report, and only real changes. One trace per unit. Fixed storage, no allocation, one thread.
 *
 * A sink that is attached late gets the levels last reported, and what the board's `wake` adds. So a board that computes
 * no edges without sinks still reports the idle levels of its lines (trace_put() costs little), and in `wake` the edges of
 * what is under way. */
#ifndef PSABENCH_TRACE_TRACE_H
#define PSABENCH_TRACE_TRACE_H

#include <stdbool.h>
#include <stdint.h>

#define TRACE_SIGNALS_MAX 64u
#define TRACE_PENDING_MAX 16384u
#define TRACE_RUNS_MAX    64u
#define TRACE_LAG_NS      200000 /* longer than any byte or word on a board's lines */

#define TRACE_BIT(sig) (UINT64_C(1) << (sig))
#define TRACE_FIRST(n) ((n) < 64 ? TRACE_BIT((n) % 64) - 1 : UINT64_MAX) /* mask of signals 0 .. n-1 */

/* From t_ns on the signals in the mask `lines` have these levels. Bit per signal; at one instant in order of their
 * numbers. Bits of `level` outside the mask mean nothing. */
struct trace_step {
    int64_t t_ns;
    uint64_t lines, level;
};

static inline uint64_t trace_after(uint64_t level, const struct trace_step *s)
{
    return (level & ~s->lines) | (s->level & s->lines);
}

/* Steps in a row whose `lines` are just what changes, provided that all these lines are low before; they are after. */
struct trace_run {
    uint64_t at; /* number of the first, counted from the beginning */
    unsigned n;
    uint64_t lines;
};

struct trace_sink {
    uint64_t mask; /* bit i: wants signal i */
    /* n steps in order of time. `lines` are real changes, perhaps none, of all signals: look at those in the mask. */
    void (*steps)(void *ctx, const struct trace_step *s, unsigned n);
    void (*advance)(void *ctx, int64_t t_ns); /* nothing more will come before t_ns; may be NULL */
    void *ctx;
    struct trace_sink *next;
};

/* Between the trace and its sinks: line_fault.h. */
struct trace_filter {
    /* All steps up to and including until_ns, real changes from the levels `before`; hands on what trace_emit() is given. */
    void (*steps)(void *ctx, uint64_t before, const struct trace_step *s, unsigned n, int64_t until_ns);
    void (*start)(void *ctx); /* of a standing one: puts itself in */
    uint64_t level;           /* as the sinks know them */
    void *ctx;
};

/* Of a board that reports less without sinks. */
struct trace_source {
    void (*wake)(void *ctx, uint64_t mask); /* a sink for these signals is being attached: report what is under way */
    /* For lines that move all the time: report them up to t_ns, or as far as there is room; returns how far. May be NULL. */
    int64_t (*report)(void *ctx, int64_t t_ns);
    void *ctx;
};

/* All zero before the first signal is added. */
struct trace {
    const char *name[TRACE_SIGNALS_MAX];
    unsigned count;
    uint64_t level;        /* as delivered, bit per signal */
    uint64_t watched;      /* union of the sinks' masks, and what these follow from */
    uint64_t wires, wired; /* signals that the filter makes, of these: line_fault.h */
    struct trace_sink *sinks;
    struct trace_filter *filter;                  /* or NULL */
    struct trace_filter *standing;                /* starts before the first sink is attached; or NULL */
    struct trace_source source;                   /* set by the board; wake may stay NULL */
    struct trace_group *group;                    /* group.h; or NULL: its owner advances it */
    struct trace_reals *reals;                    /* real.h; of the board, or NULL: it has none */
    struct trace *next_awake;                     /* of the group */
    unsigned room;                                /* TRACE_PENDING_MAX; 0: asleep, it takes no steps before it wakes */
    struct trace_step pending[TRACE_PENDING_MAX]; /* in order of time, then of report, from pending[first] on */
    unsigned first, pending_count;
    uint64_t gone;                        /* steps delivered */
    struct trace_run run[TRACE_RUNS_MAX]; /* of steps pending that need no look at each; may be forgotten */
    unsigned runs;
    int64_t done_ns;  /* delivered up to here */
    uint32_t late;    /* reports behind done_ns: delivered at done_ns, counted; 0 unless a board breaks the window */
    uint32_t dropped; /* reports that found pending full */
};

/* Adds a signal with its level at power-on; returns its number. The name is kept by pointer. */
unsigned trace_add(struct trace *t, const char *name, bool level);

/* Number of the signal of that name, or -1. */
int trace_find(const struct trace *t, const char *name);

/* Wakes the source, then the sink gets the present levels, at t = done_ns. */
void trace_attach(struct trace *t, struct trace_sink *s);
void trace_detach(struct trace *t, struct trace_sink *s); /* gets nothing more; harmless for one that is not attached */

/* Levels at t_ns, of watched lines, as far as they have been reported; with a filter, those delivered. */
uint64_t trace_known(const struct trace *t, int64_t t_ns);

/* Whether a sink watches one of the signals in mask. */
static inline bool trace_watched(const struct trace *t, uint64_t mask)
{
    return (t->watched & mask) != 0;
}

/* Before done_ns is read or a filter set from outside: a trace of a group has caught up, and keeps up. */
void trace_wake(struct trace *t);

/* For a filter: steps as they go to the sinks. */
void trace_emit(const struct trace *t, const struct trace_step *s, unsigned n);

/* Reports n steps that are in order of time: the edges of a byte, a word. */
void trace_steps(struct trace *t, const struct trace_step *s, unsigned n);

/* The same without a copy: room for up to n steps to be filled in order of time, then how many there are. NULL, and
 * nothing to commit, when pending is full. */
struct trace_step *trace_room(struct trace *t, unsigned n);
void trace_commit(struct trace *t, unsigned n);

/* As trace_commit() for steps that are a run of these lines. Delivered faster. */
void trace_commit_run(struct trace *t, unsigned n, uint64_t lines);

/* Reports the levels of the signals in the mask `lines` from t_ns on. Cheap without observers. */
static inline void trace_put(struct trace *t, uint64_t lines, uint64_t level, int64_t t_ns)
{
    if (!(t->watched & lines) && t->pending_count == 0) t->level = (t->level & ~lines) | (level & lines);
    else trace_steps(t, &(struct trace_step){t_ns, lines, level}, 1);
}

static inline void trace_set(struct trace *t, unsigned sig, bool level, int64_t t_ns)
{
    trace_put(t, TRACE_BIT(sig), (uint64_t)level << sig, t_ns);
}

/* Calls a function for each change that a sink was given, one signal at a time: for sinks that need no speed. */
typedef void trace_change_fn(void *ctx, unsigned sig, bool level, int64_t t_ns);
void trace_each(const struct trace_step *s, unsigned n, uint64_t mask, trace_change_fn *change, void *ctx);

/* Delivers everything up to and including t_ns: call with now - TRACE_LAG_NS while running (also without observers, so
 * that done_ns keeps up), with now at the end. Then calls advance of every sink. A t_ns in the past has no effect. */
void trace_advance(struct trace *t, int64_t t_ns);

#endif
