/* A filter whose gate has shut though the receiver is right: what of a kind was refused, whether it agrees, and how P is widened. */
#include "nav/koi/koi_model.hpp"

#include "nav/sins/sins_model.hpp"

#include <algorithm>

namespace
{

constexpr int LEAST_COUNT = 10;
constexpr int MOST_POWER = 20;

/* Standard deviations that widening does not pass (E0): beyond them errors are not of first order. m, m/s, rad in the
 * order of enum koi_moving. */
const double limits[KOI_MOVING] = {1e5, 1e5, 100.0, 100.0, 0.02, 0.02, 0.1, 1e4, 100.0};

/* By kind: what widens, and how fast the innovation of a filter that is wrong may move (E0): 0.03 m/s^2 is 10' of level. */
struct Doubt {
    bool widens[KOI_MOVING];
    double per_s; /* m/s, m/s^2 */
};
const Doubt doubts[NAV_KOI_KINDS] = {
    {{true, true, false, false, false, false, false, true, false}, 0.5},
    {{false, false, true, true, true, true, true, false, true}, 0.03},
    {{false, false, true, true, true, true, true, false, true}, 0.03},
    {{false, false, false, false, false, false, false, true, true}, 0.5},
};

/* The receiver's place alone says nothing of where the error is; with velocities that are taken it is in the place. */
bool widens_covariance(const nav_koi *k, int kind, double t_s, int state)
{
    if (kind != NAV_KOI_POSITION) return doubts[kind].widens[state];
    return doubts[kind].widens[state] || t_s - k->last[NAV_KOI_VELOCITY].accepted_s > k->cfg.reopen_s;
}

/* Of white noise and of the receiver's slow errors. */
double noise_of(const nav_koi *k, int kind, const koi_rows *rows, int i)
{
    const int block = kind == NAV_KOI_POSITION ? NAV_KOI_SLOW_R : NAV_KOI_SLOW_V;
    const bool slow = (kind == NAV_KOI_POSITION || kind == NAV_KOI_VELOCITY) && k->at[block].size;
    return rows->r[i] + (slow ? kf_variance(&k->kf, k->at[block].offset + i) : 0.0);
}

/* With the first of the run, but for what a wrong filter may have moved since. */
bool agrees_with_first(const nav_koi *k, int kind, double t_s, const koi_rows *rows)
{
    const koi_refused &run = k->refused[kind];
    double sum = 0.0;
    for (int i = 0; i < rows->count; i++) {
        const double off = std::fabs(rows->y[i] - run.first[i]) - doubts[kind].per_s * (t_s - run.since_s);
        if (off > 0.0) sum += off * off / (2.0 * noise_of(k, kind, rows, i));
    }
    return run.count > 0 && sum <= k->cfg.gate_nis[rows->count == 3];
}

void find_factors(const nav_koi *k, int kind, double t_s, double by, double factors[KOI_MOVING])
{
    for (int i = 0; i < KOI_MOVING; i++) {
        const double sd = nav_root(kf_variance(&k->kf, i));
        factors[i] =
            widens_covariance(k, kind, t_s, i) ? std::max(1.0, sd * by > limits[i] ? limits[i] / sd : by) : 1.0;
    }
}

/* Normalised innovation squared with P widened so. */
double nis_with(const nav_koi *k, const koi_rows *rows, const double factors[KOI_MOVING])
{
    double h[3 * KF_MAX], s[9];
    for (int i = 0; i < rows->count; i++)
        for (int c = 0; c < k->n; c++) h[i * k->n + c] = rows->h[i * k->n + c] * (c < KOI_MOVING ? factors[c] : 1.0);
    if (kf_joint(&k->kf, h, rows->r, rows->count, s) != NAV_OK) return NAV_NAN;
    return nav_kf_nees(rows->count, rows->y, s);
}

/* P = D P D: correlations stay, so that what one of them is found to be moves the others. The estimates stay. */
bool widen_covariance(nav_koi *k, const double factors[KOI_MOVING])
{
    double a[KOI_ERRORS * KOI_ERRORS] = {}, x[KF_MAX];
    for (int i = 0; i < KOI_ERRORS; i++) a[i * (KOI_ERRORS + 1)] = factors[KOI_OF_ERROR[i]];
    std::copy(k->kf.x, k->kf.x + k->n, x);
    const int status = koi_move_errors(k, a);
    std::copy(x, x + k->n, k->kf.x);
    return status == NAV_OK;
}

} // namespace

bool koi_reopen(nav_koi *k, int kind, double t_s, const koi_rows *rows)
{
    koi_refused &run = k->refused[kind];
    if (!agrees_with_first(k, kind, t_s, rows)) {
        std::copy(rows->y, rows->y + rows->count, run.first);
        run.since_s = t_s;
        run.count = 0;
    }
    run.count++;
    if (k->cfg.reopen_s <= 0.0 || t_s - run.since_s < k->cfg.reopen_s || run.count < LEAST_COUNT) return false;
    double factors[KOI_MOVING];
    for (int power = 1; power <= MOST_POWER; power++) {
        find_factors(k, kind, t_s, (double)(1 << power), factors);
        if (nis_with(k, rows, factors) <= rows->count) return widen_covariance(k, factors);
    }
    return false;
}
