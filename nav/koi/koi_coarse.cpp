/* Coarse alignment: apparent gravity, held against inertial space by the gyros, turns with the Earth. */
#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_earth.hpp"

/* Integrals of the force in axes that stand still in inertial space, those of b at the start, and the attitude to them at the end. */
struct held {
    vec3 first, second; /* of the halves */
    mat3 end;
};

static held hold_force(const double *dtheta_rad, const double *dv_mps, int64_t n)
{
    held s = {vec3::Zero(), vec3::Zero(), mat3::Identity()};
    vec3 a_before = vec3::Zero();
    const int64_t half = n / 2;
    for (int64_t i = 0; i < 2 * half; i++) {
        const vec3 a(dtheta_rad + 3 * i), v(dv_mps + 3 * i);
        (i < half ? s.first : s.second) += s.end * (v + 0.5 * a.cross(v));
        s.end = s.end * nav_rotation_by(a + a_before.cross(a) / 12.0);
        a_before = a;
    }
    return s;
}

int nav_koi_coarse(const double *dtheta_rad, const double *dv_mps, int64_t n, double sample_s, double lat_rad,
                   double C_nb_begin[9], double C_nb_end[9], double *ratio)
{
    const int64_t half = n / 2;
    const double half_s = (double)half * sample_s;
    if (n < 2 || !(sample_s > 0.0 && half_s >= 5.0)) return NAV_RANGE;
    if (!(std::fabs(lat_rad) <= 85.0 * NAV_DEG)) return NAV_LATITUDE;
    const held s = hold_force(dtheta_rad, dv_mps, n);
    if (!s.end.allFinite() || !s.first.allFinite() || !s.second.allFinite()) return NAV_NOT_FINITE;
    const vec3 up = (s.first.normalized() + s.second.normalized()).normalized();
    vec3 east = s.second.normalized() - s.first.normalized();
    east -= up * up.dot(east);
    const double seen = east.norm() / (NAV_EARTH_RADPS * nav_cos(lat_rad) * half_s);
    if (ratio) *ratio = seen;
    if (!(seen > 0.5 && seen < 1.5)) return NAV_SINGULAR;
    east.normalize();
    mat3 c; /* from the axes of the start to n in the middle */
    c.row(0) = east;
    c.row(1) = up.cross(east);
    c.row(2) = up;
    const vec3 u(0.0, NAV_EARTH_RADPS * nav_cos(lat_rad), NAV_EARTH_RADPS * nav_sin(lat_rad));
    const mat3 half_turn = nav_rotation_by(u * half_s); /* of n in inertial space */
    if (C_nb_begin) nav_store_rows(nav_nearest_rotation(half_turn * c), C_nb_begin);
    if (C_nb_end) nav_store_rows(nav_nearest_rotation(half_turn.transpose() * c * s.end), C_nb_end);
    return NAV_OK;
}
