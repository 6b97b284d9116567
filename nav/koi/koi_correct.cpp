/* What is read of a filter, and the one-off correction. */
#include "nav/koi/koi_model.hpp"

#include "nav/sins/sins_model.hpp"

#include <cstring>

/* to += x, of the states that are taken; take NULL: of all. */
void koi_add_sensors(const struct nav_koi *k, const double *x, const unsigned char *take, struct nav_koi_sensors *to)
{
    const struct sins_gauge *gauge = &sins_gauges[k->cfg.gauge];
    const auto part = [&](int block, int i) {
        const int at = k->at[block].offset + i;
        return !take || take[at] ? x[at] : 0.0;
    };
    for (int i = 0; i < 3; i++) to->nu_radps[i] += part(NAV_KOI_NU, i);
    for (int i = 0; i < 3; i++) to->df_mps2[i] += part(NAV_KOI_DF, i);
    for (int i = 0; i < 9; i++) to->theta[i] += part(NAV_KOI_THETA, i);
    for (int i = 0; i < gauge->count; i++) to->gamma[gauge->at[i]] += part(NAV_KOI_GAMMA, i);
}

int koi_move_errors(struct nav_koi *k, const double *a)
{
    double phi[KF_MAX * KF_MAX] = {}, q[KF_MAX * KF_MAX] = {};
    for (int i = 0; i < k->dynamic; i++) phi[i * (k->n + 1)] = 1.0;
    for (int i = 0; i < KOI_ERRORS; i++)
        for (int j = 0; j < KOI_ERRORS; j++) phi[KOI_OF_ERROR[i] * k->n + KOI_OF_ERROR[j]] = a[i * KOI_ERRORS + j];
    return nav_kf_predict(&k->kf, phi, q);
}

/* x and P of the same errors after the autonomous velocity and place have moved: T(after) T(before)^-1. */
static int move_map(struct nav_koi *k, const struct koi_map &before, const struct koi_map &after)
{
    double a[KOI_ERRORS * KOI_ERRORS] = {};
    for (int i = 0; i < KOI_ERRORS; i++) a[i * (KOI_ERRORS + 1)] = 1.0;
    koi_unmap_columns(before, KOI_ERRORS, KOI_ERRORS, a);
    koi_map_rows(after, KOI_ERRORS, a);
    return koi_move_errors(k, a);
}

int nav_koi_correct(nav_koi *k, const unsigned char *take)
{
    if (k->in_step) return NAV_TIMES;
    double x[KF_MAX] = {}, errors[KOI_ERRORS];
    for (int i = 0; i < k->n; i++) x[i] = take[i] ? k->kf.x[i] : 0.0;
    for (const int block : {NAV_KOI_BARO, NAV_KOI_SLOW_R, NAV_KOI_SLOW_V, NAV_KOI_DT}) /* not of the unit */
        for (int i = 0; i < k->at[block].size; i++) x[k->at[block].offset + i] = 0.0;
    const struct koi_map before = koi_map_at(&k->before);
    koi_errors_of(before, x, errors);
    k->before = koi_less(k->before, errors);
    k->unit.at = k->before;
    koi_add_sensors(k, x, take, &k->sensors);
    koi_use_sensors(k);
    for (int i = 0; i < k->n; i++) k->kf.x[i] -= x[i];
    return move_map(k, before, koi_map_at(&k->before));
}

int nav_koi_converged(const nav_koi *k, double limit, unsigned char *take)
{
    int count = 0;
    for (int i = 0; i < k->n; i++) {
        take[i] = nav_root(kf_variance(&k->kf, i)) < limit * k->prior_sd[i];
        count += take[i];
    }
    return count;
}

int nav_koi_get(const nav_koi *k, struct nav_koi_state *state)
{
    double accepted_s = k->started_alone_s;
    for (const struct nav_koi_last &last : k->last)
        if (last.accepted_s > accepted_s) accepted_s = last.accepted_s;
    state->t_s = koi_time_s(k);
    state->autonomous = k->before;
    state->hybrid = koi_hybrid(k);
    state->sensors = state->total = k->sensors;
    koi_add_sensors(k, k->kf.x, nullptr, &state->total);
    state->alone_s = state->t_s > accepted_s ? state->t_s - accepted_s : 0.0;
    memcpy(state->last, k->last, sizeof k->last);
    return NAV_OK;
}

int nav_koi_covariance(const nav_koi *k, double *x, double *p, double *sd)
{
    for (int i = 0; sd && i < k->n; i++) sd[i] = nav_root(kf_variance(&k->kf, i));
    return nav_kf_get(&k->kf, x, p);
}

int nav_koi_jacobians(const nav_koi *k, double *phi, double *q)
{
    if (phi) memcpy(phi, k->phi, sizeof *phi * (size_t)(k->dynamic * k->n));
    if (q) memcpy(q, k->q, sizeof *q * (size_t)(k->dynamic * k->dynamic));
    return k->dynamic;
}
