#include "nav/common/nav_check.hpp"
#include "nav/north/nav_mc.hpp"

void nav_mc_default(struct nav_mc_cfg *cfg)
{
    *cfg = {};
    cfg->latitude_rad = 50.0 * NAV_DEG;
    cfg->latitude_error_rad = 0.1 * NAV_ARCMIN;
    cfg->tilt_rad = 5.0 * NAV_DEG;
    cfg->alpha1_rad = std::nan("");
    cfg->drift1_radps = 25.0 * NAV_DEGPH;
    cfg->gm_sigma_radps = 0.2 * NAV_DEGPH;
    cfg->gm_tau_s = 1000.0;
    cfg->m1_per_s = 1.0;
    cfg->beta_sys_rad = cfg->gamma_sys_rad = 10.0 * NAV_ARCMIN;
    cfg->beta_random_rad = cfg->gamma_random_rad = NAV_ARCMIN;
    cfg->angle_sys_rad = 6.0 * NAV_ARCMIN;
    cfg->angle_random_rad = 3.0 * NAV_ARCMIN;
    cfg->angle_sys = NAV_ANGLE_COMMON;
    cfg->random_sign = 1;
    cfg->sample_s = 0.01;
    cfg->count = 3;
    for (int i = 0; i < cfg->count; i++) cfg->angle_rad[i] = 0.5 * NAV_PI * i;
    cfg->window_s = cfg->gap_s = 10.0;
    cfg->fit.latitude_rad = cfg->latitude_rad;
    cfg->fit.method = NAV_CLOSED3;
    cfg->fit.simplified = 1;
    cfg->fit.noise.gm_tau_s = 1000.0;
}

void nav_mc_hold_default(struct nav_mc_hold_cfg *cfg)
{
    *cfg = {};
    nav_mc_default(&cfg->start);
    cfg->hours = 4.0;
    cfg->step_s = 60.0;
    cfg->wait_s = 10.0;
}

void mc_schedule(const struct nav_mc_cfg *cfg, struct nav_position *p)
{
    double begins_s = 0.0;
    for (int i = 0; i < cfg->count; i++) {
        p[i] = {};
        p[i].delta_rad = cfg->angle_rad[i] - cfg->angle_rad[0];
        if (i > 0) {
            const double turn = std::fabs(cfg->angle_rad[i] - cfg->angle_rad[i - 1]);
            begins_s += cfg->window_s + (cfg->slew_radps > 0.0 ? turn / cfg->slew_radps + cfg->settle_s : cfg->gap_s);
        }
        p[i].t_mid_s = begins_s + 0.5 * cfg->window_s;
        p[i].window_s = cfg->window_s;
    }
}

double mc_gm_begin_sd_radps(const struct nav_mc_cfg *cfg)
{
    if (!cfg->gm_from_zero) return cfg->gm_sigma_radps;
    return cfg->gm_sigma_radps * std::sqrt(nav_rise(2.0 * cfg->gm_before_s / cfg->gm_tau_s));
}

double mc_samples_per_window(const struct nav_mc_cfg *cfg)
{
    return std::floor(cfg->window_s / cfg->sample_s + 0.5);
}

constexpr const char *WANT_SIZE = "0 or more";
constexpr const char *WANT_LENGTH = "a length above 0 s";
constexpr const char *WANT_CHOICE = "one of its enum";
constexpr const char *WANT_YES_NO = "0 or 1";
constexpr const char *WANT_ANGLE = "an angle of at most 45 deg";

