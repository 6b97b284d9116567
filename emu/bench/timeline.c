#include "bench/timeline.h"

#include "base/text.h"
#include "scenario/yaml_file.h"

#include <stdio.h>
#include <string.h>

static const char *row_at(const void *ctx, size_t i)
{
    (void)ctx;
    const struct control_command *row = control_row(control_tables, (unsigned)i);
    return row ? row->name : NULL;
}

static bool fail_event(const struct scenario *s, const struct scenario_event *e, const char *what, const char *text,
                       char *why, size_t cap)
{
    snprintf(why, cap, "%s:%u:%u: %s: %s: %s", s->path, e->line, e->column, what, e->cmd, text);
    text_one_line(why);
    return false;
}

static bool check_event(const struct scenario *s, const struct control_bench *view, const struct scenario_event *e,
                        const char *what, char *why, size_t cap)
{
    char text[CONTROL_WHY_MAX];
    const struct control_command *row = control_find(control_tables, e->cmd);
    if (!row) {
        const char *near = yaml_nearest(e->cmd, row_at, NULL);
        snprintf(text, sizeof text, "unknown command%s%s", near ? "; nearest: " : "", near ? near : "");
        return fail_event(s, e, what, text, why, cap);
    }
    if (!row->changes) return fail_event(s, e, what, "expected a command that changes the bench", why, cap);
    if (row->missing && row->missing(view)) { /* the section has the name of the instrument, as its commands do */
        const int len = (int)strcspn(e->cmd, ".");
        snprintf(text, sizeof text, "expected a section %.*s in the scenario, got none", len, e->cmd);
        return fail_event(s, e, what, text, why, cap);
    }
    cJSON *args = cJSON_Parse(e->args);
    const bool ok = control_check(control_tables, view, e->cmd, args, text);
    cJSON_Delete(args);
    return ok || fail_event(s, e, what, text, why, cap);
}

bool timeline_check(struct bench *b, char *why, size_t cap)
{
    const struct scenario *s = &b->scenario;
    struct control_bench view = {.ctx = NULL};
    bench_view(b, &view);
    for (unsigned i = 0; i < s->timeline.count; i++)
        if (!check_event(s, &view, &s->timeline.event[i], "timeline", why, cap)) return false;
    for (unsigned i = 0; i < s->faults.count; i++)
        if (!check_event(s, &view, &s->faults.event[i], "faults", why, cap)) return false;
    return true;
}

static void carry_out(struct timeline *t, const struct scenario_event *e, const char *what, int64_t t_ns)
{
    cJSON *args = cJSON_Parse(e->args), *result = cJSON_CreateObject();
    if (control_call(&t->control, e->cmd, args, result, t_ns) == CONTROL_REJECTED) {
        char why[CONTROL_WHY_MAX + 640];
        fail_event(&t->bench->scenario, e, what, t->control.error.why, why, sizeof why);
        t->say(why);
    }
    cJSON_Delete(result);
    cJSON_Delete(args);
}

static int64_t due_ns(const struct timeline *t, unsigned i)
{
    return (int64_t)(t->bench->scenario.timeline.event[t->order[i]].at_s * 1e9 + 0.5);
}

static void on_due(void *ctx, int64_t t_ns)
{
    struct timeline *t = ctx;
    const struct scenario_events *events = &t->bench->scenario.timeline;
    while (t->next < events->count && due_ns(t, t->next) <= t_ns)
        carry_out(t, &events->event[t->order[t->next++]], "timeline", t_ns);
    if (t->next < events->count) sched_at(&t->bench->sched, &t->ev, due_ns(t, t->next));
}

/* Insertion keeps entries of one instant as they were written. */
static void put_in_order(struct timeline *t)
{
    const struct scenario_events *events = &t->bench->scenario.timeline;
    for (unsigned i = 0; i < events->count; i++) {
        unsigned k = i;
        for (; k > 0 && events->event[t->order[k - 1]].at_s > events->event[i].at_s; k--) t->order[k] = t->order[k - 1];
        t->order[k] = i;
    }
}

void timeline_start(struct timeline *t, struct bench *b, const struct control_bench *view)
{
    const struct scenario *s = &b->scenario;
    t->bench = b;
    t->view = *view;
    t->view.process.journal = NULL;
    t->next = 0;
    control_init(&t->control, control_tables, &t->view);
    put_in_order(t);
    for (unsigned i = 0; i < s->faults.count; i++) carry_out(t, &s->faults.event[i], "faults", 0);
    sched_ev(&t->ev, on_due, t);
    if (s->timeline.count) sched_at(&b->sched, &t->ev, due_ns(t, 0));
}
