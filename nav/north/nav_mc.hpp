/* What the Monte-Carlo models share: schedule, gain of first order, the errors of one run. */
#ifndef PSABENCH_NAV_MC_HPP
#define PSABENCH_NAV_MC_HPP

#include "nav/nav_mc.h"
#include "nav/north/nav_fit.hpp"
#include "nav/north/nav_random.hpp"

/* Middles and lengths of the windows, angles as increments; S, beta and gamma 0. The first window begins at t = 0. */
void mc_schedule(const struct nav_mc_cfg *cfg, struct nav_position *p);
/* Of nav_mc_samples(), and what the models of first order reject besides. */
int mc_refusal(const struct nav_mc_cfg *cfg, struct nav_refusal *why);
int mc_first_order_refusal(const struct nav_mc_cfg *cfg, struct nav_refusal *why);
double mc_samples_per_window(const struct nav_mc_cfg *cfg);

/* Standard deviation of the random drift at the start of the first window. */
double mc_gm_begin_sd_radps(const struct nav_mc_cfg *cfg);

/* Gain of first order about the truth. Free fit: weighted is the gain itself, normal and inverse are 1. On the circle the gain
 * hangs on alpha: weighted is rows' W, from which mc_solve() goes on. */
struct mc_linear {
    int count, unknowns;
    bool constrained;
    double we_radps, wz_radps;
    double weighted[FIT_MAX][NAV_MAX_POSITIONS]; /* of an error of S/We at each position */
    double normal[FIT_MAX][FIT_MAX];             /* weighted rows */
    double inverse[FIT_MAX][FIT_MAX];
    double cos_delta[NAV_MAX_POSITIONS], sin_delta[NAV_MAX_POSITIONS];
    struct nav_position p[NAV_MAX_POSITIONS];
};
int mc_linear_make(const struct nav_mc_cfg *cfg, struct mc_linear *lin);

/* Errors of alpha on the scale of the angles, of the drift in We, and the quality, from r = weighted error. */
struct mc_error {
    double alpha_rad, drift, quality;
};
struct mc_error mc_solve_on_circle(const struct mc_linear *lin, const double r[FIT_MAX], double cos_a, double sin_a);

inline struct mc_error mc_solve(const struct mc_linear *lin, const double r[FIT_MAX], double cos_a, double sin_a)
{
    if (lin->constrained) return mc_solve_on_circle(lin, r, cos_a, sin_a);
    return {cos_a * r[FIT_S] - sin_a * r[FIT_C], r[FIT_DRIFT], std::fabs(sin_a * r[FIT_S] + cos_a * r[FIT_C])};
}

/* A systematic error with the sign that this run drew. */
inline double mc_signed(const struct nav_mc_cfg *cfg, double value, struct random_stream *rnd)
{
    return cfg->random_sign ? value * rnd->sign() : value;
}

/* How many times the systematic error of the angle counts at position i. */
inline double mc_angle_share(const struct nav_mc_cfg *cfg, int i)
{
    switch (cfg->angle_sys) {
    case NAV_ANGLE_COMMON:
        return 1.0;
    case NAV_ANGLE_INCREMENT:
        return i > 0 ? 1.0 : 0.0;
    case NAV_ANGLE_ACCUMULATES:
        return i;
    default:
        return 0.0;
    }
}

inline double mc_tilt(const struct nav_mc_cfg *cfg, struct random_stream *rnd)
{
    return cfg->tilt == NAV_TILT_CORNERS ? cfg->tilt_rad * rnd->sign() : cfg->tilt_rad * (2.0 * rnd->uniform() - 1.0);
}

inline double mc_alpha1(const struct nav_mc_cfg *cfg, struct random_stream *rnd)
{
    return std::isnan(cfg->alpha1_rad) ? NAV_PI * (2.0 * rnd->uniform() - 1.0) : nav_wrap(cfg->alpha1_rad);
}

inline void mc_put(double *array, uint64_t k, double value)
{
    if (array) array[k] = value;
}

#endif
