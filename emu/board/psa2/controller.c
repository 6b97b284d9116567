#include "board/psa2/psa2.h"

#include "base/bits.h"
#include "board/psa2/inside.h"
#include "board/psa2/internal.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define RES_LOW_NS   10000 /* E0: length of the pulse on Res */
#define CONFIG1_CHOP 0x08  /* chopping on, as after reset; multiplexer 000: AIN1 */

/* ---- pins ---- */

static void res_pin(struct psa2 *b, bool level, int64_t t_ns)
{
    trace_set(&b->base.trace, PSA2_LINE_RES, level, t_ns);
    for (unsigned i = 0; i < 3; i++) ads1282_reset_pin(&b->adc[i], level, t_ns);
    ads1256_reset_pin(&b->tadc, level, t_ns);
}

static bool port_free(const struct psa2 *b)
{
    return !psa2_spi_busy(b) && !b->pulse.busy;
}

/* ---- set-up ---- */

static void enter_run(struct psa2 *b, int64_t t_ns)
{
    b->mode = PSA2_RUN;
    board_notify(&b->base, PSA2_EV_SETUP_DONE, t_ns);
    psa2_arm_timeout(b, t_ns);
}

/* Beyond the article: the gain. It follows SYNC_A at once, while the filters are empty. */
static void setup_gain(struct psa2 *b, int64_t t_ns)
{
    uint8_t code = 0;
    for (unsigned gain = b->profile.adc_pga; gain > 1; gain /= 2) code++;
    const uint8_t bytes[] = {0x42, 0x00, (uint8_t)(CONFIG1_CHOP | code)};
    struct psa2_xfer x = psa2_xfer_accel(b, bytes, sizeof bytes);
    x.done = enter_run;
    psa2_spi_start(b, &x, t_ns);
}

/* The step that is due; in reverse order: the last of its event in place of the first. */
static const struct psa2_setup_step *setup_step(const struct psa2 *b)
{
    const struct psa2_setup_step *const all = b->profile.setup, *due = &all[b->step];
    if (!b->reversed) return due;
    int before = 0;
    for (unsigned i = 0; i < b->step; i++) before += all[i].on == due->on;
    const struct psa2_setup_step *s = all + b->profile.setup_count;
    do before -= (--s)->on == due->on;
    while (before >= 0);
    return s;
}

/* DRD_A is awaited all the time, again after each step: a new CONFIG0 means another settling time. */
static void await_step(struct psa2 *b, int64_t t_ns)
{
    psa2_arm_timeout(b, t_ns);
    if (b->profile.setup[b->step].on == PSA2_ON_DRD_T) psa2_temp_await(b, t_ns);
}

static void setup_done(struct psa2 *b, int64_t t_ns)
{
    if (++b->step < b->profile.setup_count) {
        await_step(b, t_ns);
        return;
    }
    if (b->profile.adc_pga > 1 && !b->profile.adc_is_1281) setup_gain(b, t_ns);
    else enter_run(b, t_ns);
}

static void setup_event(struct psa2 *b, enum psa2_setup_event on, int64_t t_ns)
{
    if (b->step >= b->profile.setup_count || !port_free(b)) return;
    const struct psa2_setup_step *s = setup_step(b);
    if (s->on != on) return;
    if (on == PSA2_ON_DRD_T) psa2_temp_answered(b);
    if (s->action == PSA2_SYNC_A || s->action == PSA2_SYNC_T) {
        psa2_pulse(b, s->action == PSA2_SYNC_T ? PSA2_TEMP : PSA2_ACCEL, setup_done, t_ns);
        return;
    }
    struct psa2_xfer x =
        s->action == PSA2_WRITE_T ? psa2_xfer_temp(b, s->bytes, s->count) : psa2_xfer_accel(b, s->bytes, s->count);
    x.done = setup_done;
    psa2_spi_start(b, &x, t_ns);
}

/* ---- reading ---- */

static uint8_t status_of(struct psa2 *b, const struct psa2_frame *f)
{
    uint8_t status = b->sample.unsettled ? 0 : PSA2_ST_SETTLED;
    for (unsigned i = 0; i < 3; i++)
        if (f->code[i] == 0x7FFFFF || f->code[i] == -0x800000) status |= PSA2_ST_CLIP;
    if (b->sample.overrun) status |= PSA2_ST_OVERRUN;
    if (b->temp.fresh) status |= PSA2_ST_TEMP_NEW;
    return status;
}

