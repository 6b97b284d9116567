#include "board/pik/pik.h"

#include "board/pik/internal.h"

#include <string.h>

#define WARM_NS      INT64_C(10000000) /* between looks at the temperature, rounded up to looks at the inputs */
#define BOARD_SENSOR 3u                /* temperature channel of the board itself */

/* ---- time ---- */

static void set_clock(struct pik *b, int64_t tick, int64_t t_ns)
{
    b->clk = (struct clk){.t0_ns = t_ns, .hz = pik_tick_hz(b), .div = 1000};
    b->first_tick = tick;
}

/* ---- looks ---- */

static void keep_counters(struct pik_channel *c)
{
    c->plus = (uint32_t)c->axis.plus;
    c->minus = (uint32_t)c->axis.minus;
    c->saturated_looks = c->axis.saturated;
    c->opposed = c->axis.opposed;
    c->lost = (uint32_t)(c->axis.lost / PIK_PULSE);
}

/* Whether it could not keep up since the last look. */
static bool check_saturation(struct pik_channel *c)
{
    const uint32_t before = c->axis.saturated;
    pik_axis_look(&c->axis, c->axis.tick, &c->axis.drive);
    keep_counters(c);
    const bool saturated = c->axis.saturated != before;
    c->saturated |= saturated;
    return saturated;
}

static void notify_saturation(struct pik *b, bool now, int64_t t_ns)
{
    if (now) b->saturated_ns = t_ns;
    if (now == b->saturated) return;
    if (!now && (double)(t_ns - b->saturated_ns) < b->profile.saturated_ms * 1e6) return;
    b->saturated = now;
    if (now) board_notify(&b->base, PIK_EV_SATURATED, t_ns);
    if (b->host.saturated) b->host.saturated(b->host.ctx, now, t_ns);
}

/* At a fixed pace, with or without observers: the result does not depend on them. Noise is one value per interval. */
static void look_at_inputs(void *ctx, int64_t t_ns)
{
    struct pik *b = ctx;
    const int64_t pace = b->profile.look_ticks;
    bool saturated = false;
    pik_sample_until(b, t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) saturated |= check_saturation(&b->channel[i]);
    if (t_ns >= b->warm_ns) {
        pik_warm(b, b->base.io.temp_degc(b->base.io.ctx, BOARD_SENSOR, t_ns));
        b->warm_ns = t_ns + WARM_NS;
    }
    for (unsigned i = 0; b->noise_v > 0.0 && i < PIK_AXES; i++)
        b->channel[i].noise_v = b->noise_v * draws_gauss(&b->channel[i].noise, t_ns);
    notify_saturation(b, saturated, t_ns);
    b->look_tick += pace;
    sched_at(b->base.sched, &b->look, pik_tick_ns(b, b->look_tick));
}

/* ---- life ---- */

void pik_init(struct pik *b, const struct pik_profile *p, const struct board_cfg *cfg, const struct board_io *io,
              struct sched *s)
{
    static const char *const noise[PIK_AXES] = {"pik.x", "pik.y", "pik.z"};
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, pik_lines, PIK_LINES, cfg, io, s);
    b->specimen = pik_specimen_draw(p, cfg->seed, cfg->serial);
    set_clock(b, 0, 0);
    pik_warm(b, 25.0);
    for (unsigned i = 0; i < PIK_AXES; i++) b->channel[i].noise = board_draws(&b->base, noise[i]);
    sched_ev_inner(&b->look, look_at_inputs, b);
    pik_lines_init(b);
    pik_latch_init(b);
    pik_bus_init(b);
}

void pik_power_up(struct pik *b, int64_t t_ns)
{
    if (b->on) return;
    b->on = true;
    set_clock(b, 0, t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        const struct pik_axis was = c->axis;
        c->axis = pik_axis_at(0, &c->drive);
        c->axis.plus = was.plus; /* counters of the bench outlive the power */
        c->axis.minus = was.minus;
        c->axis.saturated = was.saturated;
        c->axis.opposed = was.opposed;
        c->axis.lost = was.lost;
        c->due_vs = c->slope_v_per_s = c->noise_v = 0.0;
        c->shown_tick = -1;
    }
    b->look_tick = 0;
    b->fed_ns = b->warm_ns = t_ns;
    b->clk_shown_tick = 0;
    pik_lines_rest(b, true, t_ns);
    board_notify(&b->base, PIK_EV_POWER_UP, t_ns);
    sched_at(b->base.sched, &b->look, t_ns);
    pik_latch_restart(b, t_ns);
}

void pik_power_down(struct pik *b, int64_t t_ns)
{
    if (!b->on) return;
    pik_sample_until(b, t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) keep_counters(&b->channel[i]);
    pik_lines_clock(b, t_ns);
    b->on = false;
    b->any = b->saturated = false;
    sched_cancel(b->base.sched, &b->look);
    sched_cancel(b->base.sched, &b->latch);
    sched_cancel(b->base.sched, &b->latch_end);
    pik_bus_cut(b, t_ns);
    pik_lines_rest(b, false, t_ns);
    board_notify(&b->base, PIK_EV_POWER_DOWN, t_ns);
}

void pik_reset(struct pik *b, int64_t t_ns)
{
    if (!b->on) return;
    b->counters.resets++;
    pik_sample_until(b, t_ns);
    pik_bus_cut(b, t_ns);
    board_notify(&b->base, PIK_EV_RES, t_ns);
    pik_latch_restart(b, t_ns);
}

void pik_observe(struct pik *b, bool on)
{
    if (on && !b->base.observed) b->heard_ns = b->base.sched->now_ns; /* earlier events are not notified */
    b->base.observed = on;
}

/* ---- faults ---- */

void pik_clock(struct pik *b, int32_t ppm, int64_t t_ns)
{
    if (ppm == b->clock_fault_ppm) return;
    if (!b->on) {
        b->clock_fault_ppm = ppm;
        pik_warm(b, b->degc);
        return;
    }
    const int64_t tick = pik_tick_at(b, t_ns);
    pik_sample_until(b, t_ns);
    pik_lines_clock(b, t_ns);
    const int64_t tick_ns = pik_tick_ns(b, tick);
    b->clock_fault_ppm = ppm;
    set_clock(b, tick, tick_ns);
    pik_warm(b, b->degc);
    sched_at(b->base.sched, &b->look, pik_tick_ns(b, b->look_tick));
}

void pik_stick(struct pik *b, unsigned axis, const struct chip_fault *f, int64_t t_ns)
{
    struct pik_channel *c = &b->channel[axis];
    pik_sample_until(b, t_ns);
    const uint64_t plus = pik_count_plus(c), minus = pik_count_minus(c);
    c->stuck = f->dout != CHIP_FREE;
    c->stuck_level = f->dout == CHIP_STUCK_HIGH;
    c->plus_from = plus - (c->stuck ? 0 : c->axis.plus);
    c->minus_from = minus - (c->stuck ? 0 : c->axis.minus);
    pik_lines_stuck(b, axis, t_ns);
}

bool pik_flip(struct pik *b, unsigned axis, unsigned reg, uint8_t mask, int64_t t_ns)
{
    struct pik_channel *c = &b->channel[axis];
    if (!b->on) return false;
    pik_sample_until(b, t_ns);
    const uint64_t bits = (uint64_t)mask << (8 * (reg & 1));
    const uint64_t was = reg < 2 ? pik_count_plus(c) : pik_count_minus(c);
    *(reg < 2 ? &c->plus_from : &c->minus_from) += (was ^ bits) - was;
    return true;
}
