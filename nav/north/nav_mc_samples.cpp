#include "nav/north/nav_mc.hpp"

constexpr int BLOCK = 512; /* random numbers made at once */
constexpr int STRETCHES = 16;

/* What does not change from run to run. */
struct samples_plan {
    const struct nav_mc_cfg *cfg;
    struct nav_position p[NAV_MAX_POSITIONS];
    uint64_t per_window;
    double decay, step_sd_radps;          /* of the drift over a sample */
    double decays[BLOCK / STRETCHES + 1]; /* powers of decay, and sums of those before */
    double decay_sums[BLOCK / STRETCHES + 1];
    int width;                                                           /* of the processor's vectors */
    double white_sd_radps;                                               /* of S in a sample */
    double over_gap[NAV_MAX_POSITIONS], gap_sd_radps[NAV_MAX_POSITIONS]; /* of the drift over the gap before window i */
};

/* One virtual instrument: what it drew for good. */
struct sampled_instrument {
    struct random_stream rnd;
    double alpha1_rad, psi_rad, pitch_rad, roll_rad;
    double q1_rad; /* gimbal angle of position 1 */
    double angle_sys_rad, latitude_error_rad, beta_sys_rad, gamma_sys_rad;
    double drift_radps;      /* random part, now */
    double first_actual_rad; /* alpha of the platform in position 1, and as the angle's zero has it */
    double first_nominal_rad;
};

static int plan_make(const struct nav_mc_cfg *cfg, struct samples_plan *plan)
{
    plan->cfg = cfg;
    const int refused = mc_refusal(cfg, nullptr);
    if (refused) return refused;
    mc_schedule(cfg, plan->p);
    plan->per_window = (uint64_t)mc_samples_per_window(cfg);
    plan->decay = nav_decay(cfg->sample_s / cfg->gm_tau_s);
    plan->decays[0] = 1.0;
    plan->decay_sums[0] = 0.0;
    for (int k = 1; k <= BLOCK / STRETCHES; k++) {
        plan->decay_sums[k] = plan->decay_sums[k - 1] + plan->decays[k - 1];
        plan->decays[k] = plan->decays[k - 1] * plan->decay;
    }
    plan->width = nav_width();
    plan->step_sd_radps = cfg->gm_sigma_radps * std::sqrt(1.0 - plan->decay * plan->decay);
    plan->white_sd_radps = cfg->white_radps_rts / std::sqrt(cfg->sample_s);
    plan->over_gap[0] = 1.0;
    for (int i = 1; i < cfg->count; i++) {
        const double gap_s = plan->p[i].t_mid_s - plan->p[i - 1].t_mid_s - cfg->window_s;
        plan->over_gap[i] = nav_decay(gap_s > 0.0 ? gap_s / cfg->gm_tau_s : 0.0);
        plan->gap_sd_radps[i] = cfg->gm_sigma_radps * std::sqrt(1.0 - plan->over_gap[i] * plan->over_gap[i]);
    }
    return NAV_OK;
}

