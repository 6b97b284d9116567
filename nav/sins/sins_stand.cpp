/* Angles of the table beside the integrated attitude, (4). */
#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

#include <cstring>

constexpr double RATE_CHANGED_RADPS =
    0.2 * NAV_DEG; /* above the rate noise of 100 Hz samples of such gyros, below a program's step */

/* The sample of the ring that contains t; NULL: gone, or not there yet. */
static const struct sins_ring_entry *sample_at(const struct nav_sins *s, double t_s)
{
    const double from_start = (t_s - s->start_s) / s->cfg.sample_s;
    const int64_t number = (int64_t)nav_floor(from_start) + 1;
    if (number < 1 || number > s->samples || number <= s->samples - SINS_RING) return nullptr;
    return &s->ring[number % SINS_RING];
}

static vec3 mean_rate(const struct nav_sins *s, double from_s, double to_s)
{
    const struct sins_ring_entry *a = sample_at(s, from_s);
    const struct sins_ring_entry *b = sample_at(s, to_s);
    if (!a || !b || b->t_s <= a->t_s) return vec3::Constant(NAV_NAN);
    return nav_rotation_log(a->c.transpose() * b->c) / (b->t_s - a->t_s);
}

/* Rates before and after agree: no change within the guard. */
static bool is_steady(const struct nav_sins *s, double t_s)
{
    const double guard = s->cfg.stand_guard_s;
    if (guard == 0.0) return true;
    const vec3 before = mean_rate(s, t_s - guard, t_s);
    const vec3 after = mean_rate(s, t_s, t_s + guard);
    return (after - before).norm() < RATE_CHANGED_RADPS;
}

/* (4) at the time t of the unit: the residual, and its sensitivities. delta of the model is a finite rotation: exp(delta + d) is
 * exp(d + delta x d / 2) exp(delta). beta is of lag_s before the filter's. */
static vec3 set_rows(struct nav_sins *s, const struct sins_angle *angle, double t_s, double lag_s)
{
    const int n = s->n;
    const struct sins_ring_entry *at = sample_at(s, t_s);
    const mat3 c = at->c * nav_rotation_by(-at->w_rel_b * (at->t_s - t_s));
    const vec3 delta = Eigen::Map<const vec3>(s->model.delta_rad);
    const vec3 eps = Eigen::Map<const vec3>(s->model.eps_rad);
    const mat3 to_delta = -c * (mat3::Identity() + 0.5 * nav_cross_matrix(delta));
    const vec3 to_tau = -c * at->w_rel_b;
    const mat3 between = -lag_s * c * nav_rotation_by(0.5 * lag_s * at->w_rel_b);
    const vec3 w = at->w_rel_b + c.transpose() * s->earth_n;
    memset(s->h + 3 * n, 0, sizeof *s->h * (size_t)(3 * n));
    for (int i = 0; i < 3; i++) {
        double *row = s->h + (3 + i) * n;
        row[i] = 1.0;
        for (int j = 0; j < 3; j++) {
            row[s->at[NAV_SINS_NU].offset + j] = between(i, j);
            for (int k = 0; k < 3; k++) row[s->at[NAV_SINS_THETA].offset + 3 * j + k] = between(i, j) * w(k);
            row[s->at[NAV_SINS_DELTA].offset + j] = to_delta(i, j);
            if (s->cfg.base) row[s->at[NAV_SINS_EPS].offset + j] = i == j ? -1.0 : 0.0;
        }
        row[s->at[NAV_SINS_TAU].offset] = to_tau(i);
    }
    return nav_rotation_log(c * nav_rotation_by(delta) * angle->c_st.transpose() * nav_rotation_by(eps));
}

static double trace_of(const struct nav_sins *s, int block)
{
    double sum = 0.0;
    for (int k = 0; k < s->at[block].size; k++) sum += kf_variance(&s->kf, s->at[block].offset + k);
    return sum;
}

/* Products of two unknown rotations, beta, delta and w tau, that (4) leaves out: half of each cross product. While they are unknown
 * by degrees this exceeds the table's noise a hundredfold, and a first pass would believe what is wrong. */
static double second_order(const struct nav_sins *s, const vec3 &w_rel_b)
{
    const double late = w_rel_b.squaredNorm() * trace_of(s, NAV_SINS_TAU);
    const double beta = trace_of(s, NAV_SINS_BETA);
    const double delta = trace_of(s, NAV_SINS_DELTA);
    return 0.25 * (beta * delta + beta * late + delta * late);
}

static int take_angle(struct nav_sins *s, const struct sins_angle *angle, double t_filter_s)
{
    const double t_s = angle->t_s + s->model.tau_s;
    if (!sample_at(s, t_s) || !is_steady(s, t_s)) {
        s->found.stand_left_out++;
        return NAV_OK;
    }
    const vec3 z = set_rows(s, angle, t_s, t_filter_s - t_s);
    const double density2 = s->cfg.stand_sd_rad * s->cfg.stand_sd_rad / s->cfg.stand_noise_rate_hz;
    const double left_out = s->feedback ? second_order(s, sample_at(s, t_s)->w_rel_b) : 0.0;
    const double r = density2 / s->cfg.stand_interval_s + left_out;
    const double rs[3] = {r, r, r};
    const int status = nav_kf_update(&s->kf, s->h + 3 * s->n, z.data(), rs, 3, s->found.last + 3);
    if (status != NAV_OK) return status;
    for (int i = 3; i < 6; i++)
        s->found.nis_stand += s->found.last[i].value * s->found.last[i].value / s->found.last[i].variance;
    s->found.count_stand += 3;
    return NAV_OK;
}

int sins_take_angles(struct nav_sins *s, double t_filter_s)
{
    int status = NAV_OK;
    for (int i = 3; i < 6; i++) s->found.last[i] = {0.0, 0.0};
    while (s->pending_count > 0 && status == NAV_OK) {
        const struct sins_angle *angle = &s->pending[s->pending_first];
        if (angle->t_s + s->model.tau_s + s->cfg.stand_guard_s > t_filter_s) break;
        status = take_angle(s, angle, t_filter_s);
        s->pending_first = (s->pending_first + 1) % SINS_PENDING;
        s->pending_count--;
    }
    return status;
}

int nav_sins_stand(nav_sins *s, double t_s, const double c_st[9])
{
    const mat3 c = Eigen::Map<const mat3_rows>(c_st);
    if (!s->cfg.stand || s->pending_count == SINS_PENDING) return NAV_RANGE;
    if (!std::isfinite(t_s) || !c.allFinite()) return NAV_NOT_FINITE;
    if (!nav_is_rotation(c, 1e-6)) return NAV_RANGE;
    const int last = (s->pending_first + s->pending_count + SINS_PENDING - 1) % SINS_PENDING;
    if (s->pending_count > 0 && t_s <= s->pending[last].t_s) return NAV_TIMES;
    s->pending[(s->pending_first + s->pending_count) % SINS_PENDING] = {t_s, c};
    s->pending_count++;
    return NAV_OK;
}
