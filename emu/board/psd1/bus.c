/* The bus D0..D15 with A3..A0, R/W, CS: strobes, and the registers behind the addresses. */
#include "board/life.h"
#include "board/psd1/internal.h"

#include <stdio.h>

/* ---- registers ---- */

static const struct board_register registers[PSD1_REGS] = {
    [PSD1_REG_X] = {"X", BOARD_READABLE, 0},
    [PSD1_REG_Y] = {"Y", BOARD_READABLE, 0},
    [PSD1_REG_Z] = {"Z", BOARD_READABLE, 0},
    [PSD1_REG_STATUS] = {"STATUS", BOARD_READABLE, 0},
    [PSD1_REG_GYRO_X] = {"GYRO_X", BOARD_READABLE, 0},
    [PSD1_REG_GYRO_X + 1] = {"GYRO_Y", BOARD_READABLE, 0},
    [PSD1_REG_GYRO_X + 2] = {"GYRO_Z", BOARD_READABLE, 0},
    [PSD1_REG_RATE_X] = {"RATE_X", BOARD_READABLE, 0},
    [PSD1_REG_RATE_X + 1] = {"RATE_Y", BOARD_READABLE, 0},
    [PSD1_REG_RATE_X + 2] = {"RATE_Z", BOARD_READABLE, 0},
    [PSD1_REG_TEMP] = {"TEMP", BOARD_READABLE | BOARD_WRITABLE, 3},
    [PSD1_REG_SERVICE] = {"SERVICE", BOARD_READABLE | BOARD_WRITABLE, 3},
    [PSD1_REG_UC_HIGH] = {"UC_HIGH", BOARD_READABLE | BOARD_WRITABLE, 0xFF},
    [PSD1_REG_UC_LOW] = {"UC_LOW", BOARD_READABLE | BOARD_WRITABLE, 0xFFFF},
    [PSD1_REG_COMMAND] = {"COMMAND", BOARD_READABLE | BOARD_WRITABLE, 0xFF},
    [PSD1_REG_FLAGS] = {"FLAGS", BOARD_READABLE | BOARD_WRITABLE, 3},
};

static uint16_t status_word(const struct psd1 *b)
{
    const unsigned bits[] = {
        b->fl2 ? PSD1_ST_FL2 | b->axis << 1 : 0u,
        psd1_in_cycle(b) ? PSD1_ST_CYCLE : 0u,
        b->int0 ? PSD1_ST_INT0 : 0u,
        b->fl1 ? PSD1_ST_FL1 : 0u,
        b->dr ? 0u : PSD1_ST_DR,
        b->ready ? PSD1_ST_READY : 0u,
        b->job.at || b->job.request ? PSD1_ST_COMMAND : 0u,
        b->coef_known ? PSD1_ST_COEF : 0u,
        b->latest.status & PSD1_CY_OVERRUN ? PSD1_ST_OVERRUN : 0u,
        b->latest.status & PSD1_CY_LATE ? PSD1_ST_LATE : 0u,
    };
    unsigned all = 0;
    for (unsigned i = 0; i < sizeof bits / sizeof *bits; i++) all |= bits[i];
    return (uint16_t)all;
}

/* Bit 15: it is under way, bit 14: it has failed. */
static uint16_t command_word(const struct psd1 *b)
{
    const bool busy = b->job.request == &b->job.own;
    return (uint16_t)(b->last_command | (busy ? 0x8000u : 0u) | (b->job.failed ? 0x4000u : 0u));
}

