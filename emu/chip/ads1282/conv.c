#include "chip/ads1282/internal.h"

#include "base/bits.h"
#include "base/detmath.h"

/* Sources 1.6: t_DR = 62.98046875 data periods + 468 tCLK, which is 251/2 N + 468 tCLK and 62 data periods of 128 N. */
#define FIR_LATENCY_TCLK    468
#define FIR_SETTLE_PERIODS  62
#define SYNC_TOLERANCE_TCLK 1  /* of a periodic SYNC against the data periods; D sister ADS1288 */
#define SYNC_KEEPOUT_NS     30 /* sources 1.4, M70 */

/* ---- Configuration ---- */

bool ads1282_models(uint8_t config0)
{
    const unsigned rate = (config0 & ADS1282_CONFIG0_DR) >> 3;
    return rate <= 4 && (config0 & (ADS1282_CONFIG0_SYNC | ADS1282_CONFIG0_FILTR)) == 0x02;
}

static bool is_continuous(const struct ads1282 *a)
{
    return a->config0 & ADS1282_CONFIG0_SYNC;
}

static bool high_pass(const struct ads1282 *a)
{
    return (a->config0 & ADS1282_CONFIG0_FILTR) == 3;
}

/* tCLK from the restart to the first word of the sinc alone, by rate: sources 1.6, M60. */
static int64_t sinc_settle_tclk(const struct ads1282 *a)
{
    static const int16_t tclk[5] = {2824, 1672, 968, 616, 440};
    return tclk[ads1282_rate(a) <= 4 ? ads1282_rate(a) : 2];
}

static void time_periods(struct ads1282 *a)
{
    const int64_t n = ads1282_sinc_ratio(a);
    struct ads1282_timing *t = &a->timing;
    const bool sinc = ads1282_sinc_only(a);
    t->first_tclk = sinc ? sinc_settle_tclk(a) : 251 * n / 2 + FIR_LATENCY_TCLK;
    t->period_tclk = sinc ? 4 * n : 128 * n;
    t->settle = sinc ? 0 : FIR_SETTLE_PERIODS;
    t->period_ns = clk_span_ns(a->clk.hz, t->period_tclk);
    t->settle_ns = clk_span_ns(a->clk.hz, t->first_tclk + t->settle * t->period_tclk);
}

/* Pin mode: the pins in the places of their fields of CONFIG0. */
static uint8_t config0_of_pins(const struct ads1282_mode_pins *m)
{
    return (uint8_t)((m->continuous_sync ? ADS1282_CONFIG0_SYNC : 0) | 0x40u | (m->dr & 3u) << 3 |
                     (m->minimum_phase ? ADS1282_CONFIG0_PHASE : 0) | (m->high_pass ? 3u : 2u));
}

static bool has_known_delay(const struct ads1282 *a)
{
    return ads1282_rate(a) <= 4 || ads1282_bits_only(a);
}

static void choose_special(struct ads1282 *a)
{
    a->special = is_continuous(a) || high_pass(a) || ads1282_sinc_only(a) || a->cal.kind != ADS1282_CAL_NONE;
}

/* SNR in dB by rate and gain, chopping on. Column 1: E2 for 250 and 500 words/s, M90 below; other columns M60. */
// clang-format off
static const uint8_t snr_db[5][7] = {
    {130, 130, 129, 128, 125, 119, 114},
    {127, 127, 126, 125, 122, 116, 111},
    {124, 124, 123, 122, 119, 113, 108},
    {121, 121, 120, 119, 116, 110, 105},
    {118, 118, 117, 115, 112, 107, 101},
};
// clang-format on

/* Output noise of the FIR modes in volts rms at the input; rate 0..4 (250..4000 words/s), pga_log2 0..6. From the SNR of a
 * full-scale sine at VREF 5 V (sources 1.9); with another reference the volts stay: they are thermal (E0). */
