#include "trace/line_fault.h"

#include "base/detmath.h"

#include <assert.h>
#include <string.h>

#define NEVER INT64_MAX
#define ROOM  128u /* steps handed on at a time */

struct out {
    struct trace_step step[ROOM];
    unsigned n;
};

static uint64_t bit_of(const struct line_fault_slot *s)
{
    return TRACE_BIT(s->f.line);
}

/* ---- one fault ---- */

/* Steps come later than commands: a seed waits for the edges of its instant. */
static void take_seeds(struct line_fault_slot *s, int64_t t_ns)
{
    while (s->laters > 0 && s->later[0].from_ns <= t_ns) {
        rng_reseed(&s->f.rng, s->later[0].seed);
        memmove(s->later, s->later + 1, --s->laters * sizeof *s->later);
    }
}

static int64_t noise_gap_ns(struct line_fault_slot *s, int64_t t_ns)
{
    struct line_fault *f = &s->f;
    take_seeds(s, t_ns);
    const double gap_ns = -det_log(rng_uniform(&f->rng)) * 1e9 / f->rate_hz;
    return gap_ns < 1.0 ? 1 : gap_ns > 1e15 ? INT64_C(1000000000000000) : (int64_t)gap_ns;
}

/* When it next does something of itself. */
static int64_t due_ns(const struct line_fault_slot *s)
{
    if (s->id == 0) return NEVER;
    if (!s->began) return s->f.from_ns;
    return s->next_ns < s->f.until_ns ? s->next_ns : s->f.until_ns;
}

static void begin_fault(struct line_fault_slot *s, int64_t t_ns)
{
    s->began = true;
    s->next_ns = NEVER;
    if (s->f.kind == LINE_NOISE) s->next_ns = t_ns + noise_gap_ns(s, t_ns);
    if (s->f.kind != LINE_GLITCH) return;
    s->flip = true;
    s->next_ns = t_ns + s->f.width_ns;
}

static void toggle_fault(struct line_fault_slot *s, int64_t t_ns)
{
    s->flip = !s->flip;
    if (s->flip) s->next_ns = t_ns + s->f.width_ns;
    else s->next_ns = s->f.kind == LINE_NOISE ? t_ns + noise_gap_ns(s, t_ns) : NEVER;
    if (!s->flip && s->f.kind == LINE_GLITCH) s->id = 0;
}

static void run_fault(struct line_fault_slot *s, int64_t t_ns)
{
    if (!s->began) begin_fault(s, t_ns);
    else if (t_ns >= s->f.until_ns) s->id = 0;
    else toggle_fault(s, t_ns);
}

/* A step of the board's: frames begin, pulses are counted. */
static void watch_step(struct line_fault_slot *s, const struct trace_step *step)
{
    if (s->id == 0 || !s->began) return;
    const bool missing = s->f.kind == LINE_MISSING_PULSE;
    if (!missing && s->f.kind != LINE_EXTRA_PULSE) return;
    if (step->lines & ~step->level & TRACE_BIT(s->f.frame_line)) s->pulses = 0;
    if (!(step->lines & bit_of(s))) return;
    const bool rise = (step->level & bit_of(s)) != 0;
    s->pulses += rise;
    const bool mine = s->pulses == s->f.pulse;
    if (missing) s->flip = mine && rise;
    else if (mine && !rise) s->next_ns = step->t_ns + s->f.width_ns;
}

/* ---- all faults of a trace ---- */

struct levels {
    uint64_t near, far; /* at the drivers' inputs; as the receivers have them, before their delay */
};

static struct levels faulty_levels(const struct line_faults *l)
{
    uint64_t level = l->level, swapped = 0, high = 0, low = 0, open = 0;
    for (const struct line_fault_slot *s = l->slot; s < l->slot + l->top; s++) {
        if (s->id == 0 || !s->began) continue;
        if (s->flip) level ^= bit_of(s);
        if (s->f.kind == LINE_INVERTED) swapped ^= bit_of(s);
        if (s->f.kind == LINE_STUCK_HIGH) high |= bit_of(s);
        if (s->f.kind == LINE_STUCK_LOW) low |= bit_of(s);
        if (s->f.kind == LINE_OPEN) open |= bit_of(s);
    }
    return (struct levels){.near = (level | high) & ~low, .far = (((level ^ swapped) | high) & ~low) | open};
}

