#include "nav/filter/kf_form.hpp"

#include <cmath>
#include <cstring>

static void add_rows(const struct nav_kf *kf, const struct kf_sum &s)
{
    kf->kernels->add_rows(&s);
}

/* w = P h of each. */
void kf_full_products(const struct nav_kf *kf, const double *h, int count, struct kf_gain *g)
{
    constexpr int GAIN_STRIDE = sizeof *g / sizeof *g->w;
    struct kf_used used;
    kf_list_used(count, kf->n, h, &used);
    for (int m = 0; m < count; m++) memset(g[m].w, 0, sizeof *g->w * (size_t)kf->stride);
    add_rows(kf, {count, kf->stride, used.count, used.at, h, kf->p, g->w, kf->n, kf->stride, GAIN_STRIDE});
}

/* (P - v v') h = w - v (v h), v of the measurements before; s = h w + r. */
void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g, int before)
{
    struct kf_gain *last = g + before;
    for (int m = 0; m < before; m++) {
        const double part = kf_dot(kf->n, g[m].w, h);
        for (int i = 0; i < kf->stride; i++) last->w[i] -= g[m].w[i] * part;
    }
    last->variance = r + kf_dot(kf->n, h, last->w);
}

/* w w'/s is v v' of v = w/sqrt s. */
void kf_full_take(const struct nav_kf *kf, struct kf_gain *g)
{
    const double scale = 1.0 / std::sqrt(g->variance);
    for (int i = 0; i < kf->stride; i++) g->w[i] *= scale;
}

void kf_full_subtract(struct nav_kf *kf, const struct kf_gain *g, int count)
{
    const struct kf_squares squares = {kf->n, kf->stride, count, sizeof *g / sizeof *g->w, g->w, kf->p};
    kf->kernels->subtract_squares(&squares);
}

/* y += Phi p of so many columns; rows of p and of y that far apart. */
static void add_moving(const struct nav_kf *kf, const double *p, int columns, double *y, int y_stride)
{
    for (int i = 0; i < kf->dynamic; i += KF_GROUP) {
        const struct kf_used *used = &kf->phi.group[i / KF_GROUP];
        add_rows(kf, {kf_group(kf, i), columns, used->count, used->at, kf->phi.rows + i * kf->n, p, y + i * y_stride,
                      kf->n, kf->stride, y_stride});
    }
}

/* N = Phi P and its transpose as the moving rows and columns; in the square where they meet, Q + Phi N'. */
void kf_full_predict(struct nav_kf *kf, const double *q)
{
    const int n = kf->n;
    const int nd = kf->dynamic;
    const int stride = kf->stride;
    const int side = KF_PADDED(nd);
    double *rows = kf->work;
    alignas(KF_ALIGN_BYTES) double square[KF_MAX * KF_MAX];
    memset(rows, 0, sizeof *rows * (size_t)(nd * stride));
    add_moving(kf, kf->p, stride, rows, stride);
    for (int k = 0; k < n; k++)
        for (int i = 0; i < nd; i++) kf->p[k * stride + i] = rows[i * stride + k];
    for (int i = 0; i < nd; i++)
        for (int j = 0; j < side; j++) square[i * side + j] = j < nd ? q[i * nd + j] : 0.0;
    add_moving(kf, kf->p, side, square, side);
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
