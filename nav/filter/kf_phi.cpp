#include "nav/filter/kf_form.hpp"

/* Without the sign, which is no number: a comparison would not be taken in vectors. */
static void mark_used(int rows, int n, const double *a, uint64_t *any)
{
    for (int i = 0; i < rows; i++)
        for (int k = 0; k < n; k++) any[k] |= kf_bits(a[i * n + k]) << 1;
}

static void list_marked(int n, const uint64_t *any, struct kf_used *used)
{
    int count = 0;
    for (int k = 0; k < n; k++) {
        used->at[count] = k;
        count += any[k] != 0;
    }
    used->count = count;
}

void kf_list_used(int rows, int n, const double *a, struct kf_used *used)
{
    uint64_t any[KF_MAX] = {0};
    mark_used(rows, n, a, any);
    list_marked(n, any, used);
}

/* Four sums side by side, each a chain of additions of its own. */
double kf_dot(int n, const double *a, const double *b)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int k = 0;
    for (; k + 4 <= n; k += 4)
        for (int i = 0; i < 4; i++) sum[i] += a[k + i] * b[k + i];
    for (; k < n; k++) sum[0] += a[k] * b[k];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

void kf_take_phi(struct nav_kf *kf, const double *rows)
{
    const int n = kf->n;
    uint64_t all[KF_MAX] = {0};
    kf->phi.rows = rows;
    for (int i = 0; i < kf->dynamic; i += KF_GROUP) {
        uint64_t any[KF_MAX] = {0};
        mark_used(kf->dynamic - i < KF_GROUP ? kf->dynamic - i : KF_GROUP, n, rows + i * n, any);
        list_marked(n, any, &kf->phi.group[i / KF_GROUP]);
        for (int k = 0; k < n; k++) all[k] |= any[k];
    }
    list_marked(n, all, &kf->phi.all);
}

/* By columns: as many sums at once as there are rows. */
void kf_move(const struct nav_kf *kf, const double *a, int count, double *y)
{
    const struct kf_phi *phi = &kf->phi;
    for (int i = 0; i < kf->dynamic; i++) y[i] = 0.0;
    for (int k = 0; k < count; k++)
        for (int i = 0; i < kf->dynamic; i++) y[i] += phi->rows[i * kf->n + phi->all.at[k]] * a[phi->all.at[k]];
}