static void take_codes(struct psa2 *b, struct psa2_frame *f)
{
    for (unsigned i = 0; i < 3; i++) {
        const uint8_t *rx = b->spi.rx[i]; /* 0 beyond what was read */
        f->raw[i] = (uint32_t)rx[0] << 24 | (uint32_t)rx[1] << 16 | (uint32_t)rx[2] << 8 | rx[3];
        f->code[i] = bits_sign_extend(f->raw[i] >> 8, 24);
    }
    f->temp_code = b->temp.code;
    f->temp_channel = b->temp.code_channel;
}

static void read_done(struct psa2 *b, int64_t t_ns)
{
    struct psa2_frame *f = &b->latest; /* in place: copies of what has just been written are slow */
    f->seq = b->sample.seq;
    f->t_sample_ns = b->sample.t_ns;
    if (!(b->base.faults & PSA2_FAULT_FROZEN_WORDS)) take_codes(b, f);
    f->status = status_of(b, f);
    for (unsigned i = 0; i < PSA2_WORDS; i++) f->word[i] = 0; /* until it is sent */
    b->sample.reading = b->sample.overrun = b->temp.fresh = false;
    if (b->sample.unsettled) b->sample.unsettled--;
    psa2_out_start(b, t_ns);
}

static void read_start(struct psa2 *b, int64_t t_ns)
{
    b->sample.due = false;
    b->sample.reading = true;
    b->sample.seq = b->sample.due_seq;
    b->sample.t_ns = b->sample.due_ns;
    psa2_spi_start(b, &b->read, t_ns);
}

static void init_read(struct psa2 *b)
{
    static const uint8_t zeros[4] = {0}; /* DIn low: WAKEUP, harmless */
    b->read = psa2_xfer_accel(b, zeros, b->profile.read_bits / 8);
    for (unsigned i = 0; i + 1 < b->read.count; i++) b->read.gap_ns[i] = 0;
    b->read.zeros = true;
    b->read.done = read_done;
}

/* Carries out what is due on an idle serial port: the read, then a request, then the temperature scan. */
static void serve_port(struct psa2 *b, int64_t t_ns)
{
    if (b->mode != PSA2_RUN || !port_free(b)) return;
    if (b->sample.due) {
        read_start(b, t_ns);
        return;
    }
    if (b->request && psa2_request_start(b, t_ns)) return;
    if (!psa2_temp_start(b, t_ns)) psa2_lazy_sleep(b);
}

static void sample_due(struct psa2 *b, int64_t t_ns)
{
    struct psa2_sample *s = &b->sample;
    if (s->due || s->reading) {
        b->counters.overruns++;
        s->overrun = true;
    }
    s->due = true;
    s->due_ns = t_ns;
    s->due_seq = b->seq++;
    serve_port(b, t_ns);
}

/* ---- data-ready and its timeout ---- */

static void on_accel_timeout(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    if (t_ns < b->timeout_ns) {
        sched_at(b->base.sched, &b->timeout, b->timeout_ns);
        psa2_lazy_sleep(b);
        return;
    }
    b->counters.timeouts++;
    if (!b->fault_notified && b->host.fault) b->host.fault(b->host.ctx, PSA2_FAULT_ACCEL_PORT, t_ns);
    b->fault_notified = true;
    psa2_request_fail(b, PSA2_ACCEL, false, t_ns);
    serve_port(b, t_ns);
}

static void on_temp_timeout(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    psa2_temp_timeout(b, t_ns);
    psa2_request_fail(b, PSA2_TEMP, false, t_ns);
    serve_port(b, t_ns);
}

enum psa2_result psa2_submit(struct psa2 *b, struct psa2_request *r, int64_t t_ns)
{
    const enum psa2_result result = psa2_request_accept(b, r);
    if (result != PSA2_OK) return result;
    if (!b->timeout.queued) psa2_arm_timeout(b, t_ns);
    serve_port(b, t_ns);
    return PSA2_OK;
}

static void drd_a_fell(struct psa2 *b, int64_t t_ns)
{
    b->board_degc = b->base.io.temp_degc(b->base.io.ctx, 3, t_ns);
    b->period_ns = ads1282_period_ns(&b->adc[0]);
    b->drd_a_seen = true;
    b->drd_a_ns = t_ns;
    b->fault_notified = false;
    psa2_arm_timeout(b, t_ns);
    if (b->mode == PSA2_SETUP) setup_event(b, PSA2_ON_DRD_A, t_ns);
    else if (b->mode == PSA2_RUN) sample_due(b, t_ns);
}

/* The wire DRD_A comes from converter X (E0). */
static void accel_drdy(void *ctx, bool level, int64_t t_ns)
{
    const struct psa2_port *port = ctx;
    struct psa2 *b = port->b;
    if (!level) trace_set(&b->base.trace, PSA2_LINE_DOUTX + port->axis, spi_miso(&b->adc[port->axis].spi), t_ns);
    if (port->axis != 0) return;
    psa2_line(b, PSA2_LINE_DRD_A, level, t_ns);
    if (level || b->mode == PSA2_OFF) return;
    board_notify(&b->base, PSA2_EV_DRD_A, t_ns);
    drd_a_fell(b, t_ns);
}

