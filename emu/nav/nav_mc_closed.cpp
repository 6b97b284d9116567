#include "nav/nav_mc.hpp"

/* Unit vectors of 256 directions, made once a call; a run turns one of them by less than a 256th of a turn. */
struct circle {
    double cos[256], sin[256];
};

static void circle_make(struct circle *c)
{
    for (int i = 0; i < 256; i++) {
        c->cos[i] = det_cos(NAV_PI / 128.0 * i);
        c->sin[i] = det_sin(NAV_PI / 128.0 * i);
    }
}

struct direction {
    double alpha_rad, cos, sin;
};

static inline struct direction turned(const struct circle *c, double turn /* [0, 1) */)
{
    const double t = turn * 256.0;
    const int i = (int)t;
    const double x = (t - i) * (NAV_PI / 128.0); /* up to 0.0246: x^7/5040 is below 1e-15 */
    const double z = x * x;
    const double sx = x * (1.0 - z * (1.0 / 6 - z * (1.0 / 120)));
    const double cx = 1.0 - z * (0.5 - z * (1.0 / 24 - z * (1.0 / 720)));
    const double alpha = 2.0 * NAV_PI * turn;
    return {alpha > NAV_PI ? alpha - 2.0 * NAV_PI : alpha, c->cos[i] * cx - c->sin[i] * sx,
            c->sin[i] * cx + c->cos[i] * sx};
}

/* The algebra that is done once: factor of the covariance of rows' W error, sums of weights, scales. */
struct closed_plan {
    const struct nav_mc_cfg *cfg;
    struct mc_linear lin;
    struct circle circle;
    double factor[FIT_MAX][FIT_MAX]; /* lower */
    double sums[FIT_MAX];            /* of weighted, of an error that all positions share */
    double level;                    /* gamma_sys in S/We */
    double angle_sd_rad;
    double scale; /* relative error of s and c and drift, and of s and c alone */
    double earth_scale;
};

/* Of S/We but for angles: random drift, level sensors, white noise. */
static fit_square random_covariance(const struct nav_mc_cfg *cfg, const struct mc_linear *lin)
{
    const double ns = cfg->per_sample ? mc_samples_per_window(cfg) : 1.0;
    const struct nav_noise noise = {
        cfg->gm_sigma_radps, cfg->gm_tau_s, cfg->white_radps_rts, 0.0, 0.0, cfg->gamma_random_rad / std::sqrt(ns)};
    fit_square c = fit_covariance(lin->p, lin->count, &noise, cfg->latitude_rad);
    if (!cfg->gm_from_zero) return c;
    for (int i = 0; i < lin->count; i++)
        for (int j = 0; j < lin->count; j++)
            c(i, j) -= nav_gm_from_zero_less(&noise, lin->p[i].t_mid_s, lin->p[i].window_s, lin->p[j].t_mid_s,
                                             lin->p[j].window_s) /
                       (lin->we_radps * lin->we_radps);
    return c;
}

/* Lower Cholesky factor of a covariance that may be short of rank. */
static void factor_of(const fit_small &m, double l[FIT_MAX][FIT_MAX])
{
    for (Eigen::Index i = 0; i < m.rows(); i++)
        for (Eigen::Index j = 0; j <= i; j++) {
            double left = m(i, j);
            for (Eigen::Index k = 0; k < j; k++) left -= l[i][k] * l[j][k];
            if (i == j) l[i][j] = left > 1e-14 * m(i, i) ? std::sqrt(left) : 0.0;
            else l[i][j] = l[j][j] > 0.0 ? left / l[j][j] : 0.0;
        }
}

static int plan_make(const struct nav_mc_cfg *cfg, struct closed_plan *plan)
{
    plan->cfg = cfg;
    const int refused = mc_linear_make(cfg, &plan->lin);
    if (refused) return refused;
    const struct mc_linear *lin = &plan->lin;
    fit_gain weighted(lin->unknowns, lin->count);
    for (int k = 0; k < lin->unknowns; k++) {
        plan->sums[k] = 0.0;
        for (int i = 0; i < lin->count; i++) {
            weighted(k, i) = lin->weighted[k][i];
            plan->sums[k] += lin->weighted[k][i];
        }
    }
    const fit_gain spread = weighted.lazyProduct(random_covariance(cfg, lin));
    const fit_small covariance = spread.lazyProduct(weighted.transpose());
    factor_of(covariance, plan->factor);
    circle_make(&plan->circle);
    plan->level = lin->wz_radps * cfg->gamma_sys_rad / lin->we_radps;
    plan->angle_sd_rad = cfg->angle_random_rad / std::sqrt(cfg->per_sample ? mc_samples_per_window(cfg) : 1.0);
    plan->scale = -cfg->torquer_scale;
    plan->earth_scale = lin->constrained ? det_sin(cfg->latitude_rad) / det_cos(cfg->latitude_rad) : 0.0;
    return NAV_OK;
}

/* r += normal (scale (s, c, drift) + earth (s, c)): a scale error of S, and one of the Earth's rate. */
static void add_scales(const struct closed_plan *plan, const struct direction *a, double earth, double r[FIT_MAX])
{
    const struct mc_linear *lin = &plan->lin;
    const double x[FIT_MAX] = {(plan->scale + earth) * a->sin, (plan->scale + earth) * a->cos,
                               plan->scale * plan->cfg->drift1_radps / lin->we_radps, 0.0};
    for (int k = 0; k < lin->unknowns; k++)
        for (int j = 0; j < lin->unknowns; j++) r[k] += lin->normal[k][j] * x[j];
}

