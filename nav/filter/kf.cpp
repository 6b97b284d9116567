#include "nav/filter/kf_form.hpp"

#include <cstdint>
#include <cstring>

size_t nav_kf_bytes(void)
{
    return sizeof(struct nav_kf);
}

/* The filter points into its own memory: it stays where it was started. */
static void place_arrays(struct nav_kf *kf)
{
    const uintptr_t past = (uintptr_t)kf->store % KF_ALIGN_BYTES;
    kf->p = kf->store + (KF_ALIGN_BYTES - past) % KF_ALIGN_BYTES / sizeof *kf->store;
    kf->work = kf->p + KF_MAX * KF_MAX;
}

int nav_kf_start(void *memory, size_t bytes, int n, int dynamic, int form, nav_kf **out)
{
    if (!memory || bytes < sizeof(struct nav_kf)) return NAV_RANGE;
    if (n < 1 || n > KF_MAX || dynamic < 0 || dynamic > n || form < NAV_KF_JOSEPH || form > NAV_KF_UD) return NAV_RANGE;
    memset(memory, 0, sizeof(struct nav_kf));
    struct nav_kf *kf = (struct nav_kf *)memory;
    kf->n = n;
    kf->dynamic = dynamic;
    kf->form = form;
    kf->stride = KF_PADDED(n);
    kf->kernels = &kf_kernels[kf_width()];
    place_arrays(kf);
    for (int i = 0; form == NAV_KF_UD && i < n; i++) kf->p[i * n + i] = 1.0;
    *out = kf;
    return NAV_OK;
}

static bool is_symmetric(int n, const double *p)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) {
            const double gap = p[i * n + j] - p[j * n + i];
            if (gap * gap > 1e-20 * std::fabs(p[i * n + i] * p[j * n + j])) return false;
        }
    return true;
}

int nav_kf_set(nav_kf *kf, const double *x, const double *p)
{
    const int n = kf->n;
    double d[KF_MAX];
    if (!nav_all_finite(p, n * n) || (x && !nav_all_finite(x, n))) return NAV_NOT_FINITE;
    if (!is_symmetric(n, p) || !kf_factor(n, p, kf->work, d)) return NAV_SINGULAR;
    if (kf->form == NAV_KF_UD) memcpy(kf->p, kf->work, sizeof *p * (size_t)(n * n));
    else kf_full_set(kf, p);
    memcpy(kf->d, d, sizeof *d * (size_t)n);
    for (int i = 0; i < n; i++) kf->x[i] = x ? x[i] : 0.0;
    return NAV_OK;
}

int nav_kf_get(const nav_kf *kf, double *x, double *p)
{
    const int n = kf->n;
    if (x) memcpy(x, kf->x, sizeof *x * (size_t)n);
    if (p && kf->form == NAV_KF_UD) kf_ud_full(kf, p);
    if (p && kf->form == NAV_KF_JOSEPH) kf_full_get(kf, p);
    return NAV_OK;
}

double kf_variance(const nav_kf *kf, int i)
{
    if (kf->form == NAV_KF_JOSEPH) return kf->p[i * (kf->stride + 1)];
    double sum = 0.0;
    for (int k = i; k < kf->n; k++) sum += kf->p[k * kf->n + i] * kf->p[k * kf->n + i] * kf->d[k];
    return sum;
}

static void move_state(struct nav_kf *kf)
{
    double moved[KF_MAX];
    for (int i = 0; i < kf->dynamic; i++) {
        const struct kf_used *used = &kf->phi.group[i / KF_GROUP];
        moved[i] = 0.0;
        for (int k = 0; k < used->count; k++) moved[i] += kf->phi.rows[i * kf->n + used->at[k]] * kf->x[used->at[k]];
    }
    memcpy(kf->x, moved, sizeof *moved * (size_t)kf->dynamic);
}

int nav_kf_predict(nav_kf *kf, const double *phi, const double *q)
{
    if (!nav_all_finite(phi, kf->dynamic * kf->n) || !nav_all_finite(q, kf->dynamic * kf->dynamic))
        return NAV_NOT_FINITE;
    kf_take_phi(kf, phi);
    if (kf->form == NAV_KF_JOSEPH) kf_full_predict(kf, q);
    else if (!kf_ud_predict(kf, q)) return NAV_SINGULAR;
    move_state(kf);
    return NAV_OK;
}

static int check_measurement(const nav_kf *kf, const double *h, double z, double r)
{
    if (!nav_all_finite(h, kf->n) || !std::isfinite(z) || !std::isfinite(r)) return NAV_NOT_FINITE;
    return r > 0.0 ? NAV_OK : NAV_RANGE;
}

static int find_innovation(const nav_kf *kf, const double *h, double z, const struct kf_gain *g,
                           struct nav_kf_innovation *out)
{
    if (!(g->variance > 0.0)) return NAV_SINGULAR;
    out->variance = g->variance;
    out->value = z - kf_dot(kf->n, h, kf->x);
    return NAV_OK;
}

