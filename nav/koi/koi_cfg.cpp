#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_check.hpp"
#include "nav/common/nav_earth.hpp"

#include <cstring>

/* What differs between the classes; the rest is common. Drifts and biases: persistent, from run to run. Misalignments: what a calibration
 * on a rate table leaves after a year (E0). */
struct unit_class {
    double nu_degph, nu_run_degph, df_mps2, df_run_mps2;
    double nu_walk_degph_rth; /* after an hour */
    double gyro_noise_degph, velocity_sd_mps;
};
static const struct unit_class classes[NAV_KOI_CLASSES] = {
    {0.01, 0.003, 5e-4, 1.5e-4, 0.0, 0.1, 0.05},
    {0.02, 0.01, 1.5e-3, 5e-4, 0.01, 0.15, 0.15},
};

static void set_measured(struct nav_koi_cfg *cfg, double velocity_sd_mps)
{
    for (int i = 0; i < 3; i++) {
        cfg->dr_sd_m[i] = 10.0;
        cfg->dv_sd_mps[i] = 0.01;
        cfg->position_sd_m[i] = i < 2 ? 5.0 : 8.0;
        cfg->velocity_sd_mps[i] = velocity_sd_mps;
    }
    cfg->stop_sd_mps = 0.02;
    cfg->height_sd_m = 1.0;
    cfg->damping_per_s = 0.05; /* poles at 0.025/s: 40 s */
    cfg->damping_per_s2 = 6.3e-4;
    cfg->gate_nis[0] = 10.83; /* chi-square, one in a thousand */
    cfg->gate_nis[1] = 16.27;
    cfg->outlier_nis = 1000.0;
    cfg->max_age_s = 0.5;
    cfg->reopen_s = 120.0;
    cfg->slow_s = 60.0;
}

int nav_koi_default(int unit_class, struct nav_koi_cfg *cfg)
{
    if (unit_class < 0 || unit_class >= NAV_KOI_CLASSES) return NAV_RANGE;
    const struct unit_class *c = &classes[unit_class];
    *cfg = {};
    cfg->sample_s = 0.01;
    cfg->step_s = 0.1;
    cfg->form = NAV_KF_JOSEPH;
    cfg->gauge = NAV_SINS_ARTICLE;
    cfg->alignment_s = 600.0;
    cfg->nu_sd_radps = c->nu_degph * NAV_DEGPH;
    cfg->nu_run_radps = c->nu_run_degph * NAV_DEGPH;
    cfg->df_sd_mps2 = c->df_mps2;
    cfg->df_run_mps2 = c->df_run_mps2;
    cfg->gamma_scale_sd = 2e-4;
    cfg->theta_scale_sd = 1e-5;
    cfg->gamma_angle_sd_rad = cfg->theta_angle_sd_rad = NAV_ARCMIN / 6.0;
    cfg->dt1_sd_s = cfg->dt2_sd_s = 0.05;
    cfg->baro_sd_m = 30.0;
    cfg->baro_walk_m_rts = 0.5;
    cfg->gyro_noise_radps_rts = c->gyro_noise_degph * NAV_DEGPH;
    cfg->accel_noise_mps2_rts = 0.001;
    cfg->nu_walk_radps_rts = c->nu_walk_degph_rth * NAV_DEGPH / 60.0;
    set_measured(cfg, c->velocity_sd_mps);
    return NAV_OK;
}

