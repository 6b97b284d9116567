/* Measurements: which may be taken, and their rows. */
#include "nav/koi/koi_model.hpp"

#include "nav/common/nav_earth.hpp"

namespace
{

struct Kind {
    int values, count; /* that are read; scalars */
    void (*find_rows)(const nav_koi *k, const nav_koi_measurement *m, koi_rows *rows);
};

/* The hybrid solution, and the antenna by it, for a value that is late by the latencies of the state. */
struct Seen {
    nav_state at;
    vec3 arm_m, arm_mps; /* of the antenna about the unit, in n */
    vec3 v, a;           /* of the antenna */
    koi_map map;
    double age_s, dt1_s, dt2_s;
};

Seen see_hybrid(const nav_koi *k, const nav_koi_measurement *m)
{
    const double *dt = k->kf.x + k->at[NAV_KOI_DT].offset;
    Seen s = {koi_hybrid(k), {}, {}, {}, k->antenna_mps2, koi_map_at(&k->before), koi_time_s(k) - m->t_s, dt[0], dt[1]};
    const mat3 c = Eigen::Map<const mat3_rows>(s.at.C_nb);
    s.arm_m = c * vec3(k->cfg.antenna_m);
    s.arm_mps = c * k->arm_mps;
    s.v = vec3(s.at.v_n_mps) + s.arm_mps;
    return s;
}

/* beta x a of what turns with the unit. */
void add_turn(const nav_koi *k, const Seen &s, const vec3 &a, double *h)
{
    const int n = k->n;
    const double by_up[3] = {-a[1], a[0], 0.0};
    h[KOI_A2] += a[2];
    h[n + KOI_A1] -= a[2];
    h[2 * n + KOI_A1] += a[1];
    h[2 * n + KOI_A2] -= a[0];
    for (int i = 0; i < 2; i++) {
        h[i * n + KOI_B3] += by_up[i];
        h[i * n + KOI_R1] -= s.map.t_per_m * by_up[i];
    }
}

/* dv of errors.h by the state: T^-1. */
void add_velocity(const nav_koi *k, const Seen &s, double factor, double *h)
{
    const int n = k->n;
    h[KOI_V1] += factor;
    h[KOI_B3] -= factor * s.map.north_mps;
    h[KOI_R1] += factor * s.map.t_per_m * s.map.north_mps;
    h[n + KOI_V2] += factor;
    h[n + KOI_B3] += factor * s.map.east_mps;
    h[n + KOI_R1] -= factor * s.map.t_per_m * s.map.east_mps;
    h[2 * n + KOI_V3] += factor;
}

/* What the receiver errs by for long, of the hybrid solution's innovation too. */
void add_slow(const nav_koi *k, int block, koi_rows *rows)
{
    for (int i = 0; i < k->at[block].size; i++) {
        rows->y[i] += k->kf.x[k->at[block].offset + i];
        rows->h[i * k->n + k->at[block].offset + i] = -1.0;
    }
}

void position_rows(const nav_koi *k, const nav_koi_measurement *m, koi_rows *rows)
{
    const Seen s = see_hybrid(k, m);
    const earth_place place = earth_place_at(s.at.lat_rad, s.at.h_m);
    const double late = s.age_s + s.dt1_s;
    const vec3 moved = late * s.v - 0.5 * late * late * s.a - s.arm_m; /* since the value's time, from the antenna */
    rows->y[0] = nav_wrap(s.at.lon_rad - m->value[1]) * place.vertical_m * place.cos_lat - moved[0];
    rows->y[1] = (s.at.lat_rad - m->value[0]) * place.meridian_m - moved[1];
    rows->y[2] = s.at.h_m - m->value[2] - moved[2];
    for (int i = 0; i < 3; i++) {
        rows->h[i * k->n + (i < 2 ? KOI_R1 + i : KOI_R3)] = 1.0;
        rows->h[i * k->n + k->at[NAV_KOI_DT].offset] = s.v[i] - late * s.a[i];
    }
    add_velocity(k, s, -s.age_s, rows->h);
    add_turn(k, s, s.arm_m - s.age_s * s.arm_mps, rows->h);
    add_slow(k, NAV_KOI_SLOW_R, rows);
}

void velocity_rows(const nav_koi *k, const nav_koi_measurement *m, koi_rows *rows)
{
    const Seen s = see_hybrid(k, m);
    const int dt = k->at[NAV_KOI_DT].offset;
    add_velocity(k, s, 1.0, rows->h);
    add_turn(k, s, s.arm_mps, rows->h);
    for (int i = 0; i < 3; i++) {
        rows->y[i] = s.v[i] - (s.age_s + s.dt1_s + s.dt2_s) * s.a[i] - m->value[i];
        rows->h[i * k->n + dt] = rows->h[i * k->n + dt + 1] = s.a[i];
    }
    add_slow(k, NAV_KOI_SLOW_V, rows);
}

void stop_rows(const nav_koi *k, const nav_koi_measurement *m, koi_rows *rows)
{
    const Seen s = see_hybrid(k, m);
    add_velocity(k, s, 1.0, rows->h);
    for (int i = 0; i < 3; i++) rows->y[i] = s.at.v_n_mps[i];
}

void height_rows(const nav_koi *k, const nav_koi_measurement *m, koi_rows *rows)
{
    const Seen s = see_hybrid(k, m);
    rows->y[0] = s.at.h_m - s.age_s * s.at.v_n_mps[2] - m->value[0];
    rows->h[KOI_R3] = 1.0;
    if (!k->at[NAV_KOI_BARO].size) return;
    rows->y[0] += k->kf.x[k->at[NAV_KOI_BARO].offset];
    rows->h[k->at[NAV_KOI_BARO].offset] = -1.0;
}

const Kind kinds[NAV_KOI_KINDS] = {
    {3, 3, position_rows}, {3, 3, velocity_rows}, {0, 3, stop_rows}, {1, 1, height_rows}};

double own_sd(const nav_koi_cfg *cfg, int kind, int i)
{
    const double sds[NAV_KOI_KINDS] = {cfg->position_sd_m[i], cfg->velocity_sd_mps[i], cfg->stop_sd_mps,
                                       cfg->height_sd_m};
    return sds[kind];
}

/* What can be said without the filter. */
int look_at(const nav_koi *k, const nav_koi_measurement *m)
{
    const Kind &kind = kinds[m->kind];
    const double now_s = koi_time_s(k) + k->in_step * k->cfg.sample_s;
    double sum = m->t_s;
    bool negative = false;
    for (int i = 0; i < kind.values; i++) sum += m->value[i];
    for (int i = 0; i < kind.count; i++) {
        sum += m->sd[i];
        negative |= m->sd[i] < 0.0;
    }
    if (!m->valid) return NAV_KOI_INVALID;
    if (!std::isfinite(sum)) return NAV_KOI_NOT_FINITE;
    if (negative || (m->kind == NAV_KOI_POSITION && std::fabs(m->value[0]) > EARTH_LATITUDE_MAX_RAD))
        return NAV_KOI_UNFIT;
    if (m->t_s <= k->last[m->kind].t_s) return NAV_KOI_BACKWARDS;
    if (m->t_s > now_s + 0.5 * k->cfg.sample_s) return NAV_KOI_EARLY;
    return koi_time_s(k) - m->t_s > k->cfg.max_age_s ? NAV_KOI_STALE : NAV_KOI_ACCEPTED;
}

/* Innovations one by one, and y' S^-1 y of all. */
int find_nis(const nav_koi *k, const koi_rows *rows, nav_koi_last *last)
{
    const int count = rows->count;
    double s[9];
    const int status = kf_joint(&k->kf, rows->h, rows->r, count, s);
    if (status != NAV_OK) return status;
    for (int i = 0; i < count; i++) last->innovation[i] = {rows->y[i], s[i * (count + 1)]};
    last->nis = nav_kf_nees(count, rows->y, s);
    return std::isfinite(last->nis) ? NAV_OK : NAV_SINGULAR;
}

/* Both the autonomous height and its error move by as much. */
void damp_vertical(nav_koi *k, const nav_koi_measurement *m, double before_s)
{
    const double off_m = k->before.h_m - k->before.v_n_mps[2] * (koi_time_s(k) - m->t_s) - m->value[0];
    const double gap_s = m->t_s - before_s;
    const double t_s = gap_s > 1.0 ? 1.0 : gap_s; /* after a gap, gains as for a second */
    const double h_m = -k->cfg.damping_per_s * t_s * off_m, v_mps = -k->cfg.damping_per_s2 * t_s * off_m;
    k->before.h_m += h_m;
    k->before.v_n_mps[2] += v_mps;
    k->unit.at.h_m += h_m;
    k->unit.at.v_n_mps[2] += v_mps;
    k->kf.x[KOI_R3] += h_m;
    k->kf.x[KOI_V3] += v_mps;
}

int take_rows(nav_koi *k, const nav_koi_measurement *m, nav_koi_last *last)
{
    koi_rows rows = {};
    rows.count = kinds[m->kind].count;
    for (int i = 0; i < rows.count; i++) {
        const double sd = m->sd[i] > 0.0 ? m->sd[i] : own_sd(&k->cfg, m->kind, i);
        rows.r[i] = sd * sd;
    }
    kinds[m->kind].find_rows(k, m, &rows);
    if (find_nis(k, &rows, last) != NAV_OK) return NAV_KOI_REJECTED;
    const bool refused = last->nis > k->cfg.outlier_nis || last->nis > k->cfg.gate_nis[rows.count == 3];
    if (refused && !koi_reopen(k, m->kind, m->t_s, &rows))
        return last->nis > k->cfg.outlier_nis ? NAV_KOI_OUTLIER : NAV_KOI_GATED;
    double z[3];
    for (int i = 0; i < rows.count; i++) {
        z[i] = rows.y[i];
        for (int c = 0; c < k->n; c++) z[i] += rows.h[i * k->n + c] * k->kf.x[c];
    }
    if (nav_kf_update(&k->kf, rows.h, z, rows.r, rows.count, nullptr) != NAV_OK) return NAV_KOI_REJECTED;
    k->refused[m->kind].count = 0;
    return refused ? NAV_KOI_REOPENED : NAV_KOI_ACCEPTED;
}

} // namespace

int nav_koi_take(nav_koi *k, const struct nav_koi_measurement *m)
{
    if (m->kind < 0 || m->kind >= NAV_KOI_KINDS) return NAV_RANGE;
    struct nav_koi_last *last = &k->last[m->kind];
    int reason = look_at(k, m);
    if (reason == NAV_KOI_ACCEPTED) {
        reason = take_rows(k, m, last);
        last->t_s = m->t_s;
    }
    if (reason == NAV_KOI_ACCEPTED) {
        last->nis_sum += last->nis;
        last->nis_dof += kinds[m->kind].count;
    }
    if (reason == NAV_KOI_ACCEPTED || reason == NAV_KOI_REOPENED) {
        if (m->kind == NAV_KOI_HEIGHT) damp_vertical(k, m, last->accepted_s);
        last->accepted_s = m->t_s;
    }
    last->reason = reason;
    last->counts[reason]++;
    return reason;
}
