#include "chip/ads1282/ads1282.h"

#include "chip/ads1282/internal.h"

#include <assert.h>

#define PULSE_TCLK      2  /* shortest SYNC and RESET pulse; sources 1.4 */
#define SYNC_KEEPOUT_NS 30 /* of SYNC's rise from CLK's; M70, D sister */
#define LONG_AGO_NS     (-INT64_C(1000000000))

/* ---- Registers ---- */

/* A change restarts (M75), any write does on a strict part. */
static void config0_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (was == now && !a->cfg.strict_config0) return;
    ads1282_configure(a);
    a->count.refused += !a->running && !a->standby;
    a->count.restarts++;
    ads1282_restart(a, t_ns);
}

/* No restart: the next 63 words are a mixture (M55). */
static void config1_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (was == now) return;
    ads1282_sample_until(a, t_ns);
    ads1282_configure_input(a);
    a->count.refused += (now & ADS1282_CONFIG1_PGA) == 7 || a->mux > 4;
}

/* Sources 1.2: reset values E3 (two independent drivers) unless said otherwise. */
// clang-format off
#define ROWS_BUT_CONFIG1 \
    [ADS1282_ID]      = {.name = "ID",      .src = "tab. ID, high nibble factory set, 0 here: E0", .reset = 0x00}, \
    [ADS1282_CONFIG0] = {.name = "CONFIG0", .src = "SBAS418 CONFIG0; fields E3",   .reset = 0x52, .rw = 0xFF, \
                         .on_write = config0_written}, \
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

/* ---- Power ---- */

/* Into reset, or out of it when supplies and pins allow. */
void ads1282_reset(struct ads1282 *a, int64_t t_ns)
{
    a->alive = a->powered && a->pin.pwdn && !a->waking && a->pin.reset;
    a->standby = false;
    reg_reset(&a->regs);
    ads1282_serial_reset(a);
    ads1282_configure(a);
    ads1282_restart(a, t_ns);
}

static void on_wake(void *ctx, int64_t t_ns)
{
    struct ads1282 *a = ctx;
    a->waking = false;
    ads1282_reset(a, t_ns);
}

/* Supplies, clock and PWDN have become good, or bad: internal reset of 2^16 tCLK on a real part (M75). */
static void power_changed(struct ads1282 *a, int64_t t_ns)
{
    sched_cancel(a->sched, &a->wake);
    a->waking = a->powered && a->pin.pwdn && a->cfg.power_up_tclk > 0;
    if (a->waking)
        sched_at(a->sched, &a->wake, clk_edge_ns(&a->clk, clk_count_at(&a->clk, t_ns) + a->cfg.power_up_tclk));
    ads1282_reset(a, t_ns);
}

void ads1282_power_up(struct ads1282 *a, int64_t t_ns)
{
    a->powered = true;
    power_changed(a, t_ns);
}

void ads1282_power_off(struct ads1282 *a, int64_t t_ns)
{
    a->powered = false;
    power_changed(a, t_ns);
}

void ads1282_pwdn_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (level == a->pin.pwdn) return;
    a->pin.pwdn = level;
    power_changed(a, t_ns);
}

/* The clock is gated, registers and interface stay; WAKEUP restarts (M65). */
void ads1282_standby(struct ads1282 *a, int64_t t_ns)
{
    if (a->standby) return;
    ads1282_sample_until(a, t_ns);
    a->standby = true;
    ads1282_configure(a);
    ads1282_restart(a, t_ns);
}

void ads1282_wakeup(struct ads1282 *a, int64_t t_ns)
{
    if (!a->standby) return;
    a->standby = false;
    ads1282_configure(a);
    ads1282_restart(a, t_ns);
}

/* ---- Pins ---- */

void ads1282_reset_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (level == a->pin.reset) return;
    a->limit.reset_width += level && t_ns - a->pin.reset_ns < clk_span_ns(a->clk.hz, PULSE_TCLK);
    a->pin.reset = level;
    a->pin.reset_ns = t_ns;
    ads1282_reset(a, t_ns);
}

static bool near_clk_edge(const struct ads1282 *a, int64_t t_ns)
{
    const int64_t next = clk_count_at(&a->clk, t_ns);
    return clk_edge_ns(&a->clk, next) - t_ns < SYNC_KEEPOUT_NS ||
           t_ns - clk_edge_ns(&a->clk, next - 1) < SYNC_KEEPOUT_NS;
}

void ads1282_sync_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (level == a->pin.sync) return;
    const bool brief = t_ns - a->pin.sync_ns < clk_span_ns(a->clk.hz, PULSE_TCLK);
    a->pin.sync = level;
    a->pin.sync_ns = t_ns;
    a->limit.sync_width += brief;
    if (!level) return;
    a->limit.sync_keepout += near_clk_edge(a, t_ns);
    if (!(brief && a->cfg.strict_sync)) ads1282_sync(a, t_ns);
}

void ads1282_mode_pins(struct ads1282 *a, const struct ads1282_mode_pins *pins, int64_t t_ns)
{
    assert(a->cfg.pin_mode && pins->dr <= 3);
    a->mode = *pins;
    const uint8_t was = a->config0;
    ads1282_configure(a);
    if (a->config0 == was) return;
    a->count.restarts += a->running;
    ads1282_restart(a, t_ns);
}

void ads1282_init(struct ads1282 *a, const struct ads1282_cfg *cfg, const struct ads1282_io *io, struct sched *s,
                  struct draws noise)
{
    assert(cfg->clk_hz > 0 && cfg->vref_v > 0.0 && cfg->noise_scale >= 0.0 && (io->vin_v || io->vin_row_v));
    assert(!cfg->pin_mode || cfg->part == ADS1282_PART_1281);
    *a = (struct ads1282){.cfg = *cfg, .io = *io, .sched = s, .noise = noise, .drdy = true};
    a->notify_drdy = io->drdy;
    a->pin = (struct ads1282_pins){.reset = true, .pwdn = true};
    a->pin.sclk_rise_ns = a->pin.sclk_fall_ns = a->pin.din_ns = LONG_AGO_NS;
    a->pin.sync_ns = a->pin.reset_ns = a->pin.drdy_ns = LONG_AGO_NS;
    a->regs = (struct reg_file){.map = cfg->part == ADS1282_PART_1282 ? map_1282 : map_1281,
                                .count = ADS1282_REGS,
                                .value = a->reg_value,
                                .chip = a};
    ads1282_conv_init(a);
    sched_ev_inner(&a->wake, on_wake, a);
    ads1282_serial_init(a);
    ads1282_reset(a, s->now_ns);
}
