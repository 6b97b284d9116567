#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

#include <cstring>

size_t nav_sins_bytes(void)
{
    return sizeof(struct nav_sins);
}

int nav_sins_start(void *memory, size_t bytes, const struct nav_sins_cfg *cfg, const double c_nb[9], int feedback,
                   nav_sins **out)
{
    struct nav_sins_rows at[NAV_SINS_BLOCKS];
    const int n = nav_sins_layout(cfg, at);
    const mat3 c = Eigen::Map<const mat3_rows>(c_nb);
    if (n < 0) return n;
    if (!c.allFinite()) return NAV_NOT_FINITE;
    if (!memory || bytes < sizeof(struct nav_sins) || !nav_is_rotation(c, 1e-6)) return NAV_RANGE;
    memset(memory, 0, sizeof(struct nav_sins));
    struct nav_sins *s = (struct nav_sins *)memory;
    s->cfg = *cfg;
    memcpy(s->at, at, sizeof at);
    s->n = n;
    s->dynamic = at[NAV_SINS_NU].offset;
    s->per_step = (int)nav_floor(cfg->step_s / cfg->sample_s + 0.5);
    s->feedback = feedback != 0;
    s->c0 = s->c0_prior = nav_nearest_rotation(c);
    s->gravity_n = vec3(0.0, 0.0, cfg->gravity_mps2);
    s->earth_n = NAV_EARTH_RADPS * vec3(0.0, nav_cos(cfg->latitude_rad), nav_sin(cfg->latitude_rad));
    s->earth_turn = nav_rotation_by(-s->earth_n * cfg->sample_s);
    const int status = sins_reset(s);
    if (status == NAV_OK) *out = s;
    return status;
}

int nav_sins_about(nav_sins *s, const struct nav_sins_params *model)
{
    if (!nav_all_finite((const double *)model, sizeof *model / sizeof(double))) return NAV_NOT_FINITE;
    if (s->started) return NAV_TIMES;
    s->model = *model;
    return sins_reset(s);
}

static int take_time(nav_sins *s, double t_s)
{
    if (!std::isfinite(t_s)) return NAV_NOT_FINITE;
    if (!s->started) s->start_s = t_s;
    s->started = true;
    const double due_s = s->start_s + (double)s->samples * s->cfg.sample_s;
    return std::fabs(t_s - due_s) <= 0.5 * s->cfg.sample_s ? NAV_OK : NAV_TIMES;
}

int nav_sins_samples(nav_sins *s, double t_s, const double *dtheta_rad, const double *dv_mps, int count)
{
    if (count < 0) return NAV_RANGE;
    if (!nav_all_finite(dtheta_rad, 3 * count) || !nav_all_finite(dv_mps, 3 * count)) return NAV_NOT_FINITE;
    int status = take_time(s, t_s);
    for (int k = 0; k < count && status == NAV_OK; k++) {
        sins_take_sample(s, Eigen::Map<const vec3>(dtheta_rad + 3 * k), Eigen::Map<const vec3>(dv_mps + 3 * k));
        const int64_t in_step = s->samples % s->per_step;
        if (in_step == s->per_step / 2) sins_middle(s);
        if (in_step == 0) status = sins_finish_step(s);
    }
    return status;
}

int nav_sins_again(nav_sins *s)
{
    if (!s->cfg.clone) return NAV_RANGE;
    sins_feed_back(s);
    s->feedback = 0;
    return sins_reset(s);
}

int nav_sins_get(const nav_sins *s, struct nav_sins_state *state)
{
    const double *x = s->kf.x;
    const double *start = x + s->at[NAV_SINS_BETA0].offset;
    *state = s->found;
    state->params = s->model;
    sins_add_state(s, &state->params);
    nav_store_rows(nav_rotation_by(-vec3(x[0], x[1], x[2])) * s->c, state->c_nb);
    const vec3 beta0 = s->cfg.clone ? vec3(start[0], start[1], start[2]) : vec3::Zero();
    nav_store_rows(nav_rotation_by(-beta0) * s->c0, state->c0_nb);
    return NAV_OK;
}

int nav_sins_covariance(const nav_sins *s, double *x, double *p)
{
    return nav_kf_get(&s->kf, x, p);
}

int nav_sins_jacobians(const nav_sins *s, double *phi, double *q, double *h)
{
    if (phi) memcpy(phi, s->phi, sizeof *phi * (size_t)(s->dynamic * s->n));
    if (q) memcpy(q, s->q, sizeof *q * (size_t)(s->dynamic * s->dynamic));
    if (h) memcpy(h, s->h, sizeof *h * (size_t)(6 * s->n));
    return NAV_OK;
}