static void temp_ready(struct psa2 *b, int64_t t_ns)
{
    psa2_temp_ready(b);
    serve_port(b, t_ns);
}

static void temp_drdy(void *ctx, bool level, int64_t t_ns)
{
    struct psa2 *b = ctx;
    psa2_line(b, PSA2_LINE_DRD_T, level, t_ns);
    if (level || b->mode == PSA2_OFF) return;
    board_notify(&b->base, PSA2_EV_DRD_T, t_ns);
    if (b->mode == PSA2_SETUP) setup_event(b, PSA2_ON_DRD_T, t_ns);
    else if (b->mode == PSA2_RUN) temp_ready(b, t_ns);
}

/* Input pair 1 carries the channel; pair 2 is not connected. */
static void accel_vin_row_v(void *ctx, unsigned mux, const struct looks *at, double *vin_v)
{
    const struct psa2_port *port = ctx;
    struct psa2 *b = port->b;
    if (mux != 0 && mux != 3) {
        for (unsigned i = 0; i < at->n; i++) vin_v[i] = 0.0;
        return;
    }
    b->base.io.accel(b->base.io.ctx, port->axis, at, vin_v);
    afe_out_row_v(&b->base.afe[port->axis], vin_v, b->board_degc, at);
    if (psa2_uref_moves(b)) psa2_uref_row(b, vin_v, at);
}

/* ---- life ---- */

static void wake_lines(void *ctx, uint64_t mask)
{
    const uint32_t out_lines = 1u << PSA2_LINE_INT | 1u << PSA2_LINE_DATA | 1u << PSA2_LINE_CLK;
    struct psa2 *b = ctx;
    if (mask & out_lines) psa2_out_wake(b, b->base.sched->now_ns);
}

static void init_trace(struct psa2 *b)
{
    b->base.trace.source = (struct trace_source){.wake = wake_lines, .ctx = b};
    b->idle_lines = b->base.trace.level;
}

_Static_assert((int)BOARD_CHAIN_MODULATOR == (int)ADS1282_CHAIN_MODULATOR, "one number for the same chain");

static void init_accel(struct psa2 *b)
{
    static const char *const adc_noise[] = {"adc.x", "adc.y", "adc.z"};
    struct ads1282_cfg cfg = {.part = b->profile.adc_is_1281 ? ADS1282_PART_1281 : ADS1282_PART_1282,
                              .clk_hz = b->profile.fclk_hz,
                              .vref_v = b->profile.adc_vref_v,
                              .noise_scale = b->base.cfg.adc_noise_scale,
                              .avss_v = b->profile.adc_avss_v,
                              .avdd_v = b->profile.adc_avdd_v,
                              .chain = (enum ads1282_chain)b->base.cfg.adc_chain};
    for (unsigned i = 0; i < 3; i++) {
        cfg.common_mode_v = b->profile.common_mode_v[i];
        b->port[i] = (struct psa2_port){b, i};
        const struct ads1282_io io = {.ctx = &b->port[i], .vin_row_v = accel_vin_row_v, .drdy = accel_drdy};
        ads1282_init(&b->adc[i], &cfg, &io, b->base.sched, board_draws(&b->base, adc_noise[i]));
    }
}

static void init_temp(struct psa2 *b)
{
    const struct ads1256_cfg cfg = {.clkin_hz = b->profile.temp_clkin_hz,
                                    .sync_halts = true, /* an idle DRD_T tells KPSA of a converter that waits (E0) */
                                    .vref_v = b->profile.temp_vref_v,
                                    .noise_scale = b->base.cfg.temp_noise_scale,
                                    .offset_v = b->base.cfg.temp_adc_offset_v,
                                    .gain_error = b->base.cfg.temp_adc_gain_error,
                                    .strict_timing = true};
    const struct ads1256_io io = {.ctx = b, .ain_v = psa2_temp_ain_v, .drdy = temp_drdy};
    ads1256_init(&b->tadc, &cfg, &io, b->base.sched, board_draws(&b->base, "adc.t"));
}

static void res_up(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    b->mode = PSA2_SETUP;
    b->reversed = b->base.faults & PSA2_FAULT_SETUP_ORDER;
    res_pin(b, true, t_ns);
    await_step(b, t_ns);
}

void psa2_init(struct psa2 *b, const struct psa2_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s)
{
    psa2_init_inside(b, p, psa2_lines, PSA2_LINES, cfg, io, s);
}

