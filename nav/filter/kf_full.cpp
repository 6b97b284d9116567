#include "nav/filter/kf_form.hpp"

#include <cmath>
#include <cstring>

/* y += a x: whole rows, which the compiler turns into vectors without another order of any sum. */
static void add_scaled(int n, double *__restrict y, double a, const double *__restrict x)
{
    for (int i = 0; i < n; i++) y[i] += a * x[i];
}

void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g)
{
    const int n = kf->n;
    memset(g->w, 0, sizeof g->w);
    for (int k = 0; k < n; k++)
        if (h[k] != 0.0) add_scaled(n, g->w, h[k], kf->p + k * n);
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
    for (int i = 0; i < n; i++)
        if (v[i] != 0.0) add_scaled(n, kf->p + i * n, -v[i], v);
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
