#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

void sins_use_model(struct nav_sins *s)
{
    const mat3 theta = Eigen::Map<const mat3_rows>(s->model.theta);
    const mat3 gamma = Eigen::Map<const mat3_rows>(s->model.gamma);
    s->gyro_back = (mat3::Identity() + theta).inverse();
    s->accel_back = (mat3::Identity() + gamma).inverse();
}

/* What an accelerometer at r sees beside f, row i of [w x][w x] + [dw/dt x] times r_i, as a matrix: L(i, :) of accelerometer i. */
static mat3 lever_rows(const vec3 &w, const vec3 &dw)
{
    return w * w.transpose() - w.squaredNorm() * mat3::Identity() + nav_cross_matrix(dw);
}

/* Sensitivity of beta: integrals of C and of C w' over the sample, by the mean of its ends (docs/procedures/sins.md (2)). */
static void add_drift(struct nav_sins *s, const mat3 &middle, const vec3 &dtheta)
{
    const mat3 m = middle * s->gyro_back;
    s->now.drift.leftCols<3>() += m * s->cfg.sample_s;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) s->now.drift.col(3 + 3 * i + j) += m.col(i) * dtheta(j);
    s->now.time_s += s->cfg.sample_s;
}

/* Sensitivity of z_a: f is C' g, free of the accelerometers' noise. */
static void add_accel(struct nav_sins *s, const mat3 &middle, const mat3 &lever, const vec3 &w_rel)
{
    const double dt = s->cfg.sample_s;
    const mat3 m = middle * s->accel_back * dt;
    const vec3 f = middle.transpose() * s->gravity_n;
    s->accel.leftCols<3>() += m;
    for (int i = 0; i < 3; i++) s->accel.col(SINS_AT_QUAD + i) += m.col(i) * (f(i) * f(i));
    s->accel.col(SINS_AT_DELAY) += m * w_rel.cross(f);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            s->accel.col(3 + 3 * i + j) += m.col(i) * f(j);
            if (s->cfg.lever) s->accel.col(12 + 3 * i + j) += m.col(i) * lever(i, j);
        }
}

/* C of the sample's start times this is the integral of C f: exact to the third order of the turn relative to n, for a force
 * constant there. */
static vec3 undo_turn(const vec3 &turn, const vec3 &dv)
{
    const vec3 once = turn.cross(dv);
    return dv + 0.5 * once + turn.cross(once) / 12.0;
}

static vec3 without_lever(const struct nav_sins *s, const vec3 &dv, const mat3 &lever)
{
    vec3 left = dv;
    for (int i = 0; i < 3; i++)
        left(i) -= lever.row(i).dot(Eigen::Map<const vec3>(s->model.lever_m + 3 * i)) * s->cfg.sample_s;
    return left;
}

/* f = f'' - (I + Gamma)^-1 q f^2, twice from f'' on: what is left is of the order of q^3 f^4, 1e-10 m/s^2 of 100 ug/g^2. */
static vec3 without_quad(const struct nav_sins *s, const vec3 &dv)
{
    const Eigen::Map<const vec3> q(s->model.quadratic_s2pm);
    if (q.isZero(0.0)) return dv;
    vec3 left = dv;
    for (int pass = 0; pass < 2; pass++)
        left = dv - s->accel_back * (q.cwiseProduct(left).cwiseProduct(left) / s->cfg.sample_s);
    return left;
}

/* f(t) of f'(t) = f(t - delay): exp(-w delay) f', w relative to n. */
static vec3 without_delay(const struct nav_sins *s, const vec3 &dv, const vec3 &turn_rel)
{
    if (s->model.delay_s == 0.0) return dv;
    return nav_rotation_by(-turn_rel * (s->model.delay_s / s->cfg.sample_s)) * dv;
}

void sins_take_sample(struct nav_sins *s, const vec3 &dtheta_raw, const vec3 &dv_raw)
{
    const double dt = s->cfg.sample_s;
    const vec3 dtheta = s->gyro_back * (dtheta_raw - Eigen::Map<const vec3>(s->model.nu_radps) * dt);
    const vec3 w = dtheta / dt;
    const mat3 lever =
        s->cfg.lever ? lever_rows(w, s->samples ? vec3((w - s->w_before) / dt) : vec3::Zero()) : mat3::Zero();
    vec3 dv = dv_raw - Eigen::Map<const vec3>(s->model.df_mps2) * dt;
    if (s->cfg.lever) dv = without_lever(s, dv, lever);
    dv = without_quad(s, s->accel_back * dv);

    const vec3 turn = dtheta + s->dtheta_before.cross(dtheta) / 12.0; /* coning of two samples */
    const mat3 after = s->earth_turn * (s->c * nav_rotation_by(turn));
    const mat3 middle = 0.5 * (s->c + after);
    const vec3 turn_rel = dtheta - middle.transpose() * s->earth_n * dt;
    add_drift(s, middle, dtheta);
    add_accel(s, middle, lever, turn_rel / dt);
    s->z_sum += s->c * undo_turn(turn_rel, without_delay(s, dv, turn_rel));

    s->c = after;
    s->dtheta_before = dtheta;
    s->w_before = w;
    s->samples++;
    struct sins_ring_entry *kept = &s->ring[s->samples % SINS_RING];
    kept->t_s = s->start_s + (double)s->samples * dt;
    kept->c = s->c;
    kept->w_rel_b = turn_rel / dt;
}