static uint64_t with_bit(uint64_t level, unsigned sig, bool high)
{
    return high ? level | TRACE_BIT(sig) : level & ~TRACE_BIT(sig);
}

/* What is seen from t_ns on: lines behind their receivers, and the wires. */
static uint64_t seen_levels(struct line_faults *l, int64_t t_ns)
{
    const struct levels now = faulty_levels(l);
    uint64_t level = now.far;
    for (struct pair *p = l->pair; p < l->pair + l->pairs; p++) {
        const bool a = now.near >> p->cfg.line & 1;
        pair_input(p, now.far >> p->cfg.line & 1, t_ns);
        level = with_bit(with_bit(with_bit(level, p->cfg.line, p->out), p->cfg.a, a), p->cfg.b, !a);
    }
    return level;
}

static void flush_steps(const struct line_faults *l, struct out *o)
{
    if (o->n > 0) trace_emit(l->trace, o->step, o->n);
    o->n = 0;
}

static void report_levels(struct line_faults *l, struct out *o, int64_t t_ns)
{
    const uint64_t level = seen_levels(l, t_ns);
    const uint64_t lines = level ^ l->filter.level;
    if (!lines) return;
    if (o->n == ROOM) flush_steps(l, o);
    o->step[o->n++] = (struct trace_step){t_ns, lines, level};
    l->filter.level = level;
}

static int64_t next_due_ns(const struct line_faults *l)
{
    int64_t next_ns = NEVER;
    for (const struct line_fault_slot *s = l->slot; s < l->slot + l->top; s++)
        if (due_ns(s) < next_ns) next_ns = due_ns(s);
    for (const struct pair *p = l->pair; p < l->pair + l->pairs; p++)
        if (pair_due_ns(p) < next_ns) next_ns = pair_due_ns(p);
    return next_ns;
}

/* What the faults do of themselves up to and including t_ns; shown but for what happens at t_ns itself, where steps may
 * follow: a level that changes and changes back at one instant has not changed. */
static void run_until(struct line_faults *l, struct out *o, int64_t t_ns)
{
    for (int64_t at_ns; (at_ns = next_due_ns(l)) <= t_ns;) {
        for (struct line_fault_slot *s = l->slot; s < l->slot + l->top; s++)
            if (due_ns(s) == at_ns) run_fault(s, at_ns);
        for (struct pair *p = l->pair; p < l->pair + l->pairs; p++) pair_run(p, at_ns);
        if (at_ns < t_ns) report_levels(l, o, at_ns < l->done_ns ? l->done_ns : at_ns);
    }
}

static void take_step(struct line_faults *l, const struct trace_step *step)
{
    l->level = trace_after(l->level, step);
    for (struct line_fault_slot *s = l->slot; s < l->slot + l->top; s++) watch_step(s, step);
}

static bool any_active(const struct line_faults *l)
{
    for (unsigned i = 0; i < l->top; i++)
        if (l->slot[i].id) return true;
    return false;
}

static void on_steps(void *ctx, uint64_t before, const struct trace_step *s, unsigned n, int64_t until_ns)
{
    struct line_faults *l = ctx;
    struct out o = {.n = 0};
    /* No sinks are left: early reports are processed, but a new sink gets steps from done_ns on. */
    if (until_ns == INT64_MAX || until_ns < l->done_ns) until_ns = l->done_ns;
    l->level = before; /* a line without an observer moves without a step */
    for (const struct trace_step *const end = s + n; s < end;) {
        const int64_t t_ns = s->t_ns;
        run_until(l, &o, t_ns);
        take_step(l, s++);
        report_levels(l, &o, t_ns); /* step by step: installing and removing the filter leaves no trace */
    }
    run_until(l, &o, until_ns);
    report_levels(l, &o, until_ns);
    flush_steps(l, &o);
    l->done_ns = until_ns;
    const bool active = any_active(l);
    if (!active) l->top = 0;
    if (!active && !(l->trace->standing && l->trace->sinks)) l->trace->filter = NULL;
}

