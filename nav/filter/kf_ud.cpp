#include "nav/filter/kf_form.hpp"

#include <cmath>
#include <cstring>

constexpr double FACTOR_ZERO = 1e-12; /* of a diagonal element: what is left of it that is taken for none */

/* Column j of U from what is left of P, and its part taken off. False: a column below a pivot of zero. */
static bool take_column(int n, int j, double *m, double *d, double whole)
{
    double *col = m + j * n;
    d[j] = col[j];
    if (!(d[j] >= -FACTOR_ZERO * whole)) return false;
    if (d[j] <= FACTOR_ZERO * whole) {
        for (int i = 0; i < j; i++) {
            if (col[i] * col[i] > 1e-9 * whole * m[i * n + i]) return false;
            col[i] = 0.0;
        }
        d[j] = 0.0;
        return true;
    }
    for (int i = 0; i < j; i++) {
        const double u = col[i] / d[j];
        for (int k = 0; k <= i; k++) m[i * n + k] -= u * col[k];
    }
    for (int i = 0; i < j; i++) col[i] /= d[j];
    return true;
}

bool kf_factor(int n, const double *p, double *ut, double *d)
{
    double whole[KF_MAX];
    for (int i = 0; i < n; i++) whole[i] = p[i * n + i];
    if (ut != p) memcpy(ut, p, sizeof *p * (size_t)(n * n));
    for (int j = n - 1; j >= 0; j--) {
        if (!take_column(n, j, ut, d, whole[j])) return false;
        ut[j * n + j] = 1.0;
        for (int i = j + 1; i < n; i++) ut[j * n + i] = 0.0;
    }
    return true;
}

/* u = U' h; w = U D u. */
void kf_ud_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g)
{
    const int n = kf->n;
    memset(g->w, 0, sizeof g->w);
    g->variance = r;
    for (int j = 0; j < n; j++) {
        const double *col = kf->p + j * n;
        double sum = 0.0;
        for (int i = 0; i <= j; i++) sum += col[i] * h[i];
        g->u[j] = sum;
        g->variance += kf->d[j] * sum * sum;
        for (int i = 0; i <= j; i++) g->w[i] += col[i] * (kf->d[j] * sum);
    }
}

/* Bierman's update; b becomes P h, and a the variance of the innovation. */
void kf_ud_update(struct nav_kf *kf, double r, const struct kf_gain *g)
{
    const int n = kf->n;
    double b[KF_MAX];
    double a = r;
    for (int j = 0; j < n; j++) {
        double *col = kf->p + j * n;
        const double v = kf->d[j] * g->u[j];
        const double before = a;
        a += g->u[j] * v;
        const double back = -g->u[j] / before;
        kf->d[j] *= before / a;
        for (int i = 0; i < j; i++) {
            const double old = col[i];
            col[i] = old + b[i] * back;
            b[i] += old * v;
        }
        b[j] = v;
    }
}

/* Gram-Schmidt of the rows of W, weights given: U and D of W diag(weight) W'. */
static void triangularise_rows(int nd, int n, double (*w)[2 * KF_MAX], const double *weight, double *ut, double *d)
{
    for (int i = nd - 1; i >= 0; i--) {
        double sum = 0.0;
        for (int k = 0; k < 2 * nd; k++) sum += weight[k] * w[i][k] * w[i][k];
        d[i] = sum;
        for (int l = 0; l < i; l++) {
            double dot = 0.0;
            for (int k = 0; k < 2 * nd; k++) dot += weight[k] * w[l][k] * w[i][k];
            const double u = sum > 0.0 ? dot / sum : 0.0;
            for (int k = 0; k < 2 * nd; k++) w[l][k] -= u * w[i][k];
            ut[i * n + l] = u;
        }
    }
}

/* U_c keeps its columns of constant states; of the moving rows, U_dc' = Phi U in those columns, and U_dd', D_d' are of
 * (Phi U)_dd D_d (Phi U)_dd' + Q alone. */
bool kf_ud_predict(struct nav_kf *kf, const double *q)
{
    const int n = kf->n;
    const int nd = kf->dynamic;
    struct kf_used all = {0, {0}};
    int used = 0;
    double uq[KF_MAX * KF_MAX];
    double weight[2 * KF_MAX];
    double w[KF_MAX][2 * KF_MAX];
    memset(w, 0, sizeof *w * (size_t)nd);
    memset(weight, 0, sizeof weight);
    if (!kf_factor(nd, q, uq, weight + nd)) return false;
    if (nd > 0) kf_list_used(nd, n, kf->phi.rows, &all);
    for (int j = 0; j < n; j++) {
        double *col = kf->p + j * n;
        double moved[KF_MAX];
        while (used < all.count && all.at[used] <= j) used++;
        kf_move(kf, col, all.at, used, moved);
        for (int i = 0; i < nd; i++) (j < nd ? w[i][j] : col[i]) = moved[i];
    }
    for (int j = 0; j < nd; j++) {
        weight[j] = kf->d[j];
        for (int i = 0; i < nd; i++) w[i][nd + j] = uq[j * nd + i];
    }
    triangularise_rows(nd, n, w, weight, kf->p, kf->d);
    return true;
}

void kf_ud_full(const struct nav_kf *kf, double *p)
{
    const int n = kf->n;
    memset(p, 0, sizeof *p * (size_t)(n * n));
    for (int k = 0; k < n; k++) {
        const double *col = kf->p + k * n;
        for (int i = 0; i <= k; i++)
            for (int j = 0; j <= i; j++) p[i * n + j] += col[i] * kf->d[k] * col[j];
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) p[j * n + i] = p[i * n + j];
}
