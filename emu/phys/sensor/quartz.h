/* Quartz pendulum accelerometer with current output (sources 5.6).
 *
 * The torquer balances the pendulum: I = S (a + zero), S = mL/K_DM. What is balanced is the acceleration along the input axis
 * with its misalignment and square, and the zero signal, which follows the temperature of the element along a smooth curve,
 *
 *   y(T) = zero + curve x exp((1 - x^2) / 2) + slope (T - 30),   x = (T - centre) / width,
 *
 * T with a play, plus gradient (case - element). The loop answers as one oscillator of second order, exactly for an input held
 * since the look before. Then the white noise, one draw for each instant (looks.h), and the limits. a = projection of gravity
 * on the sensor's axes as in mems.h, m/s^2; output in amperes. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_SENSOR_QUARTZ_H
#define PSABENCH_PHYS_SENSOR_QUARTZ_H

#include "base/draws.h"
#include "base/looks.h"

#include <stdbool.h>
#include <stdint.h>

#define QUARTZ_REFERENCE_DEGC 30.0 /* at which the scale is given */

/* As a passport and a scenario give it. */
struct quartz_g {
    double scale_a_per_g;
    double scale_tc_ppm_per_k;
    double zero_ug, curve_ug, curve_centre_degc, curve_width_k, slope_ug_per_k; /* millionths of g */
    double play_k;                   /* half the width of the hysteresis in temperature */
    double gradient_ug_per_k;        /* for case warmer than element */
    double tilt_y_mrad, tilt_z_mrad; /* of the input axis towards y and z */
    double square_ug_per_g2;
    double alpha0_deg;          /* error of setting, as in mems.h */
    double natural_hz, damping; /* of the loop; 0 Hz: answers at once */
    double noise_a_rthz;        /* white, one-sided */
    double limit_a;             /* either sign; 0: none */
};

struct quartz {
    struct quartz_g cfg;
    double g_mps2;
    double case_degc, element_degc; /* its owner keeps them up; the reference temperature from quartz_init() on */
    double felt_degc;               /* element with play */
    struct draws noise;
    int64_t t_ns;     /* of the last look; -1 before the first */
    int64_t dt_ns;    /* for which the coefficients of the loop hold */
    double loop_g[2]; /* deflection off the present input, and its rate times the step's unit */
    double input_g;
    double step[2][2]; /* (deviation, rate / w) of the loop over dt_ns */
    double held_a;     /* of the last look, without noise */
};

/* Plausible figures (E0): 1.28 mA/g, 350 Hz with 0.7, zero 60 ug with a curve of 300 ug, 55 K wide about 12 degC. */
struct quartz_g quartz_default(void);

/* g is the site's: a scale per g means per this g. */
void quartz_init(struct quartz *q, const struct quartz_g *cfg, double g_mps2, struct draws noise);

/* What it would give at rest without noise: truth. */
double quartz_true_a(const struct quartz *q, const double a_mps2[3]);

/* Output current at a row of looks; a_mps2 holds three numbers a look, or, if `felt` is 1, three for all. No look is
 * earlier than the last call's; the same instant gives the same current. */
void quartz_out_row_a(struct quartz *q, const double *a_mps2, unsigned felt, const struct looks *at, double *out_a);

#endif
