/* The registers as a computer reads and writes them, one cycle at a time (E0: the article says "in binary code"). */
#include "board/bus_lines.h"
#include "board/life.h"
#include "board/pik/internal.h"

#include <stdio.h>

static const struct board_register registers[PIK_REGISTERS] = {
    [PIK_REG_X] = {"X", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_Y] = {"Y", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_Z] = {"Z", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_XP] = {"XP", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_XN] = {"XN", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_YP] = {"YP", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_YN] = {"YN", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_ZP] = {"ZP", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_ZN] = {"ZN", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_SEQ] = {"SEQ", BOARD_READABLE | BOARD_LATCHED, 0},
    [PIK_REG_STATUS] = {"STATUS", BOARD_READABLE, 0},
    [PIK_REG_LATCH] = {"LATCH", BOARD_WRITABLE, 0},
    [PIK_REG_PERIOD] = {"PERIOD", BOARD_READABLE | BOARD_WRITABLE, 0},
    [PIK_REG_CLEAR] = {"CLEAR", BOARD_WRITABLE, 0},
};

static uint16_t word_at(struct pik *b, unsigned address)
{
    struct pik_reading *r = &b->latched;
    if (address <= PIK_REG_Z) return (uint16_t)r->total[address - PIK_REG_X];
    if (address <= PIK_REG_ZN) {
        const unsigned i = (address - PIK_REG_XP) / 2;
        return (uint16_t)((address - PIK_REG_XP) % 2 ? r->minus[i] : r->plus[i]);
    }
    if (address == PIK_REG_SEQ) return (uint16_t)r->seq;
    if (address == PIK_REG_PERIOD) return (uint16_t)b->period_100us;
    const uint16_t status = r->status; /* PIK_REG_STATUS */
    r->status &= (uint8_t)~PIK_ST_NEW;
    return status;
}

static void clear_counters(struct pik *b, unsigned axes, int64_t t_ns)
{
    pik_sample_until(b, t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        struct pik_channel *c = &b->channel[i];
        if (!(axes >> i & 1)) continue;
        c->plus_from = c->stuck ? 0 : 0 - c->axis.plus;
        c->minus_from = c->stuck ? 0 : 0 - c->axis.minus;
        b->latched.total[i] = 0; /* the next increment counts from here */
        b->latched.plus[i] = b->latched.minus[i] = 0;
    }
}

static void write_word(struct pik *b, const struct board_cycle *c, int64_t t_ns)
{
    if (c->address == PIK_REG_PERIOD) pik_set_period(b, c->data, t_ns);
    if (c->address == PIK_REG_CLEAR) clear_counters(b, c->data, t_ns);
    if (c->address != PIK_REG_LATCH) return;
    b->counters.strobes++;
    pik_latch_now(b, t_ns);
}

static const struct bus_lines bus_lines = {PIK_LINE_CS, PIK_LINE_RW, PIK_LINE_AB0, PIK_LINE_D0};

/* The strobe ends: what was read has stood on the bus, what is written is taken. */
static void cycle_end(void *ctx, int64_t t_ns)
{
    struct pik *b = ctx;
    struct board_cycle *c = b->cycle;
    b->cycle = NULL;
    b->counters.cycles++;
    bus_lines_end(&b->base.trace, &bus_lines, t_ns);
    if (c->write) write_word(b, c, t_ns);
    c->done(c->ctx, c, BOARD_CYCLE_OK, t_ns);
}

static bool accepts_value(const struct pik *b, const struct board_cycle *c)
{
    if (c->address == PIK_REG_PERIOD) return pik_period_fits(b, c->data);
    return c->address != PIK_REG_CLEAR || c->data < 1u << PIK_AXES;
}

static void describe_expected(const struct board *board, const struct board_cycle *c, enum board_cycle_result r,
                              char *out, size_t cap)
{
    unsigned least, most;
    pik_period_range((const struct pik *)board, &least, &most);
    if (r == BOARD_CYCLE_NOT_READY)
        (void)snprintf(out, cap, "a write to LATCH (0Bh) latches, PERIOD (0Ch) does so without end");
    else if (c->address == PIK_REG_PERIOD) (void)snprintf(out, cap, "it takes 0 and %u to %u", least, most);
    else (void)snprintf(out, cap, "it takes 0 to %u", (1u << PIK_AXES) - 1);
}

static enum board_cycle_result check_cycle(const struct pik *b, const struct board_cycle *c)
{
    if (!b->on) return BOARD_CYCLE_OFF;
    if (c->address >= PIK_REGISTERS) return BOARD_CYCLE_NO_ADDRESS;
    const unsigned rights = registers[c->address].rights;
    if (c->write && !(rights & BOARD_WRITABLE)) return BOARD_CYCLE_READ_ONLY;
    if (!c->write && !(rights & BOARD_READABLE)) return BOARD_CYCLE_WRITE_ONLY;
    if (c->strobe_ns != 0 && c->strobe_ns < b->profile.strobe_min_ns) return BOARD_CYCLE_TOO_SHORT;
    if (b->cycle) return BOARD_CYCLE_BUSY;
    if (rights & BOARD_LATCHED && !b->any) return BOARD_CYCLE_NOT_READY;
    return !c->write || accepts_value(b, c) ? BOARD_CYCLE_OK : BOARD_CYCLE_BAD_VALUE;
}

static enum board_cycle_result submit(struct board *board, struct board_cycle *c, int64_t t_ns)
{
    struct pik *b = (struct pik *)board;
    const enum board_cycle_result r = check_cycle(b, c);
    if (r != BOARD_CYCLE_OK) {
        b->counters.cycles_refused++;
        return r;
    }
    b->cycle = c;
    if (!c->write) c->data = word_at(b, c->address);
    bus_lines_begin(&b->base.trace, &bus_lines, c, c->data, t_ns);
    sched_at(b->base.sched, &b->cycle_end, t_ns + (c->strobe_ns ? c->strobe_ns : b->profile.strobe_ns));
    return BOARD_CYCLE_OK;
}

void pik_bus_cut(struct pik *b, int64_t t_ns)
{
    struct board_cycle *c = b->cycle;
    if (!c) return;
    b->cycle = NULL;
    sched_cancel(b->base.sched, &b->cycle_end);
    b->counters.cycles_refused++;
    bus_lines_end(&b->base.trace, &bus_lines, t_ns);
    c->done(c->ctx, c, BOARD_CYCLE_OFF, t_ns);
}

void pik_bus_init(struct pik *b)
{
    sched_ev_inner(&b->cycle_end, cycle_end, b);
}

BOARD_BUS(pik, PIK_REGISTERS);
