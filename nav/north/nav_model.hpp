/* The article's equations as pure functions: rows of (13) and (14), the horizontal and vertical Earth rate, noise. */
#ifndef PSABENCH_NAV_MODEL_HPP
#define PSABENCH_NAV_MODEL_HPP

#include "nav/common/nav_math.hpp"
#include "nav/nav.h"

struct nav_earth {
    double we_radps, wz_radps; /* (2): U cos lat, U sin lat */
};

inline struct nav_earth nav_earth_at(double latitude_rad)
{
    return {NAV_EARTH_RADPS * nav_cos(latitude_rad), NAV_EARTH_RADPS * nav_sin(latitude_rad)};
}

/* a and b of (13), or of (14), for We = 1. */
struct nav_row {
    double a, b;
};
struct nav_row nav_row_of(const struct nav_position *p, bool simplified);

/* Covariance of window means of a drift that was 0 at the zero of t: less than the stationary one by this. */
double nav_gm_from_zero_less(const struct nav_noise *n, double t_a_s, double window_a_s, double t_b_s,
                             double window_b_s);

/* How a gimbal turned by q about a tilted z_c differs from q, to second order in the tilts. */
inline __attribute__((always_inline)) double nav_cardan_2nd(double cos_q, double sin_q, double pitch_rad,
                                                            double roll_rad)
{
    return cos_q * cos_q * pitch_rad * roll_rad + 0.5 * sin_q * cos_q * (roll_rad * roll_rad - pitch_rad * pitch_rad);
}

#endif
