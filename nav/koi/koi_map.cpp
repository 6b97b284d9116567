/* T of koi.h: between the errors of errors.h and the article's. */
#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_earth.hpp"

struct koi_map koi_map_at(const struct nav_state *at)
{
    const earth_place place = earth_place_at(at->lat_rad, at->h_m);
    return {place.sin_lat / (place.cos_lat * place.vertical_m), at->v_n_mps[0], at->v_n_mps[1]};
}

void koi_map_rows(const struct koi_map &m, int columns, double *a)
{
    double *beta = a + ERR_BU * columns;
    for (int j = 0; j < columns; j++) {
        a[ERR_VE * columns + j] += m.north_mps * beta[j];
        a[ERR_VN * columns + j] -= m.east_mps * beta[j];
        beta[j] += m.t_per_m * a[ERR_E * columns + j];
    }
}

/* T^-1: betaU = beta3 - t dr1, dvE = dV1 - betaU V2, dvN = dV2 + betaU V1. */
void koi_unmap_columns(const struct koi_map &m, int rows, int columns, double *a)
{
    for (int i = 0; i < rows; i++) {
        double *row = a + i * columns;
        row[ERR_BU] += m.east_mps * row[ERR_VN] - m.north_mps * row[ERR_VE];
        row[ERR_E] -= m.t_per_m * row[ERR_BU];
    }
}

void koi_errors_of(const struct koi_map &m, const double *x, double errors[KOI_ERRORS])
{
    for (int i = 0; i < KOI_ERRORS; i++) errors[i] = x[KOI_OF_ERROR[i]];
    errors[ERR_BU] -= m.t_per_m * errors[ERR_E];
    errors[ERR_VE] -= m.north_mps * errors[ERR_BU];
    errors[ERR_VN] += m.east_mps * errors[ERR_BU];
}

/* Place by the radii of the place that is found: errors of kilometres are metres off by those of the other one. */
struct nav_state koi_less(const struct nav_state &at, const double errors[KOI_ERRORS])
{
    struct nav_state out = at;
    earth_place place = earth_place_at(at.lat_rad, at.h_m - errors[ERR_U]);
    out.lat_rad -= errors[ERR_N] / place.meridian_m;
    out.h_m -= errors[ERR_U];
    place = earth_place_at(out.lat_rad, out.h_m);
    out.lon_rad -= errors[ERR_E] / (place.vertical_m * place.cos_lat);
    for (int i = 0; i < 3; i++) out.v_n_mps[i] -= errors[ERR_VE + i];
    const mat3 c = Eigen::Map<const mat3_rows>(at.C_nb);
    nav_store_rows(nav_rotation_by(-vec3(errors[ERR_BE], errors[ERR_BN], errors[ERR_BU])) * c, out.C_nb);
    return out;
}

struct nav_state koi_hybrid(const struct nav_koi *k)
{
    double errors[KOI_ERRORS];
    koi_errors_of(koi_map_at(&k->before), k->kf.x, errors);
    return koi_less(k->before, errors);
}
