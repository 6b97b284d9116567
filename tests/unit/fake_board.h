/* A board that is none of the real ones, for what the commands and faults do with any board's table: four chips, two of
 * them a group, a controller that can freeze, three lines, events TICK and TOCK, a bus with four addresses. */
#ifndef PSABENCH_TESTS_FAKE_BOARD_H
#define PSABENCH_TESTS_FAKE_BOARD_H

#include "unit/unit.h"

#include <stdio.h>
#include <string.h>

#define FAKE_STROBE_NS 800 /* where the host gives none; half of it is too short */
#define FAKE_PULSES    8u
#define FAKE_CODE_V    1e-3

enum { FAKE_CTL, FAKE_CONV_A, FAKE_CONV_B, FAKE_ROM, FAKE_LAMP, FAKE_PARTS };

struct fake_chip {
    uint32_t conversions, lost;
    struct chip_fault fault;
    unsigned flipped;
};

struct fake_board {
    struct board base;
    bool on;
    uint32_t cycles, resets;
    int64_t sampled_ns;
    struct fake_chip chip[FAKE_PARTS - 1];
    struct board_cycle *cycle;
    uint16_t word[4];
    bool waits; /* a word, at address 0 */
    struct sched_ev end;
};

static void fake_end(void *ctx, int64_t t_ns)
{
    struct fake_board *b = ctx;
    struct board_cycle *c = b->cycle;
    b->cycle = NULL;
    if (c->write) b->word[c->address] = c->data;
    else c->data = b->word[c->address];
    c->done(c->ctx, c, c->address == 0 && !b->waits ? BOARD_CYCLE_NOT_READY : BOARD_CYCLE_OK, t_ns);
}

/* 0: read alone, not before its word waits; 1: written alone; 2: both, but not 13; 3: both. */
static enum board_cycle_result fake_submit(struct board *board, struct board_cycle *c, int64_t t_ns)
{
    struct fake_board *b = (struct fake_board *)board;
    const int64_t strobe_ns = c->strobe_ns ? c->strobe_ns : FAKE_STROBE_NS;
    b->cycles++;
    if (!b->on) return BOARD_CYCLE_OFF;
    if (b->cycle) return BOARD_CYCLE_BUSY;
    if (c->address > 3) return BOARD_CYCLE_NO_ADDRESS;
    if (strobe_ns <= FAKE_STROBE_NS / 2) return BOARD_CYCLE_TOO_SHORT;
    if (c->write && c->address == 0) return BOARD_CYCLE_READ_ONLY;
    if (!c->write && c->address == 1) return BOARD_CYCLE_WRITE_ONLY;
    if (c->write && c->address == 2 && c->data == 13) return BOARD_CYCLE_BAD_VALUE;
    b->cycle = c;
    sched_at(b->base.sched, &b->end, t_ns + strobe_ns);
    return BOARD_CYCLE_OK;
}

static const struct board_register fake_registers[4] = {{.name = "word"}, {.name = "command"}, {.name = "level"}};

static struct board_strobe fake_strobe(const struct board *board)
{
    (void)board;
    return (struct board_strobe){FAKE_STROBE_NS, FAKE_STROBE_NS / 2 + 1};
}

static void fake_expected(const struct board *board, const struct board_cycle *c, enum board_cycle_result r, char *out,
                          size_t cap)
{
    (void)board;
    (void)snprintf(out, cap, r == BOARD_CYCLE_BAD_VALUE ? "it takes %u" : "wait for %u", c->address);
}

static void fake_reset(struct board *board, int64_t t_ns)
{
    struct fake_board *b = (struct fake_board *)board;
    struct board_cycle *c = b->cycle;
    b->resets++;
    b->cycle = NULL;
    sched_cancel(b->base.sched, &b->end);
    if (c) c->done(c->ctx, c, BOARD_CYCLE_OFF, t_ns);
}

static bool fake_ready(const struct board *board)
{
    return ((const struct fake_board *)board)->on;
}

static void fake_sample(struct board *board, int64_t t_ns)
{
    ((struct fake_board *)board)->sampled_ns = t_ns;
}

static void fake_truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    (void)board;
    put(ctx, "capacitor_error_ppm", 250.0);
}

static void fake_chip_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    (void)t_ns;
    ((struct fake_board *)board)->chip[part - 1].fault = *f;
}

