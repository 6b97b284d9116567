#include "nav/common/nav_check.hpp"
#include "nav/north/nav_mc.hpp"

/* Exact step of a Gauss-Markov drift and its integral over t: both Gaussian, correlated. */
struct gm_step {
    double decay, integral_of_now_s; /* (1 - e^(-mu t))/mu */
    double sd_radps, integral_by_drift_s, integral_sd_rad;
};

struct gm {
    double drift_radps, integral_rad;
};

static struct gm_step gm_step_of(const struct nav_mc_cfg *cfg, double t_s)
{
    struct gm_step s = {1.0, t_s, 0.0, 0.0, 0.0};
    if (cfg->gm_sigma_radps == 0.0) return s;
    const double tau = cfg->gm_tau_s;
    const double x = t_s / tau;
    const double variance = cfg->gm_sigma_radps * cfg->gm_sigma_radps;
    const double rise = nav_rise(x);
    s.decay = nav_decay(x);
    s.integral_of_now_s = tau * rise;
    const double new_drift = variance * nav_rise(2.0 * x);
    const double both = variance * tau * rise * rise;
    const double from_zero = nav_gm_integral_sd_rad(cfg->gm_sigma_radps, tau, t_s, 1);
    s.sd_radps = std::sqrt(new_drift);
    s.integral_by_drift_s = new_drift > 0.0 ? both / new_drift : 0.0;
    const double left = from_zero * from_zero - both * s.integral_by_drift_s;
    s.integral_sd_rad = nav_root(left);
    return s;
}

static void gm_go(struct gm *g, const struct gm_step *s, struct random_stream *rnd)
{
    if (s->sd_radps == 0.0) return;
    const double fresh = s->sd_radps * rnd->gauss();
    g->integral_rad +=
        s->integral_of_now_s * g->drift_radps + s->integral_by_drift_s * fresh + s->integral_sd_rad * rnd->gauss();
    g->drift_radps = s->decay * g->drift_radps + fresh;
}

struct hold_plan {
    const struct nav_mc_hold_cfg *cfg;
    struct mc_linear lin;
    struct gm_step window, step, wait, gap[NAV_MAX_POSITIONS]; /* gap[i]: before window i */
    uint64_t steps;
};

/* At the start of the hold: error of heading, of the compensation against the mean drift, and the random drift now. */
struct hold_start {
    double heading_rad, drift_radps;
    struct gm axis2;
};

static const struct check_rule hold_rules[] = {
    CHECK_INT(nav_mc_hold_cfg, axis2, 0, NAV_AXIS2_FIXED, "one of enum nav_mc_axis2"),
    CHECK_DOUBLE(nav_mc_hold_cfg, axis2_sd_radps, 0.0, CHECK_ANY, "0 or more"),
    CHECK_DOUBLE(nav_mc_hold_cfg, heading_rad, -NAV_PI, NAV_PI, "an angle of at most 180 deg"),
    CHECK_DOUBLE(nav_mc_hold_cfg, drift_error_radps, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_mc_hold_cfg, hours, CHECK_ABOVE, CHECK_ANY, "above 0 h"),
    CHECK_DOUBLE(nav_mc_hold_cfg, step_s, CHECK_ABOVE, CHECK_ANY, "above 0 s"),
    CHECK_DOUBLE(nav_mc_hold_cfg, wait_s, 0.0, CHECK_ANY, "0 s or more"),
    CHECK_DOUBLE(nav_mc_hold_cfg, level_rad, -NAV_PI / 4, NAV_PI / 4, "an angle of at most 45 deg"),
    CHECK_DOUBLE(nav_mc_hold_cfg, latitude_error_rad, -NAV_PI / 4, NAV_PI / 4, "an angle of at most 45 deg"),
    CHECK_DOUBLE(nav_mc_hold_cfg, v_east_mps, -CHECK_ANY, CHECK_ANY, "a number"),
    CHECK_DOUBLE(nav_mc_hold_cfg, speed_error, -CHECK_ANY, CHECK_ANY, "a relative error"),
};

int nav_mc_hold_check(const struct nav_mc_hold_cfg *cfg, struct nav_refusal *why)
{
    check_refuse(why, NAV_OK, "", 0.0, "");
    const int refused = check_all(cfg, hold_rules, why);
    if (refused) return refused;
    if (cfg->hours * 3600.0 / cfg->step_s > 1e7)
        return check_refuse(why, NAV_RANGE, "step_s", cfg->step_s, "1e7 steps in hours at most");
    return mc_first_order_refusal(&cfg->start, why);
}

static int plan_make(const struct nav_mc_hold_cfg *cfg, struct hold_plan *plan)
{
    int refused = nav_mc_hold_check(cfg, nullptr);
    if (!refused) refused = mc_linear_make(&cfg->start, &plan->lin);
    if (refused) return refused;
    plan->cfg = cfg;
    const struct nav_position *p = plan->lin.p;
    plan->steps = (uint64_t)std::ceil(cfg->hours * 3600.0 / cfg->step_s - 1e-9);
    plan->step = gm_step_of(&cfg->start, cfg->hours * 3600.0 / (double)plan->steps);
    plan->wait = gm_step_of(&cfg->start, cfg->wait_s);
    plan->window = gm_step_of(&cfg->start, cfg->start.window_s);
    for (int i = 1; i < plan->lin.count; i++)
        plan->gap[i] = gm_step_of(&cfg->start, p[i].t_mid_s - p[i - 1].t_mid_s - cfg->start.window_s);
    return NAV_OK;
}

