#include "chip/ads1282.h"

#include "base/bits.h"
#include "base/detmath.h"
#include "chip/ads1282_serial.h"

#include <assert.h>

/* Sources 1.6: t_DR = 62.98046875 data periods + 468 tCLK, in blocks of 4 N tCLK 2015.375 blocks + 468 tCLK. Our
 * reading (E0): the first block begins 1.5 N tCLK after the restart, 2015 blocks make the first word, and 468 tCLK are
 * the latency of the arithmetic. The data period of 32 blocks that a restart cuts short lacks its first block, which
 * counts as taken with value 0. */
#define LATENCY_TCLK   468
#define SETTLE_PERIODS 62
#define PULSE_TCLK     4 /* DRDY high when nobody read; E2 ADS1287, M80 */

/* ---- Configuration ---- */

static uint8_t config0(const struct ads1282 *a)
{
    return a->reg_value[ADS1282_CONFIG0];
}

static unsigned rate_of(const struct ads1282 *a)
{
    return (config0(a) & ADS1282_CONFIG0_DR) >> 3;
}

/* N of the present CONFIG0; a reserved rate has none. */
static int64_t sinc_ratio(const struct ads1282 *a)
{
    return rate_of(a) <= 4 ? 128 >> rate_of(a) : 0;
}

bool ads1282_models(uint8_t config0_value)
{
    const unsigned rate = (config0_value & ADS1282_CONFIG0_DR) >> 3;
    return rate <= 4 && (config0_value & (ADS1282_CONFIG0_SYNC | ADS1282_CONFIG0_FILTR)) == 0x02;
}

static bool modelled(const struct ads1282 *a)
{
    return ads1282_models(config0(a));
}

/* SNR in dB by rate and gain, referred to a sine of full scale at VREF 5 V: sources 1.9. Column 1: E2 for 250 and
 * 500 words/s, M90 below; other columns M60. */
// clang-format off
static const uint8_t snr_db[5][7] = {
    {130, 130, 129, 128, 125, 119, 114},
    {127, 127, 126, 125, 122, 116, 111},
    {124, 124, 123, 122, 119, 113, 108},
    {121, 121, 120, 119, 116, 110, 105},
    {118, 118, 117, 115, 112, 107, 101},
};
// clang-format on

/* Output noise in volts at the input. With another reference the volts stay: they are thermal (E0). */
static double noise_v(unsigned rate, unsigned pga_log2)
{
    const double fs_rms_v = 2.5 / (1 << pga_log2) * 0.70710678118654752440;
    return fs_rms_v * det_exp(-0.11512925464970228420 * snr_db[rate][pga_log2]);
}

/* The sum of four uniform 16-bit numbers has this standard deviation: sqrt((2^32 - 1) / 3). */
#define DRAW_SD 37837.227475000000

/* Input scale, multiplexer and noise from CONFIG1. */
static void configure_input(struct ads1282 *a)
{
    const uint8_t c1 = a->cfg.part == ADS1282_PART_1282 ? a->reg_value[ADS1282_CONFIG1] : 0;
    const unsigned code = c1 & ADS1282_CONFIG1_PGA;
    const unsigned pga_log2 = code < 7 ? code : 6; /* 111 is reserved */
    const double block_fs = (double)(INT64_C(1) << ADS1282_BLOCK_LOG2);
    a->mux = (c1 & ADS1282_CONFIG1_MUX) >> 4;
    a->lsb_per_v = block_fs * 2.0 * (1 << pga_log2) / a->cfg.vref_v;
    if (!a->running) return;
    a->noise_lsb = a->cfg.noise_scale * noise_v(rate_of(a), pga_log2) * a->lsb_per_v /
                   ads1282_filter_noise_gain(&a->filter) / DRAW_SD;
}

/* Everything from the register file. */
static void configure(struct ads1282 *a)
{
    a->running = a->alive && modelled(a);
    if (a->running) {
        const bool minimum = config0(a) & ADS1282_CONFIG0_PHASE;
        ads1282_filter_init(&a->filter, (unsigned)sinc_ratio(a), minimum ? ADS1282_MINIMUM : ADS1282_LINEAR);
    }
    configure_input(a);
}

/* ---- Converter column ---- */

static int64_t data_tclk(const struct ads1282 *a)
{
    return 128 * sinc_ratio(a);
}

/* tCLK from the restart to the end of data period p; the first settled one is p = SETTLE_PERIODS. */
static int64_t due_tclk(const struct ads1282 *a, int64_t p)
{
    return 251 * sinc_ratio(a) / 2 + LATENCY_TCLK + p * data_tclk(a);
}

static int64_t due_ns(const struct ads1282 *a, int64_t p)
{
    return clk_edge_ns(&a->clk, a->sync_count + due_tclk(a, p));
}

