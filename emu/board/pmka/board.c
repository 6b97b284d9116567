#include "board/pmka/board.h"

#include "board/digest.h"
#include "board/life.h"
#include "board/pmka/pmka.h"

#include <stdio.h>

/* ---- profile ---- */

static int64_t period_ns(const void *profile)
{
    return ((const struct pmka_profile *)profile)->ts_ns;
}

static double ur_v(const struct pmka_profile *p)
{
    return p->uref_v * (0.5e-9 * p->ts_ns) / (p->rr_ohm * p->cap_f);
}

static double code_vs(const struct pmka_profile *p)
{
    return p->uref_v * (1e-9 * p->ts_ns) / (ur_v(p) / p->adc_range_v * 32768.0);
}

static void about(const void *profile, char *out, size_t cap)
{
    const struct pmka_profile *p = profile;
    (void)snprintf(out, cap, "Ts %.6g ms, Ur %.4g V, %.4g uV s a code, %s rotation, beats of %u Ts", 1e-6 * p->ts_ns,
                   ur_v(p), 1e6 * code_vs(p), p->rotation == PMKA_PROGRAM ? "programmed" : "autonomous",
                   p->beat_periods);
}

/* Current output on a load; no divider, and no filter: the integrator is one. */
static void cfg_default(struct board_cfg *cfg)
{
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        cfg->afe[i].divider_ratio = 1.0;
        cfg->afe[i].filter_hz = 0.0;
    }
}

/* ---- what is on it ---- */

#define COUNT(field) BOARD_COUNTER(pmka_counters, field, field)

static const struct board_counter counters[] = {
    COUNT(readings),      COUNT(res),   COUNT(resets_plus), COUNT(resets_minus), COUNT(calibration_resets),
    COUNT(handovers),     COUNT(beats), COUNT(saturations), COUNT(clips),        COUNT(cycles),
    COUNT(cycles_refused)};

static void adc_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    struct pmka *b = (struct pmka *)board;
    (void)part;
    (void)t_ns;
    b->adc_stuck = f->dout != CHIP_FREE;
    b->adc_stuck_level = f->dout == CHIP_STUCK_HIGH;
}

/* The ROM keeps its words without power, damaged or not. */
static bool rom_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    struct pmka *b = (struct pmka *)board;
    (void)part;
    (void)t_ns;
    b->rom[reg / 2] ^= (uint16_t)((unsigned)mask << (reg % 2 ? 8 : 0));
    return true;
}

enum { PART_CONTROLLER, PART_ADC, PART_ROM, PARTS };

static const struct board_part parts[PARTS] = {
    [PART_CONTROLLER] = {.name = "controller",
                         .label = "board",
                         .offset = offsetof(struct pmka, counters),
                         BOARD_COUNTERS(counters)},
    [PART_ADC] = {.name = "adc",
                  .label = "adc",
                  .faults = BOARD_FAULT_DOUT,
                  .unless = "the converter has neither data-ready nor a clock of its own: the board's Ts times it",
                  .fault = adc_fault},
    [PART_ROM] = {.name = "rom",
                  .label = "rom",
                  .unless = "a ROM only has words",
                  .registers = 2 * PMKA_ROM_WORDS,
                  .flip = rom_flip},
};

/* ---- life ---- */

BOARD_LIFE(pmka);

static bool ready(const struct board *board)
{
    return pmka_ready((const struct pmka *)board);
}

static void set_faults(struct board *board, uint32_t faults)
{
    pmka_set_faults((struct pmka *)board, faults);
}

/* ---- what faults are measured by ---- */

static unsigned pulses(const struct board *board)
{
    (void)board;
    return PMKA_INTS;
}

/* That a reset in each period balances. */
static double range_v(const struct board *board)
{
    return ((const struct pmka *)board)->profile.uref_v;
}

/* One in a second. */
static double code_v(const struct board *board)
{
    return code_vs(&((const struct pmka *)board)->profile);
}

/* ---- truth ---- */

static const char *const who[PMKA_INTS] = {"x", "y", "z", "k"};

static void put_integrator(const struct pmka *b, unsigned i, board_truth_fn *put, void *ctx)
{
    const struct pmka_int *n = &b->channel[i].integrator;
    const double uref_v = b->specimen.uref_v + b->specimen.uref_tc_v_per_k * (b->board_degc - PMKA_NOMINAL_DEGC);
    const double ct_plus = pmka_int_ct(&n->cfg, PMKA_PLUS, uref_v, b->profile.uref_v, b->board_degc);
    const double ct_minus = pmka_int_ct(&n->cfg, PMKA_MINUS, uref_v, b->profile.uref_v, b->board_degc);
    board_put_truth(put, ctx, n->cap_f * n->cap_left, "integrator_%s_cap_f", who[i]);
    board_put_truth(put, ctx, n->r_in_ohm, "integrator_%s_r_in_ohm", who[i]);
    board_put_truth(put, ctx, n->rr_ohm[PMKA_PLUS], "integrator_%s_rr_plus_ohm", who[i]);
    board_put_truth(put, ctx, n->rr_ohm[PMKA_MINUS], "integrator_%s_rr_minus_ohm", who[i]);
    board_put_truth(put, ctx, n->zero_v, "integrator_%s_zero_v", who[i]);
    board_put_truth(put, ctx, ct_plus, "integrator_%s_ct_plus", who[i]);
    board_put_truth(put, ctx, ct_minus, "integrator_%s_ct_minus", who[i]);
    board_put_truth(put, ctx, b->specimen.uc_v[i][PMKA_PLUS], "integrator_%s_uc_plus_v", who[i]);
    board_put_truth(put, ctx, b->specimen.uc_v[i][PMKA_MINUS], "integrator_%s_uc_minus_v", who[i]);
}

