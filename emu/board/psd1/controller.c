#include "board/psd1/psd1.h"

#include "board/bus_lines.h"
#include "board/psd1/internal.h"

#include <assert.h>
#include <string.h>

/* ---- the controller's event ---- */

/* SYNC of the three converters: Res drives it, so that they are in step after it (article: synchronised; how is E0). */
static void put_sync(struct psd1 *b, bool level, int64_t t_ns)
{
    for (unsigned i = 0; i < 3; i++) ad7712_sync_pin(&b->adc[i], level, t_ns);
}

/* Power and resets are over: the set-up begins. */
static int64_t reset_over(struct psd1 *b, int64_t t_ns)
{
    put_sync(b, true, t_ns);
    psd1_job_setup(b);
    return psd1_job_next(b, t_ns);
}

/* NULL: nothing is ever due in this phase. */
static psd1_step *const steps[PSD1_PHASES] = {
    [PSD1_OFF] = NULL,
    [PSD1_IN_RESET] = reset_over,
    [PSD1_IDLE] = NULL,
    [PSD1_START] = psd1_cycle_start,
    [PSD1_RF_FALL] = psd1_rf_fall,
    [PSD1_RF_RISE] = psd1_rf_rise,
    [PSD1_READY] = psd1_host_strobe,
    [PSD1_STROBE_END] = psd1_host_end,
    [PSD1_CLEAR] = psd1_clear,
    [PSD1_TFS_FALL] = psd1_tfs_fall,
    [PSD1_TFS_RISE] = psd1_tfs_rise,
    [PSD1_AWAIT_DR] = psd1_await_dr,
    [PSD1_COEF_A0] = psd1_coef_a0,
    [PSD1_COEF_FALL] = psd1_coef_fall,
    [PSD1_COEF_RISE] = psd1_coef_rise,
};

static void setup_done(struct psd1 *b, int64_t t_ns)
{
    b->ready = true;
    b->lost = psd1_lost(b);
    board_notify(&b->base, PSD1_EV_SETUP_DONE, t_ns);
    if (b->profile.int0 == PSD1_INT0_AUTO) psd1_flags(b, true, true, t_ns);
}

/* After a step or a notification: if the controller is idle, the next thing begins. Before the set-up is over it is not. */
static void start_next(struct psd1 *b, int64_t t_ns)
{
    if (b->phase != PSD1_IDLE) return;
    if (!b->ready) setup_done(b, t_ns);
    psd1_try_start(b, t_ns);
}

static int64_t run_step(struct psd1 *b, int64_t t_ns)
{
    b->due_ns = steps[b->phase] ? steps[b->phase](b, t_ns) : SCHED_NEVER;
    start_next(b, t_ns);
    return b->due_ns;
}

static void step_event(void *ctx, int64_t t_ns)
{
    struct psd1 *b = ctx;
    b->stepping = true;
    do t_ns = run_step(b, t_ns);
    while (t_ns != SCHED_NEVER && sched_go_on(b->base.sched, t_ns));
    b->stepping = false;
    if (t_ns != SCHED_NEVER) sched_at(b->base.sched, &b->ev, t_ns);
}

/* ---- data-ready and timeout ---- */

/* A host that does not read keeps DR low: that is no fault of the converters. */
static void on_dr_timeout(void *ctx, int64_t t_ns)
{
    struct psd1 *b = ctx;
    if (t_ns < b->timeout_ns) {
        sched_at(b->base.sched, &b->timeout, b->timeout_ns);
        return;
    }
    b->counters.timeouts++;
    if (!b->fault_notified && b->host.fault) b->host.fault(b->host.ctx, PSD1_FAULT_DR, t_ns);
    b->fault_notified = true;
    psd1_job_timeout(b, t_ns);
    start_next(b, t_ns);
}

static void refresh_degc(struct psd1 *b, int64_t t_ns)
{
    const double degc = b->base.io.temp_degc(b->base.io.ctx, 3, t_ns);
    if (degc == b->board_degc && b->per_vref > 0.0) return;
    b->board_degc = degc;
    b->vref_scale = 1.0 + b->vref_error + b->vref_tc_per_k * (b->board_degc - 25.0);
    b->per_vref = 1.0 / b->vref_scale;
}

static void dr_fell(struct psd1 *b, int64_t t_ns)
{
    b->dr_ns = t_ns;
    refresh_degc(b, t_ns);
    psd1_arm_timeout(b, t_ns);
    if (b->fault_notified && b->host.fault) b->host.fault(b->host.ctx, 0, t_ns);
    b->fault_notified = false;
    board_notify(&b->base, PSD1_EV_DR, t_ns);
    psd1_job_dr(b, t_ns);
    start_next(b, t_ns);
}

