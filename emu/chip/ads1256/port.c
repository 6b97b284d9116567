#include "chip/ads1256/internal.h"

#include <stddef.h>

/* Sources 2.4. T6: command to data; T11: after RREG, WREG, RDATA, and long after RDATAC, SDATAC, SYNC. */
enum { T6_TAU = 50, T11_TAU = 4, T11_LONG_TAU = 24 };

void ads1256_port_idle(struct ads1256 *a)
{
    a->port = ADS1256_OPCODE;
    a->rdatac = a->awaiting_data = a->garbled = a->after_sdatac = a->begun = false;
    a->word_left = 0;
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

typedef void op_fn(struct ads1256 *a, int64_t t_ns);

/* The modulator takes a little longer to settle than after SYNC; nothing is to be sent until DRDY (sources 2.4, 2.6). */
static void leave_standby(struct ads1256 *a, int64_t t_ns)
{
    if (a->cal_due || !a->sync) {
        ads1256_freeze(a, ADS1256_SYNC_LOW);
        ads1256_go(a, t_ns);
        return;
    }
    ads1256_restart(a, ADS1256_WAKE_TAU, t_ns);
    a->next_ok_ns = clk_edge_ns(&a->clkin, a->start_tau + ads1256_settle_tau(a->rate));
}

/* WAKEUP acts at the first SCLK edge of its byte. A byte slower than the settling time acts at its end: the words that came
 * meanwhile would lie in the past (E0). */
static int64_t wakeup_ns(const struct ads1256 *a, int64_t t_ns)
{
    return a->first_ns + ads1256_settle_ns(a) > t_ns ? a->first_ns : t_ns;
}

static void op_wakeup(struct ads1256 *a, int64_t t_ns)
{
    const bool synchronises = a->mode == ADS1256_SYNC_WAIT || a->sync_due;
    if (synchronises) ads1256_set_drdy(a, true, t_ns);
    if (synchronises) ads1256_restart(a, 0, wakeup_ns(a, t_ns));
    else if (a->mode == ADS1256_STANDBY) leave_standby(a, wakeup_ns(a, t_ns));
}

static void op_rdata(struct ads1256 *a, int64_t t_ns)
{
    (void)t_ns;
    a->port = ADS1256_WORD;
    a->word_left = 3;
    a->awaiting_data = true;
}

static void op_rdatac(struct ads1256 *a, int64_t t_ns)
{
    op_rdata(a, t_ns);
    a->rdatac = true;
}

static void op_sdatac(struct ads1256 *a, int64_t t_ns)
{
    (void)t_ns;
    a->rdatac = false;
    a->after_sdatac = true;
    a->port = ADS1256_OPCODE;
}

static void op_reg(struct ads1256 *a, int64_t t_ns)
{
    (void)t_ns;
    a->port = ADS1256_COUNT;
}

static void op_calibrate(struct ads1256 *a, int64_t t_ns)
{
    static const enum ads1256_cal kind[] = {ADS1256_SELFCAL, ADS1256_SELFOCAL, ADS1256_SELFGCAL, ADS1256_SYSOCAL,
                                            ADS1256_SYSGCAL};
    ads1256_calibrate(a, kind[a->opcode & 7], t_ns);
}

static void op_sync(struct ads1256 *a, int64_t t_ns)
{
    if (a->fault.lost_sync) return;
    if (a->mode == ADS1256_RUNNING && a->cfg.sync_halts) ads1256_halt(a, ADS1256_SYNC_WAIT, t_ns);
    else if (a->mode == ADS1256_RUNNING) a->sync_due = true;
    else if (a->mode == ADS1256_CALIBRATING || a->mode == ADS1256_STANDBY) ads1256_refuse(a, a->opcode);
}

/* The analog part is off from here on; a word that is ready stays so, and the clock runs (sources 2.6). */
static void op_standby(struct ads1256 *a, int64_t t_ns)
{
    (void)t_ns;
    if (a->mode == ADS1256_RUNNING || a->mode == ADS1256_SYNC_WAIT) ads1256_freeze(a, ADS1256_STANDBY);
    else ads1256_refuse(a, a->opcode);
}

static void op_reset(struct ads1256 *a, int64_t t_ns)
{
    ads1256_reset_chip(a, ADS1256_SYNC_LOW, ADS1256_ADCON_CLK, t_ns);
    ads1256_go(a, t_ns);
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
    {0x10, 0x1F, T11_TAU,      op_reg},       /* RREG */
    {0x50, 0x5F, T11_TAU,      op_reg},       /* WREG */
    {0xF0, 0xF4, 0,            op_calibrate}, /* SELFCAL, SELFOCAL, SELFGCAL, SYSOCAL, SYSGCAL */
    {0xFC, 0xFC, T11_LONG_TAU, op_sync},
    {0xFD, 0xFD, 0,            op_standby},
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

/* A strict chip loses a command that comes too early, unless it is RESET (E0). */
static bool too_early(struct ads1256 *a, const struct op *op)
{
    a->n.gap_violations += a->early || (a->after_sdatac && a->first_drdy); /* to wait for DRDY after SDATAC (M80) */
    a->after_sdatac = false;
    return a->early && a->cfg.strict_bus && op->run != op_reset;
}

static void on_opcode(struct ads1256 *a, uint8_t mosi, int64_t t_ns)
{
    const struct op *op = find_op(mosi);
    if (!op) {
        a->n.bad_opcodes++;
        return;
    }
    /* Zeros clocked in while the rest of a word comes out after SDATAC are no commands to wait for. */
    const bool rest_of_word = op->run == op_wakeup && a->in_word;
    if (!rest_of_word) {
        if (too_early(a, op)) {
            a->n.dropped++;
            return;
        }
        a->word_left = 0;
    }
    a->opcode = mosi;
    op->run(a, t_ns);
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
        a->opcode = mosi;
        op->run(a, t_ns);
        command_over(a, op->t11_tau, t_ns);
    } else if (!a->word_left) {
        command_over(a, T11_TAU, t_ns);
    }
}

static uint8_t reverse_bits(uint8_t v)
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
    return ads1256_value(a, ADS1256_STATUS) & ADS1256_STATUS_ORDER ? reverse_bits(v) : v;
}

