#include "chip/ad7712/internal.h"

#include <math.h>

#define HEADROOM  1.05 /* of modulator and filter, sources 3.2 */
#define PULSE_TAU 500  /* DRDY high before an unread word is replaced, as on sister parts (sources 3.4) */

/* What a run measures, what becomes of its outputs, which phase follows each and whether by a new run. Sources 3.2: a run's
 * first output comes after three periods, so that self-calibration takes 9, a system step 4, background calibration 6. */
enum phase { NORMAL, SELF_ZERO, SELF_FULL, SELF_END, SYS_ZERO, SYS_FULL, SYS_END, OFFSET_ZERO, BACK_ZERO, BACK_WORD };

static const struct {
    enum { PINS, SHORTED, REFERENCE } measure;
    enum { WORD, ZERO, FULL } use;
    enum phase next;
    bool restart;
} phases[] = {
    // clang-format off
    [NORMAL]      = {PINS,      WORD, NORMAL,    false},
    [SELF_ZERO]   = {SHORTED,   ZERO, SELF_FULL, true},
    [SELF_FULL]   = {REFERENCE, FULL, SELF_END,  true},
    [SELF_END]    = {PINS,      WORD, NORMAL,    false},
    [SYS_ZERO]    = {PINS,      ZERO, SYS_END,   false},
    [SYS_FULL]    = {PINS,      FULL, SYS_END,   false},
    [SYS_END]     = {PINS,      WORD, NORMAL,    false},
    [OFFSET_ZERO] = {PINS,      ZERO, SELF_FULL, true},
    [BACK_ZERO]   = {SHORTED,   ZERO, BACK_WORD, true},
    [BACK_WORD]   = {PINS,      WORD, BACK_ZERO, true},
    // clang-format on
};

static enum phase first_phase(const struct ad7712 *a)
{
    static const enum phase first[] = {NORMAL, SELF_ZERO, SYS_ZERO, SYS_FULL, OFFSET_ZERO, BACK_ZERO, NORMAL, NORMAL};
    return first[ad7712_md(a)];
}

static void set_drdy(struct ad7712 *a, bool level, int64_t t_ns)
{
    sched_cancel(a->sched, &a->rise_ev);
    if (level == a->drdy) return;
    a->drdy = level;
    if (!a->fault.drdy && a->io.drdy) a->io.drdy(a->io.ctx, level, t_ns);
}

static void on_rise(void *ctx, int64_t t_ns)
{
    set_drdy(ctx, true, t_ns);
}

static unsigned code_of(const struct ad7712 *a)
{
    return ad7712_code_of(a->control & AD7712_CTL_FS);
}

void ad7712_set_path(struct ad7712 *a)
{
    const unsigned channel = ad7712_channel(a);
    const double gain_per_v = (double)(1u << ad7712_gain_log2(a)) / a->cfg.vref_v;
    a->x_per_v = gain_per_v * (1.0 + a->cfg.gain_error[channel]) / ad7712_attenuation(a, channel);
    a->offset_v = a->cfg.offset_v[channel];
    /* The table is of AIN1; on AIN2 the divider's 4 is in the volts and not in the fraction. */
    a->noise_x = a->cfg.noise_scale * ad7712_noise_v(code_of(a), ad7712_gain_log2(a)) * gain_per_v;
}

/* Fraction of full scale, stopped where the modulator stops. */
static double path_x(struct ad7712 *a, double v)
{
    const double x = a->x_per_v * (v + a->offset_v);
    if (fabs(x) <= HEADROOM) return x;
    a->n.overloads++;
    return x < 0.0 ? -HEADROOM : HEADROOM; /* not a number saturates too */
}

/* Whoever gives rows has no resistance, and the part both inputs. */
static void take_rows(struct ad7712 *a, int64_t t_ns)
{
    int64_t at_ns[AD7712_CELLS_MAX];
    double v[AD7712_CELLS_MAX];
    while (a->look.t_ns <= t_ns) {
        unsigned n = 0;
        for (; a->look.t_ns <= t_ns && n < AD7712_CELLS_MAX; a->look = clk_on(a->look, &a->look_step))
            at_ns[n++] = a->look.t_ns;
        a->io.vin_row_v(a->io.ctx, ad7712_channel(a), &(struct looks){at_ns, n, a->look_step.ns}, v);
        for (unsigned i = 0; i < n; i++) v[i] = path_x(a, v[i]);
        ad7712_sinc3_row(&a->filter, v, n);
    }
}

