#include "chip/ads1256/ads1256.h"

#include "chip/ads1256/internal.h"

#include <assert.h>
#include <stddef.h>

/* Sources 2.4, 2.6. T10: last SCLK to CS high; T16: RESET and SYNC/PDWN low; the start of a clock and of a crystal. */
enum { T10_TAU = 8, T16_TAU = 4, START_TAU = 8192, START_NS = 30000000 };

static void drate_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns);
static void adcon_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns);

/* clang-format off */
static const struct reg_spec map[ADS1256_REGS] = {
    [ADS1256_STATUS] = {.name = "STATUS", .src = "sources 2.2 C; ID 3, DRDY read-only", .reset = 0x31, .rw = 0x0E},
    [ADS1256_MUX]    = {.name = "MUX",    .src = "sources 2.2 C", .reset = 0x01, .rw = 0xFF},
    [ADS1256_ADCON]  = {.name = "ADCON",  .src = "sources 2.2 C; bit 7 read-only, SBAS288 p. 31", .reset = 0x20, .rw = 0x7F,
                        .on_write = adcon_written},
    [ADS1256_DRATE]  = {.name = "DRATE",  .src = "sources 2.2 C; 16 codes", .reset = 0xF0, .rw = 0xFF, .on_write = drate_written},
    [ADS1256_IO]     = {.name = "IO",     .src = "sources 2.2 C; DIO reads the pins", .reset = 0xE0, .rw = 0xFF, .on_write = ads1256_gpio_written},
    [ADS1256_OFC0]   = {.name = "OFC0",   .src = "sources 2.2 C; set by self-calibration", .reset = 0x00, .rw = 0xFF},
    [ADS1256_OFC1]   = {.name = "OFC1",   .src = "sources 2.2 C", .reset = 0x00, .rw = 0xFF},
    [ADS1256_OFC2]   = {.name = "OFC2",   .src = "sources 2.2 C", .reset = 0x00, .rw = 0xFF},
    [ADS1256_FSC0]   = {.name = "FSC0",   .src = "sources 2.2 C; set by self-calibration, ideal until then (E0)", .reset = 0x08, .rw = 0xFF},
    [ADS1256_FSC1]   = {.name = "FSC1",   .src = "sources 2.2 C", .reset = 0xAC, .rw = 0xFF},
    [ADS1256_FSC2]   = {.name = "FSC2",   .src = "sources 2.2 C", .reset = 0x44, .rw = 0xFF},
};
/* clang-format on */

static void drate_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    (void)was;
    (void)t_ns;
    struct ads1256 *a = chip;
    const struct ads1256_rate *r = ads1256_rate_of(now);
    if (r) a->rate_next = r;
    else a->n.bad_drate++;
}

static void adcon_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    (void)was;
    (void)now;
    ads1256_gpio_show(chip, t_ns); /* D0 is a GPIO pin while CLKOUT is off */
}

/* ---- reset and power ---- */

void ads1256_reset_chip(struct ads1256 *a, enum ads1256_mode mode, uint8_t keep, int64_t t_ns)
{
    const unsigned adcon = ads1256_value(a, ADS1256_ADCON) & keep;
    ads1256_halt(a, mode, t_ns);
    reg_reset(&a->regs);
    reg_poke(&a->regs, ADS1256_ADCON, (uint8_t)((ads1256_value(a, ADS1256_ADCON) & ~(unsigned)keep) | adcon));
    a->dio_latch = 0;
    ads1256_gpio_show(a, t_ns);
    a->rate_next = ads1256_rate_of(ads1256_value(a, ADS1256_DRATE));
    a->word = 0;
    a->unread = false;
    a->cal = ADS1256_SELFCAL;
    a->cal_due = true;
    a->next_ok_ns = 0;
    ads1256_port_idle(a);
    ads1256_pins_release(a, t_ns);
}

void ads1256_go(struct ads1256 *a, int64_t t_ns)
{
    if (!a->reset) ads1256_halt(a, ADS1256_IN_RESET, t_ns);
    else if (!a->sync) ads1256_halt(a, ADS1256_SYNC_LOW, t_ns);
    else if (a->cal_due) ads1256_calibrate(a, a->cal, t_ns);
    else ads1256_restart(a, 0, t_ns);
}

static void on_start(void *ctx, int64_t t_ns)
{
    ads1256_go(ctx, t_ns);
}

static int64_t start_ns(const struct ads1256 *a)
{
    return a->cfg.start == ADS1256_START_CRYSTAL ? START_NS : ads1256_tau_ns(a, START_TAU);
}

