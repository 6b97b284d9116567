/* Parallel bus of a PMKA: 16 addresses, one cycle at a time (docs/boards/pmka.md; ours, E0). */
#include "board/bus_lines.h"
#include "board/life.h"
#include "board/pmka/internal.h"

#include <stddef.h>
#include <stdio.h>

#define INDEX_ROM 0x100u /* of the ROM's first word; below: numbers of resets */
#define BEAT_MAX  60000u

enum { STATUS_FRESH = 1, STATUS_OVERRUN = 2, STATUS_SATURATED = 4, STATUS_CLIPPED = 8, STATUS_AUTONOMOUS = 16 };

enum {
    REG_RESETS = PMKA_INTS, /* behind the four codes */
    REG_ROTATION,
    REG_SEQ,
    REG_TEMPERATURE,
    REG_STATUS,
    REG_MODE,
    REG_COMMAND,
    REG_BEAT,
    REG_ZERO,
    REG_INDEX,
    REG_DATA
};

static const struct board_register registers[PMKA_ADDRESSES] = {
    [0] = {"X", BOARD_READABLE | BOARD_LATCHED, 0},
    [1] = {"Y", BOARD_READABLE | BOARD_LATCHED, 0},
    [2] = {"Z", BOARD_READABLE | BOARD_LATCHED, 0},
    [PMKA_K] = {"K", BOARD_READABLE | BOARD_LATCHED, 0},
    [REG_RESETS] = {"RESETS", BOARD_READABLE | BOARD_LATCHED, 0},
    [REG_ROTATION] = {"ROTATION", BOARD_READABLE | BOARD_LATCHED, 0},
    [REG_SEQ] = {"SEQ", BOARD_READABLE | BOARD_LATCHED, 0},
    [REG_TEMPERATURE] = {"TEMPERATURE", BOARD_READABLE | BOARD_LATCHED, 0},
    [REG_STATUS] = {"STATUS", BOARD_READABLE, 0},
    [REG_MODE] = {"MODE", BOARD_READABLE | BOARD_WRITABLE, 0},
    [REG_COMMAND] = {"COMMAND", BOARD_WRITABLE, 0},
    [REG_BEAT] = {"BEAT", BOARD_READABLE | BOARD_WRITABLE, 0},
    [REG_ZERO] = {"ZERO", BOARD_READABLE | BOARD_WRITABLE, 0},
    [REG_INDEX] = {"INDEX", BOARD_READABLE | BOARD_WRITABLE, 0},
    [REG_DATA] = {"DATA", BOARD_READABLE, 0},
};

/* ---- reading ---- */

/* Two bits an integrator: 1 positive, 3 negative. */
static uint16_t resets_word(const struct pmka *b)
{
    unsigned word = 0;
    for (unsigned i = 0; i < PMKA_INTS; i++) word |= ((unsigned)b->latest.reset[i] & 3u) << (2 * i);
    return (uint16_t)word;
}

static uint16_t rotation_word(const struct pmka *b)
{
    const struct pmka_reading *r = &b->latest;
    unsigned word = (unsigned)r->tau << 8 | (unsigned)r->cal << 12;
    for (unsigned i = 0; i < PMKA_INTS; i++) word |= (unsigned)r->serves[i] << (2 * i);
    return (uint16_t)word;
}

/* Reading it clears OVERRUN. */
static uint16_t status_word(struct pmka *b)
{
    unsigned word = b->bus.fresh ? STATUS_FRESH : 0u;
    if (b->bus.overrun) word |= STATUS_OVERRUN;
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        if (b->latest.saturated[i]) word |= STATUS_SATURATED;
        if (b->latest.clipped[i]) word |= STATUS_CLIPPED;
    }
    if (b->rotation.mode == PMKA_AUTONOMOUS) word |= STATUS_AUTONOMOUS;
    b->bus.overrun = false;
    return (uint16_t)word;
}

static uint16_t data_word(const struct pmka *b)
{
    const unsigned index = b->bus.index;
    if (index >= INDEX_ROM) return b->rom[index - INDEX_ROM];
    return (uint16_t)b->channel[index / 2].count[index % 2];
}

static uint16_t read_register(struct pmka *b, unsigned address)
{
    if (address == PMKA_K) b->bus.fresh = false; /* the last of them */
    if (address <= PMKA_K) return (uint16_t)b->latest.code[address];
    if (address == REG_RESETS) return resets_word(b);
    if (address == REG_ROTATION) return rotation_word(b);
    if (address == REG_SEQ) return (uint16_t)b->latest.seq;
    if (address == REG_TEMPERATURE) return (uint16_t)b->latest.temp_code;
    if (address == REG_STATUS) return status_word(b);
    if (address == REG_MODE) return (uint16_t)b->rotation.mode;
    if (address == REG_BEAT) return (uint16_t)b->rotation.beat_periods;
    if (address == REG_ZERO) return (uint16_t)b->rotation.zero_periods;
    return address == REG_INDEX ? b->bus.index : data_word(b);
}

/* ---- writing ---- */

static bool is_index(unsigned word)
{
    return word < 2 * PMKA_INTS || (word >= INDEX_ROM && word < INDEX_ROM + PMKA_ROM_WORDS);
}

/* Bits 2..0 beat, 0: the present one goes on; bits 5..4 calibration. */
static bool write_command(struct pmka *b, uint16_t word)
{
    const unsigned cal = word >> 4 & 3u;
    return !(word & ~0x37u) && cal <= PMKA_CAL_RESET && pmka_command(b, word & 7u, (enum pmka_cal)cal);
}

