#include "chip/ad7712/internal.h"

#define GARBLED 0xFFFFFFu

/* Sources 3.4, limits of one edge to the next. */
enum { A0_TAU = 2, SCLK_TAU = 5, PULSE_TAU = 2, DATA_TAU = 2, RFS_NS = 10, TFS_TAU = 4, HIZ_TAU = 2 };

bool ad7712_deaf(const struct ad7712 *a)
{
    return a->state == AD7712_OFF || !a->port.standby;
}

static int64_t delay_ns(const struct ad7712 *a, int32_t given_ns, int64_t tau)
{
    return given_ns ? given_ns : ad7712_tau_ns(a, tau);
}

int64_t ad7712_bit_access_ns(const struct ad7712 *a)
{
    return a->port.mode ? ad7712_tau_ns(a, 1) / 2 : delay_ns(a, a->cfg.bit_access_ns, 1);
}

/* One change may be on its way. A later one takes its place: a bit that the clock did not wait for never appears. */
static void show_sdata(struct ad7712 *a, bool driven, bool level, int64_t at_ns, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (p->change_ns <= t_ns) {
        p->out = p->out_next;
        p->driven = p->driven_next;
    }
    p->out_next = driven && level;
    p->driven_next = driven;
    p->change_ns = at_ns;
    if (a->io.sdata) sched_at(a->sched, &a->sdata_ev, at_ns);
}

/* Counts a breach; a strict chip garbles the frame. */
static void count_violation(struct ad7712 *a, bool bad, uint32_t *counter)
{
    if (!bad) return;
    ++*counter;
    a->port.garbled |= a->cfg.strict_timing;
}

static bool bit_out(const struct ad7712 *a)
{
    const struct ad7712_port *p = &a->port;
    return p->index < p->width && (p->garbled || (p->shift >> (23 - p->index) & 1));
}

/* A word that waits comes first: A0 does not reach the control register before it has been read (sources 3.4). */
static void choose_source(struct ad7712 *a)
{
    struct ad7712_port *p = &a->port;
    if (p->a0 && ad7712_coef_mode(a)) p->source = AD7712_FROM_COEF;
    else p->source = p->a0 || a->unread ? AD7712_FROM_WORD : AD7712_FROM_CONTROL;
    const bool word = p->source == AD7712_FROM_WORD;
    p->width = word && !(a->control & AD7712_CTL_WL) ? 16 : 24;
    p->shift = word ? a->word : p->source == AD7712_FROM_COEF ? *ad7712_coef(a) : a->control;
    p->index = 0;
    a->n.blocked_reads += word && !p->a0;
    a->n.stale_reads += word && a->drdy;
    if (word && a->drdy && a->cfg.strict_drdy) p->shift = GARBLED;
}

void ad7712_begin_read(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (p->writing) {
        a->n.refused++;
        return;
    }
    p->garbled = false;
    count_violation(a, t_ns - p->a0_ns < ad7712_tau_ns(a, A0_TAU), &a->n.a0_violations);
    if (!p->reading) choose_source(a); /* else it goes on where RFS interrupted it */
    p->reading = true;
    p->clocked = false;
    show_sdata(a, true, bit_out(a), t_ns + delay_ns(a, a->cfg.rfs_access_ns, 3), t_ns);
    if (p->mode) ad7712_own_clock(a, t_ns);
}

void ad7712_end_read(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    ad7712_stop_clock(a, t_ns);
    if (!p->reading) return;
    count_violation(a, t_ns - p->fall_ns < RFS_NS, &a->n.frame_violations);
    p->reading = p->index > 0 && p->index < p->width;
    show_sdata(a, false, false, t_ns + ad7712_tau_ns(a, HIZ_TAU), t_ns);
}

static void on_load(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    if (a->port.load_coef) *ad7712_coef(a) = a->port.load;
    else ad7712_load_control(a, a->port.load, t_ns);
}

void ad7712_begin_write(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (!p->rfs) {
        a->n.refused++;
        return;
    }
    if (a->load_ev.queued) { /* the write before was cut short, but it was one */
        sched_cancel(a->sched, &a->load_ev);
        on_load(a, t_ns);
    }
    p->reading = p->garbled = p->clocked = false;
    p->writing = true;
    p->target = AD7712_TO_NOTHING;
    p->in = 0;
    p->taken = 0;
    if (p->mode) ad7712_own_clock(a, t_ns);
}

