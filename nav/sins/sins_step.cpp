/* One step of the filter: to the middle of the step, where the mean of the accelerometers belongs. */
#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

#include <cstring>

static int offset_of(const struct nav_sins *s, int block)
{
    return s->at[block].offset;
}

static bool has_block(const struct nav_sins *s, int block)
{
    return s->at[block].size > 0;
}

/* beta' = (I - [u x] T) beta + S (nu, Theta); walk' = e^(-T/tau) walk. */
static void set_phi(struct nav_sins *s, const struct sins_span *span)
{
    const int n = s->n;
    const mat3 turn = mat3::Identity() - nav_cross_matrix(s->earth_n) * span->time_s;
    memset(s->phi, 0, sizeof s->phi);
    for (int i = 0; i < 3; i++) {
        double *row = s->phi + i * n;
        for (int j = 0; j < 3; j++) row[j] = turn(i, j);
        for (int j = 0; j < 3; j++) row[offset_of(s, NAV_SINS_NU) + j] = span->drift(i, j);
        for (int j = 0; j < 9; j++) row[offset_of(s, NAV_SINS_THETA) + j] = span->drift(i, 3 + j);
        if (!has_block(s, NAV_SINS_WALK)) continue;
        for (int j = 0; j < 3; j++) row[3 + j] = span->drift(i, j);
        s->phi[(3 + i) * n + 3 + i] = nav_decay(span->time_s / s->cfg.walk_tau_s);
    }
}

static void set_q(struct nav_sins *s, double time_s)
{
    const int nd = s->dynamic;
    const double density = s->cfg.gyro_noise_radps_rts;
    const double walk = s->cfg.walk_sd_radps;
    memset(s->q, 0, sizeof *s->q * (size_t)(nd * nd));
    for (int i = 0; i < nd; i++)
        s->q[i * (nd + 1)] =
            i < 3 ? density * density * time_s : walk * walk * nav_rise(2.0 * time_s / s->cfg.walk_tau_s);
}

/* (3): means over the step. */
static void set_h(struct nav_sins *s)
{
    const int n = s->n;
    const double g = s->gravity_n.z();
    const struct sins_gauge *gauge = &sins_gauges[s->cfg.gauge];
    const double share = 1.0 / s->cfg.step_s;
    memset(s->h, 0, sizeof *s->h * (size_t)(3 * n));
    s->h[0 * n + 1] = g;
    s->h[1 * n + 0] = -g;
    for (int i = 0; i < 3; i++) {
        double *row = s->h + i * n;
        for (int j = 0; j < 3; j++) row[offset_of(s, NAV_SINS_DF) + j] = s->accel(i, j) * share;
        for (int j = 0; j < gauge->count; j++)
            row[offset_of(s, NAV_SINS_GAMMA) + j] = s->accel(i, 3 + gauge->at[j]) * share;
        for (int j = 0; j < s->cfg.lever; j++) /* 3: r_11, r_22, r_33 */
            row[offset_of(s, NAV_SINS_LEVER) + j] = s->accel(i, 12 + (s->cfg.lever == 3 ? 4 * j : j)) * share;
        for (int j = 0; j < s->at[NAV_SINS_QUAD].size; j++)
            row[offset_of(s, NAV_SINS_QUAD) + j] = s->accel(i, SINS_AT_QUAD + j) * share;
        if (has_block(s, NAV_SINS_DELAY)) row[offset_of(s, NAV_SINS_DELAY)] = s->accel(i, SINS_AT_DELAY) * share;
    }
}

static int take_accel(struct nav_sins *s)
{
    const double sd = s->cfg.accel_noise_mps2_rts * s->cfg.accel_noise_multiplier;
    const double r = sd * sd / s->cfg.step_s;
    const vec3 z = s->z_sum / s->cfg.step_s - s->gravity_n;
    const double rs[3] = {r, r, r};
    set_h(s);
    const int status = nav_kf_update(&s->kf, s->h, z.data(), rs, 3, s->found.last);
    if (status != NAV_OK) return status;
    for (int i = 0; i < 3; i++)
        s->found.nis_accel += s->found.last[i].value * s->found.last[i].value / s->found.last[i].variance;
    s->found.count_accel += 3;
    return NAV_OK;
}

static void clear_sums(struct nav_sins *s)
{
    s->now.drift.setZero();
    s->now.time_s = 0.0;
    s->accel.setZero();
    s->z_sum.setZero();
}

/* The first half of a step ends the span from the middle of the one before. */
void sins_middle(struct nav_sins *s)
{
    s->carry.drift += s->now.drift;
    s->carry.time_s += s->now.time_s;
    s->now.drift.setZero();
    s->now.time_s = 0.0;
}

int sins_finish_step(struct nav_sins *s)
{
    set_phi(s, &s->carry);
    set_q(s, s->carry.time_s);
    int status = nav_kf_predict(&s->kf, s->phi, s->q);
    if (status == NAV_OK) status = take_accel(s);
    const int64_t middle = s->steps * s->per_step + s->per_step / 2;
    s->found.t_s = s->start_s + (double)middle * s->cfg.sample_s;
    if (status == NAV_OK && s->cfg.stand) status = sins_take_angles(s, s->found.t_s);
    s->carry = s->now;
    clear_sums(s);
    s->c = nav_nearest_rotation(s->c);
    s->steps++;
    if (status == NAV_OK && s->feedback) sins_feed_back(s);
    return status;
}
