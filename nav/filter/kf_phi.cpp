#include "nav/filter/kf_form.hpp"

/* Without the sign, which is no number: a comparison would not be taken in vectors. */
void kf_list_used(int rows, int n, const double *a, struct kf_used *used)
{
    uint64_t any[KF_MAX];
    for (int k = 0; k < n; k++) any[k] = nav_bits(a[k]) << 1;
    for (int i = 1; i < rows; i++)
        for (int k = 0; k < n; k++) any[k] |= nav_bits(a[i * n + k]) << 1;
    int count = 0;
    for (int k = 0; k < n; k++) {
        used->at[count] = k;
        count += any[k] != 0;
    }
    used->count = count;
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
    kf->phi.rows = rows;
    for (int i = 0; i < kf->dynamic; i += KF_GROUP)
        kf_list_used(kf_group(kf, i), kf->n, rows + i * kf->n, &kf->phi.group[i / KF_GROUP]);
}

/* By columns: as many sums at once as there are rows. */
void kf_move(const struct nav_kf *kf, const double *a, const int *at, int count, double *y)
{
    for (int i = 0; i < kf->dynamic; i++) y[i] = 0.0;
    for (int k = 0; k < count; k++)
        for (int i = 0; i < kf->dynamic; i++) y[i] += kf->phi.rows[i * kf->n + at[k]] * a[at[k]];
}