static struct sampled_instrument draw_sampled(const struct nav_mc_cfg *cfg, uint64_t start)
{
    struct sampled_instrument u = {random_stream(start), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    u.alpha1_rad = mc_alpha1(cfg, &u.rnd);
    u.angle_sys_rad = mc_signed(cfg, cfg->angle_sys_rad, &u.rnd);
    u.gamma_sys_rad = mc_signed(cfg, cfg->gamma_sys_rad, &u.rnd);
    u.beta_sys_rad = mc_signed(cfg, cfg->beta_sys_rad, &u.rnd);
    u.latitude_error_rad = mc_signed(cfg, cfg->latitude_error_rad, &u.rnd);
    u.pitch_rad = mc_tilt(cfg, &u.rnd);
    u.roll_rad = mc_tilt(cfg, &u.rnd);
    u.q1_rad = NAV_PI * (2.0 * u.rnd.uniform() - 1.0);
    u.psi_rad = nav_heading(u.alpha1_rad, u.q1_rad, 0.0, u.pitch_rad, u.roll_rad);
    if (!cfg->gm_from_zero || cfg->gm_before_s > 0.0) u.drift_radps = mc_gm_begin_sd_radps(cfg) * u.rnd.gauss();
    return u;
}

static double alpha_at(const struct nav_mc_cfg *cfg, const struct sampled_instrument *u, int i, double error_rad)
{
    const double turn = cfg->angle_rad[i] - cfg->angle_rad[0];
    if (cfg->cardan == NAV_CARDAN_ALPHA) return u->alpha1_rad + turn + error_rad;
    return nav_alpha(u->psi_rad, u->q1_rad + turn + error_rad, 0.0, u->pitch_rad, u->roll_rad);
}

/* Mean of a Gaussian error drawn each sample. */
static double mean_of_samples(struct random_stream *rnd, double sd, uint64_t count)
{
    if (sd == 0.0) return 0.0;
    if (count == 1) return sd * rnd->gauss();
    double sum = 0.0;
    double noise[BLOCK];
    for (uint64_t done = 0; done < count; done += BLOCK) {
        const int n = count - done < BLOCK ? (int)(count - done) : BLOCK;
        rnd->state = random_fill(rnd->state, n + n % 2, noise);
        for (int k = 0; k < n; k++) sum += noise[k];
    }
    return sd * sum / (double)count;
}

/* Sixteen stretches of the drift at once, from zero: noise[16 k + j] is sample k of stretch j. Sums of the samples and what comes
 * after the last. One stretch would wait for itself. */
typedef double eight __attribute__((vector_size(8 * sizeof(double))));

INLINE void draw_stretches(const double *noise, int steps, double rho, double *sums, double *ends)
{
    eight w[2] = {};
    eight s[2] = {};
    for (int k = 0; k < steps; k++) {
        eight z[2];
        memcpy(z, noise + STRETCHES * k, sizeof z);
        s[0] += w[0];
        s[1] += w[1];
        w[0] = rho * w[0] + z[0];
        w[1] = rho * w[1] + z[1];
    }
    memcpy(sums, s, sizeof s);
    memcpy(ends, w, sizeof w);
}

BY_WIDTH(stretches, (const double *noise, int steps, double rho, double *sums, double *ends),
         draw_stretches(noise, steps, rho, sums, ends))

/* Sum of n samples of the drift w, which comes back as it is after the last. Each is computed, as noise started from zero and
 * what is left of w. */
static double drift_sum(const struct samples_plan *plan, const double *noise, int n, double *w)
{
    const int steps = n / STRETCHES;
    double sums[STRETCHES];
    double ends[STRETCHES];
    stretches_by_width[plan->width](noise, steps, plan->decay, sums, ends);
    double sum = 0.0;
    for (int j = 0; j < STRETCHES; j++) {
        sum += plan->decay_sums[steps] * *w + plan->step_sd_radps * sums[j];
        *w = plan->decays[steps] * *w + plan->step_sd_radps * ends[j];
    }
    for (int k = STRETCHES * steps; k < n; k++) {
        sum += *w;
        *w = plan->decay * *w + plan->step_sd_radps * noise[k];
    }
    return sum;
}

/* Mean of the random drift over a window, sample by sample; the gap before it is one exact step. */
static double drift_mean(const struct samples_plan *plan, struct sampled_instrument *u, int i)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    if (cfg->gm_sigma_radps == 0.0) return 0.0;
    double w = plan->over_gap[i] * u->drift_radps;
    if (i > 0) w += plan->gap_sd_radps[i] * u->rnd.gauss();
    double sum = 0.0;
    double noise[BLOCK];
    for (uint64_t done = 0; done < plan->per_window; done += BLOCK) {
        const uint64_t left = plan->per_window - done;
        const int n = left < BLOCK ? (int)left : BLOCK;
        u->rnd.state = random_fill(u->rnd.state, n + n % 2, noise);
        sum += drift_sum(plan, noise, n, &w);
    }
    u->drift_radps = w;
    return sum / (double)plan->per_window;
}