/* The middle of a block: held over the block, the sample is then neither early nor late. */
static int64_t block_ns(const struct ads1282 *a)
{
    return clk_edge_ns(&a->clk, a->sync_count + sinc_ratio(a) * (8 * a->block - 1) / 2);
}

/* Zero mean, unit rms after division by DRAW_SD. Four uniforms are enough: the chain averages more than 50 blocks, which
 * leaves the output an excess kurtosis below 0.006, at a seventh of the cost of a Gaussian draw. */
static double draw(struct rng *r)
{
    const uint64_t u = rng_u64(r);
    const uint32_t sum =
        (uint32_t)(u & 0xFFFF) + (uint32_t)(u >> 16 & 0xFFFF) + (uint32_t)(u >> 32 & 0xFFFF) + (uint32_t)(u >> 48);
    return (double)sum - 131070.0;
}

/* Ideal modulator: volts to a number of full scale 2^34, saturating. Rounds to nearest without a call into libm. */
static int64_t modulate(struct ads1282 *a, double v)
{
    const double max = ADS1282_SATURATION * (double)(INT64_C(1) << ADS1282_BLOCK_LOG2);
    double x = v * a->lsb_per_v;
    if (a->noise_lsb > 0.0) x += a->noise_lsb * draw(&a->noise);
    if (!(x < max)) x = max; /* not a number saturates too */
    if (x < -max) x = -max;
    return (int64_t)(x + 0x1p36 + 0.5) - (INT64_C(1) << 36);
}

static double input_v(const struct ads1282 *a, int64_t t_ns)
{
    return a->mux == 2 || a->mux > 4 ? 0.0 : a->io.vin_v(a->io.ctx, a->mux, t_ns);
}

void ads1282_sample_until(struct ads1282 *a, int64_t t_ns)
{
    if (!a->running) return;
    for (int64_t b_ns = block_ns(a); b_ns <= t_ns; b_ns = block_ns(a)) {
        const unsigned slot = (unsigned)(a->block++ % ADS1282_BLOCKS);
        a->sample[slot] = modulate(a, input_v(a, b_ns));
        if (slot == ADS1282_BLOCKS - 1) a->result_lsb = ads1282_filter_period(&a->filter, a->sample);
    }
}

void ads1282_set_drdy(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (a->drdy == level) return;
    a->drdy = level;
    if (a->io.drdy) a->io.drdy(a->io.ctx, level, t_ns);
}

/* Clears the filter and starts it at the next CLK edge. */
static void restart(struct ads1282 *a, int64_t t_ns)
{
    sched_cancel(a->sched, &a->due);
    sched_cancel(a->sched, &a->pulse);
    ads1282_set_drdy(a, true, t_ns);
    if (!a->running) return;
    ads1282_filter_clear(&a->filter);
    a->sync_count = clk_count_at(&a->clk, t_ns);
    a->sample[0] = 0;
    a->block = 1;
    a->period = 0;
    sched_at(a->sched, &a->due, due_ns(a, 0));
}

static uint32_t get24(const struct ads1282 *a, unsigned low_byte)
{
    return (uint32_t)bits_get_le(&a->reg_value[low_byte], 3);
}

static uint32_t output_word(struct ads1282 *a)
{
    bool clipped;
    const int64_t y =
        ads1282_correct(a->result_lsb, bits_sign_extend(get24(a, ADS1282_OFC0), 24), get24(a, ADS1282_FSC0));
    const uint32_t word = ads1282_word(y, &clipped);
    a->count.clipped += clipped;
    return word;
}

/* End of a data period. */
static void on_due(void *ctx, int64_t t_ns)
{
    struct ads1282 *a = ctx;
    ads1282_sample_until(a, t_ns);
    const bool settled = a->period++ >= SETTLE_PERIODS;
    sched_at(a->sched, &a->due, due_ns(a, a->period));
    ads1282_serial_period(a);
    if (!settled) return;
    a->count.conversions++;
    ads1282_serial_deliver(a, output_word(a), t_ns);
    sched_at(a->sched, &a->pulse, clk_edge_ns(&a->clk, a->sync_count + due_tclk(a, a->period) - PULSE_TCLK));
    ads1282_set_drdy(a, false, t_ns);
}

static void on_pulse(void *ctx, int64_t t_ns)
{
    ads1282_set_drdy(ctx, true, t_ns);
}

/* ---- Registers ---- */

static void config0_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (was == now) return;
    configure(a);
    a->count.refused += !a->running;
    a->count.restarts++;
    restart(a, t_ns);
}

/* No restart: the next 63 words are a mixture (M55). */
static void config1_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (was == now) return;
    ads1282_sample_until(a, t_ns);
    configure_input(a);
    a->count.refused += (now & ADS1282_CONFIG1_PGA) == 7 || a->mux > 4;
}

