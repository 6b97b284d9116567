#include "board/bins/board.h"

#include "board/digest.h"
#include "board/life.h"

#include <stdio.h>

/* ---- profile ---- */

static void describe_profile(const void *profile, char *out, size_t cap)
{
    const struct bins_profile *p = profile;
    (void)snprintf(out, cap, "increments each %.4g ms of %u words, %.4g arcsec a count of the gyros",
                   (double)bins_period_ns(p) * 1e-6, p->words_per_reading, p->gyro_arcsec_per_count);
}

/* ---- what is on it ---- */

#define COUNT(field) BOARD_COUNTER(bins_counters, field, field)

static const struct board_counter counters[] = {COUNT(readings), COUNT(resets), COUNT(missed_words),
                                                COUNT(missed_latches), COUNT(saturated)};

static const struct board_part parts[] = {
    {.name = "computer", .label = "board", .offset = offsetof(struct bins, counters), BOARD_COUNTERS(counters)},
    PSA2_KPSA_PART(NULL, "kpsa"),
    PSA2_CHIP_PARTS};

static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", BINS_FAULT_FROZEN_WORDS},
    {NULL, 0},
};
static const char *const port_lines[] = {"TICK", "Int", "Data", "CLK", NULL};
static const char *const pair_port_lines[] = {"TICK", "Int", "Data", "CLK", "Int_B", "Data_B", "CLK_B", NULL};
static const char *const capabilities[] = {"adc_chain", "temp_adc_offset_v", "temp_adc_gain_error", "temp_noise_scale",
                                           NULL};

static unsigned clk_pulses(const struct board *board)
{
    return PSA2_WORDS * ((const struct psa2 *)board)->profile.word_bits;
}

/* ---- the accelerometers */

/* Of a sensor that feels a = -f on its own axes, x y z turned on by the channel (unit.h): volts for positive force. */
static void fit_accelerometer(const struct board *board, unsigned axis, double g_mps2, struct mems_g *m)
{
    const struct bins *b = (const struct bins *)board;
    const double v_per_mps2 = b->profile.accel_v_per_g / BINS_STANDARD_G_MPS2;
    double row[3];
    inertial_force_row(&b->errors, axis, row);
    m->u0_v = b->errors.df0_mps2[axis] * v_per_mps2;
    m->kx_v_per_g = -row[axis] * v_per_mps2 * g_mps2;
    m->ky_v_per_g = -row[(axis + 1) % 3] * v_per_mps2 * g_mps2;
    m->kz_v_per_g = -row[(axis + 2) % 3] * v_per_mps2 * g_mps2;
    m->noise_v_rthz =
        b->profile.accel_noise_mps2 * v_per_mps2 * 1.4142135623730951; /* one-sided: a mean of 1 s passes half */
    m->bias_instability_v = b->profile.accel_instability_mps2 * v_per_mps2;
}

/* ---- life ---- */

BOARD_LIFE(bins);

static bool is_ready(const struct board *board)
{
    const struct bins *b = (const struct bins *)board;
    return psa2_ready(&b->psa2) && b->sums.based;
}

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct bins *b = (struct bins *)board;
    for (unsigned i = 0; i < 3; i++) at[i] = &b->psa2.adc[i].noise;
    for (unsigned i = 0; i < 3; i++) at[3 + i] = &b->gyros.noise[i];
    for (unsigned i = 0; i < 3; i++) at[6 + i] = &b->gyros.slow[i].draws;
    return 9;
}

static void put_matrix(board_truth_fn *put, void *ctx, const char *name, const double m[3][3])
{
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) board_put_truth(put, ctx, m[i][j], "%s_%u%u", name, i + 1, j + 1);
}

static void put_truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct inertial_errors *e = &((const struct bins *)board)->errors;
    for (unsigned i = 0; i < 3; i++) board_put_truth(put, ctx, e->nu0_radps[i], "nu0_%u_radps", i + 1);
    for (unsigned i = 0; i < 3; i++) board_put_truth(put, ctx, e->df0_mps2[i], "df0_%u_mps2", i + 1);
    put_matrix(put, ctx, "theta", e->theta);
    put_matrix(put, ctx, "gamma", e->gamma);
    put_matrix(put, ctx, "g_drift_radps_per_mps2", e->g_drift_radps_per_mps2);
}

/* ---- digest ---- */

static void add_latch(struct sha256 *s, const struct bins_latch *l)
{
    board_digest_u64(s, l->last_word);
    board_digest_u64(s, (uint64_t)l->t_ns);
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint64_t)l->count[i]);
}

static void add_sums(struct sha256 *s, const struct bins_sums *m)
{
    board_digest_u64(s, (uint64_t)m->based << 2 | (uint64_t)m->incomplete << 1 | m->temp_new);
    board_digest_u64(s, (uint64_t)m->word << 32 | m->words);
    board_digest_u64(s, (uint64_t)m->word_ns);
    board_digest_u64(s, (uint64_t)m->next << 32 | m->status);
    board_digest_u64(s, (uint64_t)(m->ev.queued ? m->ev.due_ns : -1));
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint64_t)m->sum[i]);
    add_latch(s, &m->from);
    for (unsigned i = 0; i < m->count; i++) add_latch(s, &m->latch[(m->first + i) % BINS_LATCHES]);
}