/* False: the register does not take this value. */
static bool write_register(struct pmka *b, unsigned address, uint16_t word)
{
    struct pmka_rotation *r = &b->rotation;
    if (address == REG_COMMAND) return write_command(b, word);
    if (address == REG_MODE && word <= PMKA_AUTONOMOUS) pmka_set_mode(b, (enum pmka_mode)word);
    else if (address == REG_BEAT && word >= r->zero_periods + PMKA_BEAT_SPARE && word <= BEAT_MAX)
        r->beat_periods = word;
    else if (address == REG_ZERO && word >= 1 && word + PMKA_BEAT_SPARE <= r->beat_periods) r->zero_periods = word;
    else if (address == REG_INDEX && is_index(word)) b->bus.index = word;
    else return false;
    return true;
}

static void expected_value(const struct pmka *b, unsigned address, char *out, size_t cap)
{
    const struct pmka_rotation *r = &b->rotation;
    if (address == REG_MODE) (void)snprintf(out, cap, "it takes 0 or 1");
    if (address == REG_COMMAND)
        (void)snprintf(out, cap,
                       "it takes in MODE 0 alone: beat 0 to %u in bits 0 to 2, calibration 0 to %d in bits 4, 5",
                       PMKA_TAUS, PMKA_CAL_RESET);
    if (address == REG_BEAT) (void)snprintf(out, cap, "it takes %u to %u", r->zero_periods + PMKA_BEAT_SPARE, BEAT_MAX);
    if (address == REG_ZERO) (void)snprintf(out, cap, "it takes 1 to %u", r->beat_periods - PMKA_BEAT_SPARE);
    if (address == REG_INDEX)
        (void)snprintf(out, cap, "it takes 0 to %u and %u to %u", 2 * PMKA_INTS - 1, INDEX_ROM,
                       INDEX_ROM + PMKA_ROM_WORDS - 1);
}

static void describe_expected(const struct board *board, const struct board_cycle *c, enum board_cycle_result r,
                              char *out, size_t cap)
{
    if (r == BOARD_CYCLE_BAD_VALUE) expected_value((const struct pmka *)board, c->address, out, cap);
    else (void)snprintf(out, cap, "STATUS (08h) has bit 0 when the first reading is there");
}

/* ---- cycles ---- */

static enum board_cycle_result check_cycle(const struct pmka *b, const struct board_cycle *c)
{
    const int64_t strobe_ns = c->strobe_ns ? c->strobe_ns : b->profile.strobe_ns;
    if (b->life == PMKA_OFF) return BOARD_CYCLE_OFF;
    if (b->bus.cycle) return BOARD_CYCLE_BUSY;
    if (c->address >= PMKA_ADDRESSES || !registers[c->address].name) return BOARD_CYCLE_NO_ADDRESS;
    if (c->write && !(registers[c->address].rights & BOARD_WRITABLE)) return BOARD_CYCLE_READ_ONLY;
    if (!c->write && !(registers[c->address].rights & BOARD_READABLE)) return BOARD_CYCLE_WRITE_ONLY;
    if (strobe_ns < b->profile.strobe_min_ns) return BOARD_CYCLE_TOO_SHORT;
    if (registers[c->address].rights & BOARD_LATCHED && !b->any) return BOARD_CYCLE_NOT_READY;
    return BOARD_CYCLE_OK;
}

static const struct bus_lines bus_lines = {PMKA_LINE_CS, PMKA_LINE_RW, PMKA_LINE_AB0, PMKA_LINE_D0};

/* What a register holds is taken at the beginning of the strobe, what is written is taken over at its end. */
static enum board_cycle_result submit(struct board *board, struct board_cycle *c, int64_t t_ns)
{
    struct pmka *b = (struct pmka *)board;
    const enum board_cycle_result r = check_cycle(b, c);
    if (r != BOARD_CYCLE_OK) {
        b->counters.cycles_refused++;
        return r;
    }
    b->bus.cycle = c;
    if (!c->write) b->bus.answer = read_register(b, c->address);
    bus_lines_begin(&b->base.trace, &bus_lines, c, c->write ? c->data : b->bus.answer, t_ns);
    sched_at(b->base.sched, &b->bus.end, t_ns + (c->strobe_ns ? c->strobe_ns : b->profile.strobe_ns));
    return BOARD_CYCLE_OK;
}

static void finish_cycle(struct pmka *b, enum board_cycle_result r, int64_t t_ns)
{
    struct board_cycle *c = b->bus.cycle;
    b->bus.cycle = NULL;
    if (b->life != PMKA_OFF) bus_lines_end(&b->base.trace, &bus_lines, t_ns);
    if (r == BOARD_CYCLE_OK) b->counters.cycles++;
    else b->counters.cycles_refused++;
    if (c->done) c->done(c->ctx, c, r, t_ns);
}

static void strobe_ends(void *ctx, int64_t t_ns)
{
    struct pmka *b = ctx;
    struct board_cycle *c = b->bus.cycle;
    if (!c->write) {
        c->data = b->bus.answer;
        finish_cycle(b, BOARD_CYCLE_OK, t_ns);
        return;
    }
    finish_cycle(b, write_register(b, c->address, c->data) ? BOARD_CYCLE_OK : BOARD_CYCLE_BAD_VALUE, t_ns);
}

void pmka_bus_init(struct pmka *b)
{
    sched_ev_inner(&b->bus.end, strobe_ends, b);
}

void pmka_bus_cut(struct pmka *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->bus.end);
    b->bus.index = 0;
    b->bus.fresh = b->bus.overrun = false;
    if (b->bus.cycle) finish_cycle(b, BOARD_CYCLE_OFF, t_ns);
}

BOARD_BUS(pmka, PMKA_ADDRESSES);