static double window_mean(const struct hold_plan *plan, struct gm *g, int i, struct random_stream *rnd)
{
    if (i > 0) gm_go(g, &plan->gap[i], rnd);
    g->integral_rad = 0.0;
    gm_go(g, &plan->window, rnd);
    return g->integral_rad / plan->cfg->start.window_s;
}

static struct gm gm_begin(const struct nav_mc_cfg *cfg, struct random_stream *rnd)
{
    return {cfg->gm_from_zero && cfg->gm_before_s == 0.0 ? 0.0 : mc_gm_begin_sd_radps(cfg) * rnd->gauss(), 0.0};
}

/* What measuring the azimuth torquer in the last window leaves: the level sensors' errors through We. */
static double axis2_level(const struct hold_plan *plan, double alpha1_rad, double beta_rad, double gamma_rad)
{
    const double alpha = alpha1_rad + plan->lin.p[plan->lin.count - 1].delta_rad;
    return plan->lin.we_radps * (nav_cos(alpha) * beta_rad - nav_sin(alpha) * gamma_rad);
}

/* What one instrument drew for good: as nav_mc_closed() has it, to first order. */
struct instrument {
    double alpha_rad, gamma_east_rad, gamma_north_rad; /* gamma_i = east cos(delta_i) - north sin(delta_i) */
    double cos_q, sin_q, pitch_rad, roll_rad;
    double angle_sys_rad, gamma_sys_rad, beta_sys_rad;
    double compensation, excess, circle; /* of gamma's error, of gamma, of s and c: see struct closed_plan */
};

/* Tilts and the latitude's sign come from a stream of their own. */
static struct instrument instrument_draw(const struct nav_mc_cfg *cfg, uint64_t start_of_stream,
                                         struct random_stream *rnd)
{
    struct instrument u = {};
    u.alpha_rad = mc_alpha1(cfg, rnd);
    u.angle_sys_rad = mc_signed(cfg, cfg->angle_sys_rad, rnd);
    u.gamma_sys_rad = mc_signed(cfg, cfg->gamma_sys_rad, rnd);
    u.beta_sys_rad = mc_signed(cfg, cfg->beta_sys_rad, rnd);
    struct random_stream aside(random_mix(start_of_stream + RANDOM_STEP / 2));
    const double given = cfg->latitude_rad + mc_signed(cfg, cfg->latitude_error_rad, &aside);
    u.pitch_rad = mc_tilt(cfg, &aside);
    u.roll_rad = mc_tilt(cfg, &aside);
    const double q = NAV_PI * (2.0 * aside.uniform() - 1.0);
    u.cos_q = nav_cos(q);
    u.sin_q = nav_sin(q);
    u.gamma_east_rad = u.cos_q * u.roll_rad - u.sin_q * u.pitch_rad;
    u.gamma_north_rad = u.sin_q * u.roll_rad + u.cos_q * u.pitch_rad;
    const double swell = 1.0 + cfg->torquer_scale;
    const double we = nav_cos(cfg->latitude_rad);
    u.compensation = swell * nav_sin(given) / we;
    u.excess = u.compensation - nav_sin(cfg->latitude_rad) / we;
    u.circle = 1.0 - nav_cos(given) * nav_cos(cfg->gamma_sys_rad) * swell / we;
    return u;
}

/* Of S in position i, but for drift and white noise: angle and gamma_error are this window's. */
static double window_error(const struct nav_mc_cfg *cfg, const struct mc_linear *lin, const struct instrument *u, int i,
                           double angle, double gamma_error)
{
    const double cd = lin->cos_delta[i];
    const double sd = lin->sin_delta[i];
    const double ca = nav_cos(u->alpha_rad + lin->p[i].delta_rad);
    const double sa = nav_sin(u->alpha_rad + lin->p[i].delta_rad);
    const double gamma = u->gamma_east_rad * cd - u->gamma_north_rad * sd;
    const double beta = -(u->beta_sys_rad + (cfg->fit.simplified ? cfg->drift1_radps / cfg->m1_per_s : 0.0));
    if (cfg->cardan == NAV_CARDAN_UNCORRECTED)
        angle +=
            nav_cardan_2nd(u->cos_q * cd - u->sin_q * sd, u->sin_q * cd + u->cos_q * sd, u->pitch_rad, u->roll_rad) -
            nav_cardan_2nd(u->cos_q, u->sin_q, u->pitch_rad, u->roll_rad);
    return u->compensation * gamma_error + u->excess * gamma + sa * gamma * u->gamma_sys_rad + ca * gamma * beta +
           ca * angle;
}

