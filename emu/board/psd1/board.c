#include "board/psd1/board.h"

#include "board/digest.h"
#include "board/life.h"
#include "board/psd1/psd1.h"

#include <stdio.h>

/* ---- profile ---- */

static void about(const void *profile, char *out, size_t cap)
{
    const struct psd1_profile *p = profile;
    static const char *const part[] = {"AD7712", "AD7710", "AD7711"};
    (void)snprintf(out, cap, "%s, 16 bits of +-%.4g V, a cycle every %.3f us, %s", part[p->part],
                   psd1_profile_full_scale_v(p), 1e-3 * (double)psd1_profile_period_ns(p),
                   p->host_strobe_ns ? "built-in host" : "read by the host alone");
}

/* The signal goes to the converter as it is: +-10 V. */
static void cfg_default(struct board_cfg *cfg)
{
    for (unsigned i = 0; i < BOARD_AXES; i++) cfg->afe[i].divider_ratio = 1.0;
}

/* ---- what is on it ---- */

#define OF          BOARD_COUNTER
#define KPSD(field) OF(psd1_counters, field, field)
#define ADC(field)  OF(ad7712, field, n.field)

// clang-format off
static const struct board_counter kpsd_counters[] = {
    KPSD(cycles), KPSD(resets), KPSD(commands), KPSD(timeouts), KPSD(late), KPSD(stretched), KPSD(lost_x), KPSD(lost_y),
    KPSD(lost_z), KPSD(bus_cycles), KPSD(refused), KPSD(too_short), KPSD(cut),
};
static const struct board_counter adc_counters[] = {
    ADC(conversions), ADC(calibrations), ADC(restarts), ADC(overruns), ADC(lost_words), ADC(torn_reads), ADC(stale_reads),
    ADC(blocked_reads), ADC(over_reads), ADC(dropped), ADC(refused), ADC(over_writes), ADC(clipped), ADC(overloads),
    ADC(cal_clamped), ADC(bad_fs), ADC(bad_channel), ADC(bad_bit), ADC(a0_violations), ADC(sclk_violations),
    ADC(sdata_violations), ADC(frame_violations), ADC(power_downs),
};
// clang-format on

enum { PART_KPSD, PART_ADC_X, PART_ADC_Y, PART_ADC_Z, PARTS };

static void adc_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    ad7712_fault(&((struct psd1 *)board)->adc[part - PART_ADC_X], f, t_ns);
}

static bool adc_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    struct psd1 *b = (struct psd1 *)board;
    return b->phase != PSD1_OFF && ad7712_flip(&b->adc[part - PART_ADC_X], reg, mask, t_ns);
}

#define SOME_FAULTS (BOARD_FAULT_DOUT | BOARD_FAULT_CLOCK)
#define NO_SYNC                                                                                                        \
    "SYNC is Res's (E0): the converters begin in step, a lost one would show only after a clock that was off"
#define DR_IS_X NO_SYNC "; DR is the pin of converter X with the profile psd1, adc.x has it"

static const struct board_part parts[PARTS] = {
    [PART_KPSD] = {.name = "kpsd",
                   .label = "board",
                   .offset = offsetof(struct psd1, counters),
                   BOARD_COUNTERS(kpsd_counters)},
#define ADC_PART(nr, axis, faults_of, why_not)                                                                         \
    {                                                                                                                  \
        .name = "adc." axis, .label = "adc_" axis,                                                                     \
        .offset = offsetof(struct psd1, adc) + (nr) * sizeof(struct ad7712), BOARD_COUNTERS(adc_counters),             \
        .faults = (faults_of), .unless = (why_not), .registers = AD7712_FLIP_REGS, .fault = adc_fault,                 \
        .flip = adc_flip                                                                                               \
    }
    [PART_ADC_X] = ADC_PART(0, "x", SOME_FAULTS | BOARD_FAULT_DRDY, NO_SYNC),
    [PART_ADC_Y] = ADC_PART(1, "y", SOME_FAULTS, DR_IS_X),
    [PART_ADC_Z] = ADC_PART(2, "z", SOME_FAULTS, DR_IS_X),
};

/* ---- life ---- */

BOARD_LIFE(psd1);

static bool ready(const struct board *board)
{
    return ((const struct psd1 *)board)->ready;
}

/* ---- what faults are measured by ---- */

static unsigned pulses(const struct board *board)
{
    (void)board;
    return BOARD_AXES * 16u;
}

static double range_v(const struct board *board)
{
    return psd1_profile_full_scale_v(&((const struct psd1 *)board)->profile);
}

static double code_v(const struct board *board)
{
    return range_v(board) / 32768.0;
}

/* ---- truth ---- */

