#include "board/pik/board.h"

#include "board/digest.h"
#include "board/life.h"
#include "board/pik/pik.h"

#include <stdio.h>

/* ---- profile ---- */

static void about(const void *profile, char *out, size_t cap)
{
    const struct pik_profile *p = profile;
    (void)snprintf(out, cap, "%.4g Hz/V, a pulse of %.4g mV s, at most %.4g kHz, TCLK %.4g us, latched every %.4g ms",
                   pik_profile_k_hz_per_v(p), pik_profile_quantum_vs(p) * 1e3, pik_profile_limit_hz(p) * 1e-3,
                   1e6 / p->clock_hz, p->latch_us * 1e-3);
}

/* The load alone is before the integrator (article, figure 1). */
static void set_load(struct board_cfg *cfg, double ohm)
{
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        cfg->afe[i].load_ohm = ohm;
        cfg->afe[i].divider_ratio = 1.0;
        cfg->afe[i].filter_hz = 0.0;
    }
}

static void cfg_default(struct board_cfg *cfg)
{
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    set_load(cfg, p.ra_ohm);
}

static void cfg_profiled(struct board_cfg *cfg, const void *profile)
{
    set_load(cfg, ((const struct pik_profile *)profile)->ra_ohm);
}

/* ---- what is on it ---- */

#define OF BOARD_COUNTER

// clang-format off
static const struct board_counter controller_counters[] = {
    OF(pik_counters, readings, readings), OF(pik_counters, resets, resets), OF(pik_counters, strobes, strobes),
    OF(pik_counters, cycles, cycles), OF(pik_counters, cycles_refused, cycles_refused),
};
static const struct board_counter converter_counters[] = {
    OF(pik_channel, pulses_plus, plus), OF(pik_channel, pulses_minus, minus), OF(pik_channel, saturated, saturated_looks),
    OF(pik_channel, opposed, opposed), OF(pik_channel, pulses_lost, lost),
};
// clang-format on

enum { PART_CONTROLLER, PART_X, PART_Y, PART_Z, PART_CLOCK, PARTS };

static void converter_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    pik_stick((struct pik *)board, part - PART_X, f, t_ns);
}

static void clock_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    (void)part;
    pik_clock((struct pik *)board, f->clock_ppm, t_ns);
}

static bool flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    return pik_flip((struct pik *)board, part - PART_X, reg, mask, t_ns);
}

#define NO_CHIP "a channel has no data-ready pin, no synchronisation and no clock of its own; its pulses are its output"
#define NO_PORT "the generator has one output, its clock"
#define PART(axis, nr)                                                                                                 \
    {                                                                                                                  \
        .name = "conv." axis, .label = "conv_" axis,                                                                   \
        .offset = offsetof(struct pik, channel) + (nr) * sizeof(struct pik_channel),                                   \
        BOARD_COUNTERS(converter_counters), .faults = BOARD_FAULT_DOUT, .unless = NO_CHIP, .registers = 4,             \
        .fault = converter_fault, .flip = flip                                                                         \
    }

static const struct board_part parts[PARTS] = {
    [PART_CONTROLLER] = {.name = "controller",
                         .label = "board",
                         .offset = offsetof(struct pik, counters),
                         BOARD_COUNTERS(controller_counters)},
    [PART_X] = PART("x", 0),
    [PART_Y] = PART("y", 1),
    [PART_Z] = PART("z", 2),
    [PART_CLOCK] =
        {.name = "clock", .label = "clock", .faults = BOARD_FAULT_CLOCK, .unless = NO_PORT, .fault = clock_fault},
};

static const char *const port_lines[] = {"FXP", "FXN", "FYP", "FYN", "FZP", "FZN", "LATCH", NULL};

/* ---- what faults are measured by ---- */

/* One pulse in a second. */
static double code_v(const struct board *board)
{
    return pik_profile_quantum_vs(&((const struct pik *)board)->profile);
}

static double range_v(const struct board *board)
{
    const struct pik_profile *p = &((const struct pik *)board)->profile;
    return pik_profile_limit_hz(p) * pik_profile_quantum_vs(p);
}

/* ---- life ---- */

BOARD_LIFE(pik);