/* ---- for the owner ---- */

static void install_filter(void *ctx)
{
    struct line_faults *l = ctx;
    if (l->trace->filter) return;
    l->level = l->filter.level = l->trace->level;
    l->done_ns = l->trace->done_ns;
    l->trace->filter = &l->filter;
    for (struct pair *p = l->pair; p < l->pair + l->pairs; p++) pair_settle(p, l->level >> p->cfg.line & 1);
    l->filter.level = seen_levels(l, l->done_ns);
}

void line_faults_init(struct line_faults *l, struct trace *t)
{
    memset(l, 0, sizeof *l);
    l->trace = t;
    l->filter = (struct trace_filter){.steps = on_steps, .start = install_filter, .ctx = l};
}

void line_pair_add(struct line_faults *l, const struct pair_cfg *cfg, const char *name_a, const char *name_b)
{
    struct trace *const t = l->trace;
    const bool level = t->level >> cfg->line & 1;
    struct pair *const p = &l->pair[l->pairs++];
    assert(l->pairs <= LINE_PAIRS_MAX && cfg->rise_ns >= 0 && cfg->rise_ns <= PAIR_DELAY_MAX_NS && cfg->fall_ns >= 0 &&
           cfg->fall_ns <= PAIR_DELAY_MAX_NS);
    *p = (struct pair){.cfg = *cfg};
    p->cfg.a = trace_add(t, name_a, level);
    p->cfg.b = trace_add(t, name_b, !level);
    t->wires |= TRACE_BIT(p->cfg.a) | TRACE_BIT(p->cfg.b);
    t->wired |= TRACE_BIT(cfg->line);
    if (pair_delays(p)) t->standing = &l->filter;
}

void line_pairs_show(struct line_faults *l)
{
    if (l->pairs == 0) return;
    l->trace->standing = &l->filter;
    if (l->trace->sinks) install_filter(l);
}

bool line_has_pair(const struct line_faults *l, unsigned line)
{
    for (const struct pair *p = l->pair; p < l->pair + l->pairs; p++)
        if (p->cfg.line == line) return true;
    return false;
}

static struct line_fault_slot *slot_of(struct line_faults *l, uint32_t id)
{
    for (unsigned i = 0; i < LINE_FAULTS_MAX; i++)
        if (l->slot[i].id == id) return &l->slot[i];
    return NULL;
}

uint32_t line_fault_add(struct line_faults *l, const struct line_fault *f)
{
    struct line_fault_slot *s = slot_of(l, 0);
    assert(f->line < l->trace->count && f->frame_line < l->trace->count && f->from_ns < f->until_ns);
    assert(f->width_ns > 0 || (f->kind != LINE_GLITCH && f->kind != LINE_EXTRA_PULSE && f->kind != LINE_NOISE));
    assert(f->kind != LINE_NOISE || (f->rate_hz > 0.0 && f->rate_hz < 1e9));
    if (!s) return 0;
    trace_wake(l->trace);
    install_filter(l);
    if (s >= l->slot + l->top) l->top = (unsigned)(s - l->slot) + 1;
    *s = (struct line_fault_slot){.f = *f, .id = ++l->last_id, .next_ns = NEVER};
    return s->id;
}

void line_fault_end(struct line_faults *l, uint32_t id, int64_t t_ns)
{
    struct line_fault_slot *s = id ? slot_of(l, id) : NULL;
    if (!s) return;
    if (t_ns < s->f.until_ns) s->f.until_ns = t_ns;
    if (!s->began && s->f.until_ns <= s->f.from_ns) s->id = 0;
}

void line_fault_reseed(struct line_faults *l, uint32_t id, uint64_t seed, int64_t t_ns)
{
    struct line_fault_slot *s = id ? slot_of(l, id) : NULL;
    if (!s) return;
    if (s->laters < LINE_FAULT_SEEDS) s->laters++;
    s->later[s->laters - 1] = (struct line_fault_seed){t_ns, seed};
}
