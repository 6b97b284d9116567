/* What the parts of libpsabench-nav share in arithmetic: the same bytes on every machine, so nothing of libm but sqrt. */
#ifndef PSABENCH_NAV_MATH_HPP
#define PSABENCH_NAV_MATH_HPP

#include <cmath>

extern "C" {
#include "base/detmath.h"
}

constexpr double NAV_PI = 3.14159265358979323846;
constexpr double NAV_DEG = NAV_PI / 180.0;
constexpr double NAV_ARCMIN = NAV_DEG / 60.0;
constexpr double NAV_DEGPH = NAV_DEG / 3600.0;

/* To (-pi, pi]. */
inline double nav_wrap(double x_rad)
{
    const double w = x_rad - 2.0 * NAV_PI * std::floor((x_rad + NAV_PI) / (2.0 * NAV_PI));
    return w <= -NAV_PI ? w + 2.0 * NAV_PI : w;
}

inline double nav_asin(double x)
{
    const double in = x > 1.0 ? 1.0 : (x < -1.0 ? -1.0 : x);
    return det_atan2(in, std::sqrt((1.0 - in) * (1.0 + in)));
}

/* e^-x for any x >= 0: beyond 700 it is nothing. */
inline double nav_decay(double x)
{
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