/* Sources 1.2: reset values E3 (two independent drivers) unless said otherwise. */
// clang-format off
#define ROWS_BUT_CONFIG1 \
    [ADS1282_ID]      = {.name = "ID",      .src = "tab. ID, high nibble factory set, 0 here: E0", .reset = 0x00}, \
    [ADS1282_CONFIG0] = {.name = "CONFIG0", .src = "SBAS418 CONFIG0; fields E3",   .reset = 0x52, .rw = 0xFF, \
                         .unimp = ADS1282_CONFIG0_SYNC, .on_write = config0_written}, \
    [ADS1282_HPF0]    = {.name = "HPF0",    .src = "SBAS418 HPF, p. 21",           .reset = 0x32, .rw = 0xFF}, \
    [ADS1282_HPF1]    = {.name = "HPF1",    .src = "SBAS418 HPF, p. 21",           .reset = 0x03, .rw = 0xFF}, \
    [ADS1282_OFC0]    = {.name = "OFC0",    .src = "SBAS378 p. 27, article E1",    .reset = 0x00, .rw = 0xFF}, \
    [ADS1282_OFC1]    = {.name = "OFC1",    .src = "SBAS378 p. 27, article E1",    .reset = 0x00, .rw = 0xFF}, \
    [ADS1282_OFC2]    = {.name = "OFC2",    .src = "SBAS378 p. 27, article E1",    .reset = 0x00, .rw = 0xFF}, \
    [ADS1282_FSC0]    = {.name = "FSC0",    .src = "SBAS378 p. 27, article E1",    .reset = 0x00, .rw = 0xFF}, \
    [ADS1282_FSC1]    = {.name = "FSC1",    .src = "SBAS378 p. 27, article E1",    .reset = 0x00, .rw = 0xFF}, \
    [ADS1282_FSC2]    = {.name = "FSC2",    .src = "SBAS378 p. 27, article E1",    .reset = 0x40, .rw = 0xFF}

static const struct reg_spec map_1282[ADS1282_REGS] = {
    ROWS_BUT_CONFIG1,
    [ADS1282_CONFIG1] = {.name = "CONFIG1", .src = "SBAS418 CONFIG1; fields E3",   .reset = 0x08, .rw = 0x7F,
                         .on_write = config1_written},
};

static const struct reg_spec map_1281[ADS1282_REGS] = {
    ROWS_BUT_CONFIG1,
    [ADS1282_CONFIG1] = {.name = "CONFIG1", .src = "bits not seen, a plain byte: E0, M40", .reset = 0x08, .rw = 0xFF},
};
// clang-format on

/* ---- Pins and power ---- */

/* Into reset, or out of it when power and pin allow. */
void ads1282_reset(struct ads1282 *a, int64_t t_ns)
{
    a->alive = a->powered && a->reset_level;
    reg_reset(&a->regs);
    ads1282_serial_reset(a);
    configure(a);
    restart(a, t_ns);
}

void ads1282_init(struct ads1282 *a, const struct ads1282_cfg *cfg, const struct ads1282_io *io, struct sched *s,
                  struct rng noise)
{
    assert(cfg->clk_hz > 0 && cfg->vref_v > 0.0 && cfg->noise_scale >= 0.0 && io->vin_v);
    *a = (struct ads1282){.cfg = *cfg, .io = *io, .sched = s, .noise = noise, .drdy = true, .reset_level = true};
    a->clk = (struct clk){.hz = cfg->clk_hz, .div = 1};
    a->regs = (struct reg_file){.map = cfg->part == ADS1282_PART_1282 ? map_1282 : map_1281,
                                .count = ADS1282_REGS,
                                .value = a->reg_value,
                                .chip = a};
    sched_ev(&a->due, on_due, a);
    sched_ev(&a->pulse, on_pulse, a);
    ads1282_serial_init(a);
    ads1282_reset(a, s->now_ns);
}

void ads1282_power_up(struct ads1282 *a, int64_t t_ns)
{
    a->powered = true;
    ads1282_reset(a, t_ns);
}

void ads1282_reset_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (level == a->reset_level) return;
    a->reset_level = level;
    ads1282_reset(a, t_ns);
}

void ads1282_sync(struct ads1282 *a, int64_t t_ns)
{
    a->count.restarts += a->running;
    restart(a, t_ns);
}

void ads1282_sync_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    const bool rise = level && !a->sync_level;
    a->sync_level = level;
    if (rise) ads1282_sync(a, t_ns);
}

bool ads1282_drdy(const struct ads1282 *a)
{
    return a->drdy;
}

bool ads1282_running(const struct ads1282 *a)
{
    return a->running;
}

int64_t ads1282_settle_ns(const struct ads1282 *a)
{
    return modelled(a) ? clk_span_ns(a->clk.hz, due_tclk(a, SETTLE_PERIODS)) : 0;
}

int64_t ads1282_period_ns(const struct ads1282 *a)
{
    return modelled(a) ? clk_span_ns(a->clk.hz, data_tclk(a)) : 0;
}
