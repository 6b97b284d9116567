/* The two forms of the covariance, each with the same three operations. */
#ifndef PSABENCH_NAV_KF_FORM_HPP
#define PSABENCH_NAV_KF_FORM_HPP

#include "nav/common/nav_math.hpp"
#include "nav/filter/kf_kernels.h"
#include "nav/kf.h"

#include <cstring>

constexpr int KF_MAX = NAV_KF_MAX;

struct kf_used { /* columns of some rows that are not zero */
    int count;
    int at[KF_MAX];
};

/* Phi's moving rows, dynamic x n, the caller's, and what each group of rows uses. */
struct kf_phi {
    const double *rows;
    struct kf_used group[(KF_MAX + KF_GROUP - 1) / KF_GROUP];
};

struct nav_kf {
    int n, dynamic, form;
    int stride;                       /* of P's rows, KF_PADDED(n) */
    const struct kf_kernels *kernels; /* of this processor */
    double *p;                        /* P; or n x n: U transposed, its columns are rows here */
    double *work;                     /* as p in store, aligned for the kernels */
    double x[KF_MAX], d[KF_MAX];
    struct kf_phi phi;
    double store[2 * KF_MAX * KF_MAX + KF_LANES];
};

/* w: gain times s, innovation variance s = h w + r. u is what the UD form needs again in the update. */
struct kf_gain {
    alignas(KF_ALIGN_BYTES) double w[KF_MAX];
    double u[KF_MAX];
    double variance;
};

/* P = U D U': ut row j holds column j of U. False: an eigenvalue is negative. p and ut may be the same. */
bool kf_factor(int n, const double *p, double *ut, double *d);

/* Moving rows of the group that begins with row i. */
inline int kf_group(const struct nav_kf *kf, int i)
{
    return kf->dynamic - i < KF_GROUP ? kf->dynamic - i : KF_GROUP;
}

void kf_list_used(int rows, int n, const double *a, struct kf_used *used); /* rows > 0 */
double kf_dot(int n, const double *a, const double *b);
void kf_take_phi(struct nav_kf *kf, const double *rows);
/* Phi a of `count` columns. */
void kf_move(const struct nav_kf *kf, const double *a, const int *at, int count, double *y);

/* S = H P H' + diag r of `count` rows, KF_GROUP at most: s, count x count. */
int kf_joint(const struct nav_kf *kf, const double *h, const double *r, int count, double *s);

/* Measurements by groups of KF_GROUP, so that P is read once and written once: products of all, then for each what the ones
 * before it leave of its gain and, once it is taken, its part of P; then the parts are subtracted. */
void kf_full_products(const struct nav_kf *kf, const double *h, int count, struct kf_gain *g);
void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g, int before);
void kf_full_take(const struct nav_kf *kf, struct kf_gain *g);
void kf_full_subtract(struct nav_kf *kf, const struct kf_gain *g, int count);
void kf_full_predict(struct nav_kf *kf, const double *q);
void kf_full_set(struct nav_kf *kf, const double *p);
void kf_full_get(const struct nav_kf *kf, double *p);

void kf_ud_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g);
void kf_ud_update(struct nav_kf *kf, double r, const struct kf_gain *g);
bool kf_ud_predict(struct nav_kf *kf, const double *q);
double kf_variance(const struct nav_kf *kf, int i); /* P_ii */
void kf_ud_full(const struct nav_kf *kf, double *p);

#endif
