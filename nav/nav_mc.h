/* Monte-Carlo of gyrocompassing and of the hold that follows: own models of errors, not the emulator's.
 *
 * One virtual instrument is one run. Run k of seed s is the same whatever the batch, thread or machine: give each worker its
 * own range first_run .. first_run + runs. Random signs and draws are as docs/nav.md lists them; outputs are errors, estimate
 * less truth, one double a run, and any of them may be NULL. */
#ifndef PSABENCH_NAV_MC_H
#define PSABENCH_NAV_MC_H

#include "nav/nav.h"

#ifdef __cplusplus
extern "C" {
#endif

enum nav_mc_angle {                      /* how the systematic error of the set angle is read */
                    NAV_ANGLE_NONE,      /* not counted */
                    NAV_ANGLE_COMMON,    /* all positions share it: the platform does not feel it, the pilot reads it */
                    NAV_ANGLE_INCREMENT, /* positions 2, 3, ... have it, the first has not */
                    NAV_ANGLE_ACCUMULATES, /* k times at the k-th turn */
};
enum nav_mc_cardan {
    NAV_CARDAN_ALPHA,       /* the angle is set about the vertical, as the article reads */
    NAV_CARDAN_UNCORRECTED, /* gimbal steps taken for steps of alpha */
    NAV_CARDAN_CORRECTED,   /* nav_cardan() with pitch and roll from the level sensors */
};
enum nav_mc_tilt { NAV_TILT_UNIFORM, NAV_TILT_CORNERS }; /* pitch and roll within, or at, +-tilt_rad */

struct nav_mc_cfg {
    double latitude_rad, latitude_error_rad; /* error: the host's and the platform's own, sign drawn with random_sign */
    double tilt_rad;
    int tilt; /* enum nav_mc_tilt */
    int cardan;
    double alpha1_rad; /* NaN: uniform over the turn */
    double drift1_radps;
    double gm_sigma_radps, gm_tau_s;
    int gm_from_zero;     /* 1: 0 at the start of the first window; 0: stationary */
    double torquer_scale; /* relative error of the x torquer */
    double m1_per_s;
    double beta_sys_rad, gamma_sys_rad;       /* level sensors, all windows alike */
    double beta_random_rad, gamma_random_rad; /* one draw a window, or a sample */
    double angle_sys_rad, angle_random_rad;   /* set angle, or the encoder's reading where one is read */
    int angle_sys;                            /* enum nav_mc_angle */
    int random_sign;                          /* 1: systematic errors have a random sign each; 0: + */
    int per_sample;                           /* 1: random errors are drawn a sample and average; 0: a window */
    double white_radps_rts;                   /* white noise of S besides */
    double sample_s;                          /* 0.01 */
    int count;                                /* positions, 3..64 */
    double angle_rad[NAV_MAX_POSITIONS];
    double window_s;
    double gap_s;                   /* between windows, used when slew_radps is 0 */
    double slew_radps, settle_s;    /* otherwise the gap is turn/slew + settle, the turn as asked for */
    struct nav_gyrocompass_cfg fit; /* of the host; its latitude is set from latitude_rad and latitude_error_rad */
    double gm_before_s;             /* with gm_from_zero: 0 so long before the first window instead of at its start */
};

/* The article's errors, three positions 90 deg apart, 10 s windows, 10 s gaps, latitude 50 deg, proper Gauss-Markov drift,
 * (14), closed form. */
NAV_API void nav_mc_default(struct nav_mc_cfg *cfg);

struct nav_mc_out {
    double *platform_rad; /* alpha of the platform in position 1 */
    double *heading_rad;  /* the same referred to the zero of the angle: what the pilot reads */
    double *drift_radps;  /* against the mean drift */
    double *alpha1_rad;   /* the truth that was drawn */
    double *quality;
};

/* Errors of first order in jointly Gaussian means of the windows: the algebra once, then nanoseconds a run. Tilts enter
 * through the gimbal's error and times the errors of level sensors, latitude and torquer; errors beyond that order are
 * rejected with NAV_RANGE (nav_mc_check()). */
NAV_API int nav_mc_closed(const struct nav_mc_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                          const struct nav_mc_out *out);
/* Drift and noise sample by sample, settled algebra of rest, nav_gyrocompass() at the end of each run. */
NAV_API int nav_mc_samples(const struct nav_mc_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                           const struct nav_mc_out *out);

enum nav_mc_model { NAV_MC_CLOSED, NAV_MC_SAMPLES };
/* The status that the model would return at once, and its cause. */
NAV_API int nav_mc_check(const struct nav_mc_cfg *cfg, int model /* enum nav_mc_model */, struct nav_refusal *why);

enum nav_mc_axis2 {
    NAV_AXIS2_SAME,     /* the azimuth axis has the very drift that was calibrated: the article's silence */
    NAV_AXIS2_DIFFERS,  /* by a draw of axis2_sd_radps, uncalibrated */
    NAV_AXIS2_MEASURED, /* from its torquer, with the level sensors' systematic errors */
    NAV_AXIS2_FIXED,    /* no gyrocompassing: heading_rad and drift_error_radps, for the article's sum */
};
struct nav_mc_hold_cfg {
    struct nav_mc_cfg start; /* the gyrocompassing before */
    int axis2;
    double axis2_sd_radps;
    double heading_rad, drift_error_radps; /* of NAV_AXIS2_FIXED */
    double hours, step_s;                  /* 4, 60: extremes are looked for at steps */
    double wait_s;                         /* between the last window and the hold */
    double level_rad;               /* levelling error in flight, direction drawn; turns drift by U cos(lat) of it */
    double latitude_error_rad;      /* in flight */
    double v_east_mps, speed_error; /* relative error of the ground speed */
};
NAV_API void nav_mc_hold_default(struct nav_mc_hold_cfg *cfg);
struct nav_mc_hold_out {
    double *end_rad; /* error of heading at the end */
    double *max_rad; /* largest magnitude on the way */
};
NAV_API int nav_mc_hold_check(const struct nav_mc_hold_cfg *cfg, struct nav_refusal *why);
NAV_API int nav_mc_hold(const struct nav_mc_hold_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                        const struct nav_mc_hold_out *out);

#ifdef __cplusplus
}
#endif

#endif
