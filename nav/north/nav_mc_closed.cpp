#include "nav/north/nav_mc.hpp"

/* Runs are computed 32 at a time, one expression for all of them before the next: loops that a compiler turns into vectors. */
constexpr int LANES = 32;

/* A number for either sign: mean + sign half. */
struct pair {
    double mean, half;
};

INLINE double pair_at(const struct pair *p, double sign)
{
    return p->mean + sign * p->half;
}

static struct pair pair_of(double plus, double minus)
{
    return {0.5 * (plus + minus), 0.5 * (plus - minus)};
}

/* The algebra that is done once: factor of the covariance of weighted errors, sums of weights, scales. */
struct closed_plan {
    const struct nav_mc_cfg *cfg;
    struct mc_linear lin;
    double factor[FIT_MAX][FIT_MAX];              /* lower */
    double sums[FIT_MAX];                         /* of weighted, of an error that all positions share */
    double cc[FIT_MAX], cs[FIT_MAX], ss[FIT_MAX]; /* of weighted cos^2, cos sin, sin^2 of delta */
    double share[NAV_MAX_POSITIONS];              /* of the angle's systematic error */
    double beta_left_rad; /* true beta at rest, but for the level sensor's error, where (14) leaves it out */
    double angle_sd_rad;
    /* What the given latitude makes of the Earth's rates, as means of both signs of its error and half the differences. All is in
     * (1 + k) S/We, k the torquer's scale error: it is before what turns the platform, not before what it takes off gamma. */
    struct pair compensation; /* of an error of gamma */
    struct pair excess;       /* of gamma itself: what compensates it less what there is */
    struct pair ratio;        /* of s and c as the estimator scales them, less 1 */
    struct pair circle;       /* r less 1 of 1/r: the same as the circle feels it, whose step goes by r, too */
    double swell;             /* 1 + k */
    double drift_lost_radps;  /* what k takes off the drift */
    double fixed_turn;        /* alpha1 in turns */
    bool gimbal;
};

/* Of S/We but for angles: random drift, level sensors, white noise. */
static fit_square random_covariance(const struct nav_mc_cfg *cfg, const struct mc_linear *lin)
{
    const double ns = cfg->per_sample ? mc_samples_per_window(cfg) : 1.0;
    const struct nav_noise noise = {cfg->gm_sigma_radps,
                                    cfg->gm_tau_s,
                                    (1.0 + cfg->torquer_scale) * cfg->white_radps_rts,
                                    0.0,
                                    0.0,
                                    (1.0 + cfg->torquer_scale) * cfg->gamma_random_rad / std::sqrt(ns),
                                    0.0};
    fit_square c = fit_covariance(lin->p, lin->count, &noise, cfg->latitude_rad);
    if (!cfg->gm_from_zero) return c;
    const double before_s = cfg->gm_before_s;
    for (int i = 0; i < lin->count; i++)
        for (int j = 0; j < lin->count; j++)
            c(i, j) -= nav_gm_from_zero_less(&noise, before_s + lin->p[i].t_mid_s, lin->p[i].window_s,
                                             before_s + lin->p[j].t_mid_s, lin->p[j].window_s) /
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
            /* A number that is none stays none. */
            if (i == j) l[i][j] = left <= 1e-14 * m(i, i) ? 0.0 : std::sqrt(left);
            else l[i][j] = l[j][j] == 0.0 ? 0.0 : left / l[j][j];
        }
}