static bool dr_of(const struct psd1 *b)
{
    const bool *const d = b->drdy;
    if (b->profile.dr == PSD1_DR_X) return d[0];
    return b->profile.dr == PSD1_DR_ALL ? d[0] || d[1] || d[2] : d[0] && d[1] && d[2];
}

static void on_drdy(void *ctx, bool level, int64_t t_ns)
{
    const struct psd1_port *port = ctx;
    struct psd1 *b = port->b;
    b->drdy[port->axis] = level;
    const bool dr = dr_of(b);
    if (dr == b->dr || b->phase == PSD1_OFF) return;
    b->dr = dr;
    psd1_put(b, PSD1_BIT(DR), dr ? PSD1_BIT(DR) : 0, t_ns);
    if (!dr) dr_fell(b, t_ns);
    psd1_recheck_start(b, t_ns);
}

/* The signal is on the profile's input; the other one is not connected. The reference's error is its inverse on the input. */
static void vin_row_v(void *ctx, unsigned channel, const struct looks *at, double *vin_v)
{
    const struct psd1_port *port = ctx;
    struct psd1 *b = port->b;
    const bool connected = channel + 1 == b->profile.adc_input;
    if (connected) {
        b->base.io.accel(b->base.io.ctx, port->axis, at, vin_v);
        afe_out_row_v(&b->base.afe[port->axis], vin_v, b->board_degc, at);
    }
    for (unsigned i = 0; i < at->n; i++) vin_v[i] = connected ? vin_v[i] * b->per_vref : 0.0;
}

/* ---- life ---- */

// clang-format off
const struct board_line psd1_lines[PSD1_LINES] = {
    {"A0", false}, {"INT0", false}, {"FL1", true}, {"FL2", false}, {"DR", true}, {"RFX", true}, {"RFY", true}, {"RFZ", true},
    {"TFS", true}, {"SCLK", false}, {"SDAT", false}, {"CLK_1M25", false}, {"CS", true}, {"RW", true},
    BUS_LINES_AB(PSD1_LINE_AB0), BUS_LINES_D(PSD1_LINE_D0),
};
// clang-format on

const char *const psd1_events[PSD1_EVENTS] = {PSD1_EVENT_LIST(BOARD_EVENT_NAME)};

static uint64_t rest_levels(const struct psd1 *b)
{
    uint64_t level = b->profile.fl2 == PSD1_ACTIVE_LOW ? PSD1_BIT(FL2) : 0;
    for (unsigned i = 0; i < PSD1_LINES; i++) level |= (uint64_t)psd1_lines[i].level << i;
    return level;
}

static void init_trace(struct psd1 *b)
{
    b->base.trace.level = rest_levels(b);
    psd1_wave_init(b);
}

static struct ad7712_cfg adc_cfg(const struct psd1 *b, unsigned axis)
{
    static const char *const of[] = {"psd1.adc.x", "psd1.adc.y", "psd1.adc.z"};
    static const enum ad7712_part part[] = {AD7712_PART_7712, AD7712_PART_7710, AD7712_PART_7711};
    const struct psd1_profile *p = &b->profile;
    struct rng r = board_noise(&b->base, of[axis]);
    struct ad7712_cfg c = {.part = part[p->part],
                           .clkin_hz = p->adc_clkin_hz,
                           .vref_v = p->adc_vref_v,
                           .noise_scale = b->base.cfg.adc_noise_scale,
                           .rfs_access_ns = (int32_t)p->rfs_access_ns,
                           .bit_access_ns = (int32_t)p->bit_access_ns,
                           .drdy_rise_ns = (int32_t)p->drdy_rise_ns,
                           .strict_timing = true};
    for (unsigned i = 0; i < AD7712_CHANNELS; i++) {
        c.offset_v[i] = rng_gauss(&r) * p->adc_offset_sd_v;
        c.gain_error[i] = 1e-6 * rng_gauss(&r) * p->adc_gain_sd_ppm;
    }
    return c;
}

