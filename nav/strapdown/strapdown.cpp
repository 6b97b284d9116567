/* Strapdown integration (strapdown.h). Names of Savage's papers, in axes east, north, up. */
#include "nav/strapdown.h"

#include "nav/common/nav_math.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace
{

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Rows3 = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
using RowsOut3 = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;

/* WGS 84 (NIMA TR8350.2, tables 3.1, 3.3, 3.4). */
constexpr double A_M = 6378137.0;
constexpr double E2 = 6.69437999014e-3;
constexpr double GE_MPS2 = 9.7803253359;
constexpr double K_SOMIGLIANA = 1.931852652458e-3; /* b gp / (a ge) - 1 */

constexpr double LATITUDE_MAX_RAD = 89.9 * NAV_DEG; /* the transport rate grows without bound */

struct Earth {
    double sin_lat, cos_lat;
    double meridian_m, vertical_m; /* radii with height */
};

Earth earth_at(double lat_rad, double h_m)
{
    const double s = nav_sin(lat_rad), x = 1.0 - E2 * s * s;
    const double re = A_M / std::sqrt(x);
    return {s, std::sqrt(1.0 - s * s), re * (1.0 - E2) / x + h_m, re + h_m};
}

double gravity_mps2(double sin_lat, double h_m)
{
    const double s2 = sin_lat * sin_lat;
    return GE_MPS2 * (1.0 + K_SOMIGLIANA * s2) / std::sqrt(1.0 - E2 * s2) * (1.0 - 2.0 * h_m / A_M);
}

/* Rate of the Earth, in n. */
Vec3 earth_rate(const Earth &e)
{
    return {0.0, NAV_EARTH_RADPS * e.cos_lat, NAV_EARTH_RADPS * e.sin_lat};
}

/* Rate of n against the Earth, in n. */
Vec3 transport_rate(const Earth &e, const Vec3 &v)
{
    const double east = v[0] / e.vertical_m;
    return {-v[1] / e.meridian_m, east, east * e.sin_lat / e.cos_lat};
}

/* exp([rv x]); a series for small angles, whose first term left out is 1e-17 of 1. */
Mat3 rotation_by(const Vec3 &rv)
{
    const double z = rv.squaredNorm();
    double cos_minus_1 = -0.5 * z + z * z * (1.0 / 24.0 - z * (1.0 / 720.0));
    double k1 = 1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)));
    double k2 = 0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0));
    if (z > 1e-4) {
        const double angle = std::sqrt(z);
        cos_minus_1 = nav_cos(angle) - 1.0;
        k1 = nav_sin(angle) / angle;
        k2 = -cos_minus_1 / z;
    }
    Mat3 r = k2 * rv * rv.transpose();
    r(0, 0) += 1.0 + cos_minus_1;
    r(1, 1) += 1.0 + cos_minus_1;
    r(2, 2) += 1.0 + cos_minus_1;
    r(0, 1) -= k1 * rv[2];
    r(1, 0) += k1 * rv[2];
    r(0, 2) += k1 * rv[1];
    r(2, 0) -= k1 * rv[1];
    r(1, 2) -= k1 * rv[0];
    r(2, 1) += k1 * rv[0];
    return r;
}

/* Of one interval, in b at its beginning (Savage 1, (33), (46); 2, (23), (37)): the rotation vector and the change of velocity. */
struct Increment {
    Vec3 theta, dv;
};

Increment increment_of(const Vec3 &a, const Vec3 &v, const Vec3 &a_before, const Vec3 &v_before)
{
    const Vec3 coning = a_before.cross(a) / 12.0;
    const Vec3 sculling = (a_before.cross(v) + v_before.cross(a)) / 12.0;
    return {a + coning, v + sculling + 0.5 * a.cross(v)};
}

struct Motion {
    double lat_rad, lon_rad, h_m;
    Vec3 v;
    Mat3 C;
};