static bool fake_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    struct fake_board *b = (struct fake_board *)board;
    (void)t_ns;
    if (b->on) b->chip[part - 1].flipped = 256 * reg + mask;
    return b->on;
}

static unsigned fake_pulses(const struct board *board)
{
    (void)board;
    return FAKE_PULSES;
}

static double fake_code_v(const struct board *board)
{
    (void)board;
    return FAKE_CODE_V;
}

static double fake_range_v(const struct board *board)
{
    (void)board;
    return 5.0;
}

static const struct board_line fake_lines[] = {{"BEAT", true}, {"CK", false}, {"MARK", false}};
static const char *const fake_events[] = {"TICK", "TOCK"};
static const struct board_counter fake_ctl_counters[] = {{"cycles", offsetof(struct fake_board, cycles)}};
static const struct board_counter fake_chip_counters[] = {{"conversions", offsetof(struct fake_chip, conversions)},
                                                          {"lost", offsetof(struct fake_chip, lost)}};
#define FAKE_CHIP(nr)                                                                                                  \
    .offset = offsetof(struct fake_board, chip) + (nr) * sizeof(struct fake_chip), .counters = fake_chip_counters,     \
    .counter_count = 2
static const struct board_part fake_parts[FAKE_PARTS] = {
    [FAKE_CTL] = {.name = "ctl", .label = "board", .counters = fake_ctl_counters, .counter_count = 1},
    [FAKE_CONV_A] = {.name = "conv.a",
                     .label = "conv_a",
                     FAKE_CHIP(0),
                     .faults = BOARD_FAULT_DRDY | BOARD_FAULT_DOUT | BOARD_FAULT_CLOCK,
                     .unless = "it runs on its own",
                     .registers = 3,
                     .fault = fake_chip_fault,
                     .flip = fake_flip},
    [FAKE_CONV_B] =
        {.name = "conv.b", .label = "conv_b", FAKE_CHIP(1), .faults = BOARD_FAULT_DOUT, .fault = fake_chip_fault},
    [FAKE_ROM] = {.name = "rom", .label = "memory", FAKE_CHIP(2)},
    [FAKE_LAMP] = {.name = "lamp", .label = "lamp", FAKE_CHIP(3)},
};
#define FAKE_FAULT_FROZEN_WORDS 4u
static const struct board_controller_fault fake_faults[] = {{"controller.frozen_words", FAKE_FAULT_FROZEN_WORDS},
                                                            {NULL, 0}};
static const struct board_bus fake_bus = {.submit = fake_submit,
                                          .addresses = 4,
                                          .registers = fake_registers,
                                          .strobe = fake_strobe,
                                          .expected = fake_expected};

static const struct board_type fake_type = {
    .name = "fake",
    .title = "FAKE-1",
    .size = sizeof(struct fake_board),
    .lines = fake_lines,
    .line_count = 3,
    .frame_line = 0,
    .pulse_line = 1,
    .pulses = fake_pulses,
    .code_v = fake_code_v,
    .range_v = fake_range_v,
    .events = fake_events,
    .event_count = 2,
    .parts = fake_parts,
    .part_count = FAKE_PARTS,
    .controller_faults = fake_faults,
    .bus = &fake_bus,
    .reset = fake_reset,
    .ready = fake_ready,
    .sample_until = fake_sample,
    .analog = true,
    .truth = fake_truth,
};

/* A unit around it; what the commands ask of a unit. Not to be moved. */
static inline void fake_unit(struct unit *u, struct fake_board *b, const char *name, struct lab *lab, struct sched *s)
{
    memset(b, 0, sizeof *b);
    b->on = true;
    sched_ev(&b->end, fake_end, b);
    board_init(&b->base, fake_lines, fake_type.line_count, &(struct board_cfg){.serial = 0},
               &(struct board_io){.ctx = b}, s);
    b->base.type = &fake_type;
    u->cfg = unit_default(name);
    u->cfg.type = &fake_type;
    for (unsigned i = 0; i < UNIT_AXES; i++) u->cfg.axis[i].sensor = UNIT_MEMS;
    u->lab = lab;
    u->type = &fake_type;
    u->board = &b->base;
    snprintf(u->profile, sizeof u->profile, "usual");
}

#endif
