#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_earth.hpp"
#include "nav/sins/sins_model.hpp"

#include <cstring>

size_t nav_koi_bytes(void)
{
    return sizeof(struct nav_koi);
}

double koi_time_s(const struct nav_koi *k)
{
    return k->start_s + (double)k->steps * k->cfg.step_s;
}

void koi_use_sensors(struct nav_koi *k)
{
    const mat3 one = mat3::Identity();
    k->gyro_back = (one + Eigen::Map<const mat3_rows>(k->sensors.theta)).inverse();
    k->accel_back = (one + Eigen::Map<const mat3_rows>(k->sensors.gamma)).inverse();
}

static int dynamic_of(const struct nav_koi_cfg *cfg, const struct nav_sins_rows *at)
{
    if (cfg->df_walk_mps2_rts > 0.0) return at[NAV_KOI_GAMMA].offset;
    if (cfg->nu_walk_radps_rts > 0.0) return at[NAV_KOI_DF].offset;
    return at[NAV_KOI_NU].offset;
}

static int set_filter(struct nav_koi *k, const double *x, const double *p)
{
    nav_kf *kf;
    double *prior = k->phi; /* not in use yet */
    int status = nav_koi_prior(&k->cfg, &k->before, prior);
    for (int i = 0; i < k->n && status == NAV_OK; i++) k->prior_sd[i] = nav_root((p ? p : prior)[i * (k->n + 1)]);
    if (status == NAV_OK) status = nav_kf_start(&k->kf, sizeof k->kf, k->n, k->dynamic, k->cfg.form, &kf);
    if (status == NAV_OK) status = nav_kf_set(kf, x, p ? p : prior);
    return status;
}

static void forget_measurements(struct nav_koi *k)
{
    for (struct nav_koi_last &last : k->last) {
        last.reason = -1;
        last.t_s = last.accepted_s = KOI_NEVER_S;
    }
}

static void set_alone(struct nav_koi *k, int block, double keep, const vec3 &variance)
{
    for (int i = 0; i < k->at[block].size; i++) {
        const int at = k->at[block].offset + i;
        if (at >= k->dynamic) return;
        k->phi[at * (k->n + 1)] = keep;
        k->q[at * (k->dynamic + 1)] = variance[i];
    }
}

/* Rows and noise of the states that no other moves, walks and Gauss-Markov ones: the same in each step. */
static void set_walks(struct nav_koi *k)
{
    const struct nav_koi_cfg *c = &k->cfg;
    const auto walk = [c](double density) { return vec3::Constant(density * density * c->step_s); };
    const double keep = nav_decay(c->step_s / c->slow_s), gain = nav_rise(2.0 * c->step_s / c->slow_s);
    set_alone(k, NAV_KOI_BARO, 1.0, walk(c->baro_walk_m_rts));
    set_alone(k, NAV_KOI_SLOW_R, keep, gain * vec3(c->slow_r_sd_m).cwiseAbs2());
    set_alone(k, NAV_KOI_SLOW_V, keep, gain * vec3(c->slow_v_sd_mps).cwiseAbs2());
    set_alone(k, NAV_KOI_NU, 1.0, walk(c->nu_walk_radps_rts));
    set_alone(k, NAV_KOI_DF, 1.0, walk(c->df_walk_mps2_rts));
}

static int check_start(const struct nav_koi_sensors *sensors, double t_s, const struct nav_state *at)
{
    if (!std::isfinite(t_s) || !nav_all_finite(&at->lat_rad, NAV_STATE_DOUBLES)) return NAV_NOT_FINITE;
    if (sensors && !nav_all_finite(sensors->nu_radps, sizeof *sensors / sizeof(double))) return NAV_NOT_FINITE;
    return nav_is_rotation(Eigen::Map<const mat3_rows>(at->C_nb), 1e-6) ? NAV_OK : NAV_RANGE;
}

int nav_koi_start(void *memory, size_t bytes, const struct nav_koi_cfg *cfg, double t_s, const struct nav_state *at,
                  const double *x, const double *p, const struct nav_koi_sensors *sensors, nav_koi **out)
{
    struct nav_sins_rows rows[NAV_KOI_BLOCKS];
    const int n = nav_koi_layout(cfg, rows);
    if (n < 0) return n;
    if (!memory || bytes < sizeof(struct nav_koi)) return NAV_RANGE;
    int status = check_start(sensors, t_s, at);
    if (status != NAV_OK) return status;
    memset(memory, 0, sizeof(struct nav_koi));
    struct nav_koi *k = (struct nav_koi *)memory;
    k->cfg = *cfg;
    k->errors = koi_errors_cfg(cfg);
    memcpy(k->at, rows, sizeof rows);
    k->n = n;
    k->dynamic = dynamic_of(cfg, rows);
    k->per_step = (int)nav_floor(cfg->step_s / cfg->sample_s + 0.5);
    k->n_errors = koi_index_columns(cfg, rows, k->column);
    k->start_s = k->started_alone_s = t_s;
    k->unit.at = k->before = *at;
    k->unit.vertical = NAV_VERTICAL_FREE;
    if (sensors) k->sensors = *sensors;
    koi_use_sensors(k);
    forget_measurements(k);
    status = set_filter(k, x, p);
    memset(k->phi, 0, sizeof k->phi);
    set_walks(k);
    if (status == NAV_OK) *out = k;
    return status;
}

