#include "board/psa2/board.h"

#include "board/digest.h"
#include "board/life.h"
#include "board/psa2/inside.h"
#include "board/psa2/internal.h"

#include <stdio.h>
#include <string.h>

/* ---- profile ---- */

static void about(const void *profile, char *out, size_t cap)
{
    const struct psa2_profile *p = profile;
    (void)snprintf(out, cap, "%s, %u bit words, CLK %.6g MHz, INT low %.3f us, a frame every %.3f us",
                   p->adc_is_1281 ? "ADS1281" : "ADS1282", p->word_bits, (double)p->line_hz / p->line_div * 1e-6,
                   (double)psa2_int_low_ns(p) * 1e-3, (double)psa2_profile_period_ns(p) * 1e-3);
}

/* ---- what is on it ---- */

#define OF          BOARD_COUNTER
#define ADC(field)  OF(ads1282, field, count.field)
#define TADC(field) OF(ads1256, field, n.field)
#define KPSA(field) OF(psa2_counters, field, field)

// clang-format off
const struct board_counter psa2_kpsa_counters[PSA2_KPSA_COUNTERS] = {
    KPSA(frames), KPSA(resets), KPSA(requests), KPSA(timeouts), KPSA(overruns), KPSA(int_late),
};
const struct board_counter psa2_adc_counters[PSA2_ADC_COUNTERS] = {
    ADC(conversions), ADC(overruns), ADC(torn_reads), ADC(late_reads), ADC(bad_opcodes), ADC(refused), ADC(gap_violations),
    ADC(restarts), ADC(clipped), ADC(range_exceeded), ADC(realigned), ADC(calibrations),
    OF(ads1282, bad_register, regs.bad_access), OF(ads1282, unmodelled_bit, regs.unimp_access), OF(ads1282, read_only_write, regs.ro_write),
};
const struct board_counter psa2_temp_counters[PSA2_TEMP_COUNTERS] = {
    TADC(conversions), TADC(overruns), TADC(torn_reads), TADC(window_reads), TADC(clipped), TADC(buffer_clipped),
    TADC(range_exceeded), TADC(bad_mux), TADC(calibrations), TADC(cal_clamped), TADC(restarts), TADC(power_downs),
    TADC(bad_opcodes), TADC(refused), TADC(bad_drate), TADC(gap_violations), TADC(dropped),
    OF(ads1256, bad_register, regs.bad_access), OF(ads1256, unmodelled_bit, regs.unimp_access), OF(ads1256, read_only_write, regs.ro_write),
};
// clang-format on

/* Which converter a part is, in whatever table of parts it is. */
static struct ads1282 *adc_of(struct board *board, unsigned part)
{
    return (struct ads1282 *)(void *)((char *)board + board->type->parts[part].offset);
}

void psa2_adc_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    ads1282_fault(adc_of(board, part), f, t_ns);
}

void psa2_temp_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns)
{
    (void)part;
    ads1256_fault(&((struct psa2 *)board)->tadc, f, t_ns);
}

/* Registers without power hold nothing. */
bool psa2_adc_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    return ((struct psa2 *)board)->mode != PSA2_OFF && reg_flip(&adc_of(board, part)->regs, reg, mask, t_ns);
}

bool psa2_temp_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns)
{
    struct psa2 *b = (struct psa2 *)board;
    (void)part;
    return b->mode != PSA2_OFF && reg_flip(&b->tadc.regs, reg, mask, t_ns);
}

static const struct board_part parts[] = {PSA2_KPSA_PART("kpsa", "board"), PSA2_CHIP_PARTS};

static unsigned pulses(const struct board *board)
{
    return PSA2_WORDS * ((const struct psa2 *)board)->profile.word_bits;
}

/* ---- life ---- */

BOARD_LIFE(psa2);

static bool ready(const struct board *board)
{
    return psa2_ready((const struct psa2 *)board);
}