static void latitude_of(const struct nav_mc_cfg *cfg, struct closed_plan *plan)
{
    double compensation[2];
    double excess[2];
    double ratio[2];
    const double we = nav_cos(cfg->latitude_rad);
    for (int minus = 0; minus < 2; minus++) {
        const double given = cfg->latitude_rad + (minus ? -1.0 : 1.0) * cfg->latitude_error_rad;
        compensation[minus] = plan->swell * nav_sin(given) / we;
        excess[minus] = (plan->swell * nav_sin(given) - nav_sin(cfg->latitude_rad)) / we;
        ratio[minus] =
            we / (nav_cos(given) * nav_cos(cfg->gamma_sys_rad) * plan->swell) - 1.0; /* rows shrink by a wrong gamma */
    }
    plan->compensation = pair_of(compensation[0], compensation[1]);
    plan->excess = pair_of(excess[0], excess[1]);
    plan->ratio = pair_of(ratio[0], ratio[1]);
    plan->circle = pair_of(ratio[0] / (1.0 + ratio[0]), ratio[1] / (1.0 + ratio[1]));
}

static int plan_make(const struct nav_mc_cfg *cfg, struct closed_plan *plan)
{
    plan->cfg = cfg;
    const int refused = mc_linear_make(cfg, &plan->lin);
    if (refused) return refused;
    const struct mc_linear *lin = &plan->lin;
    fit_gain weighted(lin->unknowns, lin->count);
    for (int k = 0; k < lin->unknowns; k++) {
        plan->sums[k] = plan->cc[k] = plan->cs[k] = plan->ss[k] = 0.0;
        for (int i = 0; i < lin->count; i++) {
            const double w = weighted(k, i) = lin->weighted[k][i];
            plan->sums[k] += w;
            plan->cc[k] += w * lin->cos_delta[i] * lin->cos_delta[i];
            plan->cs[k] += w * lin->cos_delta[i] * lin->sin_delta[i];
            plan->ss[k] += w * lin->sin_delta[i] * lin->sin_delta[i];
        }
    }
    const fit_gain spread = weighted.lazyProduct(random_covariance(cfg, lin));
    const fit_small covariance = spread.lazyProduct(weighted.transpose());
    factor_of(covariance, plan->factor);
    for (int i = 0; i < lin->count; i++) plan->share[i] = mc_angle_share(cfg, i);
    plan->swell = 1.0 + cfg->torquer_scale;
    plan->drift_lost_radps = cfg->torquer_scale / plan->swell * cfg->drift1_radps;
    latitude_of(cfg, plan);
    plan->beta_left_rad = cfg->fit.simplified ? cfg->drift1_radps / cfg->m1_per_s : 0.0;
    plan->angle_sd_rad = cfg->angle_random_rad / std::sqrt(cfg->per_sample ? mc_samples_per_window(cfg) : 1.0);
    const double fixed = nav_wrap(std::isnan(cfg->alpha1_rad) ? 0.0 : cfg->alpha1_rad) / (2.0 * NAV_PI);
    plan->fixed_turn = fixed < 0.0 ? fixed + 1.0 : fixed;
    plan->gimbal = cfg->cardan == NAV_CARDAN_UNCORRECTED;
    return NAV_OK;
}

/* What 32 runs draw and what becomes of it. */
struct lanes {
    uint64_t state[LANES];
    double turn_a[LANES], turn_q[LANES]; /* alpha and gimbal angle in position 1, [0, 1) */
    double cos_a[LANES], sin_a[LANES], cos_q[LANES], sin_q[LANES];
    double pitch[LANES], roll[LANES]; /* [0, 1) until they are scaled */
    double sign_angle[LANES], sign_gamma[LANES], sign_beta[LANES], sign_latitude[LANES];
    double z[FIT_MAX + NAV_MAX_POSITIONS + 1][LANES]; /* Gaussian: for the unknowns, then for the angles */
    double r[FIT_MAX][LANES], first[LANES], as_sin[LANES], as_cos[LANES];
    double alpha[LANES], platform[LANES], drift[LANES], quality[LANES];
};

