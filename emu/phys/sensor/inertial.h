/* Errors of a triad of gyros and a triad of accelerometers in one case, linear (article on the calibration of strapdown systems on
 * rate tables; its letters):
 *
 *   w' = w + nu0 + Theta w + D f + n_g      nu0 drifts, Theta scales and misalignments of the gyros, D drifts that follow
 *   f' = f + df0 + Gamma f + n_a            the specific force ("dynamic drifts"); df0 zeros, Gamma of the accelerometers
 *
 * Error is measured less true, as the article's measured values are; f is the specific force where each accelerometer is. All of
 * it in the instrument's axes, SI. Pure. */
#ifndef PSABENCH_PHYS_SENSOR_INERTIAL_H
#define PSABENCH_PHYS_SENSOR_INERTIAL_H

#include <stdint.h>

struct inertial_errors {
    double nu0_radps[3];
    double theta[3][3];
    double g_drift_radps_per_mps2[3][3]; /* D */
    double df0_mps2[3];
    double gamma[3][3];
};

/* A matrix of nine, row by row: diagonal elements are scales, the others misalignments. */
struct inertial_spread { /* standard deviations among specimens; all independent (article) */
    double nu0_radps, theta_scale, theta_misalignment, g_drift_radps_per_mps2;
    double df0_mps2, gamma_scale, gamma_misalignment;
};

/* Adds a specimen's draws to what is in *e. Each kind has a stream of its own: a spread of 0 shifts no other. */
void inertial_draw(struct inertial_errors *e, const struct inertial_spread *sd, uint64_t seed, uint64_t serial);

/* What the gyros measure, without noise. */
void inertial_rate_radps(const struct inertial_errors *e, const double w_radps[3], const double f_mps2[3],
                         double measured_radps[3]);

/* Row `axis` of I + Gamma. */
void inertial_force_row(const struct inertial_errors *e, unsigned axis, double row[3]);

#endif
