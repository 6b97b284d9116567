#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_check.hpp"
#include "nav/common/nav_math.hpp"

#include <cstring>

/* Priors, noise: the article's (sources instruments 5.1), at Moscow's latitude. */
void nav_sins_default(struct nav_sins_cfg *cfg)
{
    *cfg = {};
    cfg->latitude_rad = 55.7 * NAV_DEG;
    cfg->gravity_mps2 = 9.81;
    cfg->sample_s = 0.01;
    cfg->step_s = 0.1;
    cfg->beta_sd_rad[0] = cfg->beta_sd_rad[1] = 1.0 * NAV_DEG;
    cfg->beta_sd_rad[2] = 3.0 * NAV_DEG;
    cfg->nu_sd_radps = 0.5 * NAV_DEGPH;
    cfg->theta_scale_sd = cfg->gamma_scale_sd = 1e-3;
    cfg->theta_angle_sd_rad = cfg->gamma_angle_sd_rad = 3.0 * NAV_ARCMIN;
    cfg->df_sd_mps2 = 0.02;
    cfg->lever_sd_m = 0.1;
    cfg->delta_sd_rad = 1.0 * NAV_DEG;
    cfg->tau_sd_s = 0.05;
    cfg->eps_sd_rad = 1.0 * NAV_ARCMIN;
    cfg->walk_tau_s = 1000.0;
    cfg->gyro_noise_radps_rts = 0.1 * NAV_DEGPH;
    cfg->accel_noise_mps2_rts = 0.001;
    cfg->accel_noise_multiplier = 1.0;
    cfg->stand_sd_rad = 15.0 / 60.0 * NAV_ARCMIN;
    cfg->stand_noise_rate_hz = 1.0;
    cfg->stand_interval_s = 0.1;
    cfg->stand_guard_s = 0.3;
}

#define REAL(field, low, high, want)  CHECK_DOUBLE(struct nav_sins_cfg, field, low, high, want)
#define WHOLE(field, low, high, want) CHECK_INT(struct nav_sins_cfg, field, low, high, want)
static const char SD[] = "a standard deviation, 0: known";
static const struct check_rule rules[] = {
    REAL(latitude_rad, -85.0 * NAV_DEG, 85.0 * NAV_DEG, "from -85 to 85 deg"),
    REAL(gravity_mps2, 9.0, 10.0, "from 9 to 10 m/s^2"),
    REAL(sample_s, 1e-4, 1.0, "from 0.1 ms to 1 s"),
    REAL(step_s, 1e-4, 10.0, "from 0.1 ms to 10 s"),
    WHOLE(form, NAV_KF_JOSEPH, NAV_KF_UD, "a form of enum nav_kf_form"),
    WHOLE(gauge, NAV_SINS_ARTICLE, NAV_SINS_FREE9, "a gauge of enum nav_sins_gauge"),
    WHOLE(lever, 0, 9, "0, 3 or 9"),
    WHOLE(stand, 0, 1, "0 or 1"),
    WHOLE(base, 0, 1, "0 or 1"),
    WHOLE(walk, 0, 1, "0 or 1"),
    WHOLE(clone, 0, 1, "0 or 1"),
    REAL(beta_sd_rad[0], 0.0, 0.2, "from 0 to 0.2 rad: errors are of first order"),
    REAL(beta_sd_rad[1], 0.0, 0.2, "from 0 to 0.2 rad: errors are of first order"),
    REAL(beta_sd_rad[2], 0.0, 0.6, "from 0 to 0.6 rad: errors are of first order"),
    REAL(nu_sd_radps, 0.0, 0.1, SD),
    REAL(theta_scale_sd, 0.0, 0.1, SD),
    REAL(theta_angle_sd_rad, 0.0, 0.1, SD),
    REAL(df_sd_mps2, 0.0, 1.0, SD),
    REAL(gamma_scale_sd, 0.0, 0.1, SD),
    REAL(gamma_angle_sd_rad, 0.0, 0.1, SD),
    REAL(lever_sd_m, 0.0, 10.0, SD),
    REAL(quad_sd_s2pm, 0.0, 1e-2, SD),
    REAL(delay_sd_s, 0.0, 0.1, SD),
    REAL(delta_sd_rad, 0.0, 0.2, SD),
    REAL(tau_sd_s, 0.0, 0.2, "from 0 to 0.2 s"),
    REAL(eps_sd_rad, 0.0, 0.2, SD),
    REAL(walk_sd_radps, 0.0, 0.1, SD),
    REAL(walk_tau_s, CHECK_ABOVE, CHECK_ANY, "above 0"),
    REAL(gyro_noise_radps_rts, 0.0, 0.1, "0 or more"),
    REAL(accel_noise_mps2_rts, CHECK_ABOVE, 1.0, "above 0"),
    REAL(accel_noise_multiplier, CHECK_ABOVE, 1e3, "above 0"),
    REAL(stand_sd_rad, CHECK_ABOVE, 0.1, "above 0"),
    REAL(stand_noise_rate_hz, CHECK_ABOVE, 1e6, "above 0"),
    REAL(stand_interval_s, CHECK_ABOVE, 1e3, "above 0"),
    REAL(stand_guard_s, 0.0, 1.0, "from 0 to 1 s"),
};

