#include "chip/ads1256.h"

#include "chip/ads1256_conv.h"

#include <assert.h>
#include <stddef.h>

/* Sources 2.4. T6: command to data; T10: last SCLK to CS high; T11: after RREG, WREG, RDATA, and long after RDATAC, SDATAC,
 * SYNC; T16: RESET and SYNC/PDWN low. */
enum { T6_TAU = 50, T10_TAU = 8, T11_TAU = 4, T11_LONG_TAU = 24, T16_TAU = 4, POWER_DOWN_PERIODS = 20 };

static void drate_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns);

/* clang-format off */
static const struct reg_spec map[ADS1256_REGS] = {
    [ADS1256_STATUS] = {.name = "STATUS", .src = "sources 2.2 C; ID 3, DRDY read-only", .reset = 0x31, .rw = 0x0E},
    [ADS1256_MUX]    = {.name = "MUX",    .src = "sources 2.2 C", .reset = 0x01, .rw = 0xFF},
    [ADS1256_ADCON]  = {.name = "ADCON",  .src = "sources 2.2 C; SDCS and the divided CLKOUT are absent", .reset = 0x20, .rw = 0x7F,
                        .unimp = 0x40 | ADS1256_ADCON_SDCS},
    [ADS1256_DRATE]  = {.name = "DRATE",  .src = "sources 2.2 C; 16 codes", .reset = 0xF0, .rw = 0xFF, .on_write = drate_written},
    [ADS1256_IO]     = {.name = "IO",     .src = "sources 2.2 C; the GPIO pins are absent", .reset = 0xE0, .rw = 0xFF, .unimp = 0x0F},
    [ADS1256_OFC0]   = {.name = "OFC0",   .src = "sources 2.2 C; set by self-calibration", .reset = 0x00, .rw = 0xFF},
    [ADS1256_OFC1]   = {.name = "OFC1",   .src = "sources 2.2 C", .reset = 0x00, .rw = 0xFF},
    [ADS1256_OFC2]   = {.name = "OFC2",   .src = "sources 2.2 C", .reset = 0x00, .rw = 0xFF},
    [ADS1256_FSC0]   = {.name = "FSC0",   .src = "sources 2.2 C; set by self-calibration, ideal until then (E0)", .reset = 0x08, .rw = 0xFF},
    [ADS1256_FSC1]   = {.name = "FSC1",   .src = "sources 2.2 C", .reset = 0xAC, .rw = 0xFF},
    [ADS1256_FSC2]   = {.name = "FSC2",   .src = "sources 2.2 C", .reset = 0x44, .rw = 0xFF},
};
/* clang-format on */

static void refuse(struct ads1256 *a, uint8_t opcode)
{
    a->n.refused++;
    a->refused_opcode = opcode;
}

/* The rule of ACAL, applied when the last byte of a WREG is stored. The ACAL bit that counts is the one after the write. */
static void auto_calibrate(struct ads1256 *a, int64_t t_ns)
{
    const uint8_t *was = a->before;
    const uint8_t *now = a->value;
    const unsigned changed = ((was[ADS1256_ADCON] ^ now[ADS1256_ADCON]) & ADS1256_ADCON_PGA) |
                             ((was[ADS1256_STATUS] ^ now[ADS1256_STATUS]) & ADS1256_STATUS_BUFEN) |
                             (was[ADS1256_DRATE] ^ now[ADS1256_DRATE]);
    if (changed && (now[ADS1256_STATUS] & ADS1256_STATUS_ACAL)) ads1256_calibrate(a, ADS1256_SELFCAL, t_ns);
}

static void drate_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    (void)was;
    (void)t_ns;
    struct ads1256 *a = chip;
    const struct ads1256_rate *r = ads1256_rate_of(now);
    if (r) a->rate_next = r;
    else a->n.bad_drate++;
}

/* ---- reset ---- */

static void port_idle(struct ads1256 *a)
{
    a->port = ADS1256_OPCODE;
    a->rdatac = a->awaiting_data = a->garbled = false;
    a->word_left = 0;
}

