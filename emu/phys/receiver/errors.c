#include "phys/receiver/errors.h"

#include "base/detmath.h"

#include <math.h>

#define NS_A_S     1e9
#define S_AN_HOUR  3600.0
#define UNIFORM(u) (((double)((u) >> 11) + 0.5) * 0x1p-53) /* (0, 1) */

/* Draws of a solution: so many numbers of each source belong to it. */
enum { NOISE_DRAWS = 6, SLOW_DRAWS = 6 };
enum event_draw {
    DRAW_OUTLIER,
    DRAW_OUTLIER_AZIMUTH,
    DRAW_JUMP,
    DRAW_JUMP_BY,
    DRAW_OUTAGE = 6,
    DRAW_OUTAGE_S,
    EVENT_DRAWS
};

void receiver_errors_init(struct receiver_errors *e, const struct receiver_errors_cfg *cfg, uint64_t seed,
                          uint32_t serial)
{
    *e = (struct receiver_errors){.cfg = *cfg,
                                  .noise = draws_of(seed, serial, "receiver.noise"),
                                  .slow = draws_of(seed, serial, "receiver.slow"),
                                  .event = draws_of(seed, serial, "receiver.event")};
    receiver_errors_restart(e);
}

/* Numbers go on from start to start: no draw is used twice. */
void receiver_errors_restart(struct receiver_errors *e)
{
    for (unsigned i = 0; i < SLOW_DRAWS; i++)
        e->slow_unit[i] = draws_gauss(&e->slow, e->number * SLOW_DRAWS + (int64_t)i);
    for (unsigned i = 0; i < 3; i++) e->jump_m[i] = 0.0;
    e->number++;
    e->outage_until_ns = INT64_MIN;
}

/* Gauss-Markov, stationary: x' = a x + sqrt(1 - a^2) n, a = exp(-T/tau). */
static void step_slow(struct receiver_errors *e)
{
    const double a = det_exp(fmax(-(double)e->cfg.period_ns / (e->cfg.slow_s * NS_A_S), -700.0));
    const double b = sqrt(1.0 - a * a);
    for (unsigned i = 0; i < SLOW_DRAWS; i++)
        e->slow_unit[i] = a * e->slow_unit[i] + b * draws_gauss(&e->slow, e->number * SLOW_DRAWS + (int64_t)i);
}

static double draw_event(const struct receiver_errors *e, enum event_draw draw)
{
    return UNIFORM(draws_u64(&e->event, e->number * EVENT_DRAWS + (int64_t)draw));
}

/* Whether what happens so often an hour happens between this solution and the one before. */
static bool event_happens(const struct receiver_errors *e, enum event_draw draw, double per_h)
{
    const double mean = per_h * (double)e->cfg.period_ns / (NS_A_S * S_AN_HOUR);
    return draw_event(e, draw) < 1.0 - det_exp(-mean);
}

static void step_jump(struct receiver_errors *e)
{
    if (!event_happens(e, DRAW_JUMP, e->cfg.jumps_per_h)) return;
    for (unsigned i = 0; i < 3; i++) {
        const int64_t n = e->number * EVENT_DRAWS + DRAW_JUMP_BY + (int64_t)i;
        e->jump_m[i] += e->cfg.jump_m * (i == 2 ? e->cfg.vertical_ratio : 1.0) * draws_gauss(&e->event, n);
    }
}

static void step_outage(struct receiver_errors *e, int64_t t_ns)
{
    if (!event_happens(e, DRAW_OUTAGE, e->cfg.outages_per_h)) return;
    const double last_s = -e->cfg.outage_s * det_log(draw_event(e, DRAW_OUTAGE_S));
    const int64_t until_ns = t_ns + (int64_t)(last_s * NS_A_S);
    if (until_ns > e->outage_until_ns) e->outage_until_ns = until_ns;
}

static void add_outlier(const struct receiver_errors *e, double by_m[3])
{
    if (!event_happens(e, DRAW_OUTLIER, e->cfg.outliers_per_h)) return;
    const struct det_pair azimuth = det_sin_cos(TURN_RAD * draw_event(e, DRAW_OUTLIER_AZIMUTH));
    by_m[0] += e->cfg.outlier_m * azimuth.sin;
    by_m[1] += e->cfg.outlier_m * azimuth.cos;
}

/* Errors of this solution; steps have been made. */
static void sum_errors(const struct receiver_errors *e, int64_t t_ns, double by_m[3], double by_mps[3])
{
    const struct receiver_errors_cfg *c = &e->cfg;
    for (unsigned i = 0; i < 3; i++) {
        const int64_t n = e->number * NOISE_DRAWS + (int64_t)i;
        const double ratio = i == 2 ? c->vertical_ratio : 1.0;
        by_m[i] = e->jump_m[i] + ratio * (c->white_m * draws_gauss(&e->noise, n) + c->slow_m * e->slow_unit[i]);
        by_mps[i] = ratio * (c->white_mps * draws_gauss(&e->noise, n + 3) + c->slow_mps * e->slow_unit[3 + i]);
    }
    add_outlier(e, by_m);
    for (unsigned i = 0; i < 2; i++) {
        const double since_s = (double)(t_ns - e->offset.from_ns) / NS_A_S;
        by_m[i] += e->offset.jump_m[i] + e->offset.base_m[i] + e->offset.rate_mps[i] * since_s;
        by_mps[i] += e->offset.rate_mps[i];
    }
}

static int64_t not_before_0(int64_t t_ns)
{
    return t_ns > 0 ? t_ns : 0;
}

void receiver_errors_solve(struct receiver_errors *e, place_at_fn *place_at, void *ctx, int64_t t_ns,
                           struct receiver_solution *out)
{
    double by_m[3], by_mps[3];
    struct place then;
    const int64_t position_ns = t_ns - e->cfg.position_delay_ns;
    step_slow(e);
    step_jump(e);
    step_outage(e, t_ns);
    sum_errors(e, t_ns, by_m, by_mps);
    e->number++;
    out->valid = t_ns >= e->outage_until_ns;
    if (!out->valid) return;
    place_at(ctx, not_before_0(position_ns), &out->place);
    place_at(ctx, not_before_0(position_ns - e->cfg.velocity_delay_ns), &then);
    for (unsigned i = 0; i < 3; i++) out->place.v_n_mps[i] = then.v_n_mps[i] + by_mps[i];
    place_displace(&out->place, by_m);
}

double receiver_errors_sd_m(const struct receiver_errors_cfg *c)
{
    return sqrt(c->white_m * c->white_m + c->slow_m * c->slow_m);
}

double receiver_errors_sd_mps(const struct receiver_errors_cfg *c)
{
    return sqrt(c->white_mps * c->white_mps + c->slow_mps * c->slow_mps);
}