/* Four numbers give the uniform draws and, in the lowest bits of the first, the signs; then come the Gaussian ones. */
INLINE void draw_lanes(int gaussians, uint64_t seed, uint64_t first_run, struct lanes *x)
{
    for (int l = 0; l < LANES; l++) {
        const uint64_t start = random_run(seed, first_run + (uint64_t)l);
        const uint64_t u = random_mix(start + RANDOM_STEP);
        x->turn_a[l] = random_unit(u);
        x->turn_q[l] = random_unit(random_mix(start + 2 * RANDOM_STEP));
        x->pitch[l] = random_unit(random_mix(start + 3 * RANDOM_STEP));
        x->roll[l] = random_unit(random_mix(start + 4 * RANDOM_STEP));
        const uint64_t one = UINT64_C(0x3FF0000000000000); /* its sign is the bit: no branch */
        x->sign_angle[l] = random_double_of(one | u << 63);
        x->sign_gamma[l] = random_double_of(one | (u >> 1) << 63);
        x->sign_beta[l] = random_double_of(one | (u >> 2) << 63);
        x->sign_latitude[l] = random_double_of(one | (u >> 3) << 63);
        x->state[l] = start + 4 * RANDOM_STEP;
    }
    for (int k = 0; k < gaussians; k += 2)
        for (int l = 0; l < LANES; l++)
            random_pair(random_mix(x->state[l] + (uint64_t)(k / 2 + 1) * RANDOM_STEP), &x->z[k][l], &x->z[k + 1][l]);
}

INLINE void scale_draws(const struct closed_plan *plan, struct lanes *x)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    const bool corners = cfg->tilt == NAV_TILT_CORNERS;
    for (int l = 0; l < LANES; l++) {
        const double pitch = 2.0 * x->pitch[l] - 1.0;
        const double roll = 2.0 * x->roll[l] - 1.0;
        const double corner_pitch = pitch < 0.0 ? -1.0 : 1.0;
        const double corner_roll = roll < 0.0 ? -1.0 : 1.0;
        x->pitch[l] = cfg->tilt_rad * (corners ? corner_pitch : pitch);
        x->roll[l] = cfg->tilt_rad * (corners ? corner_roll : roll);
    }
    if (!cfg->random_sign)
        for (int l = 0; l < LANES; l++)
            x->sign_angle[l] = x->sign_gamma[l] = x->sign_beta[l] = x->sign_latitude[l] = 1.0;
    if (!std::isnan(cfg->alpha1_rad))
        for (int l = 0; l < LANES; l++) x->turn_a[l] = plan->fixed_turn;
}

/* Random errors that do not hang on alpha, the level sensors' systematic ones, and what these do through tilts, gamma_i = A cos
 * delta_i - B sin delta_i: sin(alpha_i) gamma_i of gamma's error, as rows take the cosine of a wrong gamma; cos(alpha_i) gamma_i of
 * beta's. What is compensated of gamma_i itself in excess looks like a sine of A and a cosine of -B. */
template <int UNKNOWNS> INLINE void add_levels(const struct closed_plan *plan, struct lanes *x)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    double common[LANES];
    double cc[LANES];
    double cs[LANES];
    double ss[LANES];
    for (int l = 0; l < LANES; l++) {
        const double a = x->cos_q[l] * x->roll[l] - x->sin_q[l] * x->pitch[l];
        const double b = x->sin_q[l] * x->roll[l] + x->cos_q[l] * x->pitch[l];
        const double gamma = x->sign_gamma[l] * cfg->gamma_sys_rad;
        const double beta = -(x->sign_beta[l] * cfg->beta_sys_rad + plan->beta_left_rad);
        const double excess = pair_at(&plan->excess, x->sign_latitude[l]);
        common[l] = pair_at(&plan->compensation, x->sign_latitude[l]) * gamma;
        cc[l] = a * (gamma * x->sin_a[l] + beta * x->cos_a[l]);
        cs[l] = gamma * (a * x->cos_a[l] - b * x->sin_a[l]) - beta * (b * x->cos_a[l] + a * x->sin_a[l]);
        ss[l] = b * (beta * x->sin_a[l] - gamma * x->cos_a[l]);
        x->as_sin[l] = excess * a;
        x->as_cos[l] = -excess * b;
    }
    const int unknowns = UNKNOWNS ? UNKNOWNS : plan->lin.unknowns;
    for (int k = 0; k < unknowns; k++) {
        for (int l = 0; l < LANES; l++)
            x->r[k][l] = plan->sums[k] * common[l] + plan->cc[k] * cc[l] + plan->cs[k] * cs[l] + plan->ss[k] * ss[l];
        for (int j = 0; j <= k; j++)
            for (int l = 0; l < LANES; l++) x->r[k][l] += plan->factor[k][j] * x->z[j][l];
    }
}

