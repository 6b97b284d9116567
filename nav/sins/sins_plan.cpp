/* Increments of an ideal unit on a plan of turns: the covariance does not need data, only motion. */
#include "nav/sins/sins_model.hpp"

#include "nav/common/nav_math.hpp"

static int64_t samples_of(const struct nav_sins *s, double duration_s)
{
    return (int64_t)nav_floor(duration_s / s->cfg.sample_s + 0.5);
}

static bool is_turn(const struct nav_sins *s, const struct nav_sins_turn *turn)
{
    const Eigen::Map<const vec3> axis(turn->axis_b);
    const double most = 1e7 * s->cfg.sample_s;
    return axis.allFinite() && std::fabs(axis.norm() - 1.0) < 1e-6 && std::fabs(turn->rate_radps) <= 20.0 &&
           turn->duration_s >= 0.0 && turn->duration_s <= most;
}

/* w_rel and g constant in b and n: the integrals over a sample, to the third order of its turn. */
static int run_turn(struct nav_sins *s, const struct nav_sins_turn *turn)
{
    const double dt = s->cfg.sample_s;
    const vec3 step = Eigen::Map<const vec3>(turn->axis_b) * (turn->rate_radps * dt);
    const mat3 a = nav_cross_matrix(step);
    const mat3 mean = (mat3::Identity() - 0.5 * a + a * a / 6.0) * dt;
    for (int64_t k = samples_of(s, turn->duration_s); k > 0; k--) {
        const mat3 to_b = s->c.transpose();
        const vec3 dtheta = step + mean * (to_b * s->earth_n);
        const vec3 dv = mean * (to_b * s->gravity_n);
        if (s->cfg.stand && s->samples % s->per_step == 0) {
            const mat3_rows now = s->c;
            const int put = nav_sins_stand(s, s->start_s + (double)s->samples * dt, now.data());
            if (put != NAV_OK) return put;
        }
        const int status = nav_sins_samples(s, s->start_s + (double)s->samples * dt, dtheta.data(), dv.data(), 1);
        if (status != NAV_OK) return status;
    }
    return NAV_OK;
}

/* The unit is taken off and put on again, turned. Coefficients of the broken step are of no interest. */
static int run_remount(struct nav_sins *s, const struct nav_sins_turn *turn)
{
    const double angle = turn->rate_radps * turn->duration_s;
    s->c = s->c * nav_rotation_by(vec3(Eigen::Map<const vec3>(turn->axis_b) * angle));
    s->carry.drift.setZero();
    s->carry.time_s = 0.0;
    s->pending_first = s->pending_count = 0;
    s->dtheta_before.setZero();
    for (struct sins_ring_entry &kept : s->ring) kept.c.setConstant(NAV_NAN); /* no angle is compared across it */
    return sins_forget_beta(s);
}

int nav_sins_plan(nav_sins *s, const struct nav_sins_turn *turns, int count)
{
    if (count < 0 || s->feedback) return NAV_RANGE;
    for (int i = 0; i < count; i++)
        if (!is_turn(s, &turns[i])) return NAV_RANGE;
    for (int i = 0; i < count; i++) {
        const int status = turns[i].remount ? run_remount(s, &turns[i]) : run_turn(s, &turns[i]);
        if (status != NAV_OK) return status;
    }
    return NAV_OK;
}
