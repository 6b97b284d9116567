/* The life of a fault: it waits for its instant, then for its event, begins, lasts, and ends. */
#include "fault/fault.h"

#include "fault/internal.h"

#include <assert.h>
#include <string.h>

/* ---- kinds: a new table is named here, a new kind is a row of its layer's file */

static const struct fault_table *const tables[] = {&fault_sensor,   &fault_analog, &fault_chip, &fault_controller,
                                                   &fault_line,     &fault_link,   &fault_lab,  &fault_scpi,
                                                   &fault_receiver, &fault_gyro,   NULL};

const struct fault_kind *fault_kind(unsigned i)
{
    for (unsigned t = 0; tables[t]; t++) {
        if (i < tables[t]->count) return &tables[t]->kind[i];
        i -= tables[t]->count;
    }
    return NULL;
}

const struct fault_kind *fault_kind_find(const char *name)
{
    const struct fault_kind *k;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (strcmp(k->name, name) == 0) return k;
    }
    return NULL;
}

/* ---- life */

void fault_init(struct fault_engine *e, const struct control_bench *bench, struct sched *s)
{
    memset(e, 0, sizeof *e);
    e->bench = bench;
    e->sched = s;
    e->seed = bench->seed;
}

void fault_reseed(struct fault_engine *e, uint64_t seed, int64_t t_ns)
{
    e->seed = seed;
    for (struct fault *f = e->fault; f < e->fault + FAULTS_MAX; f++) {
        rng_reseed(&f->random, seed);
        if (f->id != 0 && f->state == FAULT_ACTIVE && f->kind->reseed) f->kind->reseed(f, seed, t_ns);
    }
}

const char *fault_state_name(enum fault_state state)
{
    static const char *const name[] = {"waiting", "listening", "active", "over", "void"};
    return name[state];
}

static void notify_change(struct fault *f, int64_t t_ns)
{
    const struct fault_engine *e = f->engine;
    if (e->changed) e->changed(e->ctx, f, t_ns);
}

static void end_fault(struct fault *f, enum fault_state state, int64_t t_ns)
{
    f->state = state;
    f->ended_ns = t_ns;
    if (state == FAULT_OVER && !f->kind->once) f->kind->lift(f, t_ns);
    notify_change(f, t_ns);
}

static bool apply_fault(struct fault *f, int64_t t_ns)
{
    if (f->kind->apply) return f->kind->apply(f, t_ns);
    f->kind->lift(f, t_ns);
    return true;
}

static void begin_fault(struct fault *f, int64_t t_ns)
{
    f->state = FAULT_ACTIVE;
    f->began_ns = t_ns;
    if (!apply_fault(f, t_ns)) {
        end_fault(f, FAULT_VOID, t_ns);
        return;
    }
    notify_change(f, t_ns);
    if (f->kind->once) end_fault(f, FAULT_OVER, t_ns);
    else if (f->for_ns > 0) sched_at(f->engine->sched, &f->ev, t_ns + f->for_ns);
}

/* Called by the board in the middle of what it does: the fault begins in an event of its own, at the same instant if there
 * is no delay. */
static void on_event(void *ctx, unsigned event, int64_t t_ns)
{
    struct fault *f = ctx;
    if (f->ev.queued || !fault_trigger_event(&f->trigger, (int)event)) return;
    sched_at(f->engine->sched, &f->ev, t_ns + f->delay_ns);
}

/* What it will do may concern each unit, as a brown-out does: none sleeps meanwhile. */
static void subscribe_events(struct fault *f)
{
    f->state = FAULT_LISTENING;
    f->engine->sched->any_time++;
    f->listener.fn = on_event;
    f->listener.ctx = f;
    unit_subscribe(f->engine->bench->unit[f->unit], &f->listener);
}

static void unsubscribe_events(struct fault *f)
{
    f->engine->sched->any_time--;
    unit_unsubscribe(f->engine->bench->unit[f->unit], &f->listener);
}

static void on_due(void *ctx, int64_t t_ns)
{
    struct fault *f = ctx;
    if (f->state == FAULT_ACTIVE) {
        end_fault(f, FAULT_OVER, t_ns);
    } else if (f->state == FAULT_WAITING && f->trigger.after != FAULT_NO_EVENT) {
        subscribe_events(f);
    } else {
        if (f->state == FAULT_LISTENING) unsubscribe_events(f);
        begin_fault(f, t_ns);
    }
}

static bool is_finished(const struct fault *f)
{
    return f->state == FAULT_OVER || f->state == FAULT_VOID;
}

/* A free place, or that of the fault that has been over longest. */
static struct fault *place_for_one(struct fault_engine *e)
{
    struct fault *best = NULL;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        struct fault *f = &e->fault[i];
        if (f->id == 0) return f;
        if (is_finished(f) && (!best || f->ended_ns < best->ended_ns)) best = f;
    }
    return best;
}

uint32_t fault_add(struct fault_engine *e, const struct fault *made, int64_t t_ns)
{
    struct fault *f = place_for_one(e);
    if (!f) return 0;
    *f = *made;
    f->id = ++e->last_id;
    f->engine = e;
    f->state = FAULT_WAITING;
    f->random = rng_stream(e->seed, f->id, "fault");
    memset(&f->ev, 0, sizeof f->ev);
    sched_ev(&f->ev, on_due, f);
    if (f->at_ns > t_ns) sched_at(e->sched, &f->ev, f->at_ns);
    else on_due(f, t_ns);
    return f->id;
}

struct fault *fault_find(struct fault_engine *e, uint32_t id)
{
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        if (id != 0 && e->fault[i].id == id) return &e->fault[i];
    }
    return NULL;
}

void fault_clear(struct fault_engine *e, struct fault *f, int64_t t_ns)
{
    assert(f->engine == e);
    sched_cancel(e->sched, &f->ev);
    if (f->state == FAULT_LISTENING) unsubscribe_events(f);
    if (f->state == FAULT_ACTIVE) end_fault(f, FAULT_OVER, t_ns);
    f->id = 0;
}