static double noise_v(unsigned rate, unsigned pga_log2)
{
    const double fs_rms_v = 2.5 / (1 << pga_log2) * 0.70710678118654752440;
    return fs_rms_v * det_exp(-0.11512925464970228420 * snr_db[rate][pga_log2]);
}

/* Scale, multiplexer and noise from CONFIG1. */
void ads1282_configure_input(struct ads1282 *a)
{
    const uint8_t c1 = a->cfg.part == ADS1282_PART_1282 ? a->reg_value[ADS1282_CONFIG1] : 0;
    const unsigned code = c1 & ADS1282_CONFIG1_PGA;
    const unsigned pga_log2 = code < 7 ? code : 6; /* 111 is reserved */
    const double block_fs = (double)(INT64_C(1) << ADS1282_BLOCK_LOG2);
    a->mux = (c1 & ADS1282_CONFIG1_MUX) >> 4;
    a->lsb_per_v = block_fs * 2.0 * (1 << pga_log2) / a->cfg.vref_v;
    if (!a->running) return;
    const unsigned rate = ads1282_rate(a) <= 4 ? ads1282_rate(a) : 2;
    a->noise_lsb = ads1282_chain_noise_lsb(a, a->cfg.noise_scale * noise_v(rate, pga_log2) * a->lsb_per_v);
}

void ads1282_configure(struct ads1282 *a)
{
    a->config0 = a->cfg.pin_mode ? config0_of_pins(&a->mode) : a->reg_value[ADS1282_CONFIG0];
    a->running = a->alive && !a->standby && has_known_delay(a);
    a->delivers = a->running && !ads1282_bits_only(a);
    time_periods(a);
    ads1282_chain_configure(a);
    ads1282_configure_input(a);
    choose_special(a);
}

/* ---- Pins ---- */

void ads1282_set_drdy(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (a->drdy == level) return;
    a->drdy = level;
    a->pin.drdy_ns = t_ns;
    if (level) sched_cancel(a->sched, &a->pulse); /* nothing is left for it to do */
    if (a->io.drdy) a->io.drdy(a->io.ctx, level, t_ns);
}

/* M70: high while the input is at or beyond full scale. Here: its newest sample. */
bool ads1282_mflag(const struct ads1282 *a)
{
    const int64_t fs = INT64_C(1) << ADS1282_BLOCK_LOG2;
    return a->running && (a->last_lsb >= fs || a->last_lsb <= -fs);
}

static void notify_mflag(struct ads1282 *a, int64_t t_ns)
{
    const bool level = ads1282_mflag(a);
    if (level == a->mflag) return;
    a->mflag = level;
    if (a->io.mflag) a->io.mflag(a->io.ctx, level, t_ns);
}

/* ---- Data periods ---- */

static int32_t get_ofc(const struct ads1282 *a)
{
    return bits_sign_extend(reg_peek24(&a->regs, ADS1282_OFC0), 24);
}

static int64_t correct_code(const struct ads1282 *a, int64_t y)
{
    return ads1282_correct(y, get_ofc(a), reg_peek24(&a->regs, ADS1282_FSC0));
}

static uint32_t fir_word(struct ads1282 *a, int64_t y)
{
    bool clipped;
    const uint32_t word = ads1282_word(correct_code(a, y), &clipped);
    a->count.clipped += clipped;
    return word;
}

/* A word, settled or, in continuous synchronisation, 0. */
static void deliver_word(struct ads1282 *a, uint32_t word, int64_t t_ns)
{
    ads1282_serial_deliver(a, word, t_ns);
    a->update_ns = clk_on(a->ended, &a->pulse_step).t_ns;
    sched_at(a->sched, &a->pulse, a->update_ns);
    ads1282_set_drdy(a, false, t_ns);
}

