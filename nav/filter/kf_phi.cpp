#include "nav/filter/kf_form.hpp"

int kf_list_used(int rows, int n, const double *a, int *at)
{
    uint64_t used[KF_MAX] = {0};
    for (int i = 0; i < rows; i++)
        for (int k = 0; k < n; k++)
            used[k] |= kf_bits(a[i * n + k]) << 1; /* without the sign: a comparison would not be taken in vectors */
    int count = 0;
    for (int k = 0; k < n; k++) {
        at[count] = k;
        count += used[k] != 0;
    }
    return count;
}

/* By columns: as many sums at once as there are rows. */
void kf_move(const struct nav_kf *kf, const double *a, int count, double *y)
{
    const struct kf_phi *phi = &kf->phi;
    for (int i = 0; i < kf->dynamic; i++) y[i] = 0.0;
    for (int k = 0; k < count; k++)
        for (int i = 0; i < kf->dynamic; i++) y[i] += phi->rows[i * kf->n + phi->at[k]] * a[phi->at[k]];
}