/* Nothing of a gyro without one: digests of healthy units stay what they were. */
static void add_gyro_fault(struct sha256 *s, unsigned axis, const struct board_gyro_fault *f)
{
    const double value[] = {f->limit_radps, f->bias_radps, f->scale, f->lock_in_radps};
    bool any = f->stuck;
    for (unsigned i = 0; i < sizeof value / sizeof *value; i++) any |= value[i] != 0.0;
    if (!any) return;
    board_digest_u64(s, (uint64_t)axis << 1 | f->stuck);
    for (unsigned i = 0; i < sizeof value / sizeof *value; i++) board_digest_real(s, value[i]);
}

/* The same of what does not move. */
static void add_slow(struct sha256 *s, const struct noise *n)
{
    if (!n->moves) return;
    board_digest_u64(s, (uint64_t)n->step);
    for (unsigned i = 0; i < NOISE_MARKOVS; i++) board_digest_real(s, n->markov_u[i]);
    board_digest_noise(s, &n->draws);
}

static void add_gyros(struct sha256 *s, const struct bins_gyros *g)
{
    board_digest_u64(s, (uint64_t)g->t_ns);
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, g->angle_rad[i]);
    for (unsigned i = 0; i < 3; i++) board_digest_noise(s, &g->noise[i]);
    for (unsigned i = 0; i < 3; i++) add_gyro_fault(s, i, &g->fault[i]);
    for (unsigned i = 0; i < 3; i++) add_slow(s, &g->slow[i]);
}

static void add_latest(struct sha256 *s, const struct bins_reading *r)
{
    board_digest_u64(s, (uint64_t)r->seq << 32 | (uint64_t)r->words << 8 | r->flags);
    board_digest_u64(s, (uint64_t)r->t_ns);
    board_digest_u64(s, (uint32_t)r->baro_mm);
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint64_t)(uint32_t)r->gyro[i] << 32 | (uint32_t)r->accel[i]);
}

static void add_nav(struct sha256 *s, const struct bins_nav *n)
{
    board_digest_u64(s, (uint64_t)n->state << 32 | n->since);
    board_digest_u64(s, (uint64_t)n->t_ns);
    board_digest_u64(s, (uint64_t)n->shown_ns);
    const double value[] = {n->set.lat_rad, n->set.lon_rad, n->set.h_m,  n->set.alignment_s, n->time_s,
                            n->lat_rad,     n->lon_rad,     n->v_mps[0], n->v_mps[1],        n->q[0],
                            n->q[1],        n->q[2],        n->q[3]};
    for (unsigned i = 0; i < sizeof value / sizeof *value; i++) board_digest_real(s, value[i]);
    const bool changed = n->taken.h_m != n->set.h_m || n->taken.alignment_s != n->set.alignment_s;
    if (changed && n->state != BINS_NAV_OFF) { /* else the digest is what it was before `taken` was there */
        board_digest_real(s, n->taken.h_m);
        board_digest_real(s, n->taken.alignment_s);
    }
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, n->rate[i]);
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, n->force[i]);
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, n->a_before[i]);
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, n->v_before[i]);
    for (unsigned i = 0; i < 3; i++) board_digest_real(s, n->turned_rad[i]);
}

static void add_digest(const struct board *board, struct sha256 *s)
{
    const struct bins *b = (const struct bins *)board;
    psa2_digest(&b->psa2, s);
    board_digest_u64(s, b->psa2.base.faults);
    add_gyros(s, &b->gyros);
    add_sums(s, &b->sums);
    add_latest(s, &b->latest);
    add_nav(s, &b->nav);
    sha256_add(s, &b->counters, sizeof b->counters);
    for (unsigned i = 0; i < 4; i++) board_digest_u64(s, b->temp_code[i]);
}

const struct board_type bins_board = {
    .name = "bins",
    .size = sizeof(struct bins),
    .fields = &bins_fields,
    .profile_check = bins_profile_check,
    .about = describe_profile,
    .lines = bins_lines,
    .line_count = BINS_LINES,
    .port_lines = port_lines,
    .pairs = psa2_pairs,
    .pair_count = PSA2_PAIRS,
    .pair_port_lines = pair_port_lines,
    .events = bins_events,
    .event_count = BINS_EVENTS,
    .parts = parts,
    .part_count = sizeof parts / sizeof *parts,
    .controller_faults = controller_faults,
    .can = &bins_can,
    .gyros = &bins_gyros_faults,
    BOARD_LIFE_FUNCTIONS,
    .ready = is_ready,
    .digest = add_digest,
    .title = "BINS",
    .profile_name = "bins",
    .capabilities = capabilities,
    .node = 11,
    .period_ns = bins_period_ns,
    .frame_line = PSA2_LINE_INT,
    .pulse_line = PSA2_LINE_CLK,
    .pulses = clk_pulses,
    .accelerometer = fit_accelerometer,
    .noises = list_noises,
    .analog = true,
    .truth = put_truth,
};