void ad7712_sample_until(struct ad7712 *a, int64_t t_ns)
{
    if (a->state != AD7712_RUNNING || a->quiet) return;
    if (a->io.vin_row_v && !a->io.source_ohm && a->cfg.part != AD7712_PART_7711A) {
        take_rows(a, t_ns);
        return;
    }
    while (a->look.t_ns <= t_ns) {
        ad7712_sinc3_push(&a->filter, path_x(a, ad7712_input_v(a, a->look.t_ns)));
        a->look = clk_on(a->look, &a->look_step);
    }
}

static void await_ready(struct ad7712 *a)
{
    sched_at(a->sched, &a->ready_ev, a->due.t_ns);
    if (a->unread && phases[a->phase].use == WORD)
        sched_at(a->sched, &a->pulse_ev, clk_on(a->due, &a->pulse_step).t_ns);
}

static void select_input(struct ad7712 *a)
{
    const unsigned channel = ad7712_channel(a);
    const double full_v = a->cfg.vref_v * ad7712_attenuation(a, channel) / (double)(1u << ad7712_gain_log2(a));
    a->quiet = phases[a->phase].measure != PINS;
    if (a->quiet) a->still = path_x(a, phases[a->phase].measure == SHORTED ? 0.0 : full_v);
}

/* A run from CLKIN count start_tau on. */
static void start_run(struct ad7712 *a, enum phase phase, int64_t start_tau)
{
    const unsigned code = code_of(a);
    const int64_t period_tau = ad7712_period_tau(code);
    a->state = AD7712_RUNNING;
    a->phase = (uint8_t)phase;
    a->start_tau = start_tau;
    ad7712_set_path(a);
    select_input(a);
    ad7712_sinc3_start(&a->filter, code, ad7712_cells(code, a->cfg.cells_max));
    const int64_t cell_tau = period_tau / a->filter.cells;
    a->look = clk_pos(&a->clkin, start_tau + cell_tau / 2);
    a->look_step = clk_step(&a->clkin, cell_tau);
    a->due = clk_pos(&a->clkin, start_tau + AD7712_SETTLE * period_tau);
    a->due_step = clk_step(&a->clkin, period_tau);
    a->pulse_step = clk_step(&a->clkin, -PULSE_TAU);
    await_ready(a);
}

static void cancel_events(struct ad7712 *a)
{
    sched_cancel(a->sched, &a->ready_ev);
    sched_cancel(a->sched, &a->pulse_ev);
    sched_cancel(a->sched, &a->begin_ev);
}

void ad7712_freeze(struct ad7712 *a, enum ad7712_state state, int64_t t_ns)
{
    ad7712_sample_until(a, t_ns);
    cancel_events(a);
    a->state = state;
    a->unread = false;
    set_drdy(a, true, t_ns);
}

void ad7712_start(struct ad7712 *a, int64_t t_ns)
{
    a->n.restarts++;
    start_run(a, first_phase(a), clk_count_at(&a->clkin, t_ns));
}

void ad7712_restart(struct ad7712 *a, int64_t t_ns)
{
    const int64_t since_tau = clk_count_at(&a->clkin, t_ns) - a->start_tau;
    const int64_t edges = (since_tau + AD7712_MOD_TAU - 1) / AD7712_MOD_TAU;
    sched_at(a->sched, &a->begin_ev, clk_edge_ns(&a->clkin, a->start_tau + edges * AD7712_MOD_TAU));
}

static void on_begin(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    ad7712_freeze(a, AD7712_RUNNING, t_ns);
    ad7712_start(a, t_ns);
}

bool ad7712_must_restart(const struct ad7712 *a, uint32_t was)
{
    const uint32_t changed = a->control ^ was;
    if (first_phase(a) != NORMAL || a->phase != NORMAL) return true;
    return (changed & AD7712_CTL_FS) || (!a->cfg.free_settling && (changed & (AD7712_CTL_G | AD7712_CTL_CH)));
}

