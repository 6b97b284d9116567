/* Where the filter begins: standard deviations of independent parts, and what the alignment makes of them. */
#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_earth.hpp"
#include "nav/sins/sins_model.hpp"

static double square_of(double x)
{
    return x * x;
}

static void set_constants(const struct nav_koi_cfg *cfg, const struct nav_sins_rows *at, double *variance)
{
    const struct sins_gauge *gauge = &sins_gauges[cfg->gauge];
    for (int i = 0; i < 3; i++) {
        variance[at[NAV_KOI_NU].offset + i] = square_of(cfg->nu_sd_radps) + square_of(cfg->nu_run_radps);
        variance[at[NAV_KOI_DF].offset + i] = square_of(cfg->df_sd_mps2) + square_of(cfg->df_run_mps2);
    }
    for (int i = 0; i < at[NAV_KOI_GAMMA].size; i++)
        variance[at[NAV_KOI_GAMMA].offset + i] =
            square_of(gauge->at[i] % 4 == 0 ? cfg->gamma_scale_sd : cfg->gamma_angle_sd_rad);
    for (int i = 0; i < 9; i++)
        variance[at[NAV_KOI_THETA].offset + i] = square_of(i % 4 == 0 ? cfg->theta_scale_sd : cfg->theta_angle_sd_rad);
    variance[at[NAV_KOI_DT].offset] = square_of(cfg->dt1_sd_s);
    variance[at[NAV_KOI_DT].offset + 1] = square_of(cfg->dt2_sd_s);
    if (at[NAV_KOI_BARO].size) variance[at[NAV_KOI_BARO].offset] = square_of(cfg->baro_sd_m);
    for (int i = 0; i < at[NAV_KOI_SLOW_R].size; i++)
        variance[at[NAV_KOI_SLOW_R].offset + i] = square_of(cfg->slow_r_sd_m[i]);
    for (int i = 0; i < at[NAV_KOI_SLOW_V].size; i++)
        variance[at[NAV_KOI_SLOW_V].offset + i] = square_of(cfg->slow_v_sd_mps[i]);
}

/* Moving ones: of dr, dv and of white noise in the alignment, which levels by the force and finds north by the east rate. */
static void set_moving(const struct nav_koi_cfg *cfg, const struct nav_state *at, double *variance)
{
    const earth_place place = earth_place_at(at->lat_rad, at->h_m);
    double level = 0.0, heading = 0.0;
    if (cfg->alignment_s > 0.0) {
        level = square_of(cfg->accel_noise_mps2_rts / earth_gravity_mps2(place.sin_lat, at->h_m)) / cfg->alignment_s;
        heading = square_of(cfg->gyro_noise_radps_rts / (NAV_EARTH_RADPS * place.cos_lat)) / cfg->alignment_s;
    }
    for (int i = 0; i < 2; i++) {
        variance[KOI_R1 + i] = square_of(cfg->dr_sd_m[i]);
        variance[KOI_V1 + i] = square_of(cfg->dv_sd_mps[i]);
        variance[KOI_A1 + i] = square_of(cfg->alpha_sd_rad) + level;
    }
    variance[KOI_B3] = square_of(cfg->beta3_sd_rad) + heading;
    variance[KOI_R3] = square_of(cfg->dr_sd_m[2]);
    variance[KOI_V3] = square_of(cfg->dv_sd_mps[2]);
}

/* P = J D J': rows of J, of which all but those of the attitude and the velocity are the identity's. */
static int set_rows(const struct nav_koi_cfg *cfg, const struct nav_state *at, int n, const int *column, double *j)
{
    double beta[3 * KF_MAX];
    const struct nav_errors_cfg errors = koi_errors_cfg(cfg);
    for (int i = 0; i < n; i++) j[i * (n + 1)] = 1.0;
    if (cfg->alignment_s > 0.0) {
        struct nav_sins_rows rows[NAV_ERRORS_BLOCKS];
        const int n_errors = nav_errors_layout(&errors, rows);
        const int status = nav_errors_alignment(&errors, at, beta);
        if (status != NAV_OK) return status;
        for (int i = 0; i < 3; i++)
            for (int c = KOI_ERRORS; c < n_errors; c++) j[(KOI_A1 + i) * n + column[c]] = beta[i * n_errors + c];
        j[KOI_B3 * n + KOI_A2] = nav_sin(at->lat_rad) / nav_cos(at->lat_rad); /* noise of the level turns the heading */
    }
    const struct koi_map m = koi_map_at(at);
    for (int c = 0; c < n; c++) { /* dV by betaU, before beta3 is made of it */
        j[KOI_V1 * n + c] += m.north_mps * j[KOI_B3 * n + c];
        j[KOI_V2 * n + c] -= m.east_mps * j[KOI_B3 * n + c];
    }
    j[KOI_B3 * n + KOI_R1] += m.t_per_m;
    return NAV_OK;
}

int nav_koi_prior(const struct nav_koi_cfg *cfg, const struct nav_state *at, double *p)
{
    struct nav_sins_rows rows[NAV_KOI_BLOCKS];
    int column[KF_MAX];
    double variance[KF_MAX] = {}, j[KF_MAX * KF_MAX] = {};
    const int n = nav_koi_layout(cfg, rows);
    if (n < 0) return n;
    if (!(std::fabs(at->lat_rad) <= EARTH_LATITUDE_MAX_RAD) || !std::isfinite(at->h_m)) return NAV_RANGE;
    koi_index_columns(cfg, rows, column);
    set_constants(cfg, rows, variance);
    set_moving(cfg, at, variance);
    const int status = set_rows(cfg, at, n, column, j);
    if (status != NAV_OK) return status;
    for (int a = 0; a < n; a++)
        for (int b = 0; b <= a; b++) {
            double sum = 0.0;
            for (int c = 0; c < n; c++) sum += j[a * n + c] * variance[c] * j[b * n + c];
            p[a * n + b] = p[b * n + a] = sum;
        }
    return NAV_OK;
}