static uint16_t read_register(struct psd1 *b, unsigned address, int64_t t_ns)
{
    if (address <= PSD1_REG_Z) return psd1_rk_bus(&b->rk);
    if (address == PSD1_REG_STATUS) return status_word(b);
    if (address == PSD1_REG_TEMP) return psd1_aux_temp(b, t_ns);
    if (address == PSD1_REG_SERVICE) return psd1_aux_service(b, t_ns);
    if (address == PSD1_REG_UC_HIGH) return (uint16_t)(b->staged >> 16);
    if (address == PSD1_REG_UC_LOW) return (uint16_t)b->staged;
    if (address == PSD1_REG_COMMAND) return command_word(b);
    if (address == PSD1_REG_FLAGS) return (uint16_t)((b->int0 ? 1u : 0u) | (b->fl1 ? 2u : 0u));
    /* latched at A0: of the cycle under way, else of the latest */
    const struct psd1_cycle *c = psd1_in_cycle(b) ? &b->now : &b->latest;
    return address < PSD1_REG_RATE_X ? (uint16_t)c->gyro[address - PSD1_REG_GYRO_X]
                                     : (uint16_t)c->rate[address - PSD1_REG_RATE_X];
}

/* ---- register COMMAND ---- */

/* What a command shows at once in UC_HIGH and UC_LOW; false: it is none of those. */
static bool show_word(const struct psd1 *b, unsigned command, uint32_t *word)
{
    const unsigned axis = command & PSD1_CMD_AXIS, kind = command - axis;
    const bool uc = command == PSD1_CMD_SHOW_UC1 || command == PSD1_CMD_SHOW_UC2;
    const bool coef = axis < 3 && (kind == PSD1_CMD_ZERO || kind == PSD1_CMD_FULL);
    if (uc) *word = command == PSD1_CMD_SHOW_UC1 ? b->uc1 : b->uc2;
    if (coef) *word = kind == PSD1_CMD_ZERO ? b->zero[axis] : b->full[axis];
    return uc || coef;
}

static void own_done(void *ctx, struct psd1_request *r, enum board_cycle_result result, int64_t t_ns)
{
    struct psd1 *b = ctx;
    (void)t_ns;
    b->job.failed = result != BOARD_CYCLE_OK;
    if (!b->job.failed && r->command >= PSD1_CMD_CONTROL) b->staged = r->word;
}

static void write_command(struct psd1 *b, uint8_t command, int64_t t_ns)
{
    const char *why = NULL;
    b->last_command = command;
    b->job.failed = false;
    if (show_word(b, command, &b->staged)) return;
    b->job.own = (struct psd1_request){.command = command, .word = b->staged, .done = own_done, .ctx = b};
    b->job.failed = psd1_request(b, &b->job.own, &why, t_ns) != BOARD_CYCLE_OK; /* another client's came meanwhile */
}

/* ---- writing ---- */

static void write_register(struct psd1 *b, unsigned address, uint16_t data, int64_t t_ns)
{
    if (address == PSD1_REG_TEMP) b->temp_channel = (uint8_t)data;
    if (address == PSD1_REG_SERVICE) b->service_channel = (uint8_t)data;
    if (address == PSD1_REG_UC_HIGH) b->staged = (b->staged & 0xFFFF) | (uint32_t)data << 16;
    if (address == PSD1_REG_UC_LOW) b->staged = (b->staged & 0xFF0000) | data;
    if (address == PSD1_REG_COMMAND) write_command(b, (uint8_t)data, t_ns);
    if (address == PSD1_REG_FLAGS) psd1_flags(b, data & 1, data & 2, t_ns);
}

static enum board_cycle_result check_value(const struct psd1 *b, const struct board_cycle *c, const char **why)
{
    uint32_t word;
    if (c->data > registers[c->address].most) return BOARD_CYCLE_BAD_VALUE;
    if (c->address != PSD1_REG_COMMAND || show_word(b, c->data, &word)) return BOARD_CYCLE_OK;
    return psd1_request_check(b, (uint8_t)c->data, b->staged, why);
}

