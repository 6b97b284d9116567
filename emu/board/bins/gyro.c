/* Three counting gyros: a phase counter sees the integral of the rate, whatever is read when. */
#include "board/bins/bins.h"

#include "base/detmath.h"

#include <math.h>

#define PANEL_NS                                                                                                       \
    INT64_C(10000000) /* of the quadrature, and step of the noise: whole ones since power-on of the bench */
#define NS_PER_SECOND  1e9
#define GAUSS_FROM_END 0.21132486540518713 /* (1 - 1/sqrt 3)/2: nodes of Gauss-Legendre with two points */

/* Adler's equation of a laser gyro without dither: the mean rate of beats is sqrt(w^2 - lock-in^2), and 0 within. */
static double locked_rad(double angle_rad, double lock_in_radps, double dt_s)
{
    const double dead_rad = lock_in_radps * dt_s;
    if (dead_rad <= 0.0) return angle_rad;
    if (fabs(angle_rad) <= dead_rad) return 0.0;
    return copysign(sqrt(angle_rad * angle_rad - dead_rad * dead_rad), angle_rad);
}

/* What a gyro with a fault counts in an interval in which a healthy one turns by angle_rad. */
static double counted_rad(struct bins_gyros *g, unsigned axis, double angle_rad, double lock_in_radps, double dt_s)
{
    const struct board_gyro_fault *f = &g->fault[axis];
    const double shown_rad = (angle_rad + f->bias_radps * dt_s) * (1.0 + f->scale);
    const double beats_rad = locked_rad(shown_rad, lock_in_radps + f->lock_in_radps, dt_s);
    const double most_rad = f->limit_radps * dt_s;
    g->limited[axis] = most_rad > 0.0 && fabs(beats_rad) > most_rad;
    if (f->stuck) return 0.0;
    return g->limited[axis] ? copysign(most_rad, beats_rad) : beats_rad;
}

static void add_measured(const struct bins *b, int64_t t_ns, double weight_s, double angle_rad[3])
{
    double f_mps2[3], w_radps[3], measured_radps[3];
    b->psa2.base.io.kinematics(b->psa2.base.io.ctx, t_ns, f_mps2, w_radps);
    inertial_rate_radps(&b->errors, w_radps, f_mps2, measured_radps);
    for (unsigned i = 0; i < 3; i++) angle_rad[i] += weight_s * measured_radps[i];
}

/* Over an interval in which rate and force are smooth: two nodes are exact for constants and ramps, 1e-16 rad beside for a turn
 * of 10 deg/s across another rate. */
static void integrate_smooth(struct bins *b, int64_t to_ns)
{
    struct bins_gyros *g = &b->gyros;
    const int64_t span_ns = to_ns - g->t_ns, off_ns = (int64_t)((double)span_ns * GAUSS_FROM_END + 0.5);
    const double dt_s = (double)span_ns / NS_PER_SECOND;
    double angle_rad[3] = {0.0, 0.0, 0.0};
    add_measured(b, g->t_ns + off_ns, 0.5 * dt_s, angle_rad);
    add_measured(b, to_ns - off_ns, 0.5 * dt_s, angle_rad);
    const double lock_in_radps = b->profile.gyro_lock_in_degph * RAD_PER_DEG / 3600.0;
    for (unsigned i = 0; i < 3; i++) angle_rad[i] += dt_s * noise_slow_u(&g->slow[i], g->t_ns);
    for (unsigned i = 0; i < 3; i++) g->angle_rad[i] += counted_rad(g, i, angle_rad[i], lock_in_radps, dt_s);
    g->t_ns = to_ns;
}

/* A draw for each whole step, by its number: the walk does not depend on who reads. A counter that stands still or is at its
 * limit does not show it. */
static void walk_step(struct bins_gyros *g)
{
    if (g->walk_rad <= 0.0) return;
    for (unsigned i = 0; i < 3; i++)
        if (!g->fault[i].stuck && !g->limited[i])
            g->angle_rad[i] += g->walk_rad * draws_gauss(&g->noise[i], g->t_ns / PANEL_NS);
}

static int64_t earlier_of(int64_t a_ns, int64_t b_ns)
{
    return a_ns < b_ns ? a_ns : b_ns;
}

void bins_gyro_until(struct bins *b, int64_t t_ns)
{
    struct bins_gyros *g = &b->gyros;
    if (g->t_ns < 0) return;
    while (g->t_ns < t_ns) {
        const int64_t step_ns = (g->t_ns / PANEL_NS + 1) * PANEL_NS;
        const int64_t smooth_ns = b->psa2.base.io.smooth_ns(b->psa2.base.io.ctx, g->t_ns);
        integrate_smooth(b, earlier_of(earlier_of(step_ns, smooth_ns), t_ns));
        if (g->t_ns == step_ns) walk_step(g);
    }
}

void bins_gyro_counts(struct bins *b, int64_t t_ns, int64_t count[3])
{
    const double count_rad = b->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC;
    bins_gyro_until(b, t_ns);
    for (unsigned i = 0; i < 3; i++) count[i] = (int64_t)floor(b->gyros.angle_rad[i] / count_rad);
}

/* The angle up to now was counted as before. */
static void set_fault(struct board *board, unsigned axis, const struct board_gyro_fault *f, int64_t t_ns)
{
    struct bins *b = (struct bins *)board;
    bins_gyro_until(b, t_ns);
    b->gyros.fault[axis] = *f;
}

const struct board_gyros bins_gyros_faults = {.set_fault = set_fault};

/* The lab does not remember for long: it is asked also where no frame paces the computer. */
static void keep_up(void *ctx, int64_t t_ns)
{
    struct bins *b = ctx;
    bins_gyro_until(b, t_ns);
    sched_at(b->psa2.base.sched, &b->gyros.ev, (t_ns / PANEL_NS + 1) * PANEL_NS);
}

void bins_gyro_init(struct bins *b)
{
    static const char *const noise[] = {"bins.gyro.x", "bins.gyro.y", "bins.gyro.z"}, *const slow[] = {
                                                                                          "bins.gyro.slow.x",
                                                                                          "bins.gyro.slow.y",
                                                                                          "bins.gyro.slow.z"};
    struct bins_gyros *g = &b->gyros;
    g->t_ns = -1;
    g->walk_rad = b->profile.gyro_noise_degph * RAD_PER_DEG / 3600.0 * sqrt((double)PANEL_NS / NS_PER_SECOND);
    const struct noise_cfg cfg = {.bias_instability_u = b->profile.gyro_instability_degph * RAD_PER_DEG / 3600.0};
    for (unsigned i = 0; i < 3; i++) g->noise[i] = board_draws(&b->psa2.base, noise[i]);
    for (unsigned i = 0; i < 3; i++) noise_init(&g->slow[i], &cfg, board_draws(&b->psa2.base, slow[i]));
    sched_ev_inner(&g->ev, keep_up, b);
}

void bins_gyro_power(struct bins *b, bool on, int64_t t_ns)
{
    struct bins_gyros *g = &b->gyros;
    for (unsigned i = 0; i < 3; i++) g->angle_rad[i] = 0.0;
    g->t_ns = on ? t_ns : -1;
    if (on) sched_at(b->psa2.base.sched, &g->ev, (t_ns / PANEL_NS + 1) * PANEL_NS);
    else sched_cancel(b->psa2.base.sched, &g->ev);
}