/* A window in position i: settled algebra with the means of all errors, which enter S to first order. */
static struct nav_position measure_position(const struct samples_plan *plan, struct sampled_instrument *u, int i)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    const uint64_t draws = cfg->per_sample ? plan->per_window : 1;
    const double angle =
        u->angle_sys_rad * mc_angle_share(cfg, i) + mean_of_samples(&u->rnd, cfg->angle_random_rad, draws);
    const double alpha = alpha_at(cfg, u, i, angle);
    struct nav_position p = plan->p[i];
    struct nav_rest at = {};
    at.latitude_rad = cfg->latitude_rad;
    at.latitude_error_rad = u->latitude_error_rad;
    at.alpha_rad = alpha;
    at.m1_per_s = cfg->m1_per_s;
    at.torquer_scale1 = cfg->torquer_scale;
    at.beta_error_rad = u->beta_sys_rad + mean_of_samples(&u->rnd, cfg->beta_random_rad, draws);
    at.gamma_error_rad = u->gamma_sys_rad + mean_of_samples(&u->rnd, cfg->gamma_random_rad, draws);
    at.gamma_rad = nav_gamma(alpha, 0.0, u->psi_rad, u->pitch_rad, u->roll_rad);
    at.drift1_radps = cfg->drift1_radps + drift_mean(plan, u, i);
    double beta = 0.0;
    p.s_radps = nav_rest_s_radps(&at, &beta) + mean_of_samples(&u->rnd, plan->white_sd_radps, plan->per_window);
    p.beta_rad = beta + at.beta_error_rad;
    p.gamma_rad = at.gamma_rad + at.gamma_error_rad;
    if (i == 0) {
        u->first_actual_rad = alpha;
        u->first_nominal_rad = alpha_at(cfg, u, 0, 0.0);
    }
    return p;
}

/* Gimbal steps to increments of alpha, with the attitude that the level sensors tell. */
static int correct_gimbal(const struct nav_mc_cfg *cfg, double q1_rad, struct nav_position *p)
{
    double q[NAV_MAX_POSITIONS];
    double beta[NAV_MAX_POSITIONS];
    double gamma[NAV_MAX_POSITIONS];
    double delta[NAV_MAX_POSITIONS];
    for (int i = 0; i < cfg->count; i++) {
        q[i] = q1_rad + p[i].delta_rad;
        beta[i] = p[i].beta_rad;
        gamma[i] = p[i].gamma_rad;
    }
    struct nav_attitude attitude;
    int refused = nav_attitude_from_level(q, beta, gamma, cfg->count, 1, &attitude);
    if (refused) return refused;
    refused = nav_cardan(q, beta, cfg->count, attitude.pitch_rad, attitude.roll_rad, delta);
    for (int i = 0; i < cfg->count && !refused; i++) p[i].delta_rad = delta[i];
    return refused;
}

static int run_samples(const struct samples_plan *plan, uint64_t start, const struct nav_mc_out *out, uint64_t k)
{
    const struct nav_mc_cfg *cfg = plan->cfg;
    struct sampled_instrument u = draw_sampled(cfg, start);
    struct nav_position p[NAV_MAX_POSITIONS];
    for (int i = 0; i < cfg->count; i++) p[i] = measure_position(plan, &u, i);
    if (cfg->cardan == NAV_CARDAN_CORRECTED) {
        const int refused = correct_gimbal(cfg, u.q1_rad, p);
        if (refused) return refused;
    }
    struct nav_gyrocompass_cfg fit = cfg->fit;
    fit.latitude_rad = cfg->latitude_rad + u.latitude_error_rad;
    struct nav_compass found;
    const int refused = nav_gyrocompass(p, cfg->count, &fit, &found);
    if (refused) return refused;
    mc_put(out->platform_rad, k, nav_wrap(found.alpha1_rad - u.first_actual_rad));
    mc_put(out->heading_rad, k, nav_wrap(found.alpha1_rad - u.first_nominal_rad));
    mc_put(out->drift_radps, k, found.drift1_radps - cfg->drift1_radps);
    mc_put(out->alpha1_rad, k, nav_wrap(u.first_actual_rad));
    mc_put(out->quality, k, found.quality);
    return NAV_OK;
}

int nav_mc_samples(const struct nav_mc_cfg *cfg, uint64_t seed, uint64_t first_run, uint64_t runs,
                   const struct nav_mc_out *out)
{
    struct samples_plan plan;
    int refused = plan_make(cfg, &plan);
    for (uint64_t k = 0; k < runs && !refused; k++)
        refused = run_samples(&plan, random_run(seed, first_run + k), out, k);
    return refused;
}
