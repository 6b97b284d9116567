#include "chip/ads1282/internal.h"

#include <stddef.h>

#define GAP_TCLK       24  /* between bytes of commands; E2 SBAS378 p. 30 */
#define REST_PERIODS   64  /* interface time-out; E3 driver, M85 */
#define READ_REST_TCLK 256 /* an unfinished read that has paused this long was given up, not torn; E0 */

/* ---- Output register ---- */

static uint8_t out_byte(const struct ads1282 *a)
{
    if (a->out_index > 7) return 0;
    return (uint8_t)(a->out >> (56 - 8 * a->out_index));
}

/* What DOUT makes of a byte. */
static uint8_t on_wire(const struct ads1282 *a, uint8_t byte)
{
    return (uint8_t)chip_fault_word(a->fault.dout, byte, 0xFF);
}

void ads1282_serial_stuck(struct ads1282 *a)
{
    spi_load(&a->spi, on_wire(a, a->spi.out));
}

void ads1282_serial_clear(struct ads1282 *a)
{
    a->out = 0;
    a->word_out = a->unread = false;
}

static unsigned bits_clocked(const struct ads1282 *a)
{
    const unsigned done = 8 * a->out_index + a->spi.bits - a->out_phase;
    return done ? done : a->in_byte;
}

/* Some but not all of a word has been clocked out. */
static bool word_under_way(const struct ads1282 *a)
{
    const unsigned n = bits_clocked(a);
    return a->word_out && n > 0 && n < 32;
}

static bool read_under_way(const struct ads1282 *a, int64_t t_ns)
{
    return word_under_way(a) && t_ns - a->sclk_ns < a->rest_ns;
}

/* The output register takes a word, read or not: there is no lock. A read under way goes on at its bit in the new word
 * (the exact tear is M50); else the word begins at bit 31, wherever the shifter's byte is. */
void ads1282_serial_deliver(struct ads1282 *a, uint32_t word, int64_t t_ns)
{
    if (!a->rdatac && !a->rdata_due) { /* the word of an RDATA, once read, answers SCLK no more */
        a->word_out = a->word_out && (a->unread || read_under_way(a, t_ns));
        return;
    }
    a->count.overruns += a->unread;
    if (read_under_way(a, t_ns)) {
        a->count.torn_reads++;
    } else {
        a->out_index = 0;
        a->out_phase = a->spi.bits;
    }
    a->out = (uint64_t)word << (32 - a->out_phase);
    a->rdata_due = false;
    a->word_out = a->unread = true;
    spi_load(&a->spi, on_wire(a, out_byte(a)));
}

/* ---- Commands ---- */

static void op_ofscal(struct ads1282 *a, int64_t t_ns)
{
    ads1282_calibrate(a, false, t_ns);
}

static void op_gancal(struct ads1282 *a, int64_t t_ns)
{
    ads1282_calibrate(a, true, t_ns);
}

static void op_rdatac(struct ads1282 *a, int64_t t_ns)
{
    (void)t_ns;
    a->rdatac = true;
}

static void op_sdatac(struct ads1282 *a, int64_t t_ns)
{
    (void)t_ns;
    a->rdatac = a->rdata_due = false;
    ads1282_serial_clear(a);
}

/* The word of the next conversion end is the answer. */
static void op_rdata(struct ads1282 *a, int64_t t_ns)
{
    a->rdata_due = true;
    ads1282_serial_clear(a);
    ads1282_set_drdy(a, true, t_ns);
}

static void op_rreg(struct ads1282 *a, int64_t t_ns)
{
    (void)t_ns;
    a->op_stage = ADS1282_READ;
}

static void op_wreg(struct ads1282 *a, int64_t t_ns)
{
    (void)t_ns;
    a->op_stage = ADS1282_WRITE;
}

enum { TWO_BYTES = 1, NEEDS_SDATAC = 2, ALWAYS = 4 /* obeyed in RDATAC even by a strict part */ };

/* SBAS378 p. 30; NEEDS_SDATAC is its footnote 4. */
struct ads1282_opcode {
    uint8_t mask, match, rights;
    uint8_t skip; /* 1: when rejected, its data bytes are still data and not opcodes */
    void (*run)(struct ads1282 *a, int64_t t_ns);
};