/* e becomes the error of the i-th angle; gimbal steps that are taken for steps of alpha add to it. */
INLINE void angle_errors(const struct closed_plan *plan, int i, double *e, struct lanes *x)
{
    for (int l = 0; l < LANES; l++)
        e[l] = plan->angle_sd_rad * e[l] + plan->share[i] * (x->sign_angle[l] * plan->cfg->angle_sys_rad);
    if (i == 0)
        for (int l = 0; l < LANES; l++) x->first[l] = e[l];
    if (!plan->gimbal) return;
    const double cd = plan->lin.cos_delta[i];
    const double sd = plan->lin.sin_delta[i];
    for (int l = 0; l < LANES; l++)
        e[l] += nav_cardan_2nd(x->cos_q[l] * cd - x->sin_q[l] * sd, x->sin_q[l] * cd + x->cos_q[l] * sd, x->pitch[l],
                               x->roll[l]) -
                nav_cardan_2nd(x->cos_q[l], x->sin_q[l], x->pitch[l], x->roll[l]);
}

/* Errors of the angles turn into errors of S by the slope We cos(alpha_i). */
template <int COUNT, int UNKNOWNS> INLINE void add_angles(const struct closed_plan *plan, struct lanes *x)
{
    const struct mc_linear *lin = &plan->lin;
    const int count = COUNT ? COUNT : lin->count;
    const int unknowns = UNKNOWNS ? UNKNOWNS : lin->unknowns;
    for (int i = 0; i < count; i++) {
        double *e = x->z[unknowns + i];
        angle_errors(plan, i, e, x);
        double by_angle[LANES];
        for (int l = 0; l < LANES; l++)
            by_angle[l] = (x->cos_a[l] * lin->cos_delta[i] - x->sin_a[l] * lin->sin_delta[i]) * e[l];
        for (int k = 0; k < unknowns; k++)
            for (int l = 0; l < LANES; l++) x->r[k][l] += lin->weighted[k][i] * by_angle[l];
    }
}

/* Errors that look like a sine and a cosine: of a free fit they are just that. The circle feels the size of s and c, too. */
INLINE void add_sines(const struct closed_plan *plan, struct lanes *x)
{
    const struct mc_linear *lin = &plan->lin;
    if (!lin->constrained) {
        for (int l = 0; l < LANES; l++) x->r[FIT_S][l] += x->as_sin[l];
        for (int l = 0; l < LANES; l++) x->r[FIT_C][l] += x->as_cos[l];
        return;
    }
    for (int k = 0; k < lin->unknowns; k++)
        for (int l = 0; l < LANES; l++) {
            const double ratio = pair_at(&plan->circle, x->sign_latitude[l]);
            x->r[k][l] += lin->normal[k][FIT_S] * (x->as_sin[l] + ratio * x->sin_a[l]) +
                          lin->normal[k][FIT_C] * (x->as_cos[l] + ratio * x->cos_a[l]);
        }
}