/* Everything to default but the CLKOUT bits, which the caller keeps or not. */
static void reset_chip(struct ads1256 *a, int64_t t_ns)
{
    ads1256_halt(a, ADS1256_OFF, t_ns);
    reg_reset(&a->regs);
    a->rate_next = ads1256_rate_of(ads1256_value(a, ADS1256_DRATE));
    a->word = 0;
    a->unread = false;
    port_idle(a);
}

/* ---- serial column: bytes to commands ---- */

typedef void op_fn(struct ads1256 *a, uint8_t opcode, int64_t t_ns);

static void op_wakeup(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)opcode;
    (void)t_ns;
    if (a->mode == ADS1256_SYNC_WAIT) ads1256_restart(a, a->first_ns);
}

static void op_rdata(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)opcode;
    (void)t_ns;
    a->port = ADS1256_WORD;
    a->word_left = 3;
    a->awaiting_data = true;
}

static void op_rdatac(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    op_rdata(a, opcode, t_ns);
    a->rdatac = true;
}

static void op_sdatac(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)opcode;
    (void)t_ns;
    a->rdatac = false;
    a->port = ADS1256_OPCODE;
}

static void op_reg(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)opcode;
    (void)t_ns;
    a->port = ADS1256_COUNT;
}

static void op_selfcal(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    static const enum ads1256_cal kind[] = {ADS1256_SELFCAL, ADS1256_SELFOCAL, ADS1256_SELFGCAL};
    ads1256_calibrate(a, kind[opcode & 3], t_ns);
}

static void op_sync(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    if (a->mode == ADS1256_RUNNING) ads1256_halt(a, ADS1256_SYNC_WAIT, t_ns);
    else if (a->mode == ADS1256_CALIBRATING) refuse(a, opcode);
}

static void op_reset(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)opcode;
    const uint8_t clk = ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_CLK;
    reset_chip(a, t_ns);
    reg_poke(&a->regs, ADS1256_ADCON, (uint8_t)((ads1256_value(a, ADS1256_ADCON) & ~ADS1256_ADCON_CLK) | clk));
    ads1256_calibrate(a, ADS1256_SELFCAL, t_ns);
}

static void op_absent(struct ads1256 *a, uint8_t opcode, int64_t t_ns)
{
    (void)t_ns;
    refuse(a, opcode);
}

/* First and last opcode of a row, t11 from its last byte (calibrations set their own), what it does. Sources 2.3. */
/* clang-format off */
static const struct op {
    uint8_t first, last, t11_tau;
    op_fn *run;
} ops[] = {
    {0x00, 0x00, 0,            op_wakeup},
    {0x01, 0x01, T11_TAU,      op_rdata},
    {0x03, 0x03, T11_LONG_TAU, op_rdatac},
    {0x0F, 0x0F, T11_LONG_TAU, op_sdatac},
    {0x10, 0x1F, T11_TAU,      op_reg},     /* RREG */
    {0x50, 0x5F, T11_TAU,      op_reg},     /* WREG */
    {0xF0, 0xF2, 0,            op_selfcal}, /* SELFCAL, SELFOCAL, SELFGCAL */
    {0xF3, 0xF4, 0,            op_absent},  /* SYSOCAL, SYSGCAL */
    {0xFC, 0xFC, T11_LONG_TAU, op_sync},
    {0xFD, 0xFD, 0,            op_absent},  /* STANDBY */
    {0xFE, 0xFE, 0,            op_reset},
    {0xFF, 0xFF, 0,            op_wakeup},
};
/* clang-format on */

static const struct op *find_op(uint8_t opcode)
{
    for (unsigned i = 0; i < sizeof ops / sizeof ops[0]; i++) {
        if (opcode >= ops[i].first && opcode <= ops[i].last) return &ops[i];
    }
    return NULL;
}

/* The command's last byte has passed: t11 runs from here, unless it started a longer wait for DRDY. */
static void command_over(struct ads1256 *a, int64_t t11_tau, int64_t t_ns)
{
    const int64_t ok_ns = t_ns + ads1256_tau_ns(a, t11_tau);
    if (ok_ns > a->next_ok_ns) a->next_ok_ns = ok_ns;
    a->port = ADS1256_OPCODE;
}