#define REAL(field, low, high, want)  CHECK_DOUBLE(struct nav_koi_cfg, field, low, high, want)
#define WHOLE(field, low, high, want) CHECK_INT(struct nav_koi_cfg, field, low, high, want)
static const char SD[] = "a standard deviation, 0: known";
static const char NOISE[] = "a density, 0: none";
static const char ABOVE[] = "above 0";
static const char ARM[] = "within 200 m";
static const struct check_rule rules[] = {
    REAL(sample_s, 1e-4, 1.0, "from 0.1 ms to 1 s"),
    REAL(step_s, 1e-4, 10.0, "from 0.1 ms to 10 s"),
    WHOLE(form, NAV_KF_JOSEPH, NAV_KF_UD, "a form of enum nav_kf_form"),
    WHOLE(gauge, NAV_SINS_ARTICLE, NAV_SINS_FREE9, "a gauge of enum nav_sins_gauge"),
    REAL(alignment_s, 0.0, 1e5, "a length, 0: none"),
    REAL(dr_sd_m[0], 0.0, 1e5, SD),
    REAL(dr_sd_m[1], 0.0, 1e5, SD),
    REAL(dr_sd_m[2], 0.0, 1e5, SD),
    REAL(dv_sd_mps[0], 0.0, 1e3, SD),
    REAL(dv_sd_mps[1], 0.0, 1e3, SD),
    REAL(dv_sd_mps[2], 0.0, 1e3, SD),
    REAL(alpha_sd_rad, 0.0, 0.2, "from 0 to 0.2 rad: errors are of first order"),
    REAL(beta3_sd_rad, 0.0, 0.2, "from 0 to 0.2 rad: errors are of first order"),
    REAL(nu_sd_radps, 0.0, 0.1, SD),
    REAL(nu_run_radps, 0.0, 0.1, SD),
    REAL(df_sd_mps2, 0.0, 1.0, SD),
    REAL(df_run_mps2, 0.0, 1.0, SD),
    REAL(gamma_scale_sd, 0.0, 0.1, SD),
    REAL(gamma_angle_sd_rad, 0.0, 0.1, SD),
    REAL(theta_scale_sd, 0.0, 0.1, SD),
    REAL(theta_angle_sd_rad, 0.0, 0.1, SD),
    REAL(dt1_sd_s, 0.0, 1.0, SD),
    REAL(dt2_sd_s, 0.0, 1.0, SD),
    REAL(baro_sd_m, 0.0, 1e4, SD),
    REAL(gyro_noise_radps_rts, 0.0, 0.1, NOISE),
    REAL(accel_noise_mps2_rts, 0.0, 1.0, NOISE),
    REAL(nu_walk_radps_rts, 0.0, 0.1, NOISE),
    REAL(df_walk_mps2_rts, 0.0, 1.0, NOISE),
    REAL(baro_walk_m_rts, 0.0, 100.0, NOISE),
    REAL(position_sd_m[0], CHECK_ABOVE, 1e5, ABOVE),
    REAL(position_sd_m[1], CHECK_ABOVE, 1e5, ABOVE),
    REAL(position_sd_m[2], CHECK_ABOVE, 1e5, ABOVE),
    REAL(velocity_sd_mps[0], CHECK_ABOVE, 1e3, ABOVE),
    REAL(velocity_sd_mps[1], CHECK_ABOVE, 1e3, ABOVE),
    REAL(velocity_sd_mps[2], CHECK_ABOVE, 1e3, ABOVE),
    REAL(stop_sd_mps, CHECK_ABOVE, 1e3, ABOVE),
    REAL(height_sd_m, CHECK_ABOVE, 1e4, ABOVE),
    REAL(damping_per_s, 0.0, 1.0, "from 0 to 1/s"),
    REAL(damping_per_s2, 0.0, 1.0, "from 0 to 1/s^2"),
    REAL(gate_nis[0], CHECK_ABOVE, CHECK_ANY, ABOVE),
    REAL(gate_nis[1], CHECK_ABOVE, CHECK_ANY, ABOVE),
    REAL(outlier_nis, CHECK_ABOVE, CHECK_ANY, ABOVE),
    REAL(max_age_s, 0.0, 10.0, "from 0 to 10 s"),
    REAL(antenna_m[0], -200.0, 200.0, ARM),
    REAL(antenna_m[1], -200.0, 200.0, ARM),
    REAL(antenna_m[2], -200.0, 200.0, ARM),
    REAL(reopen_s, 0.0, 1e6, "a time, 0: never"),
    REAL(slow_r_sd_m[0], 0.0, 1e5, SD),
    REAL(slow_r_sd_m[1], 0.0, 1e5, SD),
    REAL(slow_r_sd_m[2], 0.0, 1e5, SD),
    REAL(slow_v_sd_mps[0], 0.0, 1e3, SD),
    REAL(slow_v_sd_mps[1], 0.0, 1e3, SD),
    REAL(slow_v_sd_mps[2], 0.0, 1e3, SD),
    REAL(slow_s, CHECK_ABOVE, 1e6, ABOVE),
};

