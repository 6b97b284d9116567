#include "nav/common/nav_check.hpp"
#include "nav/north/nav_fit.hpp"

/* What a result is put together from; x and gain are of (s, c, drift, ramp) or, on the circle, of (alpha, drift, ramp). */
struct solution {
    fit_unknowns free;   /* s, c, drift, ramp */
    fit_gain gain;       /* of alpha, drift, ramp by S/We */
    fit_unknowns params; /* alpha, drift, ramp */
    int iterations;
    bool converged;
};

constexpr double TILT_MAX = NAV_PI / 4;
constexpr const char *WANT_SD = "a standard deviation, 0 or more";

static const struct check_rule cfg_rules[] = {
    CHECK_DOUBLE(nav_gyrocompass_cfg, latitude_rad, -CHECK_ANY, CHECK_ANY, "at most 85 deg of latitude"),
    CHECK_INT(nav_gyrocompass_cfg, method, NAV_CLOSED3, NAV_GLS_CONSTRAINED, "one of enum nav_method"),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.gm_sigma_radps, 0.0, CHECK_ANY, WANT_SD),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.gm_tau_s, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.white_radps_rts, 0.0, CHECK_ANY, WANT_SD),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.window_sd_radps, 0.0, CHECK_ANY, WANT_SD),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.angle_sd_rad, 0.0, CHECK_ANY, WANT_SD),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.level_sd_rad, 0.0, CHECK_ANY, WANT_SD),
    CHECK_DOUBLE(nav_gyrocompass_cfg, noise.latitude_sd_rad, 0.0, TILT_MAX, "a standard deviation, 0 to 45 deg"),
};

static const struct check_rule position_rules[] = {
    CHECK_DOUBLE(nav_position, s_radps, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_position, delta_rad, -1e4, 1e4, "at most 1e4 rad"),
    CHECK_DOUBLE(nav_position, beta_rad, -TILT_MAX, TILT_MAX, "a tilt of at most 45 deg"),
    CHECK_DOUBLE(nav_position, gamma_rad, -TILT_MAX, TILT_MAX, "a tilt of at most 45 deg"),
    CHECK_DOUBLE(nav_position, t_mid_s, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_position, window_s, 0.0, CHECK_ANY, "a length, 0 or more"),
};

/* Windows that follow one another, where drift or a ramp asks for it. */
static int times_refusal(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg,
                         struct nav_refusal *why)
{
    const bool drift = cfg->noise.gm_sigma_radps > 0.0;
    const bool length = drift || cfg->noise.white_radps_rts > 0.0;
    for (int i = 0; i < count; i++) {
        int status = NAV_OK;
        const double apart_s = i > 0 ? p[i].t_mid_s - p[i - 1].t_mid_s : 1.0;
        if (length && p[i].window_s <= 0.0)
            status = check_refuse(why, NAV_TIMES, "window_s", p[i].window_s,
                                  "above 0: correlated drift or white noise was asked for");
        else if (i > 0 && (drift || cfg->ramp) && apart_s <= 0.0)
            status = check_refuse(why, NAV_TIMES, "t_mid_s", p[i].t_mid_s, "later than that of the position before");
        else if (i > 0 && drift && apart_s < 0.5 * (p[i].window_s + p[i - 1].window_s) - 1e-6)
            status = check_refuse(why, NAV_TIMES, "t_mid_s", p[i].t_mid_s,
                                  "windows that do not overlap: half of both lengths after that before");
        if (!status) continue;
        if (why) why->position = i;
        return status;
    }
    return NAV_OK;
}

/* Are there three directions that differ? */
static bool three_directions(const struct nav_position *p, int count)
{
    double seen[3];
    int found = 0;
    for (int i = 0; i < count && found < 3; i++) {
        bool is_new = true;
        for (int k = 0; k < found; k++)
            is_new = is_new && std::fabs(nav_wrap(p[i].delta_rad - seen[k])) > 0.5 * NAV_DEG;
        if (is_new) seen[found++] = p[i].delta_rad;
    }
    return found == 3;
}