bool ads1256_half_read(const struct ads1256 *a)
{
    const int taken = 3 - a->word_left + a->begun;
    return a->port == ADS1256_WORD && a->word_left > 0 && (taken == 1 || taken == 2);
}

static void shift_word(struct ads1256 *a, int64_t t_ns)
{
    if (--a->word_left) return;
    a->unread = a->garbled = false;
    ads1256_set_drdy(a, true, t_ns);
}

bool ads1256_has_output(const struct ads1256 *a)
{
    return a->port == ADS1256_READ || a->word_left != 0;
}

static uint8_t on_byte(void *chip, uint8_t mosi, int64_t t_ns)
{
    static port_fn *const ports[ADS1256_PORTS] = {on_opcode, on_count, on_write, on_read, on_word};
    struct ads1256 *a = chip;
    if (a->cs || ads1256_deaf(a)) return ads1256_on_wire(a, ADS1256_DOUT_IDLE);
    a->begun = false;
    a->in_word = a->word_left && a->port != ADS1256_READ;
    if (a->in_word) shift_word(a, t_ns);
    ports[a->port](a, mosi, t_ns);
    a->garbled = a->garbled && a->port != ADS1256_OPCODE;
    a->command_ns = t_ns;
    return ads1256_on_wire(a, out_byte(a));
}

/* What may go wrong with a byte that begins now: t6, and the update of the word it comes from. */
static void judge_read(struct ads1256 *a, int64_t t_ns)
{
    if (a->awaiting_data) {
        const bool early = t_ns - a->command_ns < ads1256_tau_ns(a, T6_TAU);
        a->n.gap_violations += early;
        a->garbled = early && a->cfg.strict_timing;
        a->awaiting_data = false;
    }
    if (a->updating && a->port == ADS1256_WORD && a->word_left) {
        a->n.window_reads++;
        a->garbled |= a->cfg.strict_bus;
    }
}

/* First SCLK edge of a byte: gaps are judged here, and the byte to shift out is taken at this instant. */
static void on_first(void *chip, int64_t t_ns)
{
    struct ads1256 *a = chip;
    spi_load(&a->spi, ads1256_on_wire(a, ADS1256_DOUT_IDLE));
    if (a->cs || ads1256_deaf(a)) return;
    a->first_ns = t_ns;
    a->first_drdy = a->drdy;
    a->early = t_ns < a->next_ok_ns; /* before the byte itself ends standby, from where on the next one has to wait */
    if (a->mode == ADS1256_STANDBY && a->cfg.strict_bus) leave_standby(a, t_ns); /* any SCLK interrupts it */
    judge_read(a, t_ns);
    a->begun = a->port == ADS1256_WORD && a->word_left;
    spi_load(&a->spi, ads1256_on_wire(a, out_byte(a)));
}

void ads1256_serial_init(struct ads1256 *a)
{
    a->command_ns = -NS_PER_S; /* no byte yet */
    spi_init(&a->spi, on_byte, on_first, a);
}

void ads1256_port_drop(struct ads1256 *a)
{
    const bool part_read = a->word_left > 0 && (a->word_left < 3 || a->begun);
    a->n.dropped += a->rdatac ? part_read : a->port != ADS1256_OPCODE;
    a->begun = false;
    if (a->rdatac && !a->cfg.strict_cs) a->word_left = a->word_left ? 3 : 0; /* the mode stays, the word too (M50) */
    else ads1256_port_idle(a);
}