/* The gyrocompassing, to first order as in nav_mc_closed(), with the random drift's means drawn one after the other. */
static struct hold_start calibrate_start(const struct hold_plan *plan, uint64_t start_of_stream,
                                         struct random_stream *rnd)
{
    const struct nav_mc_cfg *cfg = &plan->cfg->start;
    const struct mc_linear *lin = &plan->lin;
    const double ns = std::sqrt(cfg->per_sample ? mc_samples_per_window(cfg) : 1.0);
    const double swell = 1.0 + cfg->torquer_scale;
    const struct instrument u = instrument_draw(cfg, start_of_stream, rnd);
    const bool own = plan->cfg->axis2 == NAV_AXIS2_MEASURED;
    struct gm axis1 = gm_begin(cfg, rnd);
    struct gm axis2 = gm_begin(cfg, rnd);
    double r[FIT_MAX] = {0.0};
    double measured2 = 0.0;
    for (int i = 0; i < lin->count; i++) {
        const double drift = window_mean(plan, &axis1, i, rnd);
        if (own) measured2 = window_mean(plan, &axis2, i, rnd);
        const double angle = u.angle_sys_rad * mc_angle_share(cfg, i) + cfg->angle_random_rad / ns * rnd->gauss();
        const double gamma_error = u.gamma_sys_rad + cfg->gamma_random_rad / ns * rnd->gauss();
        const double white = swell * cfg->white_radps_rts / std::sqrt(cfg->window_s) * rnd->gauss();
        const double error = (drift + white) / lin->we_radps + window_error(cfg, lin, &u, i, angle, gamma_error);
        for (int k = 0; k < lin->unknowns; k++) r[k] += lin->weighted[k][i] * error;
    }
    const double ca = nav_cos(u.alpha_rad);
    const double sa = nav_sin(u.alpha_rad);
    for (int k = 0; k < lin->unknowns && lin->constrained; k++)
        r[k] += u.circle * (lin->normal[k][FIT_S] * sa + lin->normal[k][FIT_C] * ca);
    const struct mc_error found = mc_solve(lin, r, ca, sa);
    const double lost = cfg->torquer_scale / swell * cfg->drift1_radps;
    struct hold_start start = {found.alpha_rad, found.drift * lin->we_radps / swell - lost, axis1};
    if (own)
        start = {found.alpha_rad, measured2 + axis2_level(plan, u.alpha_rad, u.beta_sys_rad, u.gamma_sys_rad), axis2};
    if (plan->cfg->axis2 == NAV_AXIS2_DIFFERS) start.drift_radps -= plan->cfg->axis2_sd_radps * rnd->gauss();
    return start;
}

static struct hold_start begin_hold(const struct hold_plan *plan, uint64_t start_of_stream, struct random_stream *rnd)
{
    if (plan->cfg->axis2 != NAV_AXIS2_FIXED) return calibrate_start(plan, start_of_stream, rnd);
    /* The sum of the article: an error that grows away from zero. */
    return {plan->cfg->heading_rad, -plan->cfg->drift_error_radps, gm_begin(&plan->cfg->start, rnd)};
}

/* Rates that the flight adds: platform not level, latitude and ground speed of the compensation wrong. */
static double flight_rate(const struct hold_plan *plan, struct random_stream *rnd)
{
    const struct nav_mc_hold_cfg *cfg = plan->cfg;
    const double direction = 2.0 * NAV_PI * rnd->uniform();
    const double tilted = plan->lin.we_radps * cfg->level_rad * nav_cos(direction);
    const double latitude = mc_signed(&cfg->start, plan->lin.we_radps * cfg->latitude_error_rad, rnd);
    const double speed =
        mc_signed(&cfg->start, nav_transport_radps(cfg->v_east_mps, cfg->start.latitude_rad) * cfg->speed_error, rnd);
    return tilted + latitude + speed;
}

/* (alpha estimated) less alpha grows by the drift that was not compensated. */
static void run_hold(const struct hold_plan *plan, uint64_t start_of_stream, const struct nav_mc_hold_out *out,
                     uint64_t k)
{
    struct random_stream rnd(start_of_stream);
    struct hold_start start = begin_hold(plan, start_of_stream, &rnd);
    const double rate = flight_rate(plan, &rnd) - start.drift_radps;
    const double step_s = plan->cfg->hours * 3600.0 / (double)plan->steps;
    gm_go(&start.axis2, &plan->wait, &rnd);
    start.axis2.integral_rad = 0.0;
    double error = start.heading_rad;
    double most = std::fabs(error);
    for (uint64_t n = 1; n <= plan->steps; n++) {
        gm_go(&start.axis2, &plan->step, &rnd);
        error = start.heading_rad + rate * step_s * (double)n + start.axis2.integral_rad;
        if (std::fabs(error) > most) most = std::fabs(error);
    }
    mc_put(out->end_rad, k, error);
    mc_put(out->max_rad, k, most);
}

int nav_mc_hold(const struct nav_mc_hold_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                const struct nav_mc_hold_out *out)
{
    struct hold_plan plan = {};
    const int refused = plan_make(cfg, &plan);
    if (refused) return refused;
    for (uint64_t k = 0; k < runs; k++) run_hold(&plan, random_run(seed, first_run + k), out, k);
    return NAV_OK;
}
