/* The two forms of the covariance, each with the same three operations. */
#ifndef PSABENCH_NAV_KF_FORM_HPP
#define PSABENCH_NAV_KF_FORM_HPP

#include "nav/kf.h"

constexpr int KF_MAX = NAV_KF_MAX;

/* Rows of Phi of the moving states, without their zeros. */
struct kf_rows {
    int count[KF_MAX];
    int at[KF_MAX][KF_MAX];
    double value[KF_MAX][KF_MAX];
};

struct nav_kf {
    int n, dynamic, form;
    double x[KF_MAX];
    double p[KF_MAX * KF_MAX]; /* n x n: P, or U transposed: its columns are rows here */
    double d[KF_MAX];
    struct kf_rows rows;
    double work[KF_MAX * KF_MAX];
};

/* w: gain times s, innovation variance s = h w + r. u is what the form wants again in the update. */
struct kf_gain {
    double w[KF_MAX], u[KF_MAX];
    double variance;
};

/* P = U D U': ut row j holds column j of U. False: an eigenvalue is negative. p and ut may be the same. */
bool kf_factor(int n, const double *p, double *ut, double *d);

void kf_full_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g);
void kf_full_update(struct nav_kf *kf, const struct kf_gain *g);
void kf_full_predict(struct nav_kf *kf, const double *q);

void kf_ud_gain(const struct nav_kf *kf, const double *h, double r, struct kf_gain *g);
void kf_ud_update(struct nav_kf *kf, const double *h, double r, struct kf_gain *g);
bool kf_ud_predict(struct nav_kf *kf, const double *q);
double kf_variance(const struct nav_kf *kf, int i); /* P_ii */
void kf_ud_full(const struct nav_kf *kf, double *p);

#endif