static void add_pairs(struct psa2 *b)
{
    const struct psa2_profile *p = &b->profile;
    for (unsigned i = 0; i < PSA2_PAIRS; i++) {
        const struct pair_cfg cfg = {.line = psa2_pairs[i].line,
                                     .rise_ns = llround(p->line_delay_ns[i]),
                                     .fall_ns = llround(p->line_delay_ns[i] + p->line_skew_ns[i])};
        line_pair_add(&b->base.line, &cfg, psa2_pairs[i].a, psa2_pairs[i].b);
    }
}

void psa2_init_inside(struct psa2 *b, const struct psa2_profile *p, const struct board_line *lines, unsigned count,
                      const struct board_cfg *cfg, const struct board_io *io, struct sched *s)
{
    assert(io->accel && io->temp_degc);
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, lines, count, cfg, io, s);
    add_pairs(b);
    b->idle = serve_port;
    b->board_degc = io->temp_degc(io->ctx, 3, s->now_ns);
    init_trace(b);
    psa2_port_init(b);
    sched_ev_inner(&b->res_up, res_up, b);
    sched_ev_inner(&b->timeout, on_accel_timeout, b);
    psa2_spi_init(b);
    init_read(b);
    sched_ev_inner(&b->temp.timeout, on_temp_timeout, b);
    psa2_temp_restart(b);
    psa2_lazy_init(b);
    psa2_out_init(b);
    init_accel(b);
    init_temp(b);
}

/* Ends all activity; the lines go idle; the controller's state is cleared. */
static void stop_all(struct psa2 *b, int64_t t_ns)
{
    b->step = 0;
    b->seq = 0;
    b->drd_a_seen = b->fault_notified = false;
    b->sample = (struct psa2_sample){.due = false};
    psa2_lazy_stop(b);
    sched_cancel(b->base.sched, &b->timeout);
    psa2_spi_stop(b, t_ns);
    psa2_out_stop(b, t_ns);
    psa2_temp_restart(b);
    psa2_pulse_stop(b, t_ns);
    res_pin(b, false, t_ns);
}

static void enter_reset(struct psa2 *b, int64_t t_ns)
{
    b->mode = PSA2_IN_RESET;
    stop_all(b, t_ns);
    sched_at(b->base.sched, &b->res_up, t_ns + RES_LOW_NS);
}

/* After a power-down: the lines that rest high rise. */
static void restore_idle_levels(struct psa2 *b, int64_t t_ns)
{
    const uint32_t all = (UINT32_C(1) << PSA2_LINES) - 1;
    b->unpowered = false;
    trace_steps(&b->base.trace, &(struct trace_step){t_ns, all, b->idle_lines}, 1);
}

void psa2_power_up(struct psa2 *b, int64_t t_ns)
{
    board_notify(&b->base, PSA2_EV_POWER_UP, t_ns);
    if (b->unpowered) restore_idle_levels(b, t_ns);
    enter_reset(b, t_ns);
    for (unsigned i = 0; i < 3; i++) ads1282_power_up(&b->adc[i], t_ns);
    ads1256_power_up(&b->tadc, t_ns);
}

void psa2_reset(struct psa2 *b, int64_t t_ns)
{
    if (b->mode == PSA2_OFF) return;
    b->counters.resets++;
    enter_reset(b, t_ns);
    board_notify(&b->base, PSA2_EV_RES, t_ns);
    psa2_request_fail(b, PSA2_ACCEL, true, t_ns);
}

void psa2_power_down(struct psa2 *b, int64_t t_ns)
{
    if (b->mode == PSA2_OFF) return;
    b->mode = PSA2_OFF; /* from here on every line is low */
    b->unpowered = true;
    sched_cancel(b->base.sched, &b->res_up);
    stop_all(b, t_ns);
    for (unsigned i = 0; i < 3; i++) ads1282_power_off(&b->adc[i], t_ns);
    ads1256_power_off(&b->tadc, t_ns);
    trace_steps(&b->base.trace, &(struct trace_step){t_ns, (UINT32_C(1) << PSA2_LINES) - 1, 0}, 1);
    b->latest = (struct psa2_frame){0};
    board_notify(&b->base, PSA2_EV_RES, t_ns);
    board_notify(&b->base, PSA2_EV_POWER_DOWN, t_ns);
    psa2_request_fail(b, PSA2_ACCEL, true, t_ns);
}

bool psa2_ready(const struct psa2 *b)
{
    return b->mode == PSA2_RUN;
}

void psa2_sample_until(struct psa2 *b, int64_t t_ns)
{
    psa2_lazy_change(b, t_ns);
    for (unsigned i = 0; i < 3; i++) ads1282_sample_until(&b->adc[i], t_ns);
}