INLINE void solve_lanes(const struct closed_plan *plan, struct lanes *x)
{
    const struct mc_linear *lin = &plan->lin;
    if (!lin->constrained) {
        for (int l = 0; l < LANES; l++) {
            x->alpha[l] = x->cos_a[l] * x->r[FIT_S][l] - x->sin_a[l] * x->r[FIT_C][l];
            x->drift[l] = x->r[FIT_DRIFT][l];
            const double along = x->sin_a[l] * x->r[FIT_S][l] + x->cos_a[l] * x->r[FIT_C][l];
            const double ratio = pair_at(&plan->ratio, x->sign_latitude[l]);
            x->quality[l] = std::fabs(along + ratio + ratio * along);
        }
        return;
    }
    for (int l = 0; l < LANES; l++) {
        const double r[FIT_MAX] = {x->r[0][l], x->r[1][l], x->r[2][l], lin->unknowns > 3 ? x->r[3][l] : 0.0};
        const struct mc_error e = mc_solve_on_circle(lin, r, x->cos_a[l], x->sin_a[l]);
        x->alpha[l] = e.alpha_rad;
        x->drift[l] = e.drift;
        x->quality[l] = e.quality * (1.0 + pair_at(&plan->ratio, x->sign_latitude[l]));
    }
}

/* One run a lane; COUNT and UNKNOWNS 0: as the plan says. */
template <int COUNT, int UNKNOWNS>
INLINE void compute_lanes(const struct closed_plan *plan, uint64_t seed, uint64_t first_run, struct lanes *x)
{
    draw_lanes(COUNT ? COUNT + UNKNOWNS : plan->lin.count + plan->lin.unknowns, seed, first_run, x);
    scale_draws(plan, x);
    for (int l = 0; l < LANES; l++) random_direction(x->turn_a[l], &x->cos_a[l], &x->sin_a[l]);
    for (int l = 0; l < LANES; l++) random_direction(x->turn_q[l], &x->cos_q[l], &x->sin_q[l]);
    add_levels<UNKNOWNS>(plan, x);
    add_angles<COUNT, UNKNOWNS>(plan, x);
    add_sines(plan, x);
    solve_lanes(plan, x);
    const double to_drift = plan->lin.we_radps / plan->swell;
    for (int l = 0; l < LANES; l++) {
        x->platform[l] = x->alpha[l] - x->first[l];
        x->drift[l] = x->drift[l] * to_drift - plan->drift_lost_radps;
        const double whole = x->turn_a[l] > 0.5 ? 1.0 : 0.0;
        x->turn_a[l] = 2.0 * NAV_PI * (x->turn_a[l] - whole); /* an angle from here on */
    }
}

BY_WIDTH(three, (const struct closed_plan *plan, uint64_t seed, uint64_t first_run, struct lanes *x),
         compute_lanes<3, 3>(plan, seed, first_run, x))
BY_WIDTH(more, (const struct closed_plan *plan, uint64_t seed, uint64_t first_run, struct lanes *x),
         compute_lanes<0, 0>(plan, seed, first_run, x))

static void put_lanes(double *array, uint64_t at, int n, const double *lane)
{
    if (array) memcpy(array + at, lane, (size_t)n * sizeof *array);
}

static void put_all(const struct nav_mc_out *out, const struct lanes *x, uint64_t at, int n)
{
    put_lanes(out->platform_rad, at, n, x->platform);
    put_lanes(out->heading_rad, at, n, x->alpha);
    put_lanes(out->drift_radps, at, n, x->drift);
    put_lanes(out->alpha1_rad, at, n, x->turn_a);
    put_lanes(out->quality, at, n, x->quality);
}

int nav_mc_closed(const struct nav_mc_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                  const struct nav_mc_out *out)
{
    struct closed_plan plan;
    const int refused = plan_make(cfg, &plan);
    if (refused) return refused;
    const bool three = plan.lin.count == 3 && plan.lin.unknowns == 3;
    const auto compute = (three ? three_by_width : more_by_width)[nav_width()];
    struct lanes x;
    for (uint64_t at = 0; at < runs; at += LANES) {
        compute(&plan, seed, first_run + at, &x);
        put_all(out, &x, at, runs - at < LANES ? (int)(runs - at) : LANES);
    }
    return NAV_OK;
}