double sins_kept_s(const struct nav_sins_cfg *cfg)
{
    return 2.0 * cfg->stand_guard_s + 2.0 * cfg->step_s + 0.4;
}

int nav_sins_check(const struct nav_sins_cfg *cfg, struct nav_refusal *why)
{
    const int status = check_all(cfg, rules, why);
    if (status != NAV_OK) return status;
    const double per_step = nav_floor(cfg->step_s / cfg->sample_s + 0.5);
    if (per_step < 1.0 || per_step > 64.0 || std::fabs(per_step * cfg->sample_s - cfg->step_s) > 1e-9)
        return check_refuse(why, NAV_RANGE, "step_s", cfg->step_s, "1 to 64 whole samples");
    if (cfg->lever % 3 == 0 && cfg->lever == 6) return check_refuse(why, NAV_RANGE, "lever", 6.0, "0, 3 or 9");
    if (cfg->lever % 3 != 0) return check_refuse(why, NAV_RANGE, "lever", cfg->lever, "0, 3 or 9");
    if (cfg->base && !cfg->stand) return check_refuse(why, NAV_RANGE, "base", 1.0, "0 without a stand");
    if (cfg->stand && sins_kept_s(cfg) > (SINS_RING - 3) * cfg->sample_s)
        return check_refuse(why, NAV_RANGE, "sample_s", cfg->sample_s, "longer samples, or a shorter stand_guard_s");
    return NAV_OK;
}

const char *nav_sins_block_name(int block)
{
    static const char *const names[] = {"beta", "walk",  "nu",    "theta", "df",  "gamma", "lever",
                                        "quad", "delay", "delta", "tau",   "eps", "beta0"};
    return block < 0 || block >= NAV_SINS_BLOCKS ? "" : names[block];
}

int nav_sins_layout(const struct nav_sins_cfg *cfg, struct nav_sins_rows rows[NAV_SINS_BLOCKS])
{
    const int status = nav_sins_check(cfg, nullptr);
    if (status != NAV_OK) return status;
    const int sizes[NAV_SINS_BLOCKS] = {3,
                                        cfg->walk ? 3 : 0,
                                        3,
                                        9,
                                        3,
                                        sins_gauges[cfg->gauge].count,
                                        cfg->lever,
                                        cfg->quad_sd_s2pm > 0.0 ? 3 : 0,
                                        cfg->delay_sd_s > 0.0 ? 1 : 0,
                                        cfg->stand ? 3 : 0,
                                        cfg->stand,
                                        cfg->base ? 3 : 0,
                                        cfg->clone ? 3 : 0};
    int offset = 0;
    for (int b = 0; b < NAV_SINS_BLOCKS; b++) {
        rows[b] = {offset, sizes[b]};
        offset += sizes[b];
    }
    return offset;
}

/* Standard deviation of state k of a block. */
static double prior_sd(const struct nav_sins_cfg *cfg, int block, int k)
{
    const int gamma = sins_gauges[cfg->gauge].at[block == NAV_SINS_GAMMA ? k : 0];
    switch (block) {
    case NAV_SINS_BETA:
    case NAV_SINS_BETA0:
        return cfg->beta_sd_rad[k];
    case NAV_SINS_WALK:
        return cfg->walk_sd_radps;
    case NAV_SINS_NU:
        return cfg->nu_sd_radps;
    case NAV_SINS_THETA:
        return k % 4 == 0 ? cfg->theta_scale_sd : cfg->theta_angle_sd_rad;
    case NAV_SINS_DF:
        return cfg->df_sd_mps2;
    case NAV_SINS_GAMMA:
        return gamma % 4 == 0 ? cfg->gamma_scale_sd : cfg->gamma_angle_sd_rad;
    case NAV_SINS_LEVER:
        return cfg->lever_sd_m;
    case NAV_SINS_QUAD:
        return cfg->quad_sd_s2pm;
    case NAV_SINS_DELAY:
        return cfg->delay_sd_s;
    case NAV_SINS_DELTA:
        return cfg->delta_sd_rad;
    case NAV_SINS_TAU:
        return cfg->tau_sd_s;
    default:
        return cfg->eps_sd_rad;
    }
}

int nav_sins_prior(const struct nav_sins_cfg *cfg, double *p)
{
    struct nav_sins_rows at[NAV_SINS_BLOCKS];
    const int n = nav_sins_layout(cfg, at);
    if (n < 0) return n;
    memset(p, 0, sizeof *p * (size_t)(n * n));
    for (int b = 0; b < NAV_SINS_BLOCKS; b++)
        for (int k = 0; k < at[b].size; k++) {
            const double sd = prior_sd(cfg, b, k);
            p[(at[b].offset + k) * (n + 1)] = sd * sd;
        }
    for (int k = 0; k < at[NAV_SINS_BETA0].size; k++) {
        const int i = at[NAV_SINS_BETA0].offset + k;
        p[i * n + k] = p[k * n + i] = p[i * (n + 1)];
    }
    return NAV_OK;
}