static void describe_expected(const struct board *board, const struct board_cycle *c, enum board_cycle_result r,
                              char *out, size_t cap)
{
    const char *why = NULL;
    if (r == BOARD_CYCLE_NOT_READY) why = "STATUS (03h) has bit 0 while one does, its axis in bits 1, 2";
    else (void)check_value((const struct psd1 *)board, c, &why);
    if (why) (void)snprintf(out, cap, "%s", why);
    else (void)snprintf(out, cap, "it takes 0 to %u", registers[c->address].most);
}

/* ---- strobes ---- */

static void put_strobe(struct psd1 *b, bool write, unsigned address, uint16_t data, int64_t t_ns)
{
    psd1_put(b, PSD1_BUS,
             (write ? 0 : PSD1_BIT(RW)) | (uint64_t)address << PSD1_LINE_AB0 | (uint64_t)data << PSD1_LINE_D0, t_ns);
}

static void release_bus(struct psd1 *b, int64_t t_ns)
{
    psd1_put(b, PSD1_BUS, PSD1_BIT(CS) | PSD1_BIT(RW), t_ns);
}

/* The word that waits is being read. */
static void begin_read(struct psd1 *b, int64_t t_ns)
{
    b->bus.takes = b->taken = true;
    if (t_ns - b->fl2_ns > b->profile.late_ns) {
        b->counters.late++;
        b->now.status |= PSD1_CY_LATE;
    }
    board_notify(&b->base, PSD1_EV_STROBE, t_ns);
}

static void end_read(struct psd1 *b)
{
    b->bus.takes = false;
    b->now.status |= (uint8_t)(1u << b->axis);
}

static enum board_cycle_result check_cycle(const struct psd1 *b, const struct board_cycle *c, int64_t len_ns)
{
    const char *why; /* psd1_expected() has it */
    if (b->phase == PSD1_OFF || b->phase == PSD1_IN_RESET) return BOARD_CYCLE_OFF;
    if (c->address >= PSD1_REGS) return BOARD_CYCLE_NO_ADDRESS;
    if (c->write && !(registers[c->address].rights & BOARD_WRITABLE)) return BOARD_CYCLE_READ_ONLY;
    if (len_ns < (int64_t)b->profile.strobe_min_ns) return BOARD_CYCLE_TOO_SHORT;
    if (c->write) return check_value(b, c, &why);
    if (c->address > PSD1_REG_Z) return BOARD_CYCLE_OK;
    if (b->profile.host_strobe_ns > 0) return BOARD_CYCLE_TAKEN;
    return b->fl2 && !b->taken && b->axis == c->address ? BOARD_CYCLE_OK : BOARD_CYCLE_NOT_READY;
}

static void count_rejected(struct psd1 *b, enum board_cycle_result r)
{
    b->counters.refused++;
    b->counters.too_short += r == BOARD_CYCLE_TOO_SHORT;
}

/* A rejected strobe moves CS, R/W and the address, too. */
static enum board_cycle_result begin_strobe(struct psd1 *b, struct board_cycle *c, int64_t t_ns)
{
    struct psd1_strobe *s = &b->bus;
    const int64_t len_ns = c->strobe_ns > 0 ? c->strobe_ns : b->profile.strobe_ns;
    const enum board_cycle_result r = check_cycle(b, c, len_ns);
    if (r == BOARD_CYCLE_OFF || r == BOARD_CYCLE_NO_ADDRESS) {
        count_rejected(b, r);
        return r;
    }
    if (r != BOARD_CYCLE_OK) count_rejected(b, r);
    else if (!c->write) c->data = read_register(b, c->address, t_ns);
    const bool data = c->write || r == BOARD_CYCLE_OK;
    s->busy = true;
    s->cycle = r == BOARD_CYCLE_OK ? c : NULL;
    s->end_ns = t_ns + len_ns;
    put_strobe(b, c->write, c->address, data ? c->data : 0, t_ns);
    sched_at(b->base.sched, &s->ev, s->end_ns);
    if (r != BOARD_CYCLE_OK || c->write || c->address > PSD1_REG_Z) return r;
    begin_read(b, t_ns);
    return r;
}