static const struct check_rule mc_rules[] = {
    CHECK_DOUBLE(nav_mc_cfg, latitude_rad, -CHECK_ANY, CHECK_ANY, "at most 85 deg of latitude"),
    CHECK_DOUBLE(nav_mc_cfg, latitude_error_rad, -NAV_PI / 4, NAV_PI / 4, WANT_ANGLE),
    CHECK_DOUBLE(nav_mc_cfg, tilt_rad, -30 * NAV_DEG, 30 * NAV_DEG, "a tilt of at most 30 deg"),
    CHECK_INT(nav_mc_cfg, tilt, 0, NAV_TILT_CORNERS, WANT_CHOICE),
    CHECK_INT(nav_mc_cfg, cardan, 0, NAV_CARDAN_CORRECTED, WANT_CHOICE),
    CHECK_DOUBLE(nav_mc_cfg, drift1_radps, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_mc_cfg, gm_sigma_radps, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, gm_tau_s, CHECK_ABOVE, CHECK_ANY, "a time above 0 s"),
    CHECK_INT(nav_mc_cfg, gm_from_zero, 0, 1, WANT_YES_NO),
    CHECK_DOUBLE(nav_mc_cfg, torquer_scale, -0.5, 1.0, "a relative error, -0.5 to 1"),
    CHECK_DOUBLE(nav_mc_cfg, m1_per_s, CHECK_ABOVE, CHECK_ANY, "above 0"),
    CHECK_DOUBLE(nav_mc_cfg, beta_sys_rad, -NAV_PI / 4, NAV_PI / 4, WANT_ANGLE),
    CHECK_DOUBLE(nav_mc_cfg, gamma_sys_rad, -NAV_PI / 4, NAV_PI / 4, WANT_ANGLE),
    CHECK_DOUBLE(nav_mc_cfg, beta_random_rad, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, gamma_random_rad, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, angle_sys_rad, -NAV_PI, NAV_PI, "an angle of at most 180 deg"),
    CHECK_DOUBLE(nav_mc_cfg, angle_random_rad, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_INT(nav_mc_cfg, angle_sys, 0, NAV_ANGLE_ACCUMULATES, WANT_CHOICE),
    CHECK_INT(nav_mc_cfg, random_sign, 0, 1, WANT_YES_NO),
    CHECK_INT(nav_mc_cfg, per_sample, 0, 1, WANT_YES_NO),
    CHECK_DOUBLE(nav_mc_cfg, white_radps_rts, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, sample_s, CHECK_ABOVE, CHECK_ANY, WANT_LENGTH),
    CHECK_DOUBLE(nav_mc_cfg, window_s, CHECK_ABOVE, CHECK_ANY, WANT_LENGTH),
    CHECK_DOUBLE(nav_mc_cfg, gap_s, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, slew_radps, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, settle_s, 0.0, CHECK_ANY, WANT_SIZE),
    CHECK_DOUBLE(nav_mc_cfg, gm_before_s, 0.0, CHECK_ANY, WANT_SIZE),
};

/* What first order bears: the closed form and the samples agree to the test's power up to here (docs/nav.md). */
static const struct check_rule first_order_rules[] = {
    CHECK_DOUBLE(nav_mc_cfg, latitude_error_rad, -10 * NAV_DEG, 10 * NAV_DEG, "at most 10 deg in first order"),
    CHECK_DOUBLE(nav_mc_cfg, torquer_scale, -0.2, 0.2, "at most 0.2 in first order"),
    CHECK_DOUBLE(nav_mc_cfg, beta_sys_rad, -5 * NAV_DEG, 5 * NAV_DEG, "at most 5 deg in first order"),
    CHECK_DOUBLE(nav_mc_cfg, gamma_sys_rad, -5 * NAV_DEG, 5 * NAV_DEG, "at most 5 deg in first order"),
};

static int angles_refusal(const struct nav_mc_cfg *c, struct nav_refusal *why)
{
    if (!std::isnan(c->alpha1_rad) && !(std::fabs(c->alpha1_rad) < 1e4))
        return check_refuse(why, std::isinf(c->alpha1_rad) ? NAV_NOT_FINITE : NAV_RANGE, "alpha1_rad", c->alpha1_rad,
                            "below 1e4 rad, or NaN: over the whole turn");
    for (int i = 0; i < c->count; i++) {
        if (std::fabs(c->angle_rad[i]) < 1e4) continue;
        const int status = std::isfinite(c->angle_rad[i]) ? NAV_RANGE : NAV_NOT_FINITE;
        check_refuse(why, status, "angle_rad", c->angle_rad[i], "below 1e4 rad");
        if (why) why->position = i;
        return status;
    }
    return NAV_OK;
}

/* Choices and signs; what the estimator rejects is left to it. Runs may draw either sign of the latitude's error. */
int mc_refusal(const struct nav_mc_cfg *c, struct nav_refusal *why)
{
    if (c->count < 3) return check_refuse(why, NAV_TOO_FEW, "count", c->count, "3 positions at least");
    if (c->count > NAV_MAX_POSITIONS) return check_refuse(why, NAV_TOO_FEW, "count", c->count, "64 positions at most");
    int refused = check_all(c, mc_rules, why);
    if (!refused) refused = angles_refusal(c, why);
    if (refused) return refused;
    if (!(c->window_s >= c->sample_s && c->window_s / c->sample_s < 1e7))
        return check_refuse(why, NAV_RANGE, "sample_s", c->sample_s, "1 to 1e7 samples in window_s");
    struct nav_position p[NAV_MAX_POSITIONS];
    mc_schedule(c, p);
    struct nav_gyrocompass_cfg fit = c->fit;
    for (int sign = 1; sign >= (c->random_sign ? -1 : 1); sign -= 2) {
        fit.latitude_rad = c->latitude_rad + sign * c->latitude_error_rad;
        refused = nav_gyrocompass_check(p, c->count, &fit, why);
        if (refused) return refused;
    }
    struct nav_compass unused;
    refused = nav_gyrocompass(p, c->count, &fit, &unused);
    return refused ? check_refuse(why, refused, "angle_rad", c->angle_rad[0], "directions that differ more") : NAV_OK;
}

/* A constrained fit takes a wrong size of the Earth's rate for a direction, which is first order in that size. Weights that hang on
 * each run's tilts are not for algebra that is done once. */
int mc_first_order_refusal(const struct nav_mc_cfg *c, struct nav_refusal *why)
{
    int refused = mc_refusal(c, why);
    if (!refused) refused = check_all(c, first_order_rules, why);
    if (refused || !fit_is_constrained(c->fit.method)) return refused;
    if (c->fit.method == NAV_GLS_CONSTRAINED && c->fit.noise.latitude_sd_rad > 0.0)
        return check_refuse(why, NAV_RANGE, "fit.noise.latitude_sd_rad", c->fit.noise.latitude_sd_rad,
                            "0 in first order with NAV_GLS_CONSTRAINED: weights would hang on the run");
    const double tan_latitude = nav_sin(c->latitude_rad) / nav_cos(c->latitude_rad);
    if (std::fabs(c->torquer_scale) > 0.05)
        return check_refuse(why, NAV_RANGE, "torquer_scale", c->torquer_scale,
                            "at most 0.05 in first order with a constrained fit");
    if (std::fabs(tan_latitude * c->latitude_error_rad) > 0.05)
        return check_refuse(why, NAV_RANGE, "latitude_error_rad", c->latitude_error_rad,
                            "times tan(latitude_rad) at most 0.05 in first order with a constrained fit");
    return NAV_OK;
}

int nav_mc_check(const struct nav_mc_cfg *cfg, int model, struct nav_refusal *why)
{
    check_refuse(why, NAV_OK, "", 0.0, "");
    return model == NAV_MC_CLOSED ? mc_first_order_refusal(cfg, why) : mc_refusal(cfg, why);
}

/* Fixed sizes: Eigen has the cofactors of these. */
static bool invert_small(const fit_small &normal, fit_small *inverse)
{
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner(normal.rows(), normal.cols()) = normal;
    Eigen::Matrix4d all;
    bool invertible = false;
    m.computeInverseWithCheck(all, invertible, 1e-12);
    *inverse = all.topLeftCorner(normal.rows(), normal.cols());
    return invertible;
}

int mc_linear_make(const struct nav_mc_cfg *cfg, struct mc_linear *lin)
{
    const int refused = mc_first_order_refusal(cfg, nullptr);
    if (refused) return refused;
    mc_schedule(cfg, lin->p);
    const struct nav_earth e = nav_earth_at(cfg->latitude_rad);
    const fit_design rows = fit_rows(lin->p, cfg->count, &cfg->fit);
    const fit_square covariance = fit_covariance(lin->p, cfg->count, &cfg->fit.noise, cfg->latitude_rad);
    const fit_square whitener = fit_whitener(covariance, &cfg->fit.noise, cfg->fit.method);
    const fit_design white_rows = whitener.lazyProduct(rows);
    fit_gain weighted = white_rows.transpose().lazyProduct(whitener);
    fit_small normal = weighted.lazyProduct(rows);
    fit_small inverse;
    if (!invert_small(normal, &inverse)) return NAV_SINGULAR;
    lin->count = cfg->count;
    lin->unknowns = (int)rows.cols();
    lin->constrained = fit_is_constrained(cfg->fit.method);
    if (!lin->constrained) {
        weighted = fit_gain(inverse.lazyProduct(weighted));
        normal.setIdentity();
        inverse.setIdentity();
    }
    lin->we_radps = e.we_radps;
    lin->wz_radps = e.wz_radps;
    for (int k = 0; k < lin->unknowns; k++) {
        for (int j = 0; j < lin->unknowns; j++) {
            lin->normal[k][j] = normal(k, j);
            lin->inverse[k][j] = inverse(k, j);
        }
        for (int i = 0; i < lin->count; i++) lin->weighted[k][i] = weighted(k, i);
    }
    for (int i = 0; i < lin->count; i++) {
        lin->cos_delta[i] = nav_cos(lin->p[i].delta_rad);
        lin->sin_delta[i] = nav_sin(lin->p[i].delta_rad);
    }
    return NAV_OK;
}

/* Of M x = r with M symmetric, of 2 or 3 unknowns, by cofactors. */
static void solve_small(const double m[3][3], const double r[3], int n, double x[3])
{
    if (n == 2) {
        const double det = m[0][0] * m[1][1] - m[0][1] * m[0][1];
        x[0] = (r[0] * m[1][1] - r[1] * m[0][1]) / det;
        x[1] = (r[1] * m[0][0] - r[0] * m[0][1]) / det;
        return;
    }
    const Eigen::Matrix3d a =
        (Eigen::Matrix3d() << m[0][0], m[0][1], m[0][2], m[0][1], m[1][1], m[1][2], m[0][2], m[1][2], m[2][2])
            .finished();
    const Eigen::Vector3d solved = a.inverse() * Eigen::Vector3d(r[0], r[1], r[2]);
    for (int i = 0; i < 3; i++) x[i] = solved(i);
}

struct mc_error mc_solve_on_circle(const struct mc_linear *lin, const double r[FIT_MAX], double cos_a, double sin_a)
{
    double x[FIT_MAX] = {0.0};
    for (int k = 0; k < lin->unknowns; k++)
        for (int j = 0; j < lin->unknowns; j++) x[k] += lin->inverse[k][j] * r[j];
    struct mc_error error = {cos_a * x[FIT_S] - sin_a * x[FIT_C], x[FIT_DRIFT],
                             std::fabs(sin_a * x[FIT_S] + cos_a * x[FIT_C])};
    /* On the circle s and c move together: the column of alpha is cos a times that of s less sin a times that of c. */
    const int n = lin->unknowns - 1;
    double m[3][3] = {};
    double right[3] = {};
    double y[3] = {};
    for (int k = 1; k < n; k++) {
        right[k] = r[k + 1];
        m[0][k] = m[k][0] = cos_a * lin->normal[FIT_S][k + 1] - sin_a * lin->normal[FIT_C][k + 1];
        for (int j = 1; j < n; j++) m[k][j] = lin->normal[k + 1][j + 1];
    }
    right[0] = cos_a * r[FIT_S] - sin_a * r[FIT_C];
    m[0][0] = cos_a * cos_a * lin->normal[FIT_S][FIT_S] - 2.0 * sin_a * cos_a * lin->normal[FIT_S][FIT_C] +
              sin_a * sin_a * lin->normal[FIT_C][FIT_C];
    solve_small(m, right, n, y);
    error.alpha_rad = y[0];
    error.drift = y[1];
    return error;
}
