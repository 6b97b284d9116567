#include "trace/capture.h"

#include <string.h>

enum { DRAIN_STEPS = 1024 }; /* handed to the copy at once: less than it holds pending */

static const struct trace_step *oldest_step(const struct capture *c)
{
    return &c->cfg.ring[c->head];
}

static void drop_oldest(struct capture *c)
{
    const struct trace_step *s = oldest_step(c);
    c->base = trace_after(c->base, s);
    c->base_ns = s->t_ns;
    c->head = c->head + 1 == c->cfg.steps_max ? 0 : c->head + 1;
    c->count--;
}

static void append_step(struct capture *c, const struct trace_step *s, uint64_t lines)
{
    if (c->count == c->cfg.steps_max) {
        c->lost += c->state == CAPTURE_WRITING;
        drop_oldest(c);
    }
    unsigned at = c->head + c->count++;
    if (at >= c->cfg.steps_max) at -= c->cfg.steps_max;
    c->cfg.ring[at] = (struct trace_step){s->t_ns, lines, s->level};
}

/* Whether the trigger's line, which changes with this step if at all, does what is waited for. */
static bool step_triggers(const struct capture *c, const struct trace_step *s)
{
    const bool up = s->level >> c->cfg.sig & 1;
    if (c->cfg.when == CAPTURE_OUTSIDE || !(s->lines >> c->cfg.sig & 1)) return false;
    switch (c->cfg.when) {
    case CAPTURE_EDGE:
        return true;
    case CAPTURE_RISING:
    case CAPTURE_HIGH:
        return up;
    default:
        return !up;
    }
}

void capture_trigger(struct capture *c, int64_t t_ns)
{
    if (c->state == CAPTURE_OFF) return;
    c->triggers++;
    if (c->state != CAPTURE_ARMED) return;
    c->state = CAPTURE_TRIGGERED;
    c->trigger_ns = t_ns;
    c->end_ns = t_ns + c->cfg.post_ns;
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct capture *c = ctx;
    for (const struct trace_step *const end = s + n; s < end; s++) {
        const uint64_t lines = s->lines & c->sink.mask;
        if (!lines) continue;
        c->level = trace_after(c->level, &(struct trace_step){s->t_ns, lines, s->level});
        append_step(c, s, lines);
        if (step_triggers(c, s)) capture_trigger(c, s->t_ns);
    }
}

static void present_levels(void *ctx, const struct trace_step *s, unsigned n)
{
    struct capture *c = ctx;
    (void)n;
    c->level = c->base = s->level;
    c->base_ns = s->t_ns;
}

/* A level that is waited for may be there. */
static void look_at_level(struct capture *c)
{
    const bool up = c->level >> c->cfg.sig & 1;
    if ((c->cfg.when == CAPTURE_HIGH && up) || (c->cfg.when == CAPTURE_LOW && !up))
        capture_trigger(c, c->trace->done_ns);
}

void capture_arm(struct capture *c, struct trace *t, const struct capture_cfg *cfg)
{
    memset(c, 0, offsetof(struct capture, vcd));
    c->cfg = *cfg;
    c->trace = t;
    c->state = CAPTURE_ARMED;
    const uint64_t mask = cfg->mask | (cfg->when == CAPTURE_OUTSIDE ? 0 : TRACE_BIT(cfg->sig));
    c->sink = (struct trace_sink){.mask = mask, .steps = present_levels, .ctx = c};
    trace_attach(t, &c->sink);
    c->sink.steps = on_steps;
    look_at_level(c);
}

/* The copy has the same lines, with their levels at from_ns. */
static void copy_lines(struct capture *c)
{
    memset(c->cfg.copy, 0, sizeof *c->cfg.copy);
    for (unsigned i = 0; i < c->trace->count; i++) trace_add(c->cfg.copy, c->trace->name[i], c->base >> i & 1);
    trace_advance(c->cfg.copy, c->from_ns);
}

void capture_begin(struct capture *c, const struct vcd_cfg *cfg)
{
    const int64_t pre_ns = c->trigger_ns - c->cfg.pre_ns;
    while (c->count && oldest_step(c)->t_ns < pre_ns) drop_oldest(c);
    c->from_ns = pre_ns > c->base_ns ? pre_ns : c->base_ns;
    copy_lines(c);
    struct vcd_cfg own = *cfg;
    own.from_ns = c->from_ns;
    own.mask = c->cfg.mask;
    (void)vcd_open(&c->vcd, &own, c->cfg.copy);
    c->state = CAPTURE_WRITING;
    c->lost = 0;
    capture_drain(c);
}

/* Up to DRAIN_STEPS of the steps up to the file's end; whether there may be more. */
static bool drain_some(struct capture *c)
{
    unsigned n = 0;
    int64_t t_ns = 0;
    for (; n < DRAIN_STEPS && c->count && oldest_step(c)->t_ns <= c->end_ns; n++) {
        t_ns = oldest_step(c)->t_ns;
        trace_steps(c->cfg.copy, oldest_step(c), 1);
        drop_oldest(c);
    }
    if (n) trace_advance(c->cfg.copy, t_ns);
    return n == DRAIN_STEPS;
}

void capture_drain(struct capture *c)
{
    if (c->state != CAPTURE_WRITING) return;
    while (drain_some(c)) continue;
    const int64_t done_ns = c->trace->done_ns;
    trace_advance(c->cfg.copy, done_ns < c->end_ns ? done_ns : c->end_ns);
    if (done_ns >= c->end_ns) c->state = CAPTURE_FULL;
}

void capture_end(struct capture *c)
{
    if (c->state != CAPTURE_WRITING && c->state != CAPTURE_FULL) return;
    const int64_t done_ns = c->cfg.copy->done_ns;
    if (done_ns < c->end_ns) c->end_ns = done_ns;
    vcd_close(&c->vcd, c->end_ns);
    c->state = CAPTURE_ARMED;
    look_at_level(c);
}

void capture_off(struct capture *c)
{
    if (c->state == CAPTURE_OFF) return;
    trace_detach(c->trace, &c->sink);
    c->state = CAPTURE_OFF;
}
