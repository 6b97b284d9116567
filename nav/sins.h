/* libpsabench-nav: calibration of a strapdown inertial unit on a rate table (docs/procedures/sins.md; the Moscow State University method).
 *
 * Frames: n east, north, up at the table; b of the instrument; C (C_nb) takes coordinates in b to n. Convention: error = measured
 * less true. w absolute rate, f specific force, both in b; g_n = (0, 0, g), u the Earth's rate in n.
 *   w' = w + nu + Theta w + noise              f' = f + df + Gamma f + q f^2 + L r + delay (w x f) + noise (1)
 *   Chat = (I + [beta x]) C, integrated from w':  d beta/dt = -u x beta + C (nu + Theta w + noise)         (2)
 *   z_a = mean over a step of Chat f', less g_n = beta x g_n + C (f' - f of (1))                          (3)
 *   stand: C_st(t) = exp(eps) C(t + tau) exp(delta);  z_s = beta - eps - C (delta + w_rel tau) + noise      (4)
 * L r: accelerometer i at r_i also sees [w x (w x r_i) + dw/dt x r_i]_i. q f^2: element by element. delay: the accelerometers are
 * later than the gyros by it, f'(t) = f(t - delay), for a force constant in n and w relative to n. Only three of a turn of the instrument frame and nine
 * Gamma, nine Theta are not observable by (1) to (3): the gauge says which Gamma are zero.
 * Apply a result: w = (I + Theta)^-1 (w' - nu), f = (I + Gamma)^-1 (f' - df - q f^2), by columns as printed, Theta row-major.
 * Units: rad, s, m, rad/s, m/s^2. Noise is a spectral density: standard deviation of a mean over one second.
 * No allocation: the caller owns the memory of an estimator, which one thread uses. Rejections as in nav.h. */
#ifndef PSABENCH_NAV_SINS_H
#define PSABENCH_NAV_SINS_H

#include "nav/kf.h"

