/* libpsabench-nav: a gyro-stabilised platform finds north, calibrates its drifts and keeps heading (docs/nav.md).
 *
 * Frames. Local level: xi east, eta north, zeta up. Platform p: x_p suspension axis, y_p along, z_p normal. alpha about
 * zeta, counter-clockwise seen from above (azimuth of y_p: -alpha), then beta about x, then gamma about y. Case c: x_c
 * right, y_c forward; psi clockwise from north, pitch nose up, roll right wing down. q is the angle of the gimbal about z_c:
 * x_p = cos q x_c + sin q y_c. Equations (1) to (19) are the article's, with the errata of docs/nav.md.
 * All functions are pure: no state, no allocation, nothing printed, any thread. Angles in rad, rates in rad/s. Functions that
 * return int return NAV_OK or a rejection below zero and then leave their outputs as they were; those that return double give
 * NaN for an angle that is not finite or beyond 1e6 rad, and for what has no answer. */
#ifndef PSABENCH_NAV_H
#define PSABENCH_NAV_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Number of the shared library, libpsabench-nav.so.N; structures change only with it. */
#define NAV_ABI 1

#define NAV_API           __attribute__((visibility("default")))
#define NAV_MAX_POSITIONS 64
#define NAV_EARTH_RADPS   7.292115e-5 /* sources 5.1 */

enum nav_status {
    NAV_OK = 0,
    NAV_TOO_FEW = -1,    /* positions: three at least, exactly three for NAV_CLOSED3, four with a ramp; 64 at most */
    NAV_COINCIDENT = -2, /* fewer than three directions that differ by half a degree */
    NAV_LATITUDE = -3,   /* beyond 85 deg: the horizontal Earth rate is below 1.3 deg/h */
    NAV_NOT_FINITE = -4, /* a number is not finite */
    NAV_RANGE = -5,      /* negative noise or window, tilt beyond 45 deg, unknown method */
    NAV_TIMES = -6,      /* correlated drift or a ramp needs windows that follow one another: t_mid_s, window_s */
    NAV_SINGULAR = -7,   /* the equations do not determine the unknowns */
};
NAV_API const char *nav_status_text(int status); /* one sentence */

/* Why a call would be rejected, for a person: "field is value; want". */
struct nav_refusal {
    int status;        /* enum nav_status; NAV_OK: it would not be */
    int position;      /* whose field it is, from 0; -1: of the configuration */
    double value;      /* what the field holds */
    const char *field; /* as the structure calls it; "" when the cause is not one field */
    const char *want;  /* what would be right; static text */
};

enum nav_flag {                        /* bits of a result; nav_flag_text() has the sentence of the lowest one */
                NAV_POOR_GEOMETRY = 1, /* |D|/We^2 < 0.3: steps below 40 or above 175 deg */
                NAV_POOR_QUALITY = 2,  /* |hypot(s, c) - 1| > 0.01: wrong latitude, rates that do not belong together */
                NAV_SIMPLIFIED = 4,    /* (14) was used for (13) */
                NAV_NO_NOISE =
                    8, /* no noise given: standard deviations are 0 and say nothing; NAV_GLS weighs all alike */
                NAV_NOT_CONVERGED = 16, /* the constrained fit was still moving after its last step */
};
NAV_API const char *nav_flag_text(uint32_t flags);
NAV_API int nav_abi(void);
NAV_API const char *nav_version(void); /* "0.1.0 eigen-3.4.0": what the last digits of results hang on */

/* One position of the platform and one window in it. */
struct nav_position {
    double
        s_radps; /* levelling command: mean of -m1 beta_n over the window (without the gamma compensation), or its slope */
    double delta_rad; /* turn of alpha since the first position; from an encoder: nav_cardan() */
    double beta_rad;  /* means of the level sensors over the window */
    double gamma_rad;
    double t_mid_s; /* middle of the window, from any instant */
    double window_s;
};

/* What the covariance and the weights rest on; all zero: not known. */
struct nav_noise {
    double gm_sigma_radps;  /* drift's random part, stationary Gauss-Markov */
    double gm_tau_s;        /* 1/mu */
    double white_radps_rts; /* white noise of S: a window's standard deviation times sqrt(window_s) */
    double window_sd_radps; /* what is drawn again for each window and does not average */
    double angle_sd_rad;    /* each angle reading, the first included */
    double level_sd_rad;    /* each window's gamma: S errs by U sin(lat) of it */
    /* Of the latitude that compensates gamma and is in the cfg, one error for all windows: S errs by U cos(lat) sin(gamma) of
     * it, which turns the heading by up to the tilt times it, and s and c by tan(lat) of it, which a constrained fit feels. */
    double latitude_sd_rad;
};

enum nav_method {
    NAV_CLOSED3,         /* (17)-(19), corrected; three positions */
    NAV_LSQ,             /* least squares on s = sin, c = cos, drift, all positions alike */
    NAV_CONSTRAINED,     /* the same with s^2 + c^2 = 1, Gauss-Newton */
    NAV_GLS,             /* weights: inverse of the noise's covariance */
    NAV_GLS_CONSTRAINED, /* both */
};

struct nav_gyrocompass_cfg {
    double latitude_rad;
    int method;     /* enum nav_method */
    int simplified; /* 1: (14), 0: (13) */
    int ramp;       /* 1: drift grows linearly; one unknown more */
    struct nav_noise noise;
};

