#include "chip/ads1256/internal.h"

#include "base/bits.h"

static int32_t get_ofc(const struct ads1256 *a)
{
    return bits_sign_extend(reg_peek24(&a->regs, ADS1256_OFC0), 24);
}

void ads1256_set_drdy(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->drdy) return;
    a->drdy = level;
    reg_poke(&a->regs, ADS1256_STATUS, (uint8_t)((ads1256_value(a, ADS1256_STATUS) & ~ADS1256_STATUS_DRDY) | level));
    if (a->io.drdy) a->io.drdy(a->io.ctx, level, t_ns);
}

/* Fraction of full scale for volts at the input of the uncalibrated path. */
static double path_fs(const struct ads1256 *a, double vin_v)
{
    const double gain = (double)(1u << ads1256_pga_log2(a)) * (1.0 + a->cfg.gain_error);
    return gain * (vin_v + a->cfg.offset_v) / (2.0 * a->cfg.vref_v);
}

static double noise_rms_fs(const struct ads1256 *a, unsigned gain_log2)
{
    const double rms_v = a->cfg.noise_scale * ads1256_noise_v(a->rate, gain_log2);
    return (double)(1u << gain_log2) * rms_v / (2.0 * a->cfg.vref_v);
}

/* Noise of a draw of so many standard deviations. */
static double draw_fs(const struct ads1256 *a, double draw)
{
    return noise_rms_fs(a, ads1256_pga_log2(a)) * draw;
}

static double noise_fs(const struct ads1256 *a, int64_t t_ns)
{
    return draw_fs(a, draws_gauss(&a->noise, t_ns));
}

static int64_t run_edge_ns(const struct ads1256 *a, int64_t tau)
{
    return clk_edge_ns(&a->clkin, a->start_tau + tau);
}

static int64_t ready_tau(const struct ads1256 *a, int64_t conversion)
{
    return ads1256_settle_tau(a->rate) + conversion * ads1256_period_tau(a->rate);
}

static unsigned cells_max(const struct ads1256 *a)
{
    return a->cfg.every_word ? ADS1256_EVERY_WORD : a->cfg.cells_max;
}

static void await_cell(struct ads1256 *a)
{
    sched_at(a->sched, &a->cell_ev, run_edge_ns(a, ads1256_cell_tau(&a->mean, a->rate, a->cell)));
}

static void await_ready(struct ads1256 *a)
{
    sched_at(a->sched, &a->ready_ev, run_edge_ns(a, ready_tau(a, a->ready)));
}

void ads1256_start_run(struct ads1256 *a, int64_t start_tau)
{
    a->mode = ADS1256_RUNNING;
    a->rate = a->rate_next;
    a->start_tau = start_tau;
    a->cell = a->ready = 0;
    ads1256_mean_start(&a->mean, a->rate, cells_max(a));
    await_cell(a);
    await_ready(a);
}

/* DRATE changed without synchronisation: periods of the new length from the DRDY at CLKIN count ready on. The sinc5 goes
 * on with what it holds; only the mean begins again. */
static void change_rate(struct ads1256 *a, int64_t ready)
{
    a->rate = a->rate_next;
    a->start_tau = ready - ADS1256_START_TAU;
    a->ready = 0;
    a->cell = ads1256_mean_change(&a->mean, a->rate, cells_max(a));
    await_cell(a);
    await_ready(a);
}

void ads1256_freeze(struct ads1256 *a, enum ads1256_mode mode)
{
    sched_cancel(a->sched, &a->cell_ev);
    sched_cancel(a->sched, &a->ready_ev);
    sched_cancel(a->sched, &a->pulse_ev);
    sched_cancel(a->sched, &a->cal_ev);
    a->updating = a->sync_due = false;
    a->mode = mode;
}

void ads1256_halt(struct ads1256 *a, enum ads1256_mode mode, int64_t t_ns)
{
    ads1256_freeze(a, mode);
    ads1256_set_drdy(a, true, t_ns);
}

