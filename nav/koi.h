/* libpsabench-nav: integration of a strapdown unit with a satellite receiver, КОИ (sources 5.11: the article on БИНС-СП-1 and -2).
 *
 * An autonomous solution, which only increments and the barometer move, goes on beside a Kalman filter of its errors; the hybrid
 * solution is the autonomous one less the estimates. Frames as in strapdown.h: 1 east, 2 north, 3 up; b the unit's axes. Error = measured
 * less true. State, in this order; the first blocks move:
 *   dr1 dr2 | dV1 dV2 | alpha1 alpha2 | beta3 | dr3 dV3 | baro | slow_r x3 | slow_v x3 | nu0 x3 | Df0 x3 | Gamma | Theta x9 row-major
 *   | Dt1 Dt2
 * 32 without baro and slow ones and with six Gamma, 35 with nine. Ours, E0: baro, the error of the barometric height (random walk);
 * slow_r, slow_v, coloured errors of the receiver (Gauss-Markov of first order, slow_s), in the state where a standard deviation is set.
 * By dr, dv, beta of errors.h, t = tan(lat)/(N + h), V the autonomous velocity:
 *   dV1 = dvE + betaU V2    dV2 = dvN - betaU V1    alpha1 = betaE    alpha2 = betaN    beta3 = betaU + t drE    dV3 = dvU
 * dV is the dynamic part of the velocity's error: that of a turned heading is left out. Equations: Phi = T(end) Phi_errors T(begin)^-1,
 * with Phi_errors of errors.h and T above; on a sphere at constant height they are the article's:
 *   dr1' = O3 dr2 + dV1 - beta3 V2                                      dr2' = -O3 dr1 + dV2 + beta3 V1
 *   dV1' = g alpha2 + w3 dV2 + V2 beta3' + Df1 + (f3 - g) beta2          alpha1' = o3 alpha2 - u2 beta3 + u3 dr1/R + dV2/R + nu1
 *   dV2' = -g alpha1 - w3 dV1 - V1 beta3' + Df2 - (f3 - g) beta1         alpha2' = -o3 alpha1 + u1 beta3 + u3 dr2/R - dV1/R + nu2
 *   beta3' = o2 (alpha1 - dr2/R) - o1 (alpha2 + dr1/R) + nu3,  O transport rate, u Earth's, o = O + u, w = 2 u + O
 * Measurements, less slow_r or slow_v of the kind: z_r = dr + V Dt1, z_V1 = dV1 - beta3 V2 + t dr1 V2 + a1 (Dt1 + Dt2),
 * z_V2 = dV2 + beta3 V1 - t dr1 V1 + a2 (Dt1 + Dt2), zero velocity (the same without Dt), z_h = dr3 - baro.
 * Innovations are of the whole hybrid solution, so that kilometres do no harm.
 * Vertical channel (E0): each accepted barometric height moves the autonomous one, h by -k1 T (h - h_b) and vU by -k2 T (h - h_b), T
 * since the one before; dr3 and dV3 move by as much, which is known. Without barometer it diverges, e-fold in 9.5 min.
 * Position and velocity are the antenna's: antenna_m from the unit, l. C l and C (w x l), w of the last increment, are taken off,
 * and beta turns them in H; left out is the Earth's part of w, 0.3 mm/s for 3 m. Stops and heights are the unit's.
 * Reopening (E0): measurements of a kind that are outliers or gated, 10 or more for reopen_s without one that is taken, whose innovations
 * agree with the first of them (gate, both noises, and 0.5 m/s or 0.03 m/s^2 for what a wrong filter moves), are believed: standard
 * deviations of what the kind sees (place; or velocity and attitude; or height) are multiplied by the least power of two by which the
 * normalised innovation squared is no more than its degrees of freedom, up to 1 deg of level and 6 deg of azimuth.
 * Not modelled: more than one receiver. Units: rad, s, m, m/s, m/s^2.
 * No allocation: the caller owns the memory, one filter for one thread. Rejections as in nav.h. */
#ifndef PSABENCH_NAV_KOI_H
#define PSABENCH_NAV_KOI_H

#include "nav/sins.h"
#include "nav/strapdown.h"