#ifdef __cplusplus
extern "C" {
#endif

enum nav_sins_gauge {
    NAV_SINS_ARTICLE, /* Gamma 11 21 22 23 31 33: z1 along accelerometer 1, accelerometer 3 in the plane (z1, z3) */
    NAV_SINS_LOWER,   /* Gamma 11 21 22 31 32 33: z1 along accelerometer 1, accelerometer 2 in the plane (z1, z2) */
    NAV_SINS_FREE9,   /* all nine: three combinations keep their prior without the stand */
};

enum nav_sins_block { /* in the order of the state; the first two move */
                      NAV_SINS_BETA,
                      NAV_SINS_WALK, /* decaying random part of nu */
                      NAV_SINS_NU,
                      NAV_SINS_THETA,
                      NAV_SINS_DF,
                      NAV_SINS_GAMMA,
                      NAV_SINS_LEVER,
                      NAV_SINS_QUAD,
                      NAV_SINS_DELAY,
                      NAV_SINS_DELTA,
                      NAV_SINS_TAU,
                      NAV_SINS_EPS,
                      NAV_SINS_BETA0, /* beta at the start: what a second pass begins with */
                      NAV_SINS_BLOCKS,
};

struct nav_sins_cfg {
    double latitude_rad, gravity_mps2;
    double sample_s, step_s; /* of increments and of the filter; a step is a whole number of samples, 64 at most */
    int form;                /* enum nav_kf_form */
    int gauge;               /* enum nav_sins_gauge */
    int lever;               /* 0: none, 3: r_ii alone, 9: r of each accelerometer */
    int stand;               /* 1: angles of the table, with delta and tau */
    int base;                /* 1: the table's base is turned by eps; needs stand */
    int walk;                /* 1: drifts have a decaying random part */
    int clone;               /* 1: beta at the start is estimated, too */
    double beta_sd_rad[3];   /* standard deviations of the prior; 0: known */
    double nu_sd_radps;
    double theta_scale_sd, theta_angle_sd_rad; /* Theta_ii, Theta_ij */
    double df_sd_mps2;
    double gamma_scale_sd, gamma_angle_sd_rad;
    double lever_sd_m;
    double quad_sd_s2pm, delay_sd_s; /* 0: known, and not in the state */
    double delta_sd_rad, tau_sd_s, eps_sd_rad;
    double walk_sd_radps, walk_tau_s; /* stationary */
    double gyro_noise_radps_rts;      /* 1 s means */
    double accel_noise_mps2_rts;
    double accel_noise_multiplier; /* 1; 4 is what the article's tables follow from */
    double stand_sd_rad;           /* of one sample at stand_noise_rate_hz: density sd / sqrt(rate) */
    double stand_noise_rate_hz;    /* 1 or 50: the two readings of the article's 15" */
    double stand_interval_s;       /* between the samples that are given */
    double stand_guard_s;          /* a sample this near a change of rate is left out: tau is not known yet */
};
NAV_API void
nav_sins_default(struct nav_sins_cfg *cfg); /* the article's, without the stand; sample 0.01 s, step 0.1 s */
NAV_API int nav_sins_check(const struct nav_sins_cfg *cfg, struct nav_refusal *why);

struct nav_sins_rows {
    int offset, size; /* size 0: the block is not in the state */
};
NAV_API int nav_sins_layout(const struct nav_sins_cfg *cfg, struct nav_sins_rows rows[NAV_SINS_BLOCKS]); /* states */
NAV_API const char *nav_sins_block_name(int block);
/* Prior covariance (n x n), clone included. */
NAV_API int nav_sins_prior(const struct nav_sins_cfg *cfg, double *p);

struct nav_sins_params { /* what the model holds; in this order in memory: 43 doubles */
    double nu_radps[3];
    double theta[9]; /* row-major */
    double df_mps2[3];
    double gamma[9];
    double lever_m[9]; /* r of accelerometer 1, 2, 3 */
    double quadratic_s2pm[3];
    double delay_s;
    double delta_rad[3];
    double tau_s;
    double eps_rad[3];
};
/* The same instrument in the frame in which the gauge's elements are zero: I + Gamma -> (I + Gamma) R',
 * I + Theta -> (I + Theta) R', C -> C R', exp(delta) -> R exp(delta); lever arms, q and delay are left. r_out: R, or NULL. Compare estimates with a truth only so. */
NAV_API int nav_sins_to_gauge(int gauge, struct nav_sins_params *p, double r_out[9]);

typedef struct nav_sins nav_sins;
NAV_API size_t nav_sins_bytes(void);
/* c_nb: attitude at the start as far as it is known, row-major, a rotation to 1e-6. feedback 1: what is found goes into the
 * model after each step (a first pass); 0: the model stays (covariances, a second pass). */
NAV_API int nav_sins_start(void *memory, size_t bytes, const struct nav_sins_cfg *cfg, const double c_nb[9],
                           int feedback, nav_sins **out);

/* Before the first increments: about this model instead of zeros, as a coarse calibration gives it. The prior stays about zero. */
NAV_API int nav_sins_about(nav_sins *s, const struct nav_sins_params *model);

/* A table's angles at stand time t_s, as the rotation C_st. Before the increments that follow it by more than stand_guard_s;
 * 256 can wait. */
NAV_API int nav_sins_stand(nav_sins *s, double t_s, const double c_st[9]);
/* count increments (rad, m/s), rows of three, the first one over t_s to t_s + sample_s. NAV_TIMES: t_s is not the end of those before,
 * within half a sample: time runs backwards or there is a gap. */
NAV_API int nav_sins_samples(nav_sins *s, double t_s, const double *dtheta_rad, const double *dv_mps, int count);

/* Turn at a constant rate about an axis of b; remount 1: done in no time, and beta is known as in the prior again. */
struct nav_sins_turn {
    double axis_b[3]; /* unit */
    double rate_radps, duration_s;
    int remount;
};
/* Covariance without data: increments, and angles of the stand each step, of an ideal unit on this plan. */
NAV_API int nav_sins_plan(nav_sins *s, const struct nav_sins_turn *turns, int count);

/* From the start again, about what was found, with the prior's own mean and covariance, without feedback: the second pass.
 * Needs clone. The caller then gives the same data. */
NAV_API int nav_sins_again(nav_sins *s);

struct nav_sins_state {
    double t_s;                    /* of x and P: the middle of the last step */
    struct nav_sins_params params; /* model with x */
    double c_nb[9], c0_nb[9];      /* attitude at the end of the last sample, at the start: beta0 */
    double nis_accel, nis_stand;   /* sums of value^2/variance over count scalars */
    int64_t count_accel, count_stand;
    int64_t stand_left_out;           /* samples of the stand near changes of rate */
    struct nav_kf_innovation last[6]; /* of the last step: 3 of the accelerometers, 3 of the stand (variance 0: none) */
};
NAV_API int nav_sins_get(const nav_sins *s, struct nav_sins_state *state);
NAV_API int nav_sins_covariance(const nav_sins *s, double *x, double *p); /* n, n x n; x counts from the model */
/* Of the last step, for tests and own filters: phi (moving x n) and q of (2), h (6 x n): rows of (3), and of (4) for the last angle of
 * the stand that was taken. Each may be NULL. */
NAV_API int nav_sins_jacobians(const nav_sins *s, double *phi, double *q, double *h);

#ifdef __cplusplus
}
#endif

#endif