/* One interval: velocity by rates at its beginning, place and attitude by the mean velocity. */
void advance_motion(Motion &m, const Increment &d, double dt_s, bool fixed)
{
    const Earth e = earth_at(m.lat_rad, m.h_m);
    const Vec3 u = earth_rate(e);
    const Vec3 w = u + transport_rate(e, m.v); /* of n in inertial space */
    const Vec3 dv_n = m.C * d.dv;
    const Vec3 g(0.0, 0.0, -gravity_mps2(e.sin_lat, m.h_m + 0.5 * m.v[2] * dt_s));
    Vec3 after = m.v + dv_n + (g - (w + u).cross(m.v) - 0.5 * w.cross(dv_n)) * dt_s;
    if (fixed) after[2] = 0.0;
    const Vec3 mean = 0.5 * (m.v + after);
    const Vec3 rho = transport_rate(e, mean);
    m.lat_rad -= rho[0] * dt_s;
    m.lon_rad += rho[1] / e.cos_lat * dt_s;
    m.h_m += mean[2] * dt_s;
    m.v = after;
    m.C = rotation_by(-(u + rho) * dt_s) * (m.C * rotation_by(d.theta));
}

Motion motion_of(const struct nav_state &s)
{
    return {s.lat_rad, s.lon_rad, s.h_m, Vec3(s.v_n_mps), Rows3(s.C_nb)};
}

void store_motion(const Motion &m, struct nav_state &s)
{
    s.lat_rad = m.lat_rad;
    s.lon_rad = m.lon_rad;
    s.h_m = m.h_m;
    Eigen::Map<Vec3>(s.v_n_mps) = m.v;
    RowsOut3(s.C_nb) = m.C;
}

bool is_finite(const Motion &m)
{
    return std::isfinite(m.lat_rad + m.lon_rad + m.h_m) && m.v.allFinite() && m.C.allFinite();
}

int fault_of(const Motion &m)
{
    if (!is_finite(m)) return NAV_NOT_FINITE;
    return std::fabs(m.lat_rad) <= LATITUDE_MAX_RAD ? NAV_OK : NAV_RANGE;
}

} // namespace

double nav_gravity_mps2(double lat_rad, double h_m)
{
    return gravity_mps2(nav_sin(lat_rad), h_m);
}

void nav_radii_m(double lat_rad, double h_m, double *meridian_m, double *vertical_m)
{
    const Earth e = earth_at(lat_rad, h_m);
    *meridian_m = e.meridian_m;
    *vertical_m = e.vertical_m;
}

void nav_dcm(double heading_rad, double pitch_rad, double roll_rad, double C_nb[9])
{
    const double sh = nav_sin(heading_rad), ch = nav_cos(heading_rad);
    const double sp = nav_sin(pitch_rad), cp = nav_cos(pitch_rad);
    const double sr = nav_sin(roll_rad), cr = nav_cos(roll_rad);
    const double c[9] = {ch * cr + sh * sp * sr,
                         sh * cp,
                         ch * sr - sh * sp * cr,
                         ch * sp * sr - sh * cr,
                         ch * cp,
                         -sh * sr - ch * sp * cr,
                         -cp * sr,
                         sp,
                         cp * cr};
    for (int i = 0; i < 9; i++) C_nb[i] = c[i];
}

void nav_dcm_angles(const double C_nb[9], double *heading_rad, double *pitch_rad, double *roll_rad)
{
    *heading_rad = nav_atan2(C_nb[1], C_nb[4]);
    *pitch_rad = nav_asin(C_nb[7]);
    *roll_rad = nav_atan2(-C_nb[6], C_nb[8]);
}

int nav_integrate(struct nav_strapdown *s, const double *dtheta_rad, const double *dv_mps, int64_t n, double dt_s,
                  struct nav_state *path, int64_t *done)
{
    Motion m = motion_of(s->at);
    const bool fixed = s->vertical == NAV_VERTICAL_FIXED;
    Vec3 a_before(s->dtheta_rad), v_before(s->dv_mps);
    int64_t i = 0;
    int status = fault_of(m);
    if (n < 0 || !(dt_s > 0.0 && dt_s <= 1.0) || (!fixed && s->vertical != NAV_VERTICAL_FREE)) status = NAV_RANGE;
    if (fixed) m.v[2] = 0.0;
    for (; i < n && status == NAV_OK; i++) {
        const Vec3 a(dtheta_rad + 3 * i), v(dv_mps + 3 * i);
        advance_motion(m, increment_of(a, v, a_before, v_before), dt_s, fixed);
        status = fault_of(m);
        if (status != NAV_OK) break;
        if (path) store_motion(m, path[i]);
        a_before = a;
        v_before = v;
    }
    if (done) *done = i;
    if (status != NAV_OK) return status;
    store_motion(m, s->at);
    Eigen::Map<Vec3>(s->dtheta_rad) = a_before;
    Eigen::Map<Vec3>(s->dv_mps) = v_before;
    return NAV_OK;
}