/* True while it is going on. At its end the word is already the corrected one (E0). */
static bool calibrate_word(struct ads1282 *a, int64_t y)
{
    struct ads1282_cal *c = &a->cal;
    if (c->kind == ADS1282_CAL_NONE) return false;
    if (!ads1282_cal_take(c, a->cfg.cal_corrected ? correct_code(a, y) : y)) return true;
    const int32_t ofc = a->cfg.cal_corrected ? 0 : get_ofc(a);
    if (c->kind == ADS1282_CAL_OFFSET) reg_poke24(&a->regs, ADS1282_OFC0, (uint32_t)ads1282_cal_ofc(c));
    else reg_poke24(&a->regs, ADS1282_FSC0, ads1282_cal_fsc(c, ofc));
    a->count.calibrations++;
    c->kind = ADS1282_CAL_NONE;
    choose_special(a);
    return false;
}

/* High-pass, calibration, the sinc's words, continuous synchronisation. */
static void special_word(struct ads1282 *a, int64_t y, bool settled, int64_t t_ns)
{
    if (high_pass(a)) y = ads1282_hpf_step(&a->hpf, y, (uint16_t)bits_get_le(&a->reg_value[ADS1282_HPF0], 2));
    if (!settled) {
        if (is_continuous(a)) deliver_word(a, 0, t_ns);
        return;
    }
    if (calibrate_word(a, y)) return;
    a->count.conversions++;
    /* The sinc's word is right-justified, neither corrected nor clipped: sources 1.7; without correction: E0. */
    deliver_word(a, ads1282_sinc_only(a) ? (uint32_t)y : fir_word(a, y), t_ns);
}

/* End of a data period. While nothing delivers words it only measures how long SCLK rests. */
static void on_due(void *ctx, int64_t t_ns)
{
    struct ads1282 *a = ctx;
    a->sample(a, t_ns);
    const int64_t p = a->period++;
    if (p > 0) a->ended = clk_on(a->ended, &a->period_step);
    sched_at(a->sched, &a->due, clk_on(a->ended, &a->period_step).t_ns);
    ads1282_serial_period(a);
    if (!a->delivers) return;
    a->update_ns = INT64_MAX;
    const int64_t y = a->result[(uint64_t)(p + a->lag) % ADS1282_RESULTS];
    const bool settled = p >= a->timing.settle;
    if (a->special) {
        special_word(a, y, settled, t_ns);
        return;
    }
    if (!settled) return;
    a->count.conversions++;
    deliver_word(a, fir_word(a, y), t_ns);
}

static void on_pulse(void *ctx, int64_t t_ns)
{
    ads1282_set_drdy(ctx, true, t_ns);
}

/* An input sample is due and MFLAG or the modulator is watched. */
static void on_watch(void *ctx, int64_t t_ns)
{
    struct ads1282 *a = ctx;
    a->sample(a, t_ns);
    notify_mflag(a, t_ns);
    sched_at(a->sched, &a->watch, a->next.t_ns);
}

void ads1282_sample_until(struct ads1282 *a, int64_t t_ns)
{
    a->sample(a, t_ns);
}

/* ---- Restart and synchronisation ---- */

static void restart_at(struct ads1282 *a, int64_t edge, int64_t t_ns)
{
    sched_cancel(a->sched, &a->due);
    sched_cancel(a->sched, &a->pulse);
    sched_cancel(a->sched, &a->watch);
    ads1282_set_drdy(a, true, t_ns);
    a->in_phase = false;
    a->update_ns = INT64_MAX;
    a->cal.kind = ADS1282_CAL_NONE;
    choose_special(a);
    if (!a->running) a->last_lsb = 0;
    notify_mflag(a, t_ns);
    if (!a->alive) return;
    a->sync_count = edge;
    a->period = 0;
    a->ended = clk_pos(&a->clk, edge + ads1282_due_tclk(a, 0));
    a->period_step = clk_step(&a->clk, a->timing.period_tclk);
    a->pulse_step = clk_step(&a->clk, a->timing.period_tclk - ADS1282_PULSE_TCLK);
    sched_at(a->sched, &a->due, a->ended.t_ns);
    if (!a->running) return;
    ads1282_hpf_clear(&a->hpf);
    ads1282_chain_restart(a);
    if ((a->io.mflag || (a->io.modulator && ads1282_bits_only(a)))) sched_at(a->sched, &a->watch, a->next.t_ns);
}