void ads1256_restart(struct ads1256 *a, int64_t extra_tau, int64_t t_ns)
{
    ads1256_halt(a, ADS1256_RUNNING, t_ns);
    a->n.restarts++;
    ads1256_start_run(a, clk_count_at(&a->clkin, t_ns) + extra_tau);
}

static void on_cell(void *ctx, int64_t t_ns)
{
    struct ads1256 *a = ctx;
    ads1256_mean_push(&a->mean, path_fs(a, ads1256_input_v(a, t_ns)));
    a->cell++;
    await_cell(a);
}

static int32_t code_of(const struct ads1256 *a, double fs, bool *clipped)
{
    return ads1256_code(a->rate->alpha * fs, get_ofc(a), reg_peek24(&a->regs, ADS1256_FSC0), clipped);
}

static int32_t convert_mean(struct ads1256 *a, int64_t t_ns)
{
    bool clipped = false;
    const int32_t code = code_of(a, a->mean.out + noise_fs(a, t_ns), &clipped);
    a->n.clipped += clipped;
    return code;
}

/* The mean of looks lies between them, and the code follows it one way. */
bool ads1256_in_range(const struct ads1256 *a, double low_v, double high_v)
{
    const double noise = draw_fs(a, DRAWS_GAUSS_MAX);
    bool clipped = false;
    (void)code_of(a, path_fs(a, low_v) - noise, &clipped);
    (void)code_of(a, path_fs(a, high_v) + noise, &clipped);
    return !clipped;
}

/* The serial port's side of a new word: a read in progress goes on with the new one's bytes, each RDATAC word starts over
 * with the next byte. */
static void offer_word(struct ads1256 *a)
{
    a->n.overruns += a->unread;
    a->unread = true;
    a->n.torn_reads += ads1256_half_read(a);
    if (a->rdatac) a->word_left = 3 + a->begun;
    else if (a->port != ADS1256_WORD) a->word_left = 0;
}

static void await_pulse(struct ads1256 *a)
{
    sched_at(a->sched, &a->pulse_ev, run_edge_ns(a, ready_tau(a, a->ready) - ADS1256_PULSE_TAU));
}

static void on_ready(void *ctx, int64_t t_ns)
{
    struct ads1256 *a = ctx;
    a->n.conversions++;
    a->updating = a->after_sdatac = false;
    a->word = convert_mean(a, t_ns);
    offer_word(a);
    a->ready++;
    if (a->rate != a->rate_next) change_rate(a, a->start_tau + ready_tau(a, a->ready - 1));
    else await_ready(a);
    await_pulse(a);
    ads1256_set_drdy(a, false, t_ns);
}

static void on_pulse(void *ctx, int64_t t_ns)
{
    struct ads1256 *a = ctx;
    a->updating = true;
    ads1256_set_drdy(a, true, t_ns);
}

/* What a calibration measures: the signal at the pins or shorted inputs and VREF; what it stores. */
static const struct {
    bool pins, ofc, fsc;
} steps[] = {
    [ADS1256_SELFCAL] = {.ofc = true, .fsc = true},
    [ADS1256_SELFOCAL] = {.ofc = true},
    [ADS1256_SELFGCAL] = {.fsc = true},
    [ADS1256_SYSOCAL] = {.pins = true, .ofc = true},
    [ADS1256_SYSGCAL] = {.pins = true, .fsc = true},
};