typedef void port_fn(struct ads1256 *a, uint8_t mosi, int64_t t_ns);

static void on_opcode(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    const struct op *op = find_op(mosi);
    if (!op) {
        a->n.bad_opcodes++;
        return;
    }
    a->opcode = mosi;
    /* Zeros clocked in while the rest of a word comes out after SDATAC are no commands to wait for. */
    const bool rest_of_word = op->run == op_wakeup && a->in_word;
    a->n.gap_violations += a->first_ns < a->next_ok_ns && !rest_of_word;
    if (!rest_of_word) a->word_left = 0;
    op->run(a, mosi, t_ns);
    if (a->port == ADS1256_OPCODE) command_over(a, op->t11_tau, t_ns);
}

static void on_count(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    (void)t_ns;
    const bool write = a->opcode & 0x40;
    a->addr = a->opcode & 15;
    a->left = (uint8_t)((mosi & 15) + 1);
    a->port = write ? ADS1256_WRITE : ADS1256_READ;
    a->awaiting_data = !write;
    for (unsigned i = 0; i < ADS1256_REGS; i++) a->before[i] = a->value[i];
}

/* Addresses wrap from 0Ah to 00h. */
static bool last_register(struct ads1256 *a)
{
    a->addr = a->addr == ADS1256_REGS - 1 ? 0 : (a->addr + 1) & 15;
    return --a->left == 0;
}

static void on_write(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    reg_write(&a->regs, a->addr, mosi, t_ns);
    if (!last_register(a)) return;
    command_over(a, T11_TAU, t_ns);
    auto_calibrate(a, t_ns);
}

static void on_read(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    (void)mosi;
    (void)reg_read(&a->regs, a->addr); /* counts a hole; out_byte() has already shown the value */
    if (last_register(a)) command_over(a, T11_TAU, t_ns);
}

/* In RDATAC every byte clocked in is looked at, in RDATA none. */
static void on_word(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    if (a->rdatac) {
        const struct op *op = find_op(mosi);
        if (!op || (op->run != op_sdatac && op->run != op_reset)) return;
        a->n.gap_violations += op->run == op_sdatac && a->first_drdy; /* to be sent while DRDY is low */
        op->run(a, mosi, t_ns);
        command_over(a, op->t11_tau, t_ns);
    } else if (!a->word_left) {
        command_over(a, T11_TAU, t_ns);
    }
}

static uint8_t reversed(uint8_t v)
{
    uint8_t r = 0;
    for (unsigned i = 0; i < 8; i++) r = (uint8_t)(r << 1 | ((v >> i) & 1));
    return r;
}

static uint8_t out_byte(const struct ads1256 *a)
{
    uint8_t v = ADS1256_DOUT_IDLE;
    if (a->garbled) return ADS1256_GARBLED;
    if (a->port == ADS1256_READ) v = reg_peek(&a->regs, a->addr);
    else if (a->word_left) v = (uint8_t)((uint32_t)a->word >> (8 * (a->word_left - 1)));
    return ads1256_value(a, ADS1256_STATUS) & ADS1256_STATUS_ORDER ? reversed(v) : v;
}

static void shift_word(struct ads1256 *a, int64_t t_ns)
{
    if (--a->word_left) return;
    a->unread = a->garbled = false;
    ads1256_set_drdy(a, true, t_ns);
}

static uint8_t on_byte(void *chip, uint8_t mosi, int64_t t_ns)
{
    static port_fn *const ports[ADS1256_PORTS] = {on_opcode, on_count, on_write, on_read, on_word};
    struct ads1256 *a = chip;
    if (a->cs || a->mode == ADS1256_OFF) return ADS1256_DOUT_IDLE;
    a->in_word = a->word_left && a->port != ADS1256_READ;
    if (a->in_word) shift_word(a, t_ns);
    ports[a->port](a, mosi, t_ns);
    a->garbled = a->garbled && a->port != ADS1256_OPCODE;
    a->command_ns = t_ns;
    return out_byte(a);
}