/* The one that has waited for its turn. */
static void begin_waiting(struct psd1 *b, int64_t t_ns)
{
    struct board_cycle *c = b->bus.waiting;
    b->bus.waiting = NULL;
    if (!c) return;
    const enum board_cycle_result r = begin_strobe(b, c, t_ns);
    if (r != BOARD_CYCLE_OK) c->done(c->ctx, c, r, t_ns);
}

static void strobe_end(void *ctx, int64_t t_ns)
{
    struct psd1 *b = ctx;
    struct psd1_strobe *s = &b->bus;
    struct board_cycle *c = s->cycle;
    s->busy = false;
    s->cycle = NULL;
    release_bus(b, t_ns);
    if (s->takes) {
        end_read(b);
        psd1_due(b, PSD1_CLEAR, psd1_next_fall(b, t_ns));
    }
    if (c) {
        b->counters.bus_cycles++;
        if (c->write) write_register(b, c->address, c->data, t_ns);
        c->done(c->ctx, c, BOARD_CYCLE_OK, t_ns);
    }
    if (!s->busy) begin_waiting(b, t_ns); /* unless done() has begun another */
}

/* While the built-in host strobes, a cycle waits its turn; its rejection then comes by done(). */
static enum board_cycle_result submit(struct board *board, struct board_cycle *c, int64_t t_ns)
{
    struct psd1 *b = (struct psd1 *)board;
    if (b->phase == PSD1_OFF) return BOARD_CYCLE_OFF;
    if (b->bus.cycle || b->bus.waiting) return BOARD_CYCLE_BUSY;
    if (!b->bus.busy) return begin_strobe(b, c, t_ns);
    b->bus.waiting = c;
    return BOARD_CYCLE_OK;
}

/* ---- the built-in host ---- */

static void host_strobe_begin(struct psd1 *b, int64_t t_ns)
{
    b->bus.busy = true;
    b->bus.end_ns = t_ns + b->profile.strobe_ns;
    put_strobe(b, false, b->axis, psd1_rk_bus(&b->rk), t_ns);
    begin_read(b, t_ns);
}

static void host_strobe_end(struct psd1 *b, int64_t t_ns)
{
    b->bus.busy = false;
    b->counters.bus_cycles++;
    release_bus(b, t_ns);
    end_read(b);
    begin_waiting(b, t_ns);
}

/* If the bus is busy: after that strobe. */
int64_t psd1_host_strobe(struct psd1 *b, int64_t t_ns)
{
    if (b->bus.busy) return b->bus.end_ns > t_ns ? b->bus.end_ns : t_ns + PSD1_PERIOD_NS;
    host_strobe_begin(b, t_ns);
    b->phase = PSD1_STROBE_END;
    return b->bus.end_ns;
}

int64_t psd1_host_end(struct psd1 *b, int64_t t_ns)
{
    host_strobe_end(b, t_ns);
    b->phase = PSD1_CLEAR;
    return psd1_next_fall(b, t_ns);
}

/* ---- life ---- */

void psd1_bus_init(struct psd1 *b)
{
    sched_ev_inner(&b->bus.ev, strobe_end, b);
}

static void cut_cycle(struct board_cycle **of, int64_t t_ns)
{
    struct board_cycle *c = *of;
    *of = NULL;
    if (c) c->done(c->ctx, c, BOARD_CYCLE_OFF, t_ns);
}

void psd1_bus_stop(struct psd1 *b, int64_t t_ns)
{
    struct psd1_strobe *s = &b->bus;
    sched_cancel(b->base.sched, &s->ev);
    if (s->busy) release_bus(b, t_ns);
    s->busy = s->takes = false;
    cut_cycle(&s->cycle, t_ns);
    cut_cycle(&s->waiting, t_ns);
}

BOARD_BUS(psd1, PSD1_REGS);
