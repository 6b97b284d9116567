#include "nav/filter/kf_form.hpp"

#include <cmath>
#include <cstring>

static void add_rows(const struct nav_kf *kf, const struct kf_sum &s)
{
    kf->kernels->add_rows(&s);
}

/* w = P h. */
void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g)
{
    const int n = kf->n;
    if (g->of != h) {
        int at[KF_MAX];
        const int count = kf_list_used(1, n, h, at);
        memset(g->w, 0, sizeof *g->w * (size_t)kf->stride);
        add_rows(kf, {1, kf->stride, count, at, h, kf->p, g->w, 0, kf->stride, 0});
    }
    g->variance = r;
    for (int k = 0; k < n; k++) g->variance += h[k] * g->w[k];
}

/* P - w w'/s as (w/sqrt s)(w/sqrt s)'. */
void kf_full_update(struct nav_kf *kf, struct kf_gain *g, const double *next_h)
{
    const double scale = 1.0 / std::sqrt(g->variance);
    alignas(KF_ALIGN_BYTES) double v[KF_MAX];
    for (int i = 0; i < kf->stride; i++) v[i] = g->w[i] * scale;
    const struct kf_square square = {kf->n, kf->stride, v, next_h, kf->p, g->w};
    kf->kernels->subtract_square(&square);
    g->of = next_h;
}

/* N = Phi P and its transpose as the moving rows and columns; in the square where they meet, Q + Phi N'. */
void kf_full_predict(struct nav_kf *kf, const double *q)
{
    const int n = kf->n;
    const int nd = kf->dynamic;
    const int stride = kf->stride;
    const int side = KF_PADDED(nd);
    const struct kf_phi *phi = &kf->phi;
    double *rows = kf->work;
    alignas(KF_ALIGN_BYTES) double square[KF_MAX * KF_MAX];
    memset(rows, 0, sizeof *rows * (size_t)(nd * stride));
    add_rows(kf, {nd, stride, phi->count, phi->at, phi->rows, kf->p, rows, n, stride, stride});
    for (int k = 0; k < n; k++)
        for (int i = 0; i < nd; i++) kf->p[k * stride + i] = rows[i * stride + k];
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < side; j++) square[i * side + j] = j < nd ? q[i * nd + j] : 0.0;
    add_rows(kf, {nd, side, phi->count, phi->at, phi->rows, kf->p, square, n, stride, side});
    memcpy(kf->p, rows, sizeof *rows * (size_t)(nd * stride));
    for (int i = 0; i < nd; i++)
        for (int j = 0; j <= i; j++) kf->p[i * stride + j] = kf->p[j * stride + i] = square[i * side + j];
}

void kf_full_set(struct nav_kf *kf, const double *p)
{
    for (int i = 0; i < kf->n; i++) memcpy(kf->p + i * kf->stride, p + i * kf->n, sizeof *p * (size_t)kf->n);
}

void kf_full_get(const struct nav_kf *kf, double *p)
{
    for (int i = 0; i < kf->n; i++) memcpy(p + i * kf->n, kf->p + i * kf->stride, sizeof *p * (size_t)kf->n);
}