struct nav_compass {
    double alpha1_rad;        /* at position 1, (-pi, pi], on the scale of the angle readings */
    double alpha1_sd_rad;     /* of alpha1_rad so read: what a heading inherits */
    double alpha1_half95_rad; /* 1.96 times it */
    double platform_sd_rad;   /* as the direction of the platform in position 1: the first reading errs, too */
    double drift1_radps;      /* about x_p, the measuring axis; with a ramp: at the mean of t_mid_s */
    double drift1_sd_radps;   /* against the mean drift: the random part is counted */
    double ramp_radps2;
    double s, c;               /* free fit, before s^2 + c^2 = 1 */
    double quality;            /* |hypot(s, c) - 1|; does not see gimbal errors */
    double geometry;           /* |D|/We^2; root mean square over all threes */
    double residual_rms_radps; /* of the fit that gave alpha1 */
    double cov[9];             /* of alpha1 [rad], drift1 [rad/s], ramp [rad/s^2], row-major */
    uint32_t flags;            /* enum nav_flag */
    int iterations;            /* of the constrained fit */
};
NAV_API int nav_gyrocompass(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg,
                            struct nav_compass *out);
/* The status that nav_gyrocompass() would return, but for NAV_SINGULAR, and its cause. */
NAV_API int nav_gyrocompass_check(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg,
                                  struct nav_refusal *why);

/* (18), (19) and S1 + S3 as printed: wrong, for negative tests only. Three positions. */
NAV_API int nav_gyrocompass_printed(const struct nav_position *p, double latitude_rad, double *alpha1_rad,
                                    double *drift1_radps);

/* Pitch and roll of the vehicle from the level sensors at several gimbal angles: -cos b sin g = q_i turns of z_c.
 * with_bias: gamma's constant error is estimated, too (three different q; otherwise two). beta_rad NULL: levelled. */
struct nav_attitude {
    double pitch_rad, roll_rad;
    double gamma_bias_rad; /* measured less true */
    double residual_rms_rad;
};
NAV_API int nav_attitude_from_level(const double *q_rad, const double *beta_rad, const double *gamma_rad, int count,
                                    int with_bias, struct nav_attitude *out);

/* alpha of a platform whose outer axis is tilted, exactly; psi_rad 0 and a difference give increments. */
NAV_API double nav_alpha(double psi_rad, double q_rad, double beta_rad, double pitch_rad, double roll_rad);
/* Block 1: gamma from alpha, beta and the vehicle's attitude. */
NAV_API double nav_gamma(double alpha_rad, double beta_rad, double psi_rad, double pitch_rad, double roll_rad);
/* Increments of alpha since q_rad[0], each within pi of the gimbal's own turn. beta_rad NULL: levelled. */
NAV_API int nav_cardan(const double *q_rad, const double *beta_rad, int count, double pitch_rad, double roll_rad,
                       double *delta_rad);
/* Heading psi in [0, 2 pi) of the vehicle from alpha and the gimbal angle of one position. */
NAV_API double nav_heading(double alpha_rad, double q_rad, double beta_rad, double pitch_rad, double roll_rad);

/* S of a window as the negative slope of beta_n less the integral of the command, count samples dt_s apart; the command
 * s_radps[k] holds from sample k to k + 1. White noise of beta_n counts sqrt(12/count)/T, not sqrt(m1 dt)/T. */
NAV_API int nav_window_slope(const double *beta_n_rad, const double *s_radps, int count, double dt_s,
                             double *out_radps);

/* S and the mean of the x torquer's whole command for a platform at rest. Errors as the device has them. */
struct nav_rest {
    double latitude_rad, latitude_error_rad;   /* true; error of the one that the compensation uses */
    double alpha_rad, gamma_rad, drift1_radps; /* true */
    double m1_per_s, torquer_scale1;           /* scale: relative error */
    double beta_error_rad, gamma_error_rad;    /* level sensors: measured less true */
};
NAV_API double nav_rest_s_radps(const struct nav_rest *at, double *beta_rad /* true, or NULL */);

/* Drift of the azimuth axis from its torquer's mean command (feed-forward included) in an angle-holding window. */
NAV_API double nav_azimuth_drift(double s_az_radps, double latitude_rad, double alpha_rad, double beta_rad,
                                 double gamma_rad);
NAV_API double nav_azimuth_drift_sd(double latitude_rad, double alpha_rad, double beta_sd_rad, double gamma_sd_rad);

/* What the azimuth of a moving platform needs besides U sin(lat): V_E tan(lat)/R, R 6371 km. */
NAV_API double nav_transport_radps(double v_east_mps, double latitude_rad);

/* Growth of the heading's error in the hold. */
struct nav_hold {
    double heading_sd_rad;
    double drift_sd_radps; /* of the compensation */
    double gm_sigma_radps, gm_tau_s;
    int gm_from_zero; /* 1: the random part was 0 when the hold began */
};
NAV_API double nav_gm_integral_sd_rad(double gm_sigma_radps, double gm_tau_s, double t_s, int from_zero);
NAV_API double nav_hold_sd_rad(const struct nav_hold *h, double t_s);
/* Covariance of the random drift's means over two windows that do not overlap, or over one (gap by middles 0). */
NAV_API double nav_gm_window_cov(double gm_sigma_radps, double gm_tau_s, double window_a_s, double window_b_s,
                                 double between_middles_s);

#ifdef __cplusplus
}
#endif

#endif
