#include "nav/filter/kf_form.hpp"

#include "nav/common/nav_width.hpp"

#include <cmath>
#include <cstring>

/* y += a x: whole rows, which the compiler turns into vectors without another order of any sum. */
INLINE void add_scaled(int n, double *__restrict y, double a, const double *__restrict x)
{
    for (int i = 0; i < n; i++) y[i] += a * x[i];
}

/* y += sum of a_k times row k of p, zeros left out. */
INLINE void add_rows(int n, double *y, const double *a, const double *p)
{
    for (int k = 0; k < n; k++)
        if (a[k] != 0.0) add_scaled(n, y, a[k], p + k * n);
}

INLINE void subtract_square(int n, double *p, const double *v)
{
    for (int i = 0; i < n; i++)
        if (v[i] != 0.0) add_scaled(n, p + i * n, -v[i], v);
}

BY_WIDTH(rows, (int n, double *y, const double *a, const double *p), add_rows(n, y, a, p))
BY_WIDTH(square, (int n, double *p, const double *v), subtract_square(n, p, v))

void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g)
{
    const int n = kf->n;
    memset(g->w, 0, sizeof *g->w * (size_t)n);
    rows_by_width[random_width()](n, g->w, h, kf->p);
    g->variance = r;
    for (int k = 0; k < n; k++) g->variance += h[k] * g->w[k];
}

/* P - w w'/s as (w/sqrt s)(w/sqrt s)': symmetric to the last bit. */
void kf_full_update(struct nav_kf *kf, const struct kf_gain *g)
{
    const int n = kf->n;
    const double scale = 1.0 / std::sqrt(g->variance);
    double v[KF_MAX];
    for (int i = 0; i < n; i++) v[i] = g->w[i] * scale;
    square_by_width[random_width()](n, kf->p, v);
}

/* Rows of the moving states: N = Phi P; P_dd = N Phi' + Q, P_dc = N_dc. */
void kf_full_predict(struct nav_kf *kf, const double *q)
{
    const int n = kf->n;
    const int nd = kf->dynamic;
    const struct kf_rows *a = &kf->rows;
    double *rows = kf->work;
    memset(rows, 0, sizeof *rows * (size_t)(nd * n));
    for (int i = 0; i < nd; i++)
        for (int k = 0; k < a->count[i]; k++) add_scaled(n, rows + i * n, a->value[i][k], kf->p + a->at[i][k] * n);
    for (int i = 0; i < nd; i++)
        for (int j = i; j < nd; j++) {
            double sum = q[i * nd + j];
            for (int k = 0; k < a->count[j]; k++) sum += rows[i * n + a->at[j][k]] * a->value[j][k];
            kf->p[i * n + j] = kf->p[j * n + i] = sum;
        }
    for (int i = 0; i < nd; i++)
        for (int j = nd; j < n; j++) kf->p[i * n + j] = kf->p[j * n + i] = rows[i * n + j];
}