static void put_word(struct ad7712 *a, uint32_t word, int64_t t_ns)
{
    if (!a->port.rfs) {
        a->n.lost_words++;
        return;
    }
    a->n.conversions++;
    a->n.overruns += a->unread;
    a->n.torn_reads += a->port.reading && a->port.source == AD7712_FROM_WORD;
    a->port.reading = false;
    a->word = word;
    a->unread = true;
    set_drdy(a, false, t_ns);
}

static void use_word(struct ad7712 *a, double x, int64_t t_ns)
{
    bool clipped = false;
    const unsigned c = ad7712_channel(a);
    const uint32_t word = ad7712_code(x, a->zero[c], a->full[c], a->control & AD7712_CTL_BU, &clipped);
    a->n.clipped += clipped;
    if (a->phase == SELF_END || a->phase == SYS_END) {
        a->n.calibrations++;
        a->control &= ~AD7712_CTL_MD;
    }
    put_word(a, word, t_ns);
}

static void use_coef(struct ad7712 *a, double x)
{
    bool clamped = false;
    const unsigned c = ad7712_channel(a);
    if (phases[a->phase].use == ZERO) a->zero[c] = ad7712_cal_zero(x, &clamped);
    else a->full[c] = ad7712_cal_full(x, a->zero[c], &clamped);
    a->n.cal_clamped += clamped;
    a->n.calibrations += a->phase == BACK_ZERO;
}

static void go_on(struct ad7712 *a)
{
    const bool restart = phases[a->phase].restart;
    const enum phase next = phases[a->phase].next;
    if (restart) {
        start_run(a, next, a->due.k);
        return;
    }
    a->phase = (uint8_t)next;
    a->due = clk_on(a->due, &a->due_step);
    await_ready(a);
}

static void on_ready(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    if (a->begin_ev.queued && a->begin_ev.due_ns == t_ns) return; /* the filter is reset at this very edge */
    ad7712_sample_until(a, t_ns);
    double x = a->quiet ? a->still : a->filter.out;
    if (a->noise_x > 0.0) x += a->noise_x * draws_gauss(&a->noise, t_ns);
    if (phases[a->phase].use == WORD) use_word(a, x, t_ns);
    else use_coef(a, x);
    go_on(a);
}

static void on_pulse(void *ctx, int64_t t_ns)
{
    struct ad7712 *a = ctx;
    if (a->port.rfs) set_drdy(a, true, t_ns);
}

void ad7712_word_read(struct ad7712 *a)
{
    a->unread = false;
    sched_cancel(a->sched, &a->pulse_ev);
}

/* Counts of the clock go on, their instants are new ones from here on. */
void ad7712_retime(struct ad7712 *a)
{
    if (a->state != AD7712_RUNNING) return;
    a->look = clk_pos(&a->clkin, a->look.k);
    a->look_step = clk_step(&a->clkin, a->look_step.k);
    a->due = clk_pos(&a->clkin, a->due.k);
    a->due_step = clk_step(&a->clkin, a->due_step.k);
    if (a->ready_ev.queued) sched_at(a->sched, &a->ready_ev, a->due.t_ns);
    a->pulse_step = clk_step(&a->clkin, -PULSE_TAU);
    if (a->pulse_ev.queued) sched_at(a->sched, &a->pulse_ev, clk_on(a->due, &a->pulse_step).t_ns);
    if (a->begin_ev.queued) ad7712_restart(a, a->sched->now_ns);
}

int64_t ad7712_period_ns(const struct ad7712 *a)
{
    return ad7712_tau_ns(a, ad7712_period_tau(code_of(a)));
}

void ad7712_conv_init(struct ad7712 *a)
{
    sched_ev_inner(&a->ready_ev, on_ready, a);
    sched_ev_inner(&a->pulse_ev, on_pulse, a);
    sched_ev_inner(&a->rise_ev, on_rise, a);
    sched_ev_inner(&a->begin_ev, on_begin, a);
}