static bool ready(const struct board *board)
{
    const struct pik *b = (const struct pik *)board;
    return b->on && (b->any || b->period_100us == 0);
}

static void observe(struct board *board, bool on)
{
    pik_observe((struct pik *)board, on);
}

static void truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct pik *b = (const struct pik *)board;
    for (unsigned i = 0; i < PIK_AXES; i++) {
        const char axis = "xyz"[i];
        board_put_truth(put, ctx, pik_true_k_hz_per_v(b, i, 1, 25.0), "%c_plus_hz_per_v", axis);
        board_put_truth(put, ctx, pik_true_k_hz_per_v(b, i, -1, 25.0), "%c_minus_hz_per_v", axis);
        board_put_truth(put, ctx, b->specimen.ratio_tc[i] - b->specimen.uref_tc, "%c_tc_ppm_per_k", axis);
        board_put_truth(put, ctx, b->specimen.zero_v[i], "%c_zero_v", axis);
        board_put_truth(put, ctx, b->specimen.zero_tc[i], "%c_zero_tc_v_per_k", axis);
        board_put_truth(put, ctx, b->specimen.c_pct[i], "%c_c_pct", axis);
    }
    put(ctx, "uref_ppm", b->specimen.uref_ppm);
    put(ctx, "clock_ppm", b->specimen.clock_ppm);
}

/* ---- digest ---- */

static void add_channel(struct sha256 *s, const struct pik *b, unsigned i)
{
    const struct pik_channel *c = &b->channel[i];
    const struct pik_axis *a = &c->axis;
    board_digest_u64(s, (uint64_t)a->charge);
    board_digest_u64(s, (uint64_t)a->begun_tick);
    board_digest_u64(s, a->plus);
    board_digest_u64(s, a->minus);
    board_digest_u64(s, (uint64_t)a->drive.per_tick);
    board_digest_u64(s, (uint64_t)a->saturated << 32 | a->opposed);
    board_digest_u64(s, c->plus_from);
    board_digest_u64(s, c->minus_from);
    board_digest_real(s, c->due_vs);
    board_digest_real(s, c->noise_v);
    board_digest_real(s, b->base.afe[i].state_v);
    board_digest_noise(s, &b->base.afe[i].noise);
    board_digest_noise(s, &c->noise);
}

static void digest(const struct board *board, struct sha256 *s)
{
    const struct pik *b = (const struct pik *)board;
    const struct pik_reading *r = &b->latched;
    board_digest_u64(s, (uint64_t)b->on << 32 | (uint64_t)b->any << 1 | b->saturated);
    board_digest_u64(s, (uint64_t)b->look_tick);
    board_digest_u64(s, (uint64_t)b->fed_ns);
    board_digest_u64(s, (uint64_t)b->counters.readings << 32 | b->counters.resets);
    board_digest_u64(s, (uint64_t)b->counters.cycles << 32 | b->counters.cycles_refused);
    board_digest_u64(s, (uint64_t)r->seq << 32 | r->status);
    board_digest_u64(s, (uint64_t)b->period_100us << 1 | (b->cycle != NULL));
    for (unsigned i = 0; i < PIK_AXES; i++) board_digest_u64(s, (uint64_t)r->total[i]);
    for (unsigned i = 0; i < PIK_AXES; i++) add_channel(s, b, i);
}

static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", PIK_FAULT_FROZEN_WORDS},
    {NULL, 0},
};

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct pik *b = (struct pik *)board;
    for (unsigned i = 0; i < PIK_AXES; i++) at[i] = &b->channel[i].noise;
    return PIK_AXES;
}

static const char *why_eager(struct board *board, int64_t t_ns)
{
    (void)board;
    (void)t_ns;
    return "its integrators hold the past";
}

const struct board_type pik_board = {
    BOARD_COMMON(pik, PIK),
    .title = "PIK",
    .profile_name = "pik",
    .cfg_default = cfg_default,
    .cfg_profiled = cfg_profiled,
    .node = 8,
    .period_ns = pik_profile_period_ns,
    .frame_line = PIK_LINE_LATCH,
    .code_v = code_v,
    .range_v = range_v,
    .bus = &pik_bus,
    .observe = observe,
    .analog = true,
    .why_eager = why_eager,
    .noises = list_noises,
    .truth = truth,
};