void ads1282_restart(struct ads1282 *a, int64_t t_ns)
{
    restart_at(a, clk_count_at(&a->clk, t_ns), t_ns);
}

void ads1282_play(struct ads1282 *a, const struct ads1282_recording *r, int64_t t_ns)
{
    a->recording = *r;
    a->recording.edge = -1;
    a->last_lsb = 0;
    ads1282_configure(a);
    ads1282_restart(a, t_ns);
}

/* Within one CLK of a whole number of data periods since the SYNC that restarted. */
static bool in_phase(const struct ads1282 *a, int64_t edge)
{
    const int64_t rest = (edge - a->sync_count) % a->timing.period_tclk;
    return rest <= SYNC_TOLERANCE_TCLK || rest >= a->timing.period_tclk - SYNC_TOLERANCE_TCLK;
}

void ads1282_sync(struct ads1282 *a, int64_t t_ns)
{
    if (!a->running || a->fault.lost_sync) return;
    int64_t edge = clk_count_at(&a->clk, t_ns);
    if (a->cfg.strict_sync && clk_edge_ns(&a->clk, edge) - t_ns < SYNC_KEEPOUT_NS) edge++;
    if (is_continuous(a) && a->in_phase && in_phase(a, edge)) return;
    a->count.restarts++;
    restart_at(a, edge, t_ns);
    a->in_phase = true;
}

void ads1282_calibrate(struct ads1282 *a, bool gain, int64_t t_ns)
{
    if (!a->delivers || ads1282_sinc_only(a)) {
        a->count.refused++;
        return;
    }
    a->cal = (struct ads1282_cal){gain ? ADS1282_CAL_GAIN : ADS1282_CAL_OFFSET, ADS1282_CAL_READINGS, 0};
    a->special = true;
    sched_cancel(a->sched, &a->pulse);
    ads1282_serial_clear(a);
    ads1282_set_drdy(a, true, t_ns);
}

/* Counts of the clock go on, their instants are new ones from here on. */
void ads1282_retime(struct ads1282 *a)
{
    time_periods(a);
    if (!a->due.queued) return;
    a->ended = clk_pos(&a->clk, a->ended.k);
    a->period_step = clk_step(&a->clk, a->timing.period_tclk);
    a->pulse_step = clk_step(&a->clk, a->timing.period_tclk - ADS1282_PULSE_TCLK);
    sched_at(a->sched, &a->due, a->period == 0 ? a->ended.t_ns : clk_on(a->ended, &a->period_step).t_ns);
    if (a->update_ns != INT64_MAX) a->update_ns = clk_on(a->ended, &a->pulse_step).t_ns;
    if (a->pulse.queued) sched_at(a->sched, &a->pulse, a->update_ns);
    if (!a->running) return;
    a->next = clk_pos(&a->clk, a->next.k);
    a->step = clk_step(&a->clk, a->timing.step_tclk);
    if (a->watch.queued) sched_at(a->sched, &a->watch, a->next.t_ns);
}

/* ---- For the owner ---- */

bool ads1282_drdy(const struct ads1282 *a)
{
    return chip_fault_level(a->fault.drdy, a->drdy);
}

static bool has_words(const struct ads1282 *a)
{
    return has_known_delay(a) && !ads1282_bits_only(a);
}

int64_t ads1282_settle_ns(const struct ads1282 *a)
{
    return has_words(a) ? a->timing.settle_ns : 0;
}

int64_t ads1282_period_ns(const struct ads1282 *a)
{
    return has_words(a) ? a->timing.period_ns : 0;
}

void ads1282_conv_init(struct ads1282 *a)
{
    a->clk = (struct clk){.hz = a->cfg.clk_hz, .div = 1};
    sched_ev_inner(&a->due, on_due, a);
    sched_ev_inner(&a->pulse, on_pulse, a);
    sched_ev_inner(&a->watch, on_watch, a);
}