int nav_koi_check(const struct nav_koi_cfg *cfg, struct nav_refusal *why)
{
    const int status = check_all(cfg, rules, why);
    if (status != NAV_OK) return status;
    const double per_step = nav_floor(cfg->step_s / cfg->sample_s + 0.5);
    if (per_step < 1.0 || per_step > KOI_STEP_MAX || std::fabs(per_step * cfg->sample_s - cfg->step_s) > 1e-9)
        return check_refuse(why, NAV_RANGE, "step_s", cfg->step_s, "1 to 64 whole samples");
    return NAV_OK;
}

const char *nav_koi_block_name(int block)
{
    static const char *const names[] = {"dr",     "dV", "alpha", "beta3", "vertical", "baro", "slow_r",
                                        "slow_v", "nu", "df",    "gamma", "theta",    "dt"};
    return block < 0 || block >= NAV_KOI_BLOCKS ? "" : names[block];
}

const char *nav_koi_reason_text(int reason)
{
    static const char *const texts[] = {"accepted",
                                        "invalid by its own status",
                                        "not finite",
                                        "latitude or standard deviation out of range",
                                        "not later than the one before",
                                        "stale",
                                        "later than the last increment",
                                        "an outlier",
                                        "gated",
                                        "rejected by the filter",
                                        "taken by a widened filter"};
    return reason < 0 || reason >= NAV_KOI_REASONS ? "" : texts[reason];
}

struct nav_errors_cfg koi_errors_cfg(const struct nav_koi_cfg *cfg)
{
    struct nav_errors_cfg e = {};
    e.vertical = NAV_VERTICAL_FREE;
    e.gauge = cfg->gauge;
    e.gyro_noise_radps_rts = cfg->gyro_noise_radps_rts;
    e.accel_noise_mps2_rts = cfg->accel_noise_mps2_rts;
    return e;
}

static int size_of_slow(const double sd[3])
{
    return sd[0] + sd[1] + sd[2] > 0.0 ? 3 : 0;
}

int nav_koi_layout(const struct nav_koi_cfg *cfg, struct nav_sins_rows rows[NAV_KOI_BLOCKS])
{
    const int status = nav_koi_check(cfg, nullptr);
    if (status != NAV_OK) return status;
    const int gamma = cfg->gauge == NAV_SINS_FREE9 ? 9 : 6;
    const int baro = cfg->baro_sd_m > 0.0 ? 1 : 0;
    const int slow_r = size_of_slow(cfg->slow_r_sd_m), slow_v = size_of_slow(cfg->slow_v_sd_mps);
    const int sizes[NAV_KOI_BLOCKS] = {2, 2, 2, 1, 2, baro, slow_r, slow_v, 3, 3, gamma, 9, 2};
    int offset = 0;
    for (int b = 0; b < NAV_KOI_BLOCKS; b++) {
        rows[b] = {offset, sizes[b]};
        offset += sizes[b];
    }
    return offset;
}

int koi_index_columns(const struct nav_koi_cfg *cfg, const struct nav_sins_rows *at, int *column)
{
    static const int block_of[NAV_ERRORS_BLOCKS] = {-1, -1, -1, NAV_KOI_NU, NAV_KOI_THETA, NAV_KOI_DF, NAV_KOI_GAMMA};
    struct nav_sins_rows rows[NAV_ERRORS_BLOCKS];
    const struct nav_errors_cfg errors = koi_errors_cfg(cfg);
    const int n = nav_errors_layout(&errors, rows);
    for (int i = 0; i < KOI_ERRORS; i++) column[i] = KOI_OF_ERROR[i];
    for (int b = NAV_ERRORS_NU; b < NAV_ERRORS_BLOCKS; b++)
        for (int i = 0; i < rows[b].size; i++) column[rows[b].offset + i] = at[block_of[b]].offset + i;
    return n;
}