/* Phi of errors.h about the hybrid solution, then T(end) Phi T(begin)^-1 and T Q T', in the article's order. */
static int find_transition(struct nav_koi *k)
{
    const int ne = k->n_errors, nd = k->dynamic;
    const struct nav_state about = koi_hybrid(k);
    const vec3 w = k->dtheta_sum / k->cfg.step_s, f = k->dv_sum / k->cfg.step_s;
    double *a = k->phi_errors, *q = k->q_errors;
    const int status = nav_errors_step(&k->errors, &about, w.data(), f.data(), k->cfg.step_s, a, q);
    if (status != NAV_OK) return status;
    const struct koi_map end = koi_map_at(&k->unit.at);
    koi_unmap_columns(koi_map_at(&k->before), KOI_ERRORS, ne, a);
    koi_map_rows(end, ne, a);
    koi_map_rows(end, KOI_ERRORS, q);
    for (int i = 0; i < KOI_ERRORS; i++) { /* Q T': by columns what koi_map_rows() does by rows */
        double *row = q + i * KOI_ERRORS;
        row[ERR_VE] += end.north_mps * row[ERR_BU];
        row[ERR_VN] -= end.east_mps * row[ERR_BU];
        row[ERR_BU] += end.t_per_m * row[ERR_E];
    }
    for (int i = 0; i < KOI_ERRORS; i++) {
        for (int j = 0; j < ne; j++) k->phi[KOI_OF_ERROR[i] * k->n + k->column[j]] = a[i * ne + j];
        for (int j = 0; j < KOI_ERRORS; j++) k->q[KOI_OF_ERROR[i] * nd + KOI_OF_ERROR[j]] = q[i * KOI_ERRORS + j];
    }
    return NAV_OK;
}

/* The antenna's velocity about the unit, in b, and what it adds to the acceleration over the step. */
static void move_antenna(struct nav_koi *k, const vec3 &rate_radps)
{
    const vec3 arm_mps = rate_radps.cross(vec3(k->cfg.antenna_m));
    const vec3 gained = Eigen::Map<const mat3_rows>(k->unit.at.C_nb) * arm_mps -
                        Eigen::Map<const mat3_rows>(k->before.C_nb) * k->arm_mps;
    k->antenna_mps2 = vec3(k->acceleration_mps2) + gained / k->cfg.step_s;
    k->arm_mps = arm_mps;
}

static int finish_step(struct nav_koi *k, const vec3 &rate_radps)
{
    int status = find_transition(k);
    if (status == NAV_OK) status = nav_kf_predict(&k->kf, k->phi, k->q);
    if (status != NAV_OK) return status;
    for (int i = 0; i < 3; i++)
        k->acceleration_mps2[i] = (k->unit.at.v_n_mps[i] - k->before.v_n_mps[i]) / k->cfg.step_s;
    move_antenna(k, rate_radps);
    k->before = k->unit.at;
    k->dtheta_sum.setZero();
    k->dv_sum.setZero();
    k->in_step = 0;
    k->steps++;
    return NAV_OK;
}

/* What a part of a step moves before the filter may reject it. */
struct part {
    struct nav_strapdown unit;
    vec3 dtheta_sum, dv_sum;
    int in_step;
};

/* count increments, no more than the step still takes. */
static int push_part(struct nav_koi *k, const double *dtheta_rad, const double *dv_mps, int count)
{
    const double dt = k->cfg.sample_s;
    const vec3 nu = vec3(k->sensors.nu_radps) * dt, df = vec3(k->sensors.df_mps2) * dt;
    double angle[3 * KOI_STEP_MAX], speed[3 * KOI_STEP_MAX];
    vec3 dtheta_sum = k->dtheta_sum, dv_sum = k->dv_sum;
    for (int i = 0; i < 3 * count; i += 3) {
        const vec3 a = k->gyro_back * (Eigen::Map<const vec3>(dtheta_rad + i) - nu);
        const vec3 v = k->accel_back * (Eigen::Map<const vec3>(dv_mps + i) - df);
        Eigen::Map<vec3>(angle + i) = a;
        Eigen::Map<vec3>(speed + i) = v;
        dtheta_sum += a;
        dv_sum += v;
    }
    const struct part before = {k->unit, k->dtheta_sum, k->dv_sum, k->in_step};
    int status = nav_integrate(&k->unit, angle, speed, count, dt, nullptr, nullptr);
    if (status != NAV_OK) return status;
    k->dtheta_sum = dtheta_sum;
    k->dv_sum = dv_sum;
    k->in_step += count;
    if (k->in_step == k->per_step) status = finish_step(k, Eigen::Map<const vec3>(angle + 3 * (count - 1)) / dt);
    if (status == NAV_OK) return status;
    k->unit = before.unit; /* as if these increments had not come */
    k->dtheta_sum = before.dtheta_sum;
    k->dv_sum = before.dv_sum;
    k->in_step = before.in_step;
    return status;
}

int nav_koi_push(nav_koi *k, const double *dtheta_rad, const double *dv_mps, int64_t count)
{
    if (count < 0) return NAV_RANGE;
    if (!nav_all_finite(dtheta_rad, 3 * count) || !nav_all_finite(dv_mps, 3 * count)) return NAV_NOT_FINITE;
    int status = NAV_OK;
    for (int64_t i = 0; i < count && status == NAV_OK;) {
        const int64_t left = k->per_step - k->in_step;
        const int part = (int)(count - i < left ? count - i : left);
        status = push_part(k, dtheta_rad + 3 * i, dv_mps + 3 * i, part);
        i += part;
    }
    return status;
}