static void init_adc(struct psd1 *b)
{
    static const char *const adc_noise[] = {"adc.x", "adc.y", "adc.z"};
    struct rng vref = board_noise(&b->base, "psd1.vref");
    b->vref_error = 1e-6 * rng_gauss(&vref) * b->profile.vref_sd_ppm;
    b->vref_tc_per_k = 1e-6 * rng_gauss(&vref) * b->profile.vref_tc_sd_ppm_per_k;
    for (unsigned i = 0; i < 3; i++) {
        const struct ad7712_cfg cfg = adc_cfg(b, i);
        b->port[i] = (struct psd1_port){b, i};
        const bool heard = i == 0 || b->profile.dr != PSD1_DR_X; /* else its DRDY is not connected */
        const struct ad7712_io io = {.ctx = &b->port[i], .vin_row_v = vin_row_v, .drdy = heard ? on_drdy : NULL};
        ad7712_init(&b->adc[i], &cfg, &io, b->base.sched, board_draws(&b->base, adc_noise[i]));
        b->drdy[i] = true;
    }
}

void psd1_init(struct psd1 *b, const struct psd1_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s)
{
    assert(io->accel && io->temp_degc);
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, psd1_lines, PSD1_LINES, cfg, io, s);
    b->due_ns = SCHED_NEVER;
    b->dr = true;
    sched_ev_inner(&b->ev, step_event, b);
    sched_ev_inner(&b->timeout, on_dr_timeout, b);
    init_trace(b);
    init_adc(b);
    psd1_bus_init(b);
    psd1_job_init(b);
    psd1_aux_init(b);
    refresh_degc(b, s->now_ns);
}

/* Ends all activity; its lines go to rest; its state is cleared. */
static void stop_all(struct psd1 *b, enum board_cycle_result why, int64_t t_ns)
{
    psd1_cut(b, t_ns);
    psd1_due(b, b->phase, SCHED_NEVER);
    psd1_bus_stop(b, t_ns);
    psd1_flags(b, false, false, t_ns);
    b->ready = b->taken = b->coef_known = false;
    b->seq = 0;
    b->latest = (struct psd1_cycle){0};
    b->staged = b->last_command = b->temp_channel = b->service_channel = 0;
    b->uc1 = psd1_profile_control(&b->profile, AD7712_SELF_CAL);
    b->uc2 = psd1_profile_control(&b->profile, AD7712_NORMAL);
    psd1_job_stop(b, why, t_ns);
}

static void enter_reset(struct psd1 *b, int64_t t_ns)
{
    stop_all(b, BOARD_CYCLE_OFF, t_ns);
    put_sync(b, false, t_ns);
    psd1_due(b, PSD1_IN_RESET, t_ns + b->profile.reset_ns);
    psd1_arm_timeout(b, t_ns);
}

void psd1_power_up(struct psd1 *b, int64_t t_ns)
{
    if (b->phase != PSD1_OFF) return;
    board_notify(&b->base, PSD1_EV_POWER_UP, t_ns);
    b->t0_ns = t_ns;
    b->phase = PSD1_IN_RESET;
    trace_put(&b->base.trace, TRACE_FIRST(PSD1_LINES), rest_levels(b), t_ns);
    psd1_wave_power(b, true, t_ns);
    psd1_aux_power_up(b, t_ns);
    enter_reset(b, t_ns);
    for (unsigned i = 0; i < 3; i++) ad7712_power_up(&b->adc[i], t_ns);
}

void psd1_reset(struct psd1 *b, int64_t t_ns)
{
    if (b->phase == PSD1_OFF) return;
    b->counters.resets++;
    enter_reset(b, t_ns);
    board_notify(&b->base, PSD1_EV_RES, t_ns);
}

void psd1_power_down(struct psd1 *b, int64_t t_ns)
{
    if (b->phase == PSD1_OFF) return;
    stop_all(b, BOARD_CYCLE_OFF, t_ns);
    psd1_wave_power(b, false, t_ns);
    psd1_due(b, PSD1_OFF, SCHED_NEVER);
    sched_cancel(b->base.sched, &b->timeout);
    b->fault_notified = false;
    for (unsigned i = 0; i < 3; i++) ad7712_power_off(&b->adc[i], t_ns);
    b->dr = true;
    trace_put(&b->base.trace, TRACE_FIRST(PSD1_LINES), 0, t_ns);
    board_notify(&b->base, PSD1_EV_RES, t_ns);
    board_notify(&b->base, PSD1_EV_POWER_DOWN, t_ns);
}

void psd1_sample_until(struct psd1 *b, int64_t t_ns)
{
    for (unsigned i = 0; i < 3; i++) ad7712_sample_until(&b->adc[i], t_ns);
    psd1_aux_until(b, t_ns);
}