/* First falling SCLK edge of a byte: gaps are judged here, and the byte to shift out is taken at this instant. */
static void on_first(void *chip, int64_t t_ns)
{
    struct ads1256 *a = chip;
    if (a->cs) return;
    a->first_ns = t_ns;
    a->first_drdy = a->drdy;
    if (a->awaiting_data) {
        const bool early = t_ns - a->command_ns < ads1256_tau_ns(a, T6_TAU);
        a->n.gap_violations += early;
        a->garbled = early && a->cfg.strict_timing;
        a->awaiting_data = false;
    }
    spi_load(&a->spi, out_byte(a));
}

/* ---- pins ---- */

void ads1256_init(struct ads1256 *a, const struct ads1256_cfg *cfg, const struct ads1256_io *io, struct sched *s,
                  struct rng noise)
{
    *a = (struct ads1256){.cfg = *cfg, .io = *io, .sched = s, .noise = noise};
    assert(cfg->clkin_hz >= 100000 && cfg->clkin_hz <= 10000000 && cfg->vref_v > 0.0);
    if (cfg->avdd_v <= 0.0) a->cfg.avdd_v = 5.0;
    a->clkin = (struct clk){.hz = cfg->clkin_hz, .div = 1};
    a->regs = (struct reg_file){.map = map, .count = ADS1256_REGS, .value = a->value, .chip = a};
    a->command_ns = -NS_PER_S; /* no byte yet */
    a->cs = a->sync = a->reset = a->drdy = true;
    spi_init(&a->spi, on_byte, on_first, a);
    ads1256_conv_init(a);
    reset_chip(a, 0);
}

void ads1256_power_up(struct ads1256 *a, int64_t t_ns)
{
    reset_chip(a, t_ns);
    if (a->reset) ads1256_calibrate(a, ADS1256_SELFCAL, t_ns);
}

/* Counts a pulse shorter than t16 and tells how long it was. */
static int64_t low_time_ns(struct ads1256 *a, int64_t t_ns)
{
    const int64_t low_ns = t_ns - a->pin_low_ns;
    a->n.gap_violations += low_ns < ads1256_tau_ns(a, T16_TAU);
    return low_ns;
}

void ads1256_reset_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->reset) return;
    a->reset = level;
    if (!level) {
        a->pin_low_ns = t_ns;
        reset_chip(a, t_ns);
        return;
    }
    low_time_ns(a, t_ns);
    ads1256_calibrate(a, ADS1256_SELFCAL, t_ns);
}

void ads1256_sync_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->sync) return;
    a->sync = level;
    if (!level) {
        a->pin_low_ns = t_ns;
        if (a->mode == ADS1256_RUNNING || a->mode == ADS1256_SYNC_WAIT) ads1256_halt(a, ADS1256_SYNC_LOW, t_ns);
        else if (a->mode == ADS1256_CALIBRATING) refuse(a, 0xFC);
        return;
    }
    if (a->mode != ADS1256_SYNC_LOW) return;
    if (low_time_ns(a, t_ns) > ads1256_tau_ns(a, POWER_DOWN_PERIODS * ads1256_period_tau(a->rate_next)))
        refuse(a, 0xFD);
    ads1256_restart(a, t_ns);
}

void ads1256_cs_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->cs) return;
    a->cs = level;
    spi_realign(&a->spi);
    if (!level) return;
    a->n.gap_violations += t_ns - a->command_ns < ads1256_tau_ns(a, T10_TAU);
    if (a->rdatac) { /* the mode stays (M50); a word half read may be read again */
        a->n.dropped += a->word_left == 1 || a->word_left == 2;
        a->word_left = a->word_left ? 3 : 0;
        return;
    }
    a->n.dropped += a->port != ADS1256_OPCODE;
    port_idle(a);
}

bool ads1256_drdy(const struct ads1256 *a)
{
    return a->drdy;
}

int64_t ads1256_settle_ns(const struct ads1256 *a)
{
    return ads1256_tau_ns(a, ads1256_settle_tau(a->rate_next));
}