static int count_refusal(int count, const struct nav_gyrocompass_cfg *cfg, struct nav_refusal *why)
{
    const int least = cfg->ramp ? 4 : 3;
    if (count < least)
        return check_refuse(why, NAV_TOO_FEW, "count", count, cfg->ramp ? "4 at least with a ramp" : "3 at least");
    if (count > NAV_MAX_POSITIONS) return check_refuse(why, NAV_TOO_FEW, "count", count, "64 at most");
    if (cfg->method == NAV_CLOSED3 && (count != 3 || cfg->ramp))
        return check_refuse(why, NAV_TOO_FEW, "count", count, "exactly three for the closed form, and no ramp");
    return NAV_OK;
}

int nav_gyrocompass_check(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg,
                          struct nav_refusal *why)
{
    check_refuse(why, NAV_OK, "", 0.0, "");
    int refused = count_refusal(count, cfg, why);
    if (!refused) refused = check_all(cfg, cfg_rules, why);
    if (!refused && cfg->noise.gm_sigma_radps > 0.0 && !(cfg->noise.gm_tau_s > 0.0))
        refused = check_refuse(why, NAV_RANGE, "noise.gm_tau_s", cfg->noise.gm_tau_s, "above 0, for gm_sigma_radps is");
    for (int i = 0; i < count && !refused; i++) {
        refused = check_all(&p[i], position_rules, why);
        if (refused && why) why->position = i;
    }
    if (refused) return refused;
    if (std::fabs(cfg->latitude_rad) > 85.0 * NAV_DEG)
        return check_refuse(why, NAV_LATITUDE, "latitude_rad", cfg->latitude_rad, "at most 85 deg (1.4835 rad)");
    if (!three_directions(p, count)) return check_refuse(why, NAV_COINCIDENT, "", 0.0, "");
    return times_refusal(p, count, cfg, why);
}

/* (17) to (19) with the errata, for We = 1: row 1 of the inverse is s, row 2 c, and the drift the mean of what is left. */
static bool solve_cramer(const fit_design &rows, fit_gain *gain)
{
    const double c1 = rows(0, FIT_S) - rows(1, FIT_S);
    const double c2 = rows(1, FIT_S) - rows(2, FIT_S);
    const double d1 = rows(0, FIT_C) - rows(1, FIT_C);
    const double d2 = rows(1, FIT_C) - rows(2, FIT_C);
    const double det = c1 * d2 - c2 * d1;
    if (std::fabs(det) < 1e-9) return false;
    gain->resize(FIT_RAMP, 3);
    gain->row(FIT_S) << d2 / det, -(d1 + d2) / det, d1 / det;  /* (f1 d2 - f2 d1)/D by S1, S2, S3 */
    gain->row(FIT_C) << -c2 / det, (c1 + c2) / det, -c1 / det; /* (c1 f2 - c2 f1)/D */
    const Eigen::RowVector3d third = Eigen::RowVector3d::Constant(1.0 / 3.0);
    gain->row(FIT_DRIFT) =
        third - rows.col(FIT_S).mean() * gain->row(FIT_S) - rows.col(FIT_C).mean() * gain->row(FIT_C);
    return true;
}

/* alpha = atan2(s, c); its gain follows from that of s and c. */
static void from_free(const fit_gain &free_gain, struct solution *x)
{
    const double s = x->free(FIT_S);
    const double c = x->free(FIT_C);
    const Eigen::Index unknowns = x->free.size() - 1;
    x->gain.resize(unknowns, free_gain.cols());
    x->gain.row(0) = (c * free_gain.row(FIT_S) - s * free_gain.row(FIT_C)) / (s * s + c * c);
    x->gain.bottomRows(unknowns - 1) = free_gain.bottomRows(unknowns - 1);
    x->params.resize(unknowns);
    x->params(0) = nav_atan2(s, c);
    x->params.tail(unknowns - 1) = x->free.tail(unknowns - 1);
}