static void step_state(nav_kf *kf, const struct kf_gain *g, const struct nav_kf_innovation *found)
{
    const double step = found->value / found->variance;
    for (int i = 0; i < kf->n; i++) kf->x[i] += g->w[i] * step;
}

int nav_kf_innovate(const nav_kf *kf, const double *h, double z, double r, struct nav_kf_innovation *out)
{
    struct kf_gain g;
    struct nav_kf_innovation found;
    int status = check_measurement(kf, h, z, r);
    if (status != NAV_OK) return status;
    if (kf->form == NAV_KF_UD) kf_ud_gain(kf, h, r, &g);
    else {
        kf_full_products(kf, h, 1, &g);
        kf_full_gain(kf, h, r, &g, 0);
    }
    status = find_innovation(kf, h, z, &g, &found);
    if (status == NAV_OK) *out = found;
    return status;
}

/* P h of each row at the beginning of g.w. */
static void find_products(const nav_kf *kf, const double *h, int count, struct kf_gain *g)
{
    if (kf->form == NAV_KF_JOSEPH) kf_full_products(kf, h, count, g);
    else
        for (int m = 0; m < count; m++) kf_ud_gain(kf, h + m * kf->n, 0.0, &g[m]);
}

int kf_joint(const struct nav_kf *kf, const double *h, const double *r, int count, double *s)
{
    struct kf_gain g[KF_GROUP];
    if (!nav_all_finite(h, (int64_t)count * kf->n) || !nav_all_finite(r, count)) return NAV_NOT_FINITE;
    find_products(kf, h, count, g);
    for (int i = 0; i < count; i++)
        for (int j = 0; j <= i; j++) {
            const double own = i == j ? r[i] : 0.0;
            s[i * count + j] = s[j * count + i] = kf_dot(kf->n, h + j * kf->n, g[i].w) + own;
        }
    return NAV_OK;
}

static int update_ud(nav_kf *kf, const double *h, double z, double r, struct nav_kf_innovation *out)
{
    struct kf_gain g;
    struct nav_kf_innovation found;
    int status = check_measurement(kf, h, z, r);
    if (status != NAV_OK) return status;
    kf_ud_gain(kf, h, r, &g);
    status = find_innovation(kf, h, z, &g, &found);
    if (status != NAV_OK) return status;
    step_state(kf, &g, &found);
    kf_ud_update(kf, r, &g);
    if (out) *out = found;
    return NAV_OK;
}

/* KF_GROUP measurements at most; those before a bad one are taken. */
static int update_full(nav_kf *kf, const double *h, const double *z, const double *r, int count,
                       struct nav_kf_innovation *out)
{
    struct kf_gain g[KF_GROUP];
    struct nav_kf_innovation found;
    int status = NAV_OK;
    int done = 0;
    kf_full_products(kf, h, count, g);
    for (; done < count; done++) {
        const double *row = h + done * kf->n;
        status = check_measurement(kf, row, z[done], r[done]);
        if (status != NAV_OK) break;
        kf_full_gain(kf, row, r[done], g, done);
        status = find_innovation(kf, row, z[done], &g[done], &found);
        if (status != NAV_OK) break;
        step_state(kf, &g[done], &found);
        kf_full_take(kf, &g[done]);
        if (out) out[done] = found;
    }
    kf_full_subtract(kf, g, done);
    return status;
}

int nav_kf_update(nav_kf *kf, const double *h, const double *z, const double *r, int count,
                  struct nav_kf_innovation *out)
{
    const int most = kf->form == NAV_KF_UD ? 1 : KF_GROUP;
    int status = NAV_OK;
    for (int m = 0; m < count && status == NAV_OK; m += most) {
        const int group = count - m < most ? count - m : most;
        struct nav_kf_innovation *found = out ? out + m : NULL;
        if (kf->form == NAV_KF_UD) status = update_ud(kf, h + m * kf->n, z[m], r[m], found);
        else status = update_full(kf, h + m * kf->n, z + m, r + m, group, found);
    }
    return status;
}

double nav_kf_nees(int n, const double *error, const double *p)
{
    double ut[KF_MAX * KF_MAX];
    double d[KF_MAX];
    if (n < 1 || n > KF_MAX || !nav_all_finite(p, n * n) || !kf_factor(n, p, ut, d)) return NAV_NAN;
    double sum = 0.0;
    double e[KF_MAX];
    memcpy(e, error, sizeof *e * (size_t)n);
    for (int j = n - 1; j >= 0; j--) { /* U y = e from the last row, then y' D^-1 y */
        if (!(d[j] > 0.0)) return NAV_NAN;
        for (int i = 0; i < j; i++) e[i] -= ut[j * n + i] * e[j];
        sum += e[j] * e[j] / d[j];
    }
    return sum;
}
