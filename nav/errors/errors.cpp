#include "nav/errors/errors_model.hpp"

#include "nav/common/nav_check.hpp"
#include "nav/common/nav_earth.hpp"

constexpr double TURN_MAX_RAD = 0.5;                  /* in a step: the series below ends at 1e-6 of it */
constexpr int NOT_VERTICAL[] = {0, 1, 3, 4, 6, 7, 8}; /* of the nine moving states */
constexpr int ALL_MOVING[] = {0, 1, 2, 3, 4, 5, 6, 7, 8};

#define REAL(field, low, high, want)  CHECK_DOUBLE(struct nav_errors_cfg, field, low, high, want)
#define WHOLE(field, low, high, want) CHECK_INT(struct nav_errors_cfg, field, low, high, want)
static const struct check_rule rules[] = {
    WHOLE(vertical, NAV_VERTICAL_FREE, NAV_VERTICAL_FIXED, "one of enum nav_vertical"),
    WHOLE(gauge, NAV_SINS_ARTICLE, NAV_SINS_FREE9, "a gauge of enum nav_sins_gauge"),
    REAL(damping_per_s, 0.0, 1.0, "from 0 to 1/s"),
    REAL(damping_per_s2, 0.0, 1.0, "from 0 to 1/s^2"),
    REAL(gyro_noise_radps_rts, 0.0, 0.1, "a density, 0: none"),
    REAL(accel_noise_mps2_rts, 0.0, 1.0, "a density, 0: none"),
};

int nav_errors_check(const struct nav_errors_cfg *cfg, struct nav_refusal *why)
{
    return check_all(cfg, rules, why);
}

static int moving_of(const struct nav_errors_cfg *cfg)
{
    return cfg->vertical == NAV_VERTICAL_FIXED ? 7 : 9;
}

int nav_errors_layout(const struct nav_errors_cfg *cfg, struct nav_sins_rows rows[NAV_ERRORS_BLOCKS])
{
    const int status = nav_errors_check(cfg, nullptr);
    if (status != NAV_OK) return status;
    const int each = (moving_of(cfg) - 3) / 2;
    const int sizes[NAV_ERRORS_BLOCKS] = {each, each, 3, 3, 9, 3, sins_gauges[cfg->gauge].count};
    int offset = 0;
    for (int b = 0; b < NAV_ERRORS_BLOCKS; b++) {
        rows[b] = {offset, sizes[b]};
        offset += sizes[b];
    }
    return offset;
}

/* Column of ERRORS_CONST of constant k of the state. */
static int column_of(const struct nav_errors_cfg *cfg, int k)
{
    return k < 15 ? k : 15 + sins_gauges[cfg->gauge].at[k - 15];
}

/* Mean of exp([w t x]) over the step. */
static mat3 mean_turn(const vec3 &turn)
{
    const mat3 a = nav_cross_matrix(turn);
    const mat3 a2 = a * a;
    return mat3::Identity() + 0.5 * a + a2 * (1.0 / 6.0) + a2 * a * (1.0 / 24.0) + a2 * a2 * (1.0 / 120.0);
}

static bool is_fit(const struct nav_state *at, const vec3 &w_b, const vec3 &f_b)
{
    bool finite = std::isfinite(at->lat_rad + at->h_m) && w_b.allFinite() && f_b.allFinite();
    for (double x : at->v_n_mps) finite &= std::isfinite(x);
    for (double x : at->C_nb) finite &= std::isfinite(x);
    return finite;
}

static int check_step(const struct nav_state *at, const vec3 &w_b, const vec3 &f_b, double dt_s)
{
    if (!is_fit(at, w_b, f_b)) return NAV_NOT_FINITE;
    if (!(dt_s > 0.0 && dt_s <= 10.0) || w_b.norm() * dt_s > TURN_MAX_RAD) return NAV_RANGE;
    return std::fabs(at->lat_rad) <= EARTH_LATITUDE_MAX_RAD ? NAV_OK : NAV_RANGE;
}

/* Noise of one step: its walk in beta and dv. */
static void set_q(const struct nav_errors_cfg *cfg, double dt_s, double *q)
{
    const int moving = moving_of(cfg), each = (moving - 3) / 2;
    const double gyro = cfg->gyro_noise_radps_rts, accel = cfg->accel_noise_mps2_rts;
    for (int i = 0; i < moving * moving; i++) q[i] = 0.0;
    for (int i = each; i < moving; i++) q[i * (moving + 1)] = (i < 2 * each ? accel * accel : gyro * gyro) * dt_s;
}