// clang-format off
static const struct ads1282_opcode opcodes[] = {
    {0xFE, 0x00, ALWAYS,                   0, ads1282_wakeup},  /* WAKEUP: also the natural no-operation */
    {0xFE, 0x02, 0,                        0, ads1282_standby}, /* STANDBY */
    {0xFE, 0x04, 0,                        0, ads1282_sync},   /* SYNC: on the 8th SCLK rise, p. 21 */
    {0xFE, 0x06, ALWAYS,                   0, ads1282_reset},  /* RESET */
    {0xFF, 0x10, 0,                        0, op_rdatac}, /* RDATAC */
    {0xFF, 0x11, ALWAYS,                   0, op_sdatac}, /* SDATAC */
    {0xFF, 0x12, NEEDS_SDATAC,             0, op_rdata},  /* RDATA */
    {0xE0, 0x20, NEEDS_SDATAC | TWO_BYTES, 0, op_rreg},   /* RREG */
    {0xE0, 0x40, TWO_BYTES,                1, op_wreg},   /* WREG: no footnote 4 */
    {0xFF, 0x60, 0,                        0, op_ofscal}, /* OFSCAL */
    {0xFF, 0x61, 0,                        0, op_gancal}, /* GANCAL */
};
// clang-format on

static const struct ads1282_opcode *find_opcode(uint8_t byte)
{
    for (unsigned i = 0; i < sizeof opcodes / sizeof opcodes[0]; i++)
        if ((byte & opcodes[i].mask) == opcodes[i].match) return &opcodes[i];
    return NULL;
}

static bool is_allowed(const struct ads1282 *a, const struct ads1282_opcode *op)
{
    return !a->rdatac || ((!a->cfg.strict_sdatac || (op->rights & ALWAYS)) && !(op->rights & NEEDS_SDATAC));
}

/* Carries out the command whose last byte has come, or rejects it. */
static void execute_command(struct ads1282 *a, int64_t t_ns)
{
    const struct ads1282_opcode *op = a->op;
    if (!(op->rights & TWO_BYTES)) a->op = NULL;
    if (is_allowed(a, op)) {
        op->run(a, t_ns);
        return;
    }
    a->count.refused++;
    if (op->skip) a->op_stage = ADS1282_SKIP;
    else a->op = NULL;
}

static void opcode_byte(struct ads1282 *a, uint8_t byte, int64_t t_ns)
{
    a->op = find_opcode(byte);
    a->op_byte = byte;
    a->op_stage = ADS1282_COUNT;
    if (!a->op) a->count.bad_opcodes++;
    else if (!(a->op->rights & TWO_BYTES)) execute_command(a, t_ns);
}

static void count_byte(struct ads1282 *a, uint8_t byte, int64_t t_ns)
{
    a->reg_addr = a->op_byte & 0x1F;
    a->regs_left = (uint8_t)((byte & 0x1F) + 1);
    execute_command(a, t_ns);
}

/* One byte of WREG data, or of a rejected WREG. */
static void data_byte(struct ads1282 *a, uint8_t byte, int64_t t_ns)
{
    if (a->op_stage == ADS1282_WRITE) reg_write(&a->regs, a->reg_addr++, byte, t_ns);
    if (--a->regs_left == 0) a->op = NULL;
}

/* The byte to shift out next. A register being read comes one byte after its turn in regs_left. */
static uint8_t next_out(struct ads1282 *a)
{
    if (a->op && a->op_stage == ADS1282_READ) {
        if (a->regs_left > 0) {
            a->regs_left--;
            return reg_read(&a->regs, a->reg_addr++);
        }
        a->op = NULL;
    }
    return out_byte(a);
}

/* Came too soon for a strict part. */
static void lose_byte(struct ads1282 *a)
{
    a->lost = false;
    a->op = NULL;
    a->count.refused++;
}