#ifdef __cplusplus
extern "C" {
#endif

enum nav_koi_block { /* in the order of the state */
                     NAV_KOI_DR,
                     NAV_KOI_DV,
                     NAV_KOI_ALPHA,
                     NAV_KOI_BETA3,
                     NAV_KOI_VERTICAL,
                     NAV_KOI_BARO,
                     NAV_KOI_SLOW_R,
                     NAV_KOI_SLOW_V,
                     NAV_KOI_NU,
                     NAV_KOI_DF,
                     NAV_KOI_GAMMA,
                     NAV_KOI_THETA,
                     NAV_KOI_DT,
                     NAV_KOI_BLOCKS
};

/* Prior and noise of a unit, E0. */
enum nav_koi_class { NAV_KOI_GOOD, NAV_KOI_BINS, NAV_KOI_CLASSES };

enum nav_koi_kind {                   /* of a measurement, with its value */
                    NAV_KOI_POSITION, /* latitude, longitude, height; sd in m east, north, up */
                    NAV_KOI_VELOCITY, /* east, north, up */
                    NAV_KOI_STOP,     /* zero velocity; value is not read */
                    NAV_KOI_HEIGHT,   /* barometric, value[0], sd[0] */
                    NAV_KOI_KINDS,
};

enum nav_koi_reason { /* the first one that holds */
                      NAV_KOI_ACCEPTED,
                      NAV_KOI_INVALID,    /* its own status says so */
                      NAV_KOI_NOT_FINITE, /* a number is not finite */
                      NAV_KOI_UNFIT,      /* latitude beyond 89.9 deg, negative standard deviation */
                      NAV_KOI_BACKWARDS,  /* not later than the one before of its kind */
                      NAV_KOI_STALE,      /* older than max_age_s */
                      NAV_KOI_EARLY,      /* later than the last increment */
                      NAV_KOI_OUTLIER,    /* normalised innovation squared above outlier_nis */
                      NAV_KOI_GATED,      /* above gate_nis */
                      NAV_KOI_REJECTED,   /* by the filter: its covariance is not positive */
                      NAV_KOI_REOPENED,   /* taken, after P was widened: those before it were refused for reopen_s */
                      NAV_KOI_REASONS,
};

struct nav_koi_cfg {
    double sample_s, step_s;           /* of increments and of the filter; 1 to 64 samples */
    int form, gauge;                   /* enum nav_kf_form; enum nav_sins_gauge: which Gamma */
    double alignment_s;                /* of the alignment before, whose errors are in P; 0: none */
    double dr_sd_m[3], dv_sd_mps[3];   /* standard deviations of the prior; 0: known */
    double alpha_sd_rad, beta3_sd_rad; /* besides what the alignment gives */
    double nu_sd_radps, nu_run_radps, df_sd_mps2, df_run_mps2; /* persistent part, from run to run: squares add */
    double gamma_scale_sd, gamma_angle_sd_rad, theta_scale_sd, theta_angle_sd_rad, dt1_sd_s, dt2_sd_s;
    double baro_sd_m;                                  /* 0: the barometer is right, and baro is not in the state */
    double gyro_noise_radps_rts, accel_noise_mps2_rts; /* standard deviation of a mean over 1 s */
    double nu_walk_radps_rts, df_walk_mps2_rts, baro_walk_m_rts;    /* random walks: after 1 s; 0: constants */
    double position_sd_m[3], velocity_sd_mps[3];                    /* of measurements that do not give their own */
    double stop_sd_mps, height_sd_m, damping_per_s, damping_per_s2; /* k1, k2 of the vertical channel */
    double gate_nis[2], outlier_nis, max_age_s;                     /* gates: of one scalar (height), of three */
    double antenna_m[3];                                            /* from the unit, in its axes */
    double reopen_s;                                                /* 0: a gate that has shut stays so */
    double slow_r_sd_m[3], slow_v_sd_mps[3], slow_s;                /* coloured errors of the receiver */
};
NAV_API int nav_koi_default(int unit_class, struct nav_koi_cfg *cfg); /* NAV_RANGE: no such class */
NAV_API int nav_koi_check(const struct nav_koi_cfg *cfg, struct nav_refusal *why);
NAV_API int nav_koi_layout(const struct nav_koi_cfg *cfg, struct nav_sins_rows rows[NAV_KOI_BLOCKS]); /* states */
NAV_API const char *nav_koi_block_name(int block);
NAV_API const char *nav_koi_reason_text(int reason);
/* Prior covariance (n x n) in this state. */
NAV_API int nav_koi_prior(const struct nav_koi_cfg *cfg, const struct nav_state *at, double *p);
/* Errors of the sensors: what is taken off the increments. */
struct nav_koi_sensors {
    double nu_radps[3], theta[9], df_mps2[3], gamma[9]; /* row-major */
};
/* C_nb at the beginning and at the end (either may be NULL) of n increments of a unit that stays where it is and may sway: apparent
 * gravity, which the gyros hold against inertial space, turns with the Earth. ratio (or NULL): of
 * the turn seen to the Earth's; NAV_SINGULAR: not 0.5 to 1.5. Latitude within 85 deg, n sample_s from 10 s; 1 deg in 120 s. */
NAV_API int nav_koi_coarse(const double *dtheta_rad, const double *dv_mps, int64_t n, double sample_s, double lat_rad,
                           double C_nb_begin[9], double C_nb_end[9], double *ratio);

typedef struct nav_koi nav_koi;
NAV_API size_t nav_koi_bytes(void);
/* In memory of nav_koi_bytes(), aligned as malloc() does, which must not be moved. at: the autonomous solution at t_s. x, p: NULL: 0, and
 * nav_koi_prior(). sensors: corrections from earlier flights, or NULL. */
NAV_API int nav_koi_start(void *memory, size_t bytes, const struct nav_koi_cfg *cfg, double t_s,
                          const struct nav_state *at, const double *x, const double *p,
                          const struct nav_koi_sensors *sensors, nav_koi **out);
/* The next raw increments, rows of three; after each step_s the filter predicts. NAV_RANGE: 0.5 rad in a step; ends before it. */
NAV_API int nav_koi_push(nav_koi *k, const double *dtheta_rad, const double *dv_mps, int64_t count);
struct nav_koi_measurement {
    int kind, valid;        /* enum nav_koi_kind; 0: the device says that it is not */
    double t_s;             /* of the value, as far as it is known: Dt1, Dt2 are what is left */
    double value[3], sd[3]; /* 0: that of the configuration */
};
/* Returns a reason, NAV_KOI_ACCEPTED and NAV_KOI_REOPENED: taken; below zero: unknown kind. */
NAV_API int nav_koi_take(nav_koi *k, const struct nav_koi_measurement *m);

/* One-off correction (довыставка), between two steps: the estimates of states i with take[i] != 0 move from the filter into the
 * autonomous solution and into what is taken off the increments; P stays. NAV_TIMES: increments since the last step. */
NAV_API int nav_koi_correct(nav_koi *k, const unsigned char *take);
/* take[i] = 1 where state i has a standard deviation below `limit` times the prior's. Returns how many. */
NAV_API int nav_koi_converged(const nav_koi *k, double limit, unsigned char *take);

struct nav_koi_last {                         /* of a kind */
    int reason;                               /* -1: none was given */
    double t_s, accepted_s;                   /* time of the last, of the last accepted; -1e300: none */
    double nis, nis_sum;                      /* of the last that came as far as the gate; of all accepted ones */
    struct nav_kf_innovation innovation[3];   /* of it, each for itself, before any was taken */
    int64_t nis_dof, counts[NAV_KOI_REASONS]; /* scalars in nis_sum */
};
struct nav_koi_state {
    double t_s;                            /* of the last step */
    struct nav_state autonomous, hybrid;   /* at t_s */
    struct nav_koi_sensors sensors, total; /* taken off the increments; with the estimates */
    double alone_s;                        /* since a measurement was accepted, or since the start: prediction only */
    struct nav_koi_last last[NAV_KOI_KINDS];
};
NAV_API int nav_koi_get(const nav_koi *k, struct nav_koi_state *state);
NAV_API int nav_koi_covariance(const nav_koi *k, double *x, double *p, double *sd); /* each may be NULL */
/* Of the last step: phi (moving x n), q (moving x moving); returns moving. For tests and smoothers. Each may be NULL. */
NAV_API int nav_koi_jacobians(const nav_koi *k, double *phi, double *q);

#ifdef __cplusplus
}
#endif

#endif
