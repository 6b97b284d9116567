#include "board/gyro/board.h"

#include "board/digest.h"
#include "board/gyro/gyro.h"
#include "board/life.h"

#include <stdio.h>

/* ---- profile ---- */

static int64_t period_ns(const void *profile)
{
    return ((const struct gyro_profile *)profile)->step_ns;
}

static void about(const void *profile, char *out, size_t cap)
{
    const struct gyro_profile *p = profile;
    (void)snprintf(out, cap, "controller of a gyro-stabilised platform, %.4g steps a second, torquers up to %.4g deg/s",
                   1e9 / p->step_ns, p->torquer_limit_dps);
}

/* ---- what is on it ---- */

#define COUNT(field) BOARD_COUNTER(gyro_counters, field, field)

static const struct board_counter counters[] = {
    COUNT(steps),     COUNT(res),     COUNT(level_frames), COUNT(level_lost),     COUNT(level_silent),
    COUNT(saturated), COUNT(windows), COUNT(unsettled),    COUNT(encoder_faults), COUNT(refused)};

static const struct board_part parts[] = {
    {.name = "controller", .label = "board", .offset = offsetof(struct gyro, counters), BOARD_COUNTERS(counters)}};

/* ---- life ---- */

BOARD_LIFE(gyro);

static bool ready(const struct board *board)
{
    return ((const struct gyro *)board)->ready;
}

static const char *set_mode(struct board *board, unsigned mode, int64_t t_ns)
{
    return gyro_set_mode((struct gyro *)board, (enum gyro_mode)mode, t_ns);
}

/* ---- digest ---- */

static void add_reals(struct sha256 *s, const double *v, size_t n)
{
    for (size_t i = 0; i < n; i++) board_digest_real(s, v[i]);
}

static void add_run(struct sha256 *s, const struct gyro_run *r)
{
    const double real[] = {r->q_ref_rad,   r->turn.from_rad, r->turn.by_rad, r->turn.rate_radps, r->turn.accel_radps2,
                           r->turn.ramp_s, r->turn.total_s,  r->servo_radps, r->frozen_radps};
    board_digest_u64(s, (uint64_t)r->mode << 32 | (uint64_t)r->phase << 16 | (uint64_t)r->servoed << 1 | r->frozen);
    board_digest_u64(s, (uint64_t)r->position << 32 | r->positions);
    board_digest_u64(s, (uint64_t)r->phase_ns);
    board_digest_u64(s, (uint64_t)r->turn.from_ns);
    board_digest_u64(s, r->servo_steps);
    add_reals(s, real, sizeof real / sizeof *real);
}

static void add_checks(struct sha256 *s, const struct gyro *b)
{
    const struct gyro_watch *w = &b->watch;
    const struct gyro_nod *n = &b->nod;
    add_reals(s, (const double[]){w->turned_rad, w->from_rad, w->track_deg, w->still_rad, w->told_deg}, 5);
    add_reals(s, (const double[]){n->from_rad, n->top_rad, n->rate_radps}, 3);
    board_digest_u64(s, w->against);
    board_digest_u64(s, (uint64_t)w->level_ns);
    board_digest_u64(s, (uint64_t)w->still_ns);
    board_digest_u64(s, (uint64_t)w->told_ns);
    board_digest_u64(s, (uint64_t)n->way << 32 | (uint64_t)n->result << 16 | (uint64_t)n->nods << 8 | n->stayed);
    board_digest_u64(s, (uint64_t)n->begun_ns);
    board_digest_u64(s, (uint64_t)n->there_ns);
    for (unsigned i = 0; i < GYRO_FLAGS; i++) board_digest_u64(s, (uint64_t)b->past[i].begun << 32 | b->past[i].step);
}

static void add_inlet(struct sha256 *s, const struct gyro_inlet *in)
{
    board_digest_u64(s, (uint64_t)in->x_lsb);
    board_digest_u64(s, (uint64_t)in->y_lsb);
    board_digest_u64(s, (uint64_t)in->frames << 32 | (uint64_t)in->seq << 2 | (uint64_t)in->any << 1 | in->gap);
    board_digest_u64(s, (uint64_t)in->last_ns);
}

static void digest(const struct board *board, struct sha256 *s)
{
    const struct gyro *b = (const struct gyro *)board;
    board_digest_u64(s, (uint64_t)b->on << 2 | (uint64_t)b->ready << 1 | b->silent);
    board_digest_u64(s, (uint64_t)b->number << 32 | (uint64_t)b->standing << 8 | b->latest.flags);
    add_reals(s, (const double *)(const void *)&b->set, sizeof b->set / sizeof(double));
    add_inlet(s, &b->inlet);
    add_run(s, &b->run);
    add_checks(s, b);
    add_reals(s, (const double[]){b->level.sin_b, b->level.sin_g, b->servo_rad, b->check.turned_rad, b->check.from_rad},
              5);
    add_reals(s, (const double[]){b->u_radps[0], b->u_radps[1], b->latest.u1_radps, b->latest.encoder_rad}, 4);
    board_digest_u64(s, b->base.faults);
    board_digest_u64(s, b->check.steps);
    board_digest_u64(s, (uint64_t)b->calm_ns[0]);
    board_digest_u64(s, (uint64_t)b->calm_ns[1]);
    sha256_add(s, &b->counters, sizeof b->counters);
}

static const struct board_platform platform = {.set_mode = set_mode};
static const char *const port_lines[] = {"STEP", "READY", "SLEW", "SETTLE", "WINDOW", "FAULT", NULL};

static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", GYRO_FAULT_FROZEN_WORDS},
    {NULL, 0},
};
static const char *const capabilities[] = {"level", NULL};

static const char *why_eager(struct board *board, int64_t t_ns)
{
    (void)board;
    (void)t_ns;
    return "its loops go on from step to step";
}

const struct board_type gyro_board = {
    BOARD_COMMON(gyro, GYRO),
    .title = "Gyro unit",
    .profile_name = "gyro",
    .capabilities = capabilities,
    .node = 9,
    .period_ns = period_ns,
    .frame_line = GYRO_LINE_STEP,
    .pulse_line = GYRO_LINE_STEP,
    .platform = &platform,
    .why_eager = why_eager,
};
