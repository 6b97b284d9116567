/* The state of the filter is what the model lacks: where each of its numbers is, and what moves between the two. */
#include "nav/sins/sins_model.hpp"

#include <cstring>

/* Number k of a block in *p; NULL for attitudes and the walk, which are no part of the model. */
static double *param_at(const struct nav_sins *s, struct nav_sins_params *p, int block, int k)
{
    switch (block) {
    case NAV_SINS_NU:
        return p->nu_radps + k;
    case NAV_SINS_THETA:
        return p->theta + k;
    case NAV_SINS_DF:
        return p->df_mps2 + k;
    case NAV_SINS_GAMMA:
        return p->gamma + sins_gauges[s->cfg.gauge].at[k];
    case NAV_SINS_LEVER:
        return p->lever_m + (s->cfg.lever == 3 ? 4 * k : k);
    case NAV_SINS_QUAD:
        return p->quadratic_s2pm + k;
    case NAV_SINS_DELAY:
        return &p->delay_s;
    case NAV_SINS_DELTA:
        return p->delta_rad + k;
    case NAV_SINS_TAU:
        return &p->tau_s;
    case NAV_SINS_EPS:
        return p->eps_rad + k;
    default:
        return nullptr;
    }
}

void sins_add_state(const struct nav_sins *s, struct nav_sins_params *p)
{
    for (int b = 0; b < NAV_SINS_BLOCKS; b++)
        for (int k = 0; k < s->at[b].size; k++) {
            double *to = param_at(s, p, b, k);
            if (to) *to += s->kf.x[s->at[b].offset + k];
        }
}

/* The samples that an angle of the stand may still be compared with. */
static void turn_ring(struct nav_sins *s, const mat3 &back)
{
    const int64_t kept = (int64_t)(sins_kept_s(&s->cfg) / s->cfg.sample_s) + 2;
    const int64_t from = s->samples - kept < 1 ? 1 : s->samples - kept;
    for (int64_t k = from; k <= s->samples; k++) {
        struct sins_ring_entry *entry = &s->ring[k % SINS_RING];
        entry->c = back * entry->c;
    }
}

void sins_feed_back(struct nav_sins *s)
{
    double *x = s->kf.x;
    const double *start = x + s->at[NAV_SINS_BETA0].offset;
    sins_add_state(s, &s->model);
    sins_use_model(s);
    const mat3 back = nav_rotation_by(-vec3(x[0], x[1], x[2]));
    s->c = back * s->c;
    if (s->cfg.stand) turn_ring(s, back);
    if (s->cfg.clone) s->c0 = nav_rotation_by(-vec3(start[0], start[1], start[2])) * s->c0;
    for (int i = 0; i < s->n; i++)
        if (i < 3 || i >= s->dynamic) x[i] = 0.0;
}

/* The prior's mean seen from the model: of the attitude it is c0 against c0_prior, of the parameters less the model's. */
static void set_mean(struct nav_sins *s, double *x)
{
    const vec3 beta = nav_rotation_log(s->c0 * s->c0_prior.transpose());
    for (int k = 0; k < 3; k++) {
        x[k] = beta(k);
        if (s->cfg.clone) x[s->at[NAV_SINS_BETA0].offset + k] = beta(k);
    }
    for (int b = 0; b < NAV_SINS_BLOCKS; b++)
        for (int k = 0; k < s->at[b].size; k++) {
            const double *of = param_at(s, &s->model, b, k);
            if (of) x[s->at[b].offset + k] = -*of;
        }
}

static void clear_motion(struct nav_sins *s)
{
    s->samples = s->steps = 0;
    s->started = false;
    s->c = s->c0;
    s->dtheta_before.setZero();
    s->w_before.setZero();
    s->carry.drift.setZero();
    s->now.drift.setZero();
    s->carry.time_s = s->now.time_s = 0.0;
    s->accel.setZero();
    s->z_sum.setZero();
    s->pending_first = s->pending_count = 0;
    s->found = {};
}

int sins_reset(struct nav_sins *s)
{
    double p[KF_MAX * KF_MAX];
    double x[KF_MAX] = {0};
    struct nav_kf *kf;
    clear_motion(s);
    sins_use_model(s);
    set_mean(s, x);
    int status = nav_sins_prior(&s->cfg, p);
    if (status == NAV_OK) status = nav_kf_start(&s->kf, sizeof s->kf, s->n, s->dynamic, s->cfg.form, &kf);
    return status == NAV_OK ? nav_kf_set(kf, x, p) : status;
}

int sins_forget_beta(struct nav_sins *s)
{
    double p[KF_MAX * KF_MAX];
    double x[KF_MAX];
    const int n = s->n;
    (void)nav_kf_get(&s->kf, x, p);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < n; j++) p[i * n + j] = p[j * n + i] = 0.0;
        p[i * (n + 1)] = s->cfg.beta_sd_rad[i] * s->cfg.beta_sd_rad[i];
        x[i] = 0.0;
    }
    return nav_kf_set(&s->kf, x, p);
}
