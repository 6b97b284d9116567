/* What the parts of libpsabench-nav share in arithmetic: the same bytes on every machine, so nothing of libm but sqrt. */
#ifndef PSABENCH_NAV_MATH_HPP
#define PSABENCH_NAV_MATH_HPP

#include <cmath>
#include <cstdint>
#include <cstring>

extern "C" {
#include "emu/base/detmath.h"
}

constexpr double NAV_PI = 3.14159265358979323846;
constexpr double NAV_DEG = NAV_PI / 180.0;
constexpr double NAV_ARCMIN = NAV_DEG / 60.0;
constexpr double NAV_DEGPH = NAV_DEG / 3600.0;

constexpr double NAV_NAN = __builtin_nan("");
constexpr double NAV_ANGLE_MAX = 1e6; /* rad: beyond it the reduction by pi/2 has lost its digits */

inline uint64_t nav_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* One more in an exponent of all ones runs over into the sign. */
inline bool nav_all_finite(const double *a, int64_t count)
{
    uint64_t over = 0;
    for (int64_t i = 0; i < count; i++) over |= (nav_bits(a[i]) & 0x7ff0000000000000) + 0x0010000000000000;
    return !(over >> 63);
}

/* The angle, or NaN for what is none. */
inline double nav_angle(double x_rad)
{
    return std::fabs(x_rad) <= NAV_ANGLE_MAX ? x_rad : NAV_NAN;
}

/* Of |x| < 2^62; std::floor is a call where the processor is not known to round. */
inline double nav_floor(double x)
{
    const double whole = (double)(int64_t)x;
    return whole > x ? whole - 1.0 : whole;
}

/* (sin x - x)/x^3 and (cos x - 1 + x^2/2)/x^4 by z = x^2, |x| <= pi/4: fdlibm's polynomials (Sun 1993). */
inline __attribute__((always_inline)) double nav_sin_poly(double z)
{
    return -1.66666666666666324348e-01 +
           z * (8.33333333332248946124e-03 +
                z * (-1.98412698298579493134e-04 +
                     z * (2.75573137070700676789e-06 +
                          z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))));
}

inline __attribute__((always_inline)) double nav_cos_poly(double z)
{
    return 4.16666666666666019037e-02 +
           z * (-1.38888888888741095749e-03 +
                z * (2.48015872894767294178e-05 +
                     z * (-2.75573143513906633035e-07 +
                          z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
}

/* sin(x + quarters pi/2) of |x| <= 1e6, below 1 ulp; NaN beyond. det_sin() divides at each term; here are products alone, for a million runs.
 * pi/2 in three parts. */
inline double nav_sin_quarters(double x_rad, int64_t quarters)
{
    if (!(std::fabs(x_rad) <= NAV_ANGLE_MAX)) return NAV_NAN;
    const double k = nav_floor(x_rad * 0.63661977236758134308 + 0.5);
    const double r = ((x_rad - k * 0x1.921fb54400000p+0) - k * 0x1.0b4611a600000p-34) - k * 0x1.3198a2e037073p-69;
    const double z = r * r;
    const int64_t q = ((int64_t)k + quarters) & 3;
    const double half = 0.5 * z;
    const double w = 1.0 - half;
    const double v = q & 1 ? w + (((1.0 - w) - half) + z * z * nav_cos_poly(z)) : r + z * r * nav_sin_poly(z);
    return q & 2 ? -v : v;
}

inline double nav_sin(double x_rad)
{
    return nav_sin_quarters(x_rad, 0);
}

inline double nav_cos(double x_rad)
{
    return nav_sin_quarters(x_rad, 1);
}

/* Root of what rounding may have taken below zero; what is no number stays none. */
inline double nav_root(double x)
{
    return x <= 0.0 ? 0.0 : std::sqrt(x);
}

/* To (-pi, pi]; NaN beyond some angles of 1e6 rad. */
inline double nav_wrap(double x_rad)
{
    if (!(std::fabs(x_rad) <= 4.0 * NAV_ANGLE_MAX)) return NAV_NAN;
    const double w = x_rad - 2.0 * NAV_PI * nav_floor((x_rad + NAV_PI) / (2.0 * NAV_PI));
    return w <= -NAV_PI ? w + 2.0 * NAV_PI : w;
}

/* det_atan2() of what may not be finite. */
inline double nav_atan2(double y, double x)
{
    return std::isfinite(y) && std::isfinite(x) ? det_atan2(y, x) : NAV_NAN;
}

inline double nav_asin(double x)
{
    const double in = x > 1.0 ? 1.0 : (x < -1.0 ? -1.0 : x);
    return nav_atan2(in, std::sqrt((1.0 - in) * (1.0 + in)));
}

/* e^-x for any x >= 0: beyond 700 it is nothing. */
inline double nav_decay(double x)
{
    if (!(x >= 0.0)) return NAV_NAN;
    return x > 700.0 ? 0.0 : det_exp(-x);
}

/* x - 1 + e^-x for x >= 0, without cancellation: the series below 1/4. */
inline double nav_ramp_up(double x)
{
    if (x > 0.25) return x - 1.0 + nav_decay(x);
    double sum = 1.0;
    for (int n = 16; n >= 3; n--) sum = 1.0 - sum * x / n;
    return 0.5 * x * x * sum;
}

/* 1 - e^-x for x >= 0. */
inline double nav_rise(double x)
{
    return x - nav_ramp_up(x);
}

#endif