static const char *why_eager(struct board *board, int64_t t_ns)
{
    return psa2_why_eager((struct psa2 *)board, t_ns);
}

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct psa2 *b = (struct psa2 *)board;
    for (unsigned i = 0; i < 3; i++) at[i] = &b->adc[i].noise;
    at[3] = &b->tadc.noise;
    return 4;
}

static void truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct board_cfg *c = &board->cfg;
    put(ctx, "temp_noise_scale", c->temp_noise_scale);
    put(ctx, "temp_adc_offset_v", c->temp_adc_offset_v);
    put(ctx, "temp_adc_gain_error", c->temp_adc_gain_error);
}

/* ---- digest ---- */

static void add_ads1282(struct sha256 *s, const struct ads1282 *a)
{
    sha256_add(s, a->reg_value, sizeof a->reg_value);
    board_digest_noise(s, &a->noise);
    board_digest_u64(s, (uint64_t)a->period);
    board_digest_u64(s, (uint64_t)a->index);
    board_digest_u64(s, (uint64_t)a->last_lsb);
    board_digest_u64(s, a->out);
}

static void add_ads1256(struct sha256 *s, const struct ads1256 *a)
{
    sha256_add(s, a->value, sizeof a->value);
    board_digest_noise(s, &a->noise);
    board_digest_u64(s, (uint64_t)a->cell);
    board_digest_u64(s, (uint64_t)a->ready);
    board_digest_u64(s, (uint64_t)a->word);
}

void psa2_digest(const struct psa2 *b, struct sha256 *s)
{
    const struct psa2_counters *c = &b->counters;
    board_digest_u64(s, (uint64_t)b->mode << 32 | b->seq);
    board_digest_u64(s, (uint64_t)b->drd_a_ns);
    board_digest_u64(s, (uint64_t)c->frames << 32 | c->resets);
    board_digest_u64(s, (uint64_t)c->requests << 32 | c->timeouts);
    board_digest_u64(s, (uint64_t)c->overruns << 32 | c->int_late);
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint64_t)b->latest.code[i]);
    for (unsigned i = 0; i < 3; i++) add_ads1282(s, &b->adc[i]);
    add_ads1256(s, &b->tadc);
}

static const char *const temps[] = {"x", "y", "z", "board", NULL};

static unsigned temp_count(const struct board *board)
{
    const unsigned scanned = ((const struct psa2 *)board)->profile.temp_channels,
                   there = sizeof temps / sizeof *temps - 1;
    return scanned < there ? scanned : there;
}

static void open_temps(struct board *board, uint32_t open)
{
    ((struct psa2 *)board)->open_temps = open;
}

static void digest(const struct board *board, struct sha256 *s)
{
    psa2_digest((const struct psa2 *)board, s);
}

static const char *const port_lines[] = {"Int", "Data", "CLK", NULL};
static const char *const pair_port_lines[] = {"Int", "Data", "CLK", "Int_B", "Data_B", "CLK_B", NULL};

static const struct board_controller_fault controller_faults[] = {
    {"controller.skip_sync_t", PSA2_FAULT_SKIP_SYNC_T},
    {"controller.setup_order", PSA2_FAULT_SETUP_ORDER},
    {"controller.frozen_words", PSA2_FAULT_FROZEN_WORDS},
    {NULL, 0},
};
static const char *const capabilities[] = {"adc_chain", "temp_adc_offset_v", "temp_adc_gain_error", "temp_noise_scale",
                                           NULL};

const struct board_type psa2_board = {
    BOARD_COMMON(psa2, PSA2),
    .title = "PSA-2",
    .profile_name = "article",
    .capabilities = capabilities,
    .node = 5,
    .frame_forms = 4,
    .period_ns = psa2_profile_period_ns,
    .pairs = psa2_pairs,
    .pair_count = PSA2_PAIRS,
    .pair_port_lines = pair_port_lines,
    .frame_line = PSA2_LINE_INT,
    .pulse_line = PSA2_LINE_CLK,
    .pulses = pulses,
    .temps = temps,
    .temp_count = temp_count,
    .open_temps = open_temps,
    .analog = true,
    .why_eager = why_eager,
    .noises = list_noises,
    .truth = truth,
};
