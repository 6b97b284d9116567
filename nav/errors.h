/* libpsabench-nav: errors of a navigating strapdown unit along its way (docs/procedures/sins_secondary.md).
 *
 * Frames as in strapdown.h: n east, north, up; b the unit's axes; C (C_nb). Convention as in sins.h: error = measured less true, and
 * measured is what the unit gives out, each in its own frame n, so that a difference of outputs is an error without more terms.
 *   dr: east, north, up, m: p dlon, M dlat, dh with p = (N + h) cos lat and M of nav_radii_m()
 *   dv: of the velocity's east, north, up coordinates          beta: Chat = (I + [beta x]) C
 *   w' = w + nu + Theta w + noise, f' = f + df + Gamma f + noise, constants in the gauge of sins.h
 * u rate of the Earth, rho transport rate, of which d- are the changes by dr and dv; vE, vN, vU velocities:
 *   drE' = dvE + vE (tan lat drN - drU)/(N + h) + (vU - vN tan lat) drE/(N + h)
 *   drN' = dvN + (vU drN - vN drU)/(M + h)                         drU' = dvU - k1 drU
 *   dv' = [v x](2 du + drho) - (2 u + rho) x dv + beta x C f + C (df + Gamma f) + dg - (0, 0, k2 drU)
 *   beta' = -(u + rho) x beta - du - drho + C (nu + Theta w)
 * Left out: changes of the radii within drho (1 % of it at most). Units: rad, s, m. Noise: standard deviation of a mean over 1 s.
 * Pure functions, no allocation. Rejections as in nav.h. */
#ifndef PSABENCH_NAV_ERRORS_H
#define PSABENCH_NAV_ERRORS_H

#include "nav/sins.h"
#include "nav/strapdown.h"

#ifdef __cplusplus
extern "C" {
#endif

enum nav_errors_block { /* in the order of the state; the first three move */
                        NAV_ERRORS_DR,
                        NAV_ERRORS_DV,
                        NAV_ERRORS_BETA,
                        NAV_ERRORS_NU,
                        NAV_ERRORS_THETA,
                        NAV_ERRORS_DF,
                        NAV_ERRORS_GAMMA,
                        NAV_ERRORS_BLOCKS,
};

struct nav_errors_cfg {
    int vertical; /* enum nav_vertical; NAV_VERTICAL_FIXED: dr and dv have two elements, and the unit has no vU */
    int gauge;    /* enum nav_sins_gauge */
    double damping_per_s, damping_per_s2; /* k1, k2 of a vertical channel that a height holds; 0: free */
    double gyro_noise_radps_rts, accel_noise_mps2_rts;
};

NAV_API int nav_errors_check(const struct nav_errors_cfg *cfg, struct nav_refusal *why);
/* Number of states; 28 with a fixed vertical and six Gamma. */
NAV_API int nav_errors_layout(const struct nav_errors_cfg *cfg, struct nav_sins_rows rows[NAV_ERRORS_BLOCKS]);

/* Of one step of dt_s from `at`: phi (moving x n) and q (moving x moving) for nav_kf_predict(). w_b: mean rate in inertial space,
 * f_b: mean specific force, in b. Rates may turn b by up to 0.5 rad in a step; place, velocity and force in n count as constant. */
NAV_API int nav_errors_step(const struct nav_errors_cfg *cfg, const struct nav_state *at, const double w_b[3],
                            const double f_b[3], double dt_s, double *phi, double *q);

/* count steps through a filter of this layout: `at` is the state at the start of each, w_b and f_b are rows of three. Stops at
 * the first that is rejected; *done (not NULL) is their number. */
NAV_API int nav_errors_predict(const struct nav_errors_cfg *cfg, nav_kf *kf, const struct nav_state *at,
                               const double *w_b, const double *f_b, int64_t count, double dt_s, int64_t *done);

/* beta after a levelling and gyrocompassing at rest, as far as the sensors' constant errors cause it (3 x n over the columns nu to
 * gamma, 0 elsewhere): Chat f' is vertical and the east component of Chat w' is 0. */
NAV_API int nav_errors_alignment(const struct nav_errors_cfg *cfg, const struct nav_state *at, double *beta_rows);

#ifdef __cplusplus
}
#endif

#endif
