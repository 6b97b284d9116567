/* The equations of errors.h as matrices. */
#include "nav/errors/errors_model.hpp"

#include "nav/common/nav_earth.hpp"

namespace
{

enum { E, N, U };

/* Where the unit is, with what its rates are made of. */
struct Place : earth_place {
    double tan_lat;
    vec3 v;
};

Place place_of(const struct nav_errors_cfg *cfg, const struct nav_state *at)
{
    Place p;
    static_cast<earth_place &>(p) = earth_place_at(at->lat_rad, at->h_m);
    p.tan_lat = p.sin_lat / p.cos_lat;
    p.v = vec3(at->v_n_mps);
    if (cfg->vertical == NAV_VERTICAL_FIXED) p.v(U) = 0.0;
    return p;
}

mat3 place_rates(const Place &p, double damping_per_s)
{
    const double m = p.meridian_m, n = p.vertical_m;
    mat3 a;
    a << (p.v(U) - p.v(N) * p.tan_lat) / n, p.v(E) * p.tan_lat / n, -p.v(E) / n, /**/
        0.0, p.v(U) / m, -p.v(N) / m,                                            /**/
        0.0, 0.0, -damping_per_s;
    return a;
}

/* d rho by dr and by dv. */
mat3 transport_by_place(const Place &p)
{
    const double m = p.meridian_m, n = p.vertical_m;
    mat3 a = mat3::Zero();
    a(E, U) = p.v(N) / (m * m);
    a(N, U) = -p.v(E) / (n * n);
    a(U, N) = p.v(E) / (n * p.cos_lat * p.cos_lat * m);
    a(U, U) = -p.v(E) * p.tan_lat / (n * n);
    return a;
}

mat3 transport_by_velocity(const Place &p)
{
    mat3 a = mat3::Zero();
    a(E, N) = -1.0 / p.meridian_m;
    a(N, E) = 1.0 / p.vertical_m;
    a(U, E) = p.tan_lat / p.vertical_m;
    return a;
}

/* du by dr: latitude alone. */
mat3 earth_by_place(const Place &p)
{
    mat3 a = mat3::Zero();
    a(N, N) = -NAV_EARTH_RADPS * p.sin_lat / p.meridian_m;
    a(U, N) = NAV_EARTH_RADPS * p.cos_lat / p.meridian_m;
    return a;
}

/* dg by dr: with height 2 g/a, with latitude by the ellipsoid's 0.0053 sin^2 (Somigliana to the first order of the flattening). */
mat3 gravity_by_place(const Place &p, double g)
{
    mat3 a = mat3::Zero();
    a(U, U) = 2.0 * g / std::sqrt(p.meridian_m * p.vertical_m);
    a(U, N) = -g * 2.0 * 5.3e-3 * p.sin_lat * p.cos_lat / p.meridian_m;
    return a;
}

} // namespace

errors_square errors_rates(const struct nav_errors_cfg *cfg, const struct nav_state *at, const vec3 &f_n)
{
    const Place p = place_of(cfg, at);
    const vec3 u = earth_rate_n(p), rho = earth_transport_n(p, p.v);
    const mat3 v = nav_cross_matrix(p.v);
    const mat3 du = earth_by_place(p), rho_r = transport_by_place(p), rho_v = transport_by_velocity(p);
    errors_square a = errors_square::Zero();
    a.block<3, 3>(0, 0) = place_rates(p, cfg->damping_per_s);
    a.block<3, 3>(0, 3) = mat3::Identity();
    a.block<3, 3>(3, 0) = v * (2.0 * du + rho_r) + gravity_by_place(p, earth_gravity_mps2(p.sin_lat, at->h_m));
    a(5, 2) -= cfg->damping_per_s2;
    a.block<3, 3>(3, 3) = v * rho_v - nav_cross_matrix(2.0 * u + rho);
    a.block<3, 3>(3, 6) = -nav_cross_matrix(f_n);
    a.block<3, 3>(6, 0) = -du - rho_r;
    a.block<3, 3>(6, 3) = -rho_v;
    a.block<3, 3>(6, 6) = -nav_cross_matrix(u + rho);
    return a;
}

/* Columns nu 3, Theta 9 row-major, df 3, Gamma 9 row-major: element ij is C of axis i times rate, force of axis j. */
errors_drive errors_of_sensors(const mat3 &mean_c, const vec3 &w_b, const vec3 &f_b)
{
    errors_drive g = errors_drive::Zero();
    g.block<3, 3>(6, 0) = mean_c;
    g.block<3, 3>(3, 12) = mean_c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            g.block<3, 1>(6, 3 + 3 * i + j) = mean_c.col(i) * w_b(j);
            g.block<3, 1>(3, 15 + 3 * i + j) = mean_c.col(i) * f_b(j);
        }
    return g;
}