void ad7712_end_write(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    ad7712_stop_clock(a, t_ns);
    if (!p->writing) return;
    p->writing = false;
    a->n.dropped += p->taken < 24;
    const bool early = p->taken >= 24 && t_ns - p->fall_ns < ad7712_tau_ns(a, TFS_TAU);
    count_violation(a, early, &a->n.frame_violations);
    if (!early || !a->load_ev.queued || !a->cfg.strict_timing) return;
    sched_cancel(a->sched, &a->load_ev);
    a->n.dropped++;
}

/* At the first SCLK of a write: drivers that work on hardware lower A0 after TFS. */
static void choose_target(struct ad7712 *a)
{
    struct ad7712_port *p = &a->port;
    p->target = !p->a0 ? AD7712_TO_CONTROL : ad7712_coef_mode(a) ? AD7712_TO_COEF : AD7712_TO_NOTHING;
    a->n.refused += p->target == AD7712_TO_NOTHING;
}

void ad7712_clock_rise(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    const int64_t period_ns = t_ns - p->rise_ns, low_ns = t_ns - p->fall_ns;
    p->rise_ns = t_ns;
    const bool in_frame = (!p->rfs && p->reading) || p->writing;
    if (!in_frame) return;
    const bool fast = period_ns < ad7712_tau_ns(a, SCLK_TAU) || low_ns < ad7712_tau_ns(a, PULSE_TAU);
    count_violation(a, fast && !p->mode, &a->n.sclk_violations);
    p->clocked = true;
    if (p->writing && p->taken == 0) choose_target(a);
    if (p->writing && p->taken < 24) p->in = p->in << 1 | p->sdata;
}

void ad7712_word_over(struct ad7712 *a, int64_t fall_ns)
{
    if (a->port.source != AD7712_FROM_WORD || !a->unread) return;
    ad7712_word_read(a);
    if (!a->io.drdy) a->drdy = true; /* no one sees when */
    if (!a->drdy) sched_at(a->sched, &a->rise_ev, fall_ns + delay_ns(a, a->cfg.drdy_rise_ns, 1));
}

static void shift_out(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (p->index >= p->width) {
        a->n.over_reads++;
        return;
    }
    p->index++;
    show_sdata(a, true, bit_out(a), t_ns + ad7712_bit_access_ns(a), t_ns);
    if (p->index == p->width) ad7712_word_over(a, t_ns);
}

/* The whole word goes to its register a moment after its last bit, in one piece. */
static void shift_in(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    if (p->taken >= 24) {
        a->n.over_writes++;
        return;
    }
    if (++p->taken < 24 || p->target == AD7712_TO_NOTHING) return;
    if (p->garbled) {
        a->n.dropped++;
        return;
    }
    p->load = p->in;
    p->load_coef = p->target == AD7712_TO_COEF;
    sched_at(a->sched, &a->load_ev, t_ns + ad7712_tau_ns(a, TFS_TAU));
}

void ad7712_clock_fall(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    const int64_t high_ns = t_ns - p->rise_ns;
    p->fall_ns = t_ns;
    if (!p->clocked) return;
    p->clocked = false;
    count_violation(a, !p->mode && high_ns < ad7712_tau_ns(a, PULSE_TAU), &a->n.sclk_violations);
    if (!p->writing) {
        shift_out(a, t_ns);
        return;
    }
    /* Set-up is 2 tau less the high time, to the rise: 2 tau to the fall. What came after the rise is the next bit's. */
    const bool late = p->sdata_ns <= p->rise_ns && t_ns - p->sdata_ns < ad7712_tau_ns(a, DATA_TAU);
    count_violation(a, !p->mode && late, &a->n.sdata_violations);
    shift_in(a, t_ns);
}

static void on_sdata(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    a->io.sdata(a->io.ctx, ad7712_sdata(a, t_ns), t_ns);
}

void ad7712_port_forget(struct ad7712 *a, int64_t t_ns)
{
    struct ad7712_port *p = &a->port;
    ad7712_stop_clock(a, t_ns);
    sched_cancel(a->sched, &a->load_ev);
    a->n.dropped += p->writing;
    p->reading = p->writing = p->clocked = p->garbled = false;
    p->index = p->width = 0;
    if (ad7712_sdata_driven(a, t_ns) || p->driven_next) show_sdata(a, false, false, t_ns, t_ns);
}

void ad7712_port_init(struct ad7712 *a)
{
    a->port = (struct ad7712_port){.rfs = true, .tfs = true, .sync = true, .standby = true, .clock = true};
    a->port.a0_ns = a->port.rise_ns = a->port.fall_ns = a->port.sdata_ns = -NS_PER_S; /* no edge yet */
    sched_ev_inner(&a->load_ev, on_load, a);
    sched_ev_inner(&a->sdata_ev, on_sdata, a);
}