static void put_axis(const struct psd1 *b, unsigned i, board_truth_fn *put, void *ctx)
{
    const struct psd1_gyro *g = &b->gyros.axis[i];
    const struct ad7712_cfg *a = &b->adc[i].cfg;
    const unsigned input = b->profile.adc_input - 1;
    const char axis = "xyz"[i];
    board_put_truth(put, ctx, a->offset_v[input], "axis_%c_adc_offset_v", axis);
    board_put_truth(put, ctx, a->gain_error[input], "axis_%c_adc_gain_error", axis);
    board_put_truth(put, ctx, g->bias_radps, "axis_%c_gyro_bias_radps", axis);
    board_put_truth(put, ctx, g->scale, "axis_%c_gyro_scale", axis);
    board_put_truth(put, ctx, g->angle_rad, "axis_%c_gyro_angle_rad", axis);
    board_put_truth(put, ctx, g->rate_offset_radps, "axis_%c_rate_offset_radps", axis);
    board_put_truth(put, ctx, g->rate_scale, "axis_%c_rate_scale", axis);
}

static void truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct psd1 *b = (const struct psd1 *)board;
    put(ctx, "vref_error", b->vref_error);
    put(ctx, "vref_tc_per_k", b->vref_tc_per_k);
    put(ctx, "supply_v", b->supply_v);
    for (unsigned i = 0; i < 3; i++) put_axis(b, i, put, ctx);
    for (unsigned i = 0; i < 4; i++) board_put_truth(put, ctx, b->temp_offset_k[i], "temp_offset_%c_k", "xyzb"[i]);
}

/* ---- digest ---- */

static void add_adc(struct sha256 *s, const struct ad7712 *a)
{
    board_digest_u64(s, (uint64_t)a->control << 32 | a->word);
    for (unsigned i = 0; i < AD7712_CHANNELS; i++) board_digest_u64(s, (uint64_t)a->zero[i] << 32 | a->full[i]);
    board_digest_u64(s, (uint64_t)a->ready << 8 | (uint64_t)a->drdy << 1 | a->unread);
    board_digest_u64(s, (uint64_t)a->due.t_ns);
    board_digest_noise(s, &a->noise);
}

static void add_gyro(struct sha256 *s, const struct psd1_gyro *g)
{
    board_digest_real(s, g->angle_rad);
    board_digest_real(s, g->w_radps);
    board_digest_noise(s, &g->noise);
}

static void add_registers(struct sha256 *s, const struct psd1 *b)
{
    board_digest_u64(s, (uint64_t)b->uc1 << 32 | b->uc2);
    board_digest_u64(s, (uint64_t)b->staged << 24 | (uint64_t)b->last_command << 8 | (uint64_t)b->temp_channel << 4 |
                            b->service_channel);
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint64_t)b->zero[i] << 32 | b->full[i]);
    for (unsigned i = 0; i < 3; i++)
        board_digest_u64(s,
                         (uint64_t)b->latest.word[i] << 32 | (uint64_t)b->now.word[i] << 16 | (uint16_t)b->now.rate[i]);
}

static void digest(const struct board *board, struct sha256 *s)
{
    const struct psd1 *b = (const struct psd1 *)board;
    board_digest_u64(s, (uint64_t)b->phase << 32 | b->seq);
    board_digest_u64(s, (uint64_t)b->t0_ns);
    board_digest_u64(s, (uint64_t)b->due_ns);
    board_digest_u64(s, (uint64_t)b->dr_ns);
    board_digest_u64(s, (uint64_t)b->axis << 8 | (uint64_t)b->int0 << 3 | (uint64_t)b->fl1 << 2 |
                            (uint64_t)b->fl2 << 1 | b->taken);
    board_digest_u64(s, (uint64_t)(b->job.at != NULL) << 1 | b->job.waits);
    board_digest_u64(s, (uint64_t)b->bus.end_ns << 1 | b->bus.busy);
    add_registers(s, b);
    for (unsigned i = 0; i < 3; i++) add_adc(s, &b->adc[i]);
    for (unsigned i = 0; i < 3; i++) add_gyro(s, &b->gyros.axis[i]);
    board_digest_u64(s, (uint64_t)b->gyros.grid_ns << 1 | b->gyros.stale);
    sha256_add(s, &b->counters, sizeof b->counters);
}

static const char *const port_lines[] = {"RFX", "RFY", "RFZ", "SCLK", "SDAT", "FL2", "CS", NULL};

static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", PSD1_FAULT_FROZEN_WORDS},
    {NULL, 0},
};

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct psd1 *b = (struct psd1 *)board;
    for (unsigned i = 0; i < 3; i++) {
        at[i] = &b->adc[i].noise;
        at[3 + i] = &b->gyros.axis[i].noise;
    }
    return 6;
}

static const char *why_eager(struct board *board, int64_t t_ns)
{
    (void)board;
    (void)t_ns;
    return "skipping its read cycles is not built, and its gyros integrate step by step";
}

const struct board_type psd1_board = {
    BOARD_COMMON(psd1, PSD1),
    .title = "PSD-1",
    .profile_name = "psd1",
    .cfg_default = cfg_default,
    .node = 6,
    .period_ns = psd1_profile_period_ns,
    .frame_line = PSD1_LINE_RFX,
    .pulse_line = PSD1_LINE_SCLK,
    .pulses = pulses,
    .code_v = code_v,
    .range_v = range_v,
    .bus = &psd1_bus,
    .analog = true,
    .why_eager = why_eager,
    .noises = list_noises,
    .truth = truth,
};