/* The oscillator and all else stops, the registers stay (SBAS288 p. 23: the GPIO outputs go on driving). */
static void on_power_down(void *ctx, int64_t t_ns)
{
    struct ads1256 *a = ctx;
    a->n.power_downs++;
    a->powered_down = true;
    sched_cancel(a->sched, &a->start_ev);
    ads1256_halt(a, ADS1256_OFF, t_ns);
    ads1256_port_idle(a);
    ads1256_pins_release(a, t_ns);
}

/* ---- pins ---- */

void ads1256_init(struct ads1256 *a, const struct ads1256_cfg *cfg, const struct ads1256_io *io, struct sched *s,
                  struct draws noise)
{
    *a = (struct ads1256){.cfg = *cfg, .io = *io, .sched = s, .noise = noise};
    assert(cfg->clkin_hz >= 100000 && cfg->clkin_hz <= 10000000 && cfg->vref_v > 0.0);
    if (cfg->avdd_v <= 0.0) a->cfg.avdd_v = 5.0;
    a->notify_drdy = io->drdy;
    a->clkin = (struct clk){.hz = cfg->clkin_hz, .div = 1};
    a->regs = (struct reg_file){.map = map, .count = ADS1256_REGS, .value = a->value, .chip = a};
    a->cs = a->sync = a->reset = a->drdy = true;
    sched_ev_inner(&a->start_ev, on_start, a);
    sched_ev_inner(&a->power_down_ev, on_power_down, a);
    ads1256_serial_init(a);
    ads1256_pins_init(a);
    ads1256_conv_init(a);
    ads1256_reset_chip(a, ADS1256_OFF, 0, 0);
}

void ads1256_power_off(struct ads1256 *a, int64_t t_ns)
{
    sched_cancel(a->sched, &a->power_down_ev);
    sched_cancel(a->sched, &a->start_ev);
    a->powered_down = false;
    ads1256_reset_chip(a, ADS1256_OFF, 0, t_ns);
}

void ads1256_power_up(struct ads1256 *a, int64_t t_ns)
{
    ads1256_power_off(a, t_ns);
    if (a->cfg.start == ADS1256_START_AT_ONCE) ads1256_go(a, t_ns);
    else sched_at(a->sched, &a->start_ev, t_ns + start_ns(a));
}

/* Counts a pulse shorter than t16. */
static void judge_low(struct ads1256 *a, int64_t t_ns)
{
    a->n.gap_violations += t_ns - a->pin_low_ns < ads1256_tau_ns(a, T16_TAU);
}

/* A chip without a clock takes the reset and stays off. */
void ads1256_reset_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->reset) return;
    a->reset = level;
    if (!level) {
        a->pin_low_ns = t_ns;
        ads1256_reset_chip(a, a->mode == ADS1256_OFF ? ADS1256_OFF : ADS1256_IN_RESET, 0, t_ns);
        return;
    }
    judge_low(a, t_ns);
    if (a->mode == ADS1256_IN_RESET) ads1256_go(a, t_ns);
}

static void sync_falls(struct ads1256 *a, int64_t t_ns)
{
    a->pin_low_ns = t_ns;
    if (a->mode == ADS1256_OFF && !a->start_ev.queued) return;
    sched_at(a->sched, &a->power_down_ev,
             t_ns + ads1256_tau_ns(a, ADS1256_POWER_DOWN_PERIODS * ads1256_period_tau(a->rate_next)) + 1);
    if (a->mode == ADS1256_RUNNING || a->mode == ADS1256_SYNC_WAIT) ads1256_halt(a, ADS1256_SYNC_LOW, t_ns);
    else if (a->mode == ADS1256_CALIBRATING) ads1256_refuse(a, 0xFC);
}

void ads1256_sync_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->sync) return;
    if (a->fault.lost_sync && !level) return;
    a->sync = level;
    if (!level) {
        sync_falls(a, t_ns);
        return;
    }
    sched_cancel(a->sched, &a->power_down_ev);
    if (a->powered_down) sched_at(a->sched, &a->start_ev, t_ns + start_ns(a));
    a->powered_down = false;
    if (a->mode != ADS1256_SYNC_LOW) return;
    judge_low(a, t_ns);
    ads1256_go(a, t_ns);
}

void ads1256_cs_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->cs) return;
    a->cs = level;
    a->pins.pattern = 0;
    ads1256_pins_release(a, t_ns);
    if (!level) return;
    a->n.gap_violations += t_ns - a->command_ns < ads1256_tau_ns(a, T10_TAU);
    ads1256_port_drop(a);
}

bool ads1256_drdy(const struct ads1256 *a)
{
    return chip_fault_level(a->fault.drdy, a->drdy);
}

int64_t ads1256_settle_ns(const struct ads1256 *a)
{
    return ads1256_tau_ns(a, ads1256_settle_tau(a->rate_next));
}
