/* Elementary functions built from IEEE-exact operations only (+ - * / sqrt, frexp, ldexp).
 *
 * libm's sin, log and exp choose other instructions on other processors and may differ in the last bit; "same seed, same
 * bytes on every machine" cannot stand on them. Accuracy here is better than 4 ulp inside the stated ranges. Pure. */
#ifndef PSABENCH_BASE_DETMATH_H
#define PSABENCH_BASE_DETMATH_H

#define RAD_PER_DEG    0.017453292519943295
#define RAD_PER_ARCMIN (RAD_PER_DEG / 60.0)
#define RAD_PER_ARCSEC (RAD_PER_DEG / 3600.0)
#define TURN_RAD       6.283185307179586

struct det_pair {
    double sin, cos;
};

double det_log(double x);     /* natural logarithm, x > 0 finite and normal */
double det_exp(double x);     /* -700 <= x <= 700 */
double det_sin(double x_rad); /* |x_rad| <= 1e6: reduced by pi/2 in three parts */
double det_cos(double x_rad);
struct det_pair det_sin_cos(double x_rad); /* the same bits as the two calls, in the time of one */

/* For angles that change little from call to call: sine and cosine of the nearest multiple of 1/64 rad are kept, and the rest is
 * a short series. The value does not depend on what is kept; within 4e-16 of the exact one. Zero it before the first call. */
struct det_near {
    double kept_rad;
    struct det_pair kept;
};

struct det_pair det_sin_cos_near(struct det_near *near, double x_rad); /* |x_rad| <= 1e6 */

double det_atan2(double y, double x); /* in [-pi, pi], finite arguments; 0 if both are 0 */

double det_wrap_rad(double angle_rad);      /* in (-pi, pi] */
double det_quantise(double x, double step); /* the nearest multiple of a step; x itself for a step of 0 or less */

#endif
