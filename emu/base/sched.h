/* Event queue in simulated time.
 *
 * Time is int64_t nanoseconds since power-on of the bench. The event struct is intrusive: its owner embeds it, so that
 * scheduling allocates nothing and cannot fail. Order is total: due time, then order of scheduling. One thread. */
#ifndef PSABENCH_BASE_SCHED_H
#define PSABENCH_BASE_SCHED_H

#include <stdbool.h>
#include <stdint.h>

#define SCHED_NEVER INT64_MAX /* due time of an empty queue */
#define SCHED_AT_ONCE_MAX                                                                                              \
    100000u /* more events than this at one instant is a bug: a callback re-arms itself at zero delay */
#define NS_PER_S INT64_C(1000000000)

static inline int64_t ns_earlier(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

static inline int64_t ns_later(int64_t a_ns, int64_t b_ns)
{
    return a_ns > b_ns ? a_ns : b_ns;
}

typedef void sched_fn(void *ctx, int64_t t_ns); /* t_ns is the instant the event was due */

/* One event. Zero it or call sched_ev() before first use; read-only outside sched.c afterwards. */
struct sched_ev {
    int64_t due_ns;
    sched_fn *fn;
    void *ctx;
    uint64_t number;              /* in the heap: order of scheduling */
    struct sched_ev *next, *prev; /* in order of due time, then of scheduling; in the heap: siblings */
    struct sched_ev *child;       /* in the heap */
    enum { SCHED_IDLE, SCHED_NEAR, SCHED_FAR } queued; /* not; in the list; in the heap */
    bool inner; /* it neither looks at what boards have measured nor changes what they measure */
    struct sched_ev *look_next, **look_at; /* not inner, armed: in no order */
};

struct sched {
    int64_t now_ns;    /* read-only outside sched.c */
    int64_t until_ns;  /* of the run under way; before now_ns outside of one */
    int64_t look_ns;   /* no one looks at the boards before, at the end of the run either */
    unsigned asleep;   /* boards whose values are not what they would be if all had been computed */
    bool eager;        /* nothing is put off */
    unsigned any_time; /* observers that may look at, or change, inputs of boards at unpredictable instants */
    uint32_t at_once;
    int64_t at_once_ns;
    uint64_t number;               /* of the next event for the heap */
    struct sched_ev *first, *last; /* the list: what comes next */
    struct sched_ev *far;          /* the heap: what comes after the list, from far_ns on */
    int64_t far_ns;
    struct sched_ev *looks; /* those of both that are not inner */
};

void sched_init(struct sched *s);

/* Names what the event does; call once, while it is idle. */
void sched_ev(struct sched_ev *e, sched_fn *fn, void *ctx);

/* The same for an inner event. */
void sched_ev_inner(struct sched_ev *e, sched_fn *fn, void *ctx);

/* Arms the event for t_ns; an armed event is moved. The past is clamped to now. */
void sched_at(struct sched *s, struct sched_ev *e, int64_t t_ns);

/* Disarms; harmless for an idle event. */
void sched_cancel(struct sched *s, struct sched_ev *e);

/* For an event's function that would arm its event for t_ns as the last thing it does: if nothing else comes before, and the
 * run reaches that far, time moves on to t_ns and the function may go on there itself. False: arm the event. */
bool sched_go_on(struct sched *s, int64_t t_ns);

/* Seconds from one instant to another; 0 if that comes before. */
static inline double sched_since_s(int64_t from_ns, int64_t t_ns)
{
    return t_ns > from_ns ? (double)(t_ns - from_ns) / (double)NS_PER_S : 0.0;
}

/* Due time of the next event, SCHED_NEVER when there is none. */
int64_t sched_next_ns(const struct sched *s);

/* Runs everything due up to and including until_ns, in order, then leaves now at until_ns. */
void sched_run_until(struct sched *s, int64_t until_ns);

/* The same, but no one looks at the boards before look_ns, unless sched_settle() has been called: at until_ns a board may be
 * asleep. What such a board computes late it has computed by look_ns. */
void sched_run_towards(struct sched *s, int64_t until_ns, int64_t look_ns);

/* Runs on until no board is asleep, as far as that takes. */
void sched_settle(struct sched *s);

/* The next instant at which someone may look at a board: an event that is not inner, or the end of the run; now, if
 * nothing is to be put off. */
int64_t sched_look_ns(const struct sched *s);

/* From within an event: the run under way ends at the present instant, as if it had been asked for until now. What else is
 * due at this instant still runs. Outside of a run nothing happens. */
void sched_stop(struct sched *s);

#endif
