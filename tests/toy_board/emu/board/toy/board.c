#include "board/toy/board.h"

#include "board/digest.h"
#include "board/life.h"

#include <stdio.h>

/* ---- profile ---- */

#define NAME(...) FIELD_NAME(struct toy_profile, __VA_ARGS__)
#define ROW(...)  FIELD_ROW(struct toy_profile, __VA_ARGS__)

static const struct field rows[] = {
    NAME("toy", "Name of the profile."),
    ROW(lsb_v, REAL, 320e-6, 1e-6, 1e-3, "Weight of a code. E0."),
    ROW(period_us, U32, 10000, 1000, 1000000, "Period of the samples. E0."),
    ROW(bit_ns, U32, 1000, 100, 4000, "Period of CLK. E0."),
};
static const struct fields fields = FIELDS_OF(struct toy_profile, rows);

static bool check_profile(const void *profile, char *why, size_t cap)
{
    return fields_check(&fields, profile, why, cap);
}

static void describe_profile(const void *profile, char *out, size_t cap)
{
    const struct toy_profile *p = profile;
    (void)snprintf(out, cap, "codes of %.4g uV, a sample each %.4g ms", p->lsb_v * 1e6, p->period_us * 1e-3);
}

/* The inputs go to the converter as they are. */
static void cfg_default(struct board_cfg *cfg)
{
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        cfg->afe[i].divider_ratio = 1.0;
        cfg->afe[i].filter_hz = 0.0;
    }
}

static int64_t period_ns(const void *profile)
{
    return toy_period_ns(profile);
}

/* ---- what is on it ---- */

static const struct board_counter controller_counters[] = {
    BOARD_COUNTER(toy_counters, samples, samples),
    BOARD_COUNTER(toy_counters, resets, resets),
};
static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", TOY_FAULT_FROZEN_WORDS},
    {NULL, 0},
};

static void set_converter_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    (void)part;
    (void)t_ns;
    ((struct toy *)board)->dout = f->dout;
}

static const struct board_part parts[] = {
    {.name = "controller",
     .label = "board",
     .offset = offsetof(struct toy, counters),
     BOARD_COUNTERS(controller_counters)},
    {.name = "conv",
     .label = "conv",
     .faults = BOARD_FAULT_DOUT,
     .unless = "the converter has a data output, and no other pin or clock that can fail",
     .fault = set_converter_fault},
};
static const char *const port_lines[] = {"FRAME", "CLK", "DATA", NULL};

static unsigned clk_pulses(const struct board *board)
{
    (void)board;
    return TOY_BITS;
}

/* ---- what faults of a sensor are measured by ---- */

static double code_v(const struct board *board)
{
    return ((const struct toy *)board)->profile.lsb_v;
}

static double range_v(const struct board *board)
{
    return INT16_MAX * code_v(board);
}

/* ---- life ---- */

BOARD_LIFE(toy);

static bool is_ready(const struct board *board)
{
    const struct toy *b = (const struct toy *)board;
    return b->on && b->latest.seq > 0;
}

/* All that its future depends on. */
static void add_digest(const struct board *board, struct sha256 *s)
{
    const struct toy *b = (const struct toy *)board;
    board_digest_u64(s, (uint64_t)b->on << 32 | b->latest.seq);
    board_digest_u64(s, (uint64_t)b->sample_ev.due_ns);
    board_digest_u64(s, (uint64_t)b->counters.samples << 32 | b->counters.resets);
    board_digest_u64(s, b->latest.clipped);
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        board_digest_u64(s, (uint16_t)b->latest.code[i]);
        board_digest_real(s, b->base.afe[i].state_v);
        board_digest_noise(s, &b->base.afe[i].noise);
    }
}

const struct board_type toy_board = {
    .name = "toy",
    .title = "TOY",
    .size = sizeof(struct toy),
    .fields = &fields,
    .profile_name = "toy",
    .profile_check = check_profile,
    .about = describe_profile,
    .cfg_default = cfg_default,
    .node = 10,
    .period_ns = period_ns,
    .lines = toy_lines,
    .line_count = TOY_LINES,
    .port_lines = port_lines,
    .frame_line = TOY_LINE_FRAME,
    .pulse_line = TOY_LINE_CLK,
    .pulses = clk_pulses,
    .events = toy_events,
    .event_count = TOY_EVENTS,
    .code_v = code_v,
    .range_v = range_v,
    .parts = parts,
    .part_count = sizeof parts / sizeof *parts,
    .controller_faults = controller_faults,
    .can = &toy_can,
    BOARD_LIFE_FUNCTIONS,
    .ready = is_ready,
    .analog = true,
    .digest = add_digest,
};
