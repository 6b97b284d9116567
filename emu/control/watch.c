#include "control/watch.h"

#include "control/control.h"
#include "control/describe.h"
#include "fault/fault.h"

#include <string.h>

const char *const control_topics[] = {"status", "events", "faults", "files", NULL};
_Static_assert(sizeof control_topics / sizeof *control_topics == CONTROL_TOPICS + 1, "one name for each topic");

enum { PUSH_MAX = 2048 };

static void push_event(const struct control_sub *s, const cJSON *event)
{
    char line[PUSH_MAX];
    const struct control_bench *b = s->control->bench;
    /* cJSON_PrintPreallocated() has the type of a tree it changes; it does not change it. */
    if (cJSON_PrintPreallocated((cJSON *)(uintptr_t)event, line, sizeof line, 0))
        b->process.push(b->ctx, s->client, line);
}

/* A line to all who subscribed to the topic; takes over the event. */
static void notify_topic(struct control *c, enum control_topic topic, cJSON *event)
{
    for (unsigned i = 0; i < CONTROL_SUBS_MAX; i++) {
        const struct control_sub *s = &c->watch.sub[i];
        if (s->control && s->topic == topic) push_event(s, event);
    }
    cJSON_Delete(event);
}

static bool has_subscriber(const struct control *c, enum control_topic topic)
{
    for (unsigned i = 0; i < CONTROL_SUBS_MAX; i++) {
        if (c->watch.sub[i].control && c->watch.sub[i].topic == topic) return true;
    }
    return false;
}

/* ---- triggers of a capture */

static void count_trigger(struct control *c, int64_t t_ns)
{
    struct control_arm *a = &c->watch.arm;
    if (++a->seen < a->count) return;
    a->seen = 0;
    c->bench->capture.trigger(c->bench->ctx, t_ns);
}

static void look_at_fault(struct control *c, const struct fault *f, int64_t t_ns)
{
    const struct control_arm *a = &c->watch.arm;
    if (a->on_fault && f->state == FAULT_ACTIVE && (!a->fault || a->fault == f->kind)) count_trigger(c, t_ns);
}

void control_fault_changed(void *ctx, const struct fault *f, int64_t t_ns)
{
    struct control *c = ctx;
    look_at_fault(c, f, t_ns);
    if (!has_subscriber(c, CONTROL_FAULTS)) return;
    cJSON *event = cJSON_CreateObject();
    cJSON_AddStringToObject(event, "event", "fault");
    cJSON_AddNumberToObject(event, "t_ns", (double)t_ns);
    cJSON_AddNumberToObject(event, "id", f->id);
    cJSON_AddStringToObject(event, "kind", f->kind->name);
    cJSON_AddStringToObject(event, "point", f->name);
    cJSON_AddStringToObject(event, "state", fault_state_name(f->state));
    notify_topic(c, CONTROL_FAULTS, event);
}

void control_file_ended(struct control *c, const char *path, uint64_t bytes, const char *why, int64_t t_ns)
{
    if (!has_subscriber(c, CONTROL_FILES)) return;
    cJSON *event = cJSON_CreateObject();
    cJSON_AddStringToObject(event, "event", "file");
    cJSON_AddNumberToObject(event, "t_ns", (double)t_ns);
    cJSON_AddStringToObject(event, "path", path);
    cJSON_AddNumberToObject(event, "bytes", (double)bytes);
    cJSON_AddStringToObject(event, "ended", why);
    notify_topic(c, CONTROL_FILES, event);
}

/* ---- the boards' events */

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    const struct control_observer *observer = ctx;
    struct control *c = observer->control;
    struct control_until *u = &c->watch.until;
    const struct control_arm *a = &c->watch.arm;
    if (a->on_event && e == a->event && observer->unit == a->unit) count_trigger(c, t_ns);
    if (has_subscriber(c, CONTROL_EVENTS)) {
        cJSON *event = cJSON_CreateObject();
        cJSON_AddStringToObject(event, "event", c->bench->unit[observer->unit]->type->events[e]);
        cJSON_AddStringToObject(event, "unit", c->bench->unit_name[observer->unit]);
        cJSON_AddNumberToObject(event, "t_ns", (double)t_ns);
        notify_topic(c, CONTROL_EVENTS, event);
    }
    if (!u->active || u->reached || e != u->event || observer->unit != u->unit) return;
    u->reached = ++u->seen == u->count;
    if (u->reached) c->bench->sim.run_stop(c->bench->ctx);
}

