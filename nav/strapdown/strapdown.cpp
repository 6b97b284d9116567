/* Strapdown integration (strapdown.h). Names of Savage's papers, in axes east, north, up. */
#include "nav/strapdown.h"

#include "nav/common/nav_earth.hpp"

namespace
{

/* Of one interval, in b at its beginning (Savage 1, (33), (46); 2, (23), (37)): the rotation vector and the change of velocity. */
struct Increment {
    vec3 theta, dv;
};

Increment increment_of(const vec3 &a, const vec3 &v, const vec3 &a_before, const vec3 &v_before)
{
    const vec3 coning = a_before.cross(a) / 12.0;
    const vec3 sculling = (a_before.cross(v) + v_before.cross(a)) / 12.0;
    return {a + coning, v + sculling + 0.5 * a.cross(v)};
}

struct Motion {
    double lat_rad, lon_rad, h_m;
    vec3 v;
    mat3 C;
};

/* One interval: velocity by rates at its beginning, place and attitude by the mean velocity. */
void advance_motion(Motion &m, const Increment &d, double dt_s, bool fixed)
{
    const earth_place e = earth_place_at(m.lat_rad, m.h_m);
    const vec3 u = earth_rate_n(e);
    const vec3 w = u + earth_transport_n(e, m.v); /* of n in inertial space */
    const vec3 dv_n = m.C * d.dv;
    const vec3 g(0.0, 0.0, -earth_gravity_mps2(e.sin_lat, m.h_m + 0.5 * m.v[2] * dt_s));
    vec3 after = m.v + dv_n + (g - (w + u).cross(m.v) - 0.5 * w.cross(dv_n)) * dt_s;
    if (fixed) after[2] = 0.0;
    const vec3 mean = 0.5 * (m.v + after);
    const vec3 rho = earth_transport_n(e, mean);
    m.lat_rad -= rho[0] * dt_s;
    m.lon_rad += rho[1] / e.cos_lat * dt_s;
    m.h_m += mean[2] * dt_s;
    m.v = after;
    m.C = nav_rotation_by(-(u + rho) * dt_s) * (m.C * nav_rotation_by(d.theta));
}

Motion motion_of(const struct nav_state &s)
{
    return {s.lat_rad, s.lon_rad, s.h_m, vec3(s.v_n_mps), Eigen::Map<const mat3_rows>(s.C_nb)};
}

void store_motion(const Motion &m, struct nav_state &s)
{
    s.lat_rad = m.lat_rad;
    s.lon_rad = m.lon_rad;
    s.h_m = m.h_m;
    Eigen::Map<vec3>(s.v_n_mps) = m.v;
    nav_store_rows(m.C, s.C_nb);
}

bool is_finite(const Motion &m)
{
    return std::isfinite(m.lat_rad + m.lon_rad + m.h_m) && m.v.allFinite() && m.C.allFinite();
}

int fault_of(const Motion &m)
{
    if (!is_finite(m)) return NAV_NOT_FINITE;
    return std::fabs(m.lat_rad) <= EARTH_LATITUDE_MAX_RAD ? NAV_OK : NAV_RANGE;
}

} // namespace

double nav_gravity_mps2(double lat_rad, double h_m)
{
    return earth_gravity_mps2(nav_sin(lat_rad), h_m);
}

void nav_radii_m(double lat_rad, double h_m, double *meridian_m, double *vertical_m)
{
    const earth_place e = earth_place_at(lat_rad, h_m);
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
    vec3 a_before(s->dtheta_rad), v_before(s->dv_mps);
    int64_t i = 0;
    int status = fault_of(m);
    if (n < 0 || !(dt_s > 0.0 && dt_s <= 1.0) || (!fixed && s->vertical != NAV_VERTICAL_FREE)) status = NAV_RANGE;
    if (fixed) m.v[2] = 0.0;
    for (; i < n && status == NAV_OK; i++) {
        const vec3 a(dtheta_rad + 3 * i), v(dv_mps + 3 * i);
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
    Eigen::Map<vec3>(s->dtheta_rad) = a_before;
    Eigen::Map<vec3>(s->dv_mps) = v_before;
    return NAV_OK;
}