int nav_errors_step(const struct nav_errors_cfg *cfg, const struct nav_state *at, const double w_b[3],
                    const double f_b[3], double dt_s, double *phi, double *q)
{
    struct nav_sins_rows rows[NAV_ERRORS_BLOCKS];
    const int n = nav_errors_layout(cfg, rows);
    const vec3 w(w_b), f(f_b);
    int status = n < 0 ? n : check_step(at, w, f, dt_s);
    if (status != NAV_OK) return status;
    const mat3 mean_c = mat3(Eigen::Map<const mat3_rows>(at->C_nb)) * mean_turn(w * dt_s);
    const errors_square a = errors_rates(cfg, at, mean_c * f);
    /* To the second order. Lazy products: those of other sizes than 4 take memory of the heap. */
    const errors_square half = errors_square::Identity() + 0.5 * dt_s * a;
    const errors_square move = errors_square::Identity() + dt_s * errors_square(a.lazyProduct(half));
    const errors_drive drive = dt_s * errors_drive(half.lazyProduct(errors_of_sensors(mean_c, w, f)));
    const int moving = moving_of(cfg);
    const int *kept = moving == 9 ? ALL_MOVING : NOT_VERTICAL;
    for (int i = 0; i < moving; i++) {
        for (int j = 0; j < moving; j++) phi[i * n + j] = move(kept[i], kept[j]);
        for (int j = moving; j < n; j++) phi[i * n + j] = drive(kept[i], column_of(cfg, j - moving));
    }
    set_q(cfg, dt_s, q);
    return NAV_OK;
}

int nav_errors_predict(const struct nav_errors_cfg *cfg, nav_kf *kf, const struct nav_state *at, const double *w_b,
                       const double *f_b, int64_t count, double dt_s, int64_t *done)
{
    double phi[ERRORS_MOVING * KF_MAX], q[ERRORS_MOVING * ERRORS_MOVING];
    struct nav_sins_rows rows[NAV_ERRORS_BLOCKS];
    const int n = nav_errors_layout(cfg, rows);
    int status = n < 0 ? n : NAV_OK;
    if (status == NAV_OK && (kf->n != n || kf->dynamic != moving_of(cfg) || count < 0)) status = NAV_RANGE;
    int64_t k = 0;
    for (; k < count && status == NAV_OK; k++) {
        status = nav_errors_step(cfg, at + k, w_b + 3 * k, f_b + 3 * k, dt_s, phi, q);
        if (status == NAV_OK) status = nav_kf_predict(kf, phi, q);
        if (status != NAV_OK) break;
    }
    if (done) *done = k;
    return status;
}

/* Horizontal parts of beta x g_n + C da = 0, then the east part of beta x u + C dw = 0. */
int nav_errors_alignment(const struct nav_errors_cfg *cfg, const struct nav_state *at, double *beta_rows)
{
    struct nav_sins_rows rows[NAV_ERRORS_BLOCKS];
    const int n = nav_errors_layout(cfg, rows);
    if (n < 0) return n;
    const int status = check_step(at, vec3::Zero(), vec3::Zero(), 1.0);
    if (status != NAV_OK) return status;
    const mat3 c = Eigen::Map<const mat3_rows>(at->C_nb);
    const earth_place place = earth_place_at(at->lat_rad, at->h_m);
    const double g = earth_gravity_mps2(place.sin_lat, at->h_m);
    const vec3 u = earth_rate_n(place);
    const errors_drive d = errors_of_sensors(c, c.transpose() * u, c.transpose() * vec3(0.0, 0.0, g));
    for (int j = 0; j < 3 * n; j++) beta_rows[j] = 0.0;
    for (int j = rows[NAV_ERRORS_NU].offset; j < n; j++) {
        const int k = column_of(cfg, j - rows[NAV_ERRORS_NU].offset);
        const double north = -d(3, k) / g;
        beta_rows[j] = d(4, k) / g;
        beta_rows[n + j] = north;
        beta_rows[2 * n + j] = (north * u.z() + d(6, k)) / u.y();
    }
    return NAV_OK;
}