/* Listens as long as somebody wants to know. */
static void refresh_observers(struct control *c)
{
    struct control_watch *w = &c->watch;
    const bool needed = w->until.active || w->arm.on_event || has_subscriber(c, CONTROL_EVENTS);
    if (needed == w->listening) return;
    w->listening = needed;
    for (unsigned i = 0; i < c->bench->units; i++) {
        struct control_observer *observer = &w->observer[i];
        if (!needed) {
            unit_unsubscribe(c->bench->unit[i], &observer->listener);
            continue;
        }
        *observer = (struct control_observer){.listener = {.fn = on_event, .ctx = observer}, .control = c, .unit = i};
        unit_subscribe(c->bench->unit[i], &observer->listener);
    }
}

void control_watch_until(struct control *c, unsigned event, unsigned unit, uint64_t count)
{
    c->watch.until = (struct control_until){.active = true, .event = event, .unit = unit, .count = count};
    refresh_observers(c);
}

struct control_until control_watch_end(struct control *c)
{
    const struct control_until was = c->watch.until;
    c->watch.until = (struct control_until){0};
    refresh_observers(c);
    return was;
}

void control_watch_arm(struct control *c, const struct control_arm *arm)
{
    c->watch.arm = *arm;
    refresh_observers(c);
}

void control_watch_disarm(struct control *c)
{
    c->watch.arm = (struct control_arm){0};
    refresh_observers(c);
}

/* ---- subscriptions */

static void on_status(void *ctx, int64_t t_ns)
{
    struct control_sub *s = ctx;
    cJSON *event = cJSON_CreateObject();
    cJSON_AddStringToObject(event, "event", "status");
    cJSON_AddNumberToObject(event, "t_ns", (double)t_ns);
    describe_status(s->control->bench, event, t_ns);
    push_event(s, event);
    cJSON_Delete(event);
    sched_at(s->control->bench->sched, &s->ev, t_ns + s->every_ns);
}

static struct control_sub *find_subscription(struct control *c, const void *client, enum control_topic topic)
{
    struct control_sub *room = NULL;
    for (unsigned i = 0; i < CONTROL_SUBS_MAX; i++) {
        struct control_sub *s = &c->watch.sub[i];
        if (s->control && s->client == client && s->topic == topic) return s;
        if (!s->control && !room) room = s;
    }
    return room;
}

bool control_subscribe(struct control *c, void *client, enum control_topic topic, int64_t every_ns, int64_t t_ns)
{
    struct control_sub *s = find_subscription(c, client, topic);
    if (!s) return false;
    if (!s->control) {
        *s = (struct control_sub){.control = c, .client = client, .topic = topic};
        sched_ev(&s->ev, on_status, s);
    }
    s->every_ns = every_ns;
    if (topic == CONTROL_STATUS) sched_at(c->bench->sched, &s->ev, t_ns + every_ns);
    refresh_observers(c);
    return true;
}

void control_unsubscribe(struct control *c, void *client, enum control_topic topic)
{
    struct control_sub *s = find_subscription(c, client, topic);
    if (!s || !s->control) return;
    sched_cancel(c->bench->sched, &s->ev);
    s->control = NULL;
    refresh_observers(c);
}

void control_gone(struct control *c, void *client)
{
    for (int topic = 0; topic < CONTROL_TOPICS; topic++) control_unsubscribe(c, client, (enum control_topic)topic);
}

/* ---- lines */

static void ignore_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    (void)ctx;
    (void)s;
    (void)n;
}

uint64_t control_lines(struct control *c, unsigned unit, int64_t t_ns)
{
    struct trace *t = unit_trace(c->bench->unit[unit]);
    struct trace_sink *probe = &c->watch.probe[unit];
    if (!probe->mask) {
        *probe = (struct trace_sink){.mask = TRACE_FIRST(t->count) & ~t->wires, .steps = ignore_steps};
        trace_attach(t, probe);
    }
    return trace_known(t, t_ns); /* a faulty line is known as far as it was delivered: TRACE_LAG_NS ago */
}