static void take_byte(struct ads1282 *a, uint8_t byte, int64_t t_ns)
{
    if (a->cfg.pin_mode) return; /* commands do nothing */
    if (a->lost) lose_byte(a);
    else if (!a->op && byte == 0 && !a->standby) return; /* WAKEUP of a part that is awake: what a read clocks in */
    else if (!a->op) opcode_byte(a, byte, t_ns);
    else if (a->op_stage == ADS1282_COUNT) count_byte(a, byte, t_ns);
    else if (a->op_stage != ADS1282_READ) data_byte(a, byte, t_ns);
}

/* The 8th SCLK rise of a byte. */
static uint8_t on_byte(void *chip, uint8_t mosi, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (!a->alive) return on_wire(a, 0);
    const bool command = a->op || mosi > 0x01;
    a->rise_ns = a->sclk_ns = t_ns;
    a->in_byte = false;
    a->rest_periods = 0;
    if (a->out_index < 8) a->out_index++;
    take_byte(a, mosi, t_ns);
    a->gap_matters = command;
    return on_wire(a, next_out(a));
}

/* t_ns: the byte's first SCLK rise where it is known, else its fall, which is later by the clock's high time. */
void ads1282_serial_gap(struct ads1282 *a, int64_t t_ns)
{
    const bool inside =
        a->op && (a->op->skip || a->op_stage == ADS1282_COUNT); /* WREG; RREG between its command bytes */
    const bool matters = a->gap_matters && !(a->cfg.wreg_gap_free && inside);
    a->gap_matters = false;
    if (!matters || t_ns - a->rise_ns >= a->gap_ns) return;
    a->count.gap_violations++;
    a->lost = a->cfg.strict_gap;
}

void ads1282_serial_fall(struct ads1282 *a, int64_t t_ns)
{
    a->rest_periods = 0;
    a->count.late_reads += t_ns > a->update_ns && word_under_way(a);
    if (!a->word_out) return;
    a->unread = false;
    ads1282_set_drdy(a, true, t_ns);
}

/* First SCLK fall of a byte. */
static void on_first(void *chip, int64_t t_ns)
{
    struct ads1282 *a = chip;
    if (!a->alive) return;
    ads1282_serial_gap(a, t_ns);
    a->sclk_ns = t_ns;
    a->in_byte = true;
    ads1282_serial_fall(a, t_ns);
}

/* No command under way nor, a zero being WAKEUP, to come. Nothing can be late: the 4 tCLK are shorter than a byte. */
bool ads1282_only_shifts(const struct ads1282 *a)
{
    return a->alive && !a->op && !a->lost && !a->standby && !a->fault.dout && a->spi.bits == 0;
}

void ads1282_shift(struct ads1282 *a, uint8_t *out, unsigned n, int64_t t_ns)
{
    for (unsigned i = 0; i < n; i++) {
        out[i] = a->spi.out;
        if (a->out_index < 8) a->out_index++;
        a->spi.out = out_byte(a);
    }
    a->spi.sent = out[n - 1];
    a->spi.in = 0;
    a->rise_ns = a->sclk_ns = t_ns;
    a->in_byte = false;
}

/* Interface time-out, counted in data periods without SCLK. */
void ads1282_serial_period(struct ads1282 *a)
{
    if (a->pin.sclk) a->rest_periods = 0; /* only rest at low counts */
    if (a->rest_periods >= REST_PERIODS || ++a->rest_periods < REST_PERIODS) return;
    a->count.realigned += a->op || a->spi.bits;
    a->op = NULL;
    a->in_byte = a->lost = false;
    spi_realign(&a->spi);
}

void ads1282_serial_reset(struct ads1282 *a)
{
    a->op = NULL;
    a->rdatac = true; /* M85 */
    a->rdata_due = a->in_byte = a->gap_matters = a->lost = false;
    a->pin.dout_held = false;
    a->rest_periods = 0;
    ads1282_serial_clear(a);
    spi_realign(&a->spi);
    spi_load(&a->spi, on_wire(a, 0));
}

void ads1282_serial_times(struct ads1282 *a)
{
    a->gap_ns = clk_span_ns(a->clk.hz, GAP_TCLK);
    a->rest_ns = clk_span_ns(a->clk.hz, READ_REST_TCLK);
}

void ads1282_serial_init(struct ads1282 *a)
{
    ads1282_serial_times(a);
    spi_init(&a->spi, on_byte, on_first, a);
}
