/* Coriolis vibratory gyro of micromechanics with voltage output.
 *
 * The article announces its calibration and describes nothing of it; the form is the general one of rate gyros (IEEE Std 1431 and
 * 647 in outline, E0). W is the rate that it senses along its input axis x, w the inertial rate, a = -f as in mems.h:
 *
 *   W = wx + my wy + mz wz + dx ax + dy ay + dz az
 *   u = u0 + S (cos p (W + c2 W^2 + c3 W^3) + Q sin p) + n
 *
 * my, mz are cross-axis sensitivities, d sensitivities to acceleration. Q is the quadrature: the stiffness of the suspension couples
 * the drive's motion into the sense axis, a quarter of a period from the Coriolis force. A demodulator with a phase error p passes
 * Q sin p as a rate and loses 1 - cos p of the scale. u0, S and p follow the temperature of the element from 25 degC. n is white,
 * one draw for each instant (looks.h), flicker and random walk (noise.h); then resolution and limits. Not modelled: the
 * bandwidth, the drive's start, the square of the acceleration, vibration. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_SENSOR_CVG_H
#define PSABENCH_PHYS_SENSOR_CVG_H

#include "base/draws.h"
#include "base/looks.h"
#include "phys/sensor/noise.h"

#include <stdint.h>

/* In the units of data sheet and scenario. True values. */
struct cvg_dps {
    double u0_v;
    double scale_v_per_dps;
    double cross_y, cross_z;
    double gx_dps_per_g, gy_dps_per_g, gz_dps_per_g;
    double square_per_dps, cube_per_dps2; /* c2, c3 */
    double quadrature_dps, phase_deg;
    double u0_tc_v_per_k, scale_tc_ppm_per_k, phase_tc_deg_per_k;
    double noise_dps_rthz; /* one-sided white density */
    double bias_instability_dps, walk_dps_rts, ramp_dps_per_s, quantum_v;
    double low_v, high_v; /* limits of the output; both 0: none */
};

struct cvg {
    struct cvg_dps cfg;
    double g_mps2;
    double temp_degc; /* of the element: its owner keeps it up */
    struct noise slow;
    struct draws noise;
};

/* g is the site's: a sensitivity per g means per this g. */
void cvg_init(struct cvg *c, const struct cvg_dps *cfg, double g_mps2, struct draws noise, struct draws slow);

/* What it would give without noise, at the temperature of the element, within its limits. */
double cvg_true_v(const struct cvg *c, const double w_radps[3], const double a_mps2[3]);

/* How far slow noise has moved the zero by t_ns, volts; later draws are those that come without this look. */
double cvg_zero_moved_v(const struct cvg *c, int64_t t_ns);

/* One look. Slow noise goes on with time: no look is earlier than the last one by more than its step. */
double cvg_out_v(struct cvg *c, const double w_radps[3], const double a_mps2[3], int64_t t_ns, int64_t every_ns);

#endif