void ads1256_calibrate(struct ads1256 *a, enum ads1256_cal kind, int64_t t_ns)
{
    a->cal = kind;
    a->cal_due = !a->sync || a->mode == ADS1256_STANDBY;
    if (a->cal_due) { /* the filter is held: at the rise of SYNC/PDWN, at WAKEUP (E0) */
        if (a->mode != ADS1256_STANDBY) ads1256_halt(a, ADS1256_SYNC_LOW, t_ns);
        return;
    }
    ads1256_halt(a, ADS1256_CALIBRATING, t_ns);
    a->rate = a->rate_next;
    const int64_t end_tau = clk_count_at(&a->clkin, t_ns) + ads1256_cal_tau(a->rate, kind, ads1256_pga_log2(a));
    const int64_t settle_tau = ads1256_settle_tau(a->rate);
    /* The printed durations include the settling of the run that follows. Before it lies the measurement: a system
     * calibration takes one word of the pins, whose first cell is 52 tau after the command in the shortest of them. */
    a->start_tau = end_tau - 2 * settle_tau;
    a->next_ok_ns = clk_edge_ns(&a->clkin, end_tau);
    sched_at(a->sched, &a->cal_ev, run_edge_ns(a, settle_tau));
    if (!steps[kind].pins) return;
    ads1256_mean_start(&a->mean, a->rate, cells_max(a));
    a->cell = 0;
    await_cell(a);
}

static void store_ofc(struct ads1256 *a, double raw)
{
    bool clamped = false;
    reg_poke24(&a->regs, ADS1256_OFC0, (uint32_t)ads1256_cal_ofc(raw, &clamped));
    a->n.cal_clamped += clamped;
}

static void store_fsc(struct ads1256 *a, double raw)
{
    bool clamped = false;
    reg_poke24(&a->regs, ADS1256_FSC0, ads1256_cal_fsc(a->rate, raw, &clamped));
    a->n.cal_clamped += clamped;
}

/* Full scale as the self-gain calibration finds it, with the noise of two measurements: that of VREF, which fits the PGA at
 * gain 1 (half of full scale) and 2 (all of it), so that no higher one is used, and that of zero, where it is a part of the
 * same calibration. Standard deviations of recorded silicon agree (E5), what it does inside is not published. */
static double self_span_fs(const struct ads1256 *a, double zero_noise_fs, int64_t t_ns)
{
    const unsigned gain_log2 = ads1256_pga_log2(a) > 0;
    const double vref_fs = gain_log2 ? 1.0 : 0.5;
    const struct draws own = {a->noise.key, a->noise.high + 1}; /* that of zero has the draw of this instant */
    const double noise = noise_rms_fs(a, gain_log2) * draws_gauss(&own, t_ns) - zero_noise_fs;
    return 1.0 + a->cfg.gain_error + noise / vref_fs;
}

static void store_result(struct ads1256 *a, int64_t t_ns)
{
    const double alpha = a->rate->alpha, noise = noise_fs(a, t_ns);
    const bool pins = steps[a->cal].pins, ofc = steps[a->cal].ofc;
    if (ofc) store_ofc(a, alpha * ((pins ? a->mean.out : path_fs(a, 0.0)) + noise));
    if (!steps[a->cal].fsc) return;
    if (pins) store_fsc(a, alpha * (a->mean.out + noise) - get_ofc(a));
    else store_fsc(a, alpha * self_span_fs(a, ofc ? noise : 0.0, t_ns));
}

static void on_cal(void *ctx, int64_t t_ns)
{
    struct ads1256 *a = ctx;
    a->n.calibrations++;
    store_result(a, t_ns);
    if (a->sync) ads1256_start_run(a, a->start_tau + ads1256_settle_tau(a->rate));
    else ads1256_halt(a, ADS1256_SYNC_LOW, t_ns);
}

/* Counts of the clock go on, their instants are new ones from here on. */
void ads1256_retime(struct ads1256 *a)
{
    if (a->cell_ev.queued) await_cell(a);
    if (a->ready_ev.queued) await_ready(a);
    if (a->pulse_ev.queued) await_pulse(a);
    if (a->cal_ev.queued) sched_at(a->sched, &a->cal_ev, run_edge_ns(a, ads1256_settle_tau(a->rate)));
}

void ads1256_conv_init(struct ads1256 *a)
{
    sched_ev_inner(&a->cell_ev, on_cell, a);
    sched_ev_inner(&a->ready_ev, on_ready, a);
    sched_ev_inner(&a->pulse_ev, on_pulse, a);
    sched_ev_inner(&a->cal_ev, on_cal, a);
}
