/* Rauch-Tung-Striebel for states of which most are constant: only the moving rows of the gain differ from Phi^-1.
 *
 *   C = P Phi' Pm^-1 = Phi^-1 (I - Q Pm^-1)            as Phi P Phi' = Pm - Q
 *   xs_k = Phi^-1 (xs - Q Pm^-1 (xs - xm))
 *   Ps_k = Phi^-1 (T Ps T' + Q - Q Pm^-1 Q) Phi^-T      T = I - Q Pm^-1 */
#include "nav/filter/kf_form.hpp"

#include "nav/common/nav_math.hpp"

#include <cstring>

/* g = Q (Pm^-1)_d, nd rows of n, by Pm = U D U'. */
static bool find_pull(int n, int nd, const double *q, const double *pm, double *g)
{
    double ut[KF_MAX * KF_MAX];
    double d[KF_MAX];
    if (!kf_factor(n, pm, ut, d)) return false;
    for (int r = 0; r < nd; r++) { /* row r of Q: solve Pm y = (q_r, 0) */
        double *y = g + r * n;
        memset(y, 0, sizeof *y * (size_t)n);
        memcpy(y, q + r * nd, sizeof *y * (size_t)nd);
        for (int j = nd - 1; j >= 0; j--) {
            for (int i = 0; i < j; i++) y[i] -= ut[j * n + i] * y[j];
        }
        for (int j = 0; j < nd; j++) {
            if (y[j] != 0.0 && !(d[j] > 0.0)) return false;
            y[j] = y[j] != 0.0 ? y[j] / d[j] : 0.0;
        }
        for (int j = 0; j < n; j++) /* U' from the first row */
            for (int i = 0; i < j; i++) y[j] -= ut[j * n + i] * y[i];
    }
    return true;
}

/* a = inverse of the nd x nd square part of phi, Gauss-Jordan with pivots. */
static bool invert_square(int n, int nd, const double *phi, double *a)
{
    double m[KF_MAX * KF_MAX];
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < nd; j++) {
            m[i * nd + j] = phi[i * n + j];
            a[i * nd + j] = i == j;
        }
    for (int c = 0; c < nd; c++) {
        int best = c;
        for (int i = c + 1; i < nd; i++)
            if (std::fabs(m[i * nd + c]) > std::fabs(m[best * nd + c])) best = i;
        const double pivot = m[best * nd + c];
        if (!(std::fabs(pivot) > 1e-12)) return false;
        for (int j = 0; j < nd; j++) {
            const double mj = m[best * nd + j];
            const double aj = a[best * nd + j];
            m[best * nd + j] = m[c * nd + j];
            a[best * nd + j] = a[c * nd + j];
            m[c * nd + j] = mj / pivot;
            a[c * nd + j] = aj / pivot;
        }
        for (int i = 0; i < nd; i++) {
            const double by = m[i * nd + c];
            for (int j = 0; i != c && j < nd; j++) {
                m[i * nd + j] -= by * m[c * nd + j];
                a[i * nd + j] -= by * a[c * nd + j];
            }
        }
    }
    return true;
}

/* The moving rows of Phi^-1, nd x n. */
static bool find_back(int n, int nd, const double *phi, double *back)
{
    double a[KF_MAX * KF_MAX];
    if (!invert_square(n, nd, phi, a)) return false;
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < n; j++) {
            double sum = j < nd ? a[i * nd + j] : 0.0;
            for (int k = 0; j >= nd && k < nd; k++) sum -= a[i * nd + k] * phi[k * n + j];
            back[i * n + j] = sum;
        }
    return true;
}

/* P <- T P T', T = I with its first nd rows t. */
static void map_rows(int n, int nd, const double *t, double *p)
{
    double rows[KF_MAX * KF_MAX];
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < n; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) sum += t[i * n + k] * p[k * n + j];
            rows[i * n + j] = sum;
        }
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < n; j++) p[i * n + j] = p[j * n + i] = rows[i * n + j];
    for (int i = 0; i < nd; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) sum += rows[i * n + k] * t[j * n + k];
            p[i * n + j] = p[j * n + i] = sum;
        }
}

static void map_state(int n, int nd, const double *t, double *x)
{
    double moved[KF_MAX];
    for (int i = 0; i < nd; i++) {
        moved[i] = 0.0;
        for (int k = 0; k < n; k++) moved[i] += t[i * n + k] * x[k];
    }
    memcpy(x, moved, sizeof *x * (size_t)nd);
}

int nav_kf_smooth(int n, int nd, const double *phi, const double *q, const double *x_pred, const double *p_pred,
                  double *xs, double *ps)
{
    double pull[KF_MAX * KF_MAX];
    double back[KF_MAX * KF_MAX];
    double left[KF_MAX];
    if (n < 1 || n > KF_MAX || nd < 0 || nd > n) return NAV_RANGE;
    if (!find_pull(n, nd, q, p_pred, pull) || !find_back(n, nd, phi, back)) return NAV_SINGULAR;
    for (int i = 0; i < n; i++) left[i] = xs[i] - x_pred[i];
    map_state(n, nd, pull, left);
    for (int i = 0; i < nd; i++) xs[i] -= left[i];
    map_state(n, nd, back, xs);

    double keep[KF_MAX * KF_MAX]; /* T, then Q - Q Pm^-1 Q on top of T Ps T' */
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < n; j++) keep[i * n + j] = (i == j) - pull[i * n + j];
    map_rows(n, nd, keep, ps);
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < nd; j++) {
            double sum = q[i * nd + j];
            for (int k = 0; k < nd; k++) sum -= pull[i * n + k] * q[k * nd + j];
            ps[i * n + j] += sum;
        }
    map_rows(n, nd, back, ps);
    return NAV_OK;
}