/* What the rows and S of one gyrocompassing become before they are solved; covariance as fit_covariance() has it. */
struct equations {
    const struct nav_position *p;
    const struct nav_gyrocompass_cfg *cfg;
    fit_design rows;
    fit_vector y;
    fit_square covariance;
};

/* With the latitude's share, all windows alike, for this s and c. */
static fit_square with_latitude(const struct equations *e, double s, double c)
{
    if (e->cfg->noise.latitude_sd_rad == 0.0) return e->covariance;
    const fit_vector v = fit_by_latitude(e->rows, e->p, e->cfg->latitude_rad, s, c) * e->cfg->noise.latitude_sd_rad;
    return e->covariance + v.lazyProduct(v.transpose());
}

/* An error of the latitude lies in the plane of the rows of s and c, gamma_i being a sine over the positions: no weights tell it
 * from them in a free fit. On the circle they do, and there it is weighed, at the s and c that the free fit found. */
static bool solve_equations(const struct equations *e, struct solution *x)
{
    const struct nav_noise *noise = &e->cfg->noise;
    const int method = e->cfg->method;
    fit_square whitener = fit_whitener(e->covariance, noise, method);
    fit_gain free_gain;
    if (!(method == NAV_CLOSED3 ? solve_cramer(e->rows, &free_gain) : fit_gain_of(e->rows, whitener, &free_gain)))
        return false;
    x->free = free_gain * e->y;
    from_free(free_gain, x);
    x->iterations = 0;
    x->converged = true;
    if (!fit_is_constrained(method)) return true;
    double alpha = x->params(0);
    if (noise->latitude_sd_rad > 0.0 && fit_is_weighted(method))
        whitener = fit_whitener(with_latitude(e, nav_sin(alpha), nav_cos(alpha)), noise, method);
    fit_unknowns rest;
    x->iterations = fit_on_circle(e->rows, whitener, e->y, &alpha, &rest, &x->gain);
    if (x->iterations < 0) return false;
    x->converged = x->iterations < 30;
    x->params = rest;
    x->params(0) = alpha;
    return true;
}

/* Standard deviations and covariance by the gain, whatever the weights were: honest for every method. */
static void set_spread(const struct solution *x, const struct equations *e, struct nav_compass *out)
{
    const struct nav_position *p = e->p;
    const int count = (int)e->rows.rows();
    const double we = nav_earth_at(e->cfg->latitude_rad).we_radps;
    const double variance = fit_angle_variance(&e->cfg->noise);
    fit_square c = with_latitude(e, nav_sin(out->alpha1_rad), nav_cos(out->alpha1_rad));
    for (int i = 0; i < count; i++) {
        const double slope = nav_cos(out->alpha1_rad + p[i].delta_rad);
        c(i, i) += variance * slope * slope;
    }
    const fit_gain spread_gain = x->gain.lazyProduct(c);
    const fit_small cov = spread_gain.lazyProduct(x->gain.transpose());
    const double unit[3] = {1.0, we, we / fit_time_scale(p, count)};
    for (int i = 0; i < 9; i++) out->cov[i] = 0.0;
    for (Eigen::Index i = 0; i < cov.rows(); i++)
        for (Eigen::Index j = 0; j < cov.cols(); j++) out->cov[3 * i + j] = cov(i, j) * unit[i] * unit[j];
    out->alpha1_sd_rad = nav_root(cov(0, 0));
    out->alpha1_half95_rad = 1.959963984540054 * out->alpha1_sd_rad;
    out->drift1_sd_radps = nav_root(cov(1, 1)) * we;
    const double by_first = x->gain(0, 0) * nav_cos(out->alpha1_rad + p[0].delta_rad);
    out->platform_sd_rad = nav_root(cov(0, 0) + variance * (1.0 - 2.0 * by_first));
}

