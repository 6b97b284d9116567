/* The ellipsoid of WGS 84 (NIMA TR8350.2, tables 3.1, 3.3, 3.4), its gravity and the rates of the local level n: east, north, up. */
#ifndef PSABENCH_NAV_EARTH_HPP
#define PSABENCH_NAV_EARTH_HPP

#include "nav/common/nav_rotation.hpp"
#include "nav/nav.h"

constexpr double EARTH_A_M = 6378137.0;
constexpr double EARTH_E2 = 6.69437999014e-3;
constexpr double EARTH_GE_MPS2 = 9.7803253359;
constexpr double EARTH_SOMIGLIANA = 1.931852652458e-3;    /* b gp / (a ge) - 1 */
constexpr double EARTH_LATITUDE_MAX_RAD = 89.9 * NAV_DEG; /* the transport rate grows without bound */

struct earth_place {
    double sin_lat, cos_lat;
    double meridian_m, vertical_m; /* radii of curvature plus height */
};

inline earth_place earth_place_at(double lat_rad, double h_m)
{
    const double s = nav_sin(lat_rad), x = 1.0 - EARTH_E2 * s * s;
    const double vertical_m = EARTH_A_M / std::sqrt(x);
    return {s, std::sqrt(1.0 - s * s), vertical_m * (1.0 - EARTH_E2) / x + h_m, vertical_m + h_m};
}

/* Somigliana, linear in height. */
inline double earth_gravity_mps2(double sin_lat, double h_m)
{
    const double s2 = sin_lat * sin_lat;
    return EARTH_GE_MPS2 * (1.0 + EARTH_SOMIGLIANA * s2) / std::sqrt(1.0 - EARTH_E2 * s2) *
           (1.0 - 2.0 * h_m / EARTH_A_M);
}

/* u: rate of the Earth, in n. */
inline vec3 earth_rate_n(const earth_place &p)
{
    return {0.0, NAV_EARTH_RADPS * p.cos_lat, NAV_EARTH_RADPS * p.sin_lat};
}

/* rho: rate of n against the Earth, in n. */
inline vec3 earth_transport_n(const earth_place &p, const vec3 &v_n_mps)
{
    const double east = v_n_mps[0] / p.vertical_m;
    return {-v_n_mps[1] / p.meridian_m, east, east * p.sin_lat / p.cos_lat};
}

#endif
