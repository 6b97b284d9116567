/* Faults: what goes wrong where, when and for how long.
 *
 * A kind of fault is a row of a table: its layer, the places it can happen at, the arguments it takes, and
 * how it is injected and cleared. A fault is a kind at a point, `a.sensor.x`, begun at an instant of simulated time or
 * by an event of a board, and lifted after a time or by command. Random ones draw from rng_stream(seed, id, "fault").
 * What a point does not support is rejected with the reason. Several faults may be at one point. One thread; owned by the
 * application, never moved after fault_init(). */
#ifndef PSABENCH_FAULT_FAULT_H
#define PSABENCH_FAULT_FAULT_H

#include "base/can/fault.h"
#include "fault/args.h"
#include "fault/point.h"
#include "fault/trigger.h"
#include "trace/line_fault.h"

#define FAULTS_MAX 64u

#define FAULT_BIT(i) (UINT64_C(1) << (i))

enum fault_state {
    FAULT_WAITING,   /* for its instant */
    FAULT_LISTENING, /* for its event */
    FAULT_ACTIVE,
    FAULT_OVER,
    FAULT_VOID /* when it was due, it could have no effect: its point was no longer there */
};

struct fault_engine;

union fault_body {
    struct sensor_fault sensor;
    struct afe_fault afe;
    uint32_t line; /* number among the faults of the unit's lines */
    struct can_fault can;
    struct table_ripple ripple;
    const struct can_node *client; /* that is stalled */
};

struct fault {
    uint32_t id; /* from 1; 0: the place is free */
    const struct fault_kind *kind;
    struct fault_point point;
    char name[FAULT_POINT_MAX]; /* of the point */
    double value[FAULT_ARGS];
    uint64_t given; /* bit of enum fault_arg: the value was given */
    enum fault_state state;
    int64_t at_ns, delay_ns, for_ns; /* for_ns 0: until it is cleared */
    unsigned unit;                   /* whose events count */
    struct fault_trigger trigger;    /* after FAULT_NO_EVENT: by time alone */
    int64_t began_ns, ended_ns;
    union fault_body as; /* what hangs in the bench while it is active */
    struct rng random;
    struct fault_engine *engine;
    struct unit_observer listener;
    struct sched_ev ev;
};

struct fault_kind {
    const char *name;   /* layer.name */
    const char *what;   /* one sentence */
    const char *seen;   /* how a host sees it, one sentence */
    const char *unless; /* what `fits` rejects, for the page; NULL: nothing */
    unsigned variant;   /* which of its layer's, for apply */
    uint64_t places;    /* bits of enum fault_place */
    uint64_t need, may; /* bits of enum fault_arg: the values it must be given, those it may */
    uint64_t nonzero;   /* values that would change nothing if they were 0 */
    const char *lacks;  /* of chips and controllers: why a board has it not, where its table gives no reason */
    bool once;          /* over as soon as it is done */
    /* What its places do not say of this point or these values: false with the reason in why. NULL: it always fits. */
    bool (*fits)(const struct control_bench *b, const struct fault *f, char *why);
    /* False: the point is no longer there, or has no room. NULL: lift does it, which puts the sum of what is ACTIVE in effect. */
    bool (*apply)(struct fault *f, int64_t t_ns);
    void (*lift)(struct fault *f, int64_t t_ns); /* it is no longer ACTIVE; NULL for those that are over at once */
    void (*reseed)(struct fault *f, uint64_t seed,
                   int64_t t_ns); /* while it is ACTIVE: what hangs in the bench; NULL: nothing random */
};

struct fault_table {
    const struct fault_kind *kind;
    unsigned count;
};

struct fault_engine {
    const struct control_bench *bench;
    struct sched *sched;
    struct fault fault[FAULTS_MAX];
    uint32_t last_id;
    uint64_t seed;                                                   /* the bench's, until fault_reseed() */
    void (*changed)(void *ctx, const struct fault *f, int64_t t_ns); /* it began or ended; may be NULL */
    void *ctx;
};

void fault_init(struct fault_engine *e, const struct control_bench *bench, struct sched *s);

/* What is random in faults, later ones and those that are active, draws from another seed from now on. */
void fault_reseed(struct fault_engine *e, uint64_t seed, int64_t t_ns);

/* The i-th kind; NULL past the last. */
const struct fault_kind *fault_kind(unsigned i);
const struct fault_kind *fault_kind_find(const char *name);
const char *fault_state_name(enum fault_state state);

/* Fills in a fault from the arguments of fault.add. False with the reason. Ranges have been checked. */
bool fault_make(const struct control_bench *b, const struct control_value *v, struct fault *out,
                struct control_error *why);

/* Whether a kind may be at a point; false with the reason in why[CONTROL_WHY_MAX]. */
bool fault_fits(const struct control_bench *b, const struct fault *f, char *why);

static inline bool fault_given(const struct fault *f, enum fault_arg arg)
{
    return (f->given & FAULT_BIT(arg)) != 0;
}

/* Takes over a fault that fault_make() made, now. Its id, or 0 if FAULTS_MAX are waiting or active. */
uint32_t fault_add(struct fault_engine *e, const struct fault *f, int64_t t_ns);

struct fault *fault_find(struct fault_engine *e, uint32_t id);
void fault_clear(struct fault_engine *e, struct fault *f, int64_t t_ns); /* lifts it and forgets it */

#endif
