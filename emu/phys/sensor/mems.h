/* MEMS accelerometer with voltage output, model (1) of the calibration article:
 *
 *   u = u0 + kx ax + ky ay + kz az + kxy ax ay + kxx ax^2 + kyy ay^2 + drift t + n,
 *
 * a = projection of gravity on the sensor's axes (an axis pointing down has a = +g, sources instruments 2.1), m/s^2. The last
 * three terms are ours. n is white noise of a one-sided density, one draw for each instant (looks.h). Zero and scale follow the
 * temperature of the element, slow noise is added (noise.h), and the output stays within its limits and is a multiple of its
 * resolution: each only where its parameters are not zero. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_SENSOR_MEMS_H
#define PSABENCH_PHYS_SENSOR_MEMS_H

#include "base/draws.h"
#include "base/looks.h"
#include "phys/sensor/noise.h"

#include <stdint.h>

#define MEMS_REFERENCE_DEGC 25.0 /* at which u0 and k are given */

/* In the units of data sheet, scenario and article: per g. True values. */
struct mems_g {
    double u0_v;
    double kx_v_per_g, ky_v_per_g, kz_v_per_g;
    double kxy_v_per_g2, kxx_v_per_g2, kyy_v_per_g2;
    double alpha0_deg;      /* error of setting: adds to the angle of the head, before the face (head.h) */
    double drift_v_per_s;   /* linear, from t = 0 of the bench */
    double noise_v_rthz;    /* one-sided white density; 0: take reading_noise_v */
    double reading_noise_v; /* specified rms of one settled reading at 1000 SPS, minimum phase: mems_density_v_rthz() */
    double u0_tc_v_per_k;   /* of the zero, from the reference temperature */
    double k_tc_ppm_per_k;  /* of all k */
    double bias_instability_v, walk_v_rts, quantum_v; /* noise.h */
    double low_v, high_v;                             /* limits of the output; both 0: none */
};

/* The same in SI. */
struct mems_cfg {
    double u0_v;
    double k_v_per_mps2[3];
    double kxy_v_per_mps2_2, kxx_v_per_mps2_2, kyy_v_per_mps2_2;
    double alpha0_rad;
    double drift_v_per_s;
    double noise_v_rthz;
    double u0_tc_v_per_k, k_tc_per_k;
    struct noise_cfg slow;
    double low_v, high_v;
};

struct mems {
    struct mems_cfg cfg;
    double temp_degc; /* of the element: its owner keeps it up; the reference temperature from mems_init() on */
    struct noise slow;
    struct draws noise;
};

/* g is the site's: a sensitivity per g means per this g. */
struct mems_cfg mems_cfg_si(const struct mems_g *p, double g_mps2);

/* Volts that its output stays within, for accelerations up to a_max_mps2 on each axis, looks every_ns apart, up to
 * until_ns, at -100 to 200 degC. Not finite: its slow noise knows no limit. */
struct looks_range mems_range_v(const struct mems *m, double a_max_mps2, int64_t every_ns, int64_t until_ns);

/* Density that gives readings of rms reading_noise_v: a settled reading at fDATA passes MEMS_ENBW * fDATA of white noise
 * (from the published FIR coefficients, minimum phase; linear phase differs by 0.2 %). Neighbouring readings of one stream
 * are then correlated by +0.20, -0.17, 0.12 ...: from 15 periods on it is below 1 %. */
#define MEMS_ENBW 0.4138
double mems_density_v_rthz(double reading_noise_v, double data_hz);

void mems_init(struct mems *m, const struct mems_cfg *cfg, struct draws noise, struct draws slow);

/* The model at the temperature of the element, within the limits of the output: what it would give without noise. */
double mems_true_v(const struct mems *m, const double a_mps2[3], int64_t t_ns);

/* How far drift and slow noise have moved the zero by t_ns from u0, volts; later draws are those that come without this look. */
double mems_zero_moved_v(const struct mems *m, int64_t t_ns);

/* Output voltage at a row of looks; a_mps2 holds three numbers a look, or, if `felt` is 1, three for all. Slow noise goes
 * on with time: no look is earlier than the last one by more than its step. */
void mems_out_row_v(struct mems *m, const double *a_mps2, unsigned felt, const struct looks *at, double *out_v);

#endif