struct closed_draw {
    struct direction a;
    double angle_sys_rad, level, earth, pitch_rad, roll_rad;
};

static inline struct closed_draw draw(const struct closed_plan *plan, struct random_stream *rnd)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    struct closed_draw d;
    const double turn = rnd->uniform();
    d.a = turned(&plan->circle, turn);
    if (!std::isnan(cfg->alpha1_rad))
        d.a = {nav_wrap(cfg->alpha1_rad), det_cos(cfg->alpha1_rad), det_sin(cfg->alpha1_rad)};
    const uint64_t signs = cfg->random_sign ? rnd->bits() : 0;
    d.angle_sys_rad = signs & 1 ? -cfg->angle_sys_rad : cfg->angle_sys_rad;
    d.level = signs & 2 ? -plan->level : plan->level;
    d.earth = (signs & 4 ? -plan->earth_scale : plan->earth_scale) * cfg->latitude_error_rad;
    d.pitch_rad = d.roll_rad = 0.0;
    if (cfg->cardan == NAV_CARDAN_UNCORRECTED) {
        d.pitch_rad = mc_tilt(cfg, rnd);
        d.roll_rad = mc_tilt(cfg, rnd);
    }
    return d;
}

/* Errors of the angles turn into errors of S by the slope We cos(alpha_i); the first one is returned. */
template <int COUNT, int UNKNOWNS>
static inline double add_angles(const struct closed_plan *plan, const struct closed_draw *d, struct random_stream *rnd,
                                double r[FIT_MAX])
{
    const struct mc_linear *lin = &plan->lin;
    const int count = COUNT ? COUNT : lin->count;
    const int unknowns = UNKNOWNS ? UNKNOWNS : lin->unknowns;
    const bool gimbal = plan->cfg->cardan == NAV_CARDAN_UNCORRECTED;
    const double first_turn = gimbal ? nav_cardan_2nd(det_cos(plan->cfg->angle_rad[0]),
                                                      det_sin(plan->cfg->angle_rad[0]), d->pitch_rad, d->roll_rad)
                                     : 0.0;
    double first = 0.0;
    for (int i = 0; i < count; i++) {
        double e = plan->angle_sd_rad * rnd->gauss() + mc_angle_share(plan->cfg, i) * d->angle_sys_rad;
        if (i == 0) first = e;
        if (gimbal)
            e += nav_cardan_2nd(det_cos(plan->cfg->angle_rad[i]), det_sin(plan->cfg->angle_rad[i]), d->pitch_rad,
                                d->roll_rad) -
                 first_turn;
        const double by_angle = (d->a.cos * lin->cos_delta[i] - d->a.sin * lin->sin_delta[i]) * e;
        for (int k = 0; k < unknowns; k++) r[k] += lin->weighted[k][i] * by_angle;
    }
    return first;
}

/* One run; COUNT and UNKNOWNS 0: as the plan says. */
template <int COUNT, int UNKNOWNS>
static inline void run(const struct closed_plan *plan, struct random_stream rnd, const struct nav_mc_out *out,
                       uint64_t k)
{
    const struct mc_linear *lin = &plan->lin;
    const int unknowns = UNKNOWNS ? UNKNOWNS : lin->unknowns;
    const struct closed_draw d = draw(plan, &rnd);
    double z[FIT_MAX];
    double r[FIT_MAX];
    for (int i = 0; i < unknowns; i++) {
        z[i] = rnd.gauss();
        r[i] = plan->sums[i] * d.level;
        for (int j = 0; j <= i; j++) r[i] += plan->factor[i][j] * z[j];
    }
    const double first = add_angles<COUNT, UNKNOWNS>(plan, &d, &rnd, r);
    if (plan->scale != 0.0 || d.earth != 0.0) add_scales(plan, &d.a, d.earth, r);
    const struct mc_error error = mc_solve(lin, r, d.a.cos, d.a.sin);
    mc_put(out->platform_rad, k, error.alpha_rad - first);
    mc_put(out->heading_rad, k, error.alpha_rad);
    mc_put(out->drift_radps, k, error.drift * lin->we_radps);
    mc_put(out->alpha1_rad, k, d.a.alpha_rad);
    mc_put(out->quality, k, error.quality);
}

template <int COUNT, int UNKNOWNS>
static void all_runs(const struct closed_plan *plan, uint64_t seed, uint64_t first_run, uint64_t runs,
                     const struct nav_mc_out *out)
{
    for (uint64_t k = 0; k < runs; k++) run<COUNT, UNKNOWNS>(plan, random_run(seed, first_run + k), out, k);
}

int nav_mc_closed(const struct nav_mc_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                  const struct nav_mc_out *out)
{
    struct closed_plan plan;
    const int refused = plan_make(cfg, &plan);
    if (refused) return refused;
    const bool three = plan.lin.count == 3 && plan.lin.unknowns == 3;
    (three ? all_runs<3, 3> : all_runs<0, 0>)(&plan, seed, first_run, runs, out);
    return NAV_OK;
}