/* At the temperature of the present period. */
static void truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct pmka *b = (const struct pmka *)board;
    put(ctx, "temp_noise_scale", b->base.cfg.temp_noise_scale);
    put(ctx, "uref_v", b->uref_v);
    put(ctx, "adc_offset_lsb", b->specimen.adc_offset_lsb);
    put(ctx, "adc_gain", b->specimen.adc_gain);
    put(ctx, "temp_offset_k", b->specimen.temp_offset_k);
    for (unsigned i = 0; i < PMKA_INTS; i++) put_integrator(b, i, put, ctx);
    for (unsigned a = 0; a < BOARD_AXES; a++)
        board_put_truth(put, ctx, b->axis[a].integral_vs, "axis_%s_integral_vs", who[a]);
}

/* ---- digest ---- */

static void add_channel(struct sha256 *s, const struct pmka_channel *c)
{
    board_digest_real(s, c->integrator.charge_c);
    board_digest_real(s, c->integrator.cap_left);
    board_digest_u64(s, (uint64_t)c->at_ns);
    board_digest_u64(s, (uint64_t)c->cell_ns);
    board_digest_u64(s, (uint64_t)c->reset_until_ns);
    board_digest_u64(s, (uint64_t)(c->axis + 1) << 32 | (uint64_t)(c->said_axis + 1));
    board_digest_u64(s, (uint64_t)c->served << 32 | (uint64_t)c->resetting << 8 | (uint64_t)c->sign << 4 |
                            (uint64_t)(c->done + 1));
    board_digest_u64(s, (uint64_t)c->count[PMKA_PLUS] << 32 | c->count[PMKA_MINUS]);
}

static void add_rotation(struct sha256 *s, const struct pmka_rotation *r)
{
    board_digest_u64(s, (uint64_t)r->mode << 32 | (uint64_t)r->cal);
    board_digest_u64(s, (uint64_t)r->tau << 32 | r->age);
    board_digest_u64(s, (uint64_t)r->asked_tau << 32 | (uint64_t)r->asked_cal);
    board_digest_u64(s, (uint64_t)r->beat_periods << 32 | r->zero_periods);
}

static void digest(const struct board *board, struct sha256 *s)
{
    const struct pmka *b = (const struct pmka *)board;
    board_digest_u64(s, (uint64_t)b->life << 32 | (uint64_t)b->stage);
    board_digest_u64(s, (uint64_t)b->set_ns);
    board_digest_u64(s, (uint64_t)b->next.seq << 32 | b->base.faults);
    board_digest_u64(s, (uint64_t)b->adc_stuck << 1 | b->adc_stuck_level);
    for (unsigned i = 0; i < PMKA_INTS; i++) add_channel(s, &b->channel[i]);
    for (unsigned i = 0; i < PMKA_INTS; i++)
        board_digest_u64(s, (uint64_t)(uint16_t)b->latest.code[i] << 16 | (uint16_t)b->next.code[i]);
    for (unsigned a = 0; a < BOARD_AXES; a++) {
        board_digest_u64(s, (uint64_t)b->axis[a].at_ns);
        board_digest_real(s, b->axis[a].integral_vs);
    }
    add_rotation(s, &b->rotation);
    board_digest_u64(s, (uint64_t)b->bus.index << 8 | (uint64_t)b->bus.fresh << 1 | b->bus.overrun);
    for (unsigned i = 0; i < PMKA_ROM_WORDS; i++) board_digest_u64(s, b->rom[i]);
    board_digest_noise(s, &b->adc_noise);
    board_digest_noise(s, &b->temp_noise);
    sha256_add(s, &b->counters, sizeof b->counters);
}

static const char *const port_lines[] = {"KL1", "KL2", "KL3", "KL4", "SH", "MUX0", "MUX1", NULL};

static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", PMKA_FAULT_FROZEN_WORDS},
    {"controller.capacitor", PMKA_FAULT_CAPACITOR},
    {"controller.stuck_reset", PMKA_FAULT_STUCK_RESET},
    {"controller.stuck_key", PMKA_FAULT_STUCK_KEY},
    {NULL, 0},
};
static const char *const capabilities[] = {"temp_noise_scale", NULL};

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct pmka *b = (struct pmka *)board;
    at[0] = &b->adc_noise;
    at[1] = &b->temp_noise;
    return 2;
}

static const char *why_eager(struct board *board, int64_t t_ns)
{
    (void)board;
    (void)t_ns;
    return "its integrators hold the past";
}

const struct board_type pmka_board = {
    BOARD_COMMON(pmka, PMKA),
    .title = "PMKA",
    .profile_name = "pmka",
    .cfg_default = cfg_default,
    .capabilities = capabilities,
    .node = 7,
    .period_ns = period_ns,
    .frame_line = PMKA_LINE_MUX1,
    .pulse_line = PMKA_LINE_CONV,
    .pulses = pulses,
    .code_v = code_v,
    .range_v = range_v,
    .bus = &pmka_bus,
    .set_faults = set_faults,
    .analog = true,
    .why_eager = why_eager,
    .noises = list_noises,
    .truth = truth,
};