static uint32_t flags_of(const struct nav_compass *r, const struct nav_gyrocompass_cfg *cfg, bool noise, bool converged)
{
    uint32_t flags = 0;
    if (r->geometry < 0.3) flags |= NAV_POOR_GEOMETRY;
    if (r->quality > 0.01) flags |= NAV_POOR_QUALITY;
    if (cfg->simplified) flags |= NAV_SIMPLIFIED;
    if (!noise) flags |= NAV_NO_NOISE;
    if (!converged) flags |= NAV_NOT_CONVERGED;
    return flags;
}

int nav_gyrocompass(const struct nav_position *p, int count, const struct nav_gyrocompass_cfg *cfg,
                    struct nav_compass *out)
{
    const int refused = nav_gyrocompass_check(p, count, cfg, nullptr);
    if (refused) return refused;
    const double we = nav_earth_at(cfg->latitude_rad).we_radps;
    struct equations e = {p, cfg, fit_rows(p, count, cfg), fit_vector(count),
                          fit_covariance(p, count, &cfg->noise, cfg->latitude_rad)};
    for (int i = 0; i < count; i++) e.y(i) = p[i].s_radps / we;
    struct solution x;
    if (!solve_equations(&e, &x) || !std::isfinite(x.params.sum() + x.free.sum())) return NAV_SINGULAR;
    out->alpha1_rad = x.params(0);
    out->drift1_radps = x.params(1) * we;
    out->ramp_radps2 = cfg->ramp ? x.params(2) * we / fit_time_scale(p, count) : 0.0;
    out->s = x.free(FIT_S);
    out->c = x.free(FIT_C);
    out->quality = std::fabs(std::sqrt(out->s * out->s + out->c * out->c) - 1.0);
    out->geometry = fit_geometry(e.rows);
    out->iterations = x.iterations;
    set_spread(&x, &e, out);
    fit_unknowns full = x.free;
    if (fit_is_constrained(cfg->method)) {
        full(FIT_S) = nav_sin(out->alpha1_rad);
        full(FIT_C) = nav_cos(out->alpha1_rad);
        full.tail(full.size() - 2) = x.params.tail(full.size() - 2);
    }
    out->residual_rms_radps = std::sqrt((e.y - e.rows * full).squaredNorm() / count) * we;
    const bool noise = e.covariance.trace() + fit_angle_variance(&cfg->noise) + cfg->noise.latitude_sd_rad > 0.0;
    out->flags = flags_of(out, cfg, noise, x.converged);
    return NAV_OK;
}

int nav_gyrocompass_printed(const struct nav_position *p, double latitude_rad, double *alpha1_rad, double *drift1_radps)
{
    struct nav_gyrocompass_cfg cfg = {};
    cfg.latitude_rad = latitude_rad;
    cfg.simplified = 1;
    const int refused = nav_gyrocompass_check(p, 3, &cfg, nullptr);
    if (refused) return refused;
    const double we = nav_earth_at(latitude_rad).we_radps;
    struct nav_row r[3];
    for (int i = 0; i < 3; i++) r[i] = nav_row_of(&p[i], true);
    const double f1 = (p[0].s_radps - p[1].s_radps) / we;
    const double f2 = (p[1].s_radps - p[2].s_radps) / we;
    const double c1 = r[0].a - r[1].a;
    const double c2 = r[1].a - r[2].a;
    const double d1 = r[0].b - r[1].b;
    const double d2 = r[1].b - r[2].b;
    const double det = c1 * d2 - c2 * d1;
    if (std::fabs(det) < 1e-9) return NAV_SINGULAR;
    *alpha1_rad = nav_atan2((f1 * d1 - f2 * d2) / det, (c1 * f2 - c2 * f1) / det);
    *drift1_radps = p[0].s_radps + p[2].s_radps;
    return NAV_OK;
}
