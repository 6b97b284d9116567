/* libpsabench-nav: a Kalman filter for problems of many constant and few moving states (docs/procedures/sins.md).
 *
 * The first `dynamic` states move, x_d' = Phi [x_d; x_c] + noise of covariance Q; the others are constant, so that a step costs
 * dynamic n instead of n^2. A random walk or a decaying drift is a moving state. Measurements are scalars z = h x + v with
 * v ~ N(0, r), independent of each other; several are taken one after the other. The filter knows nothing of what its states mean.
 *
 * Forms: NAV_KF_JOSEPH keeps P and subtracts w w'/s, w = P h, s = h w + r, which for this gain is Joseph's
 * (I - k h) P (I - k h)' + k r k'; NAV_KF_UD keeps P = U D U', U upper triangular with ones (Bierman 1977: the update of his V.3,
 * weighted Gram-Schmidt of Thornton for the moving rows), and cannot lose the positive sign of P.
 * Matrices are row-major. No allocation: the caller owns the memory, one filter for one thread. Functions return NAV_OK or a status
 * below zero (nav.h) and then leave the filter as it was, but for nav_kf_update(), which keeps the scalars before the bad one. */
#ifndef PSABENCH_NAV_KF_H
#define PSABENCH_NAV_KF_H

#include "nav/nav.h"

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define NAV_KF_MAX 64 /* states */

enum nav_kf_form { NAV_KF_JOSEPH, NAV_KF_UD };

typedef struct nav_kf nav_kf;

NAV_API size_t nav_kf_bytes(void);
/* In memory of nav_kf_bytes(), aligned as malloc() does, which must not be moved; x = 0, P = 0. */
NAV_API int nav_kf_start(void *memory, size_t bytes, int n, int dynamic, int form, nav_kf **out);

/* x (NULL: 0) and P. NAV_SINGULAR: P is not symmetric or has a negative eigenvalue; zero ones are taken. */
NAV_API int nav_kf_set(nav_kf *kf, const double *x, const double *p);
NAV_API int nav_kf_get(const nav_kf *kf, double *x, double *p); /* either may be NULL */

/* phi: dynamic rows of n; q: dynamic x dynamic, positive semidefinite. */
NAV_API int nav_kf_predict(nav_kf *kf, const double *phi, const double *q);

/* Before the measurement is taken: z - h x, and h P h' + r. value^2/variance is its part of the NIS. */
struct nav_kf_innovation {
    double value, variance;
};
/* h: count rows of n; r > 0. out: count innovations, or NULL. */
NAV_API int nav_kf_update(nav_kf *kf, const double *h, const double *z, const double *r, int count,
                          struct nav_kf_innovation *out);
NAV_API int nav_kf_innovate(const nav_kf *kf, const double *h, double z, double r, struct nav_kf_innovation *out);

/* One step back of the Rauch-Tung-Striebel smoother: xs, ps (n, n x n) come as smoothed at k + 1 and leave as smoothed at k.
 * phi, q: of the step k to k + 1; x_pred, p_pred: as nav_kf_get() gave them after that step's nav_kf_predict(). With constant states
 * the gain is Phi^-1 (I - Q P_pred^-1), of which only the moving rows differ from Phi^-1; P_pred may be singular in the constant
 * states. NAV_SINGULAR: phi's square part, or what noise leaves of P_pred's. */
NAV_API int nav_kf_smooth(int n, int dynamic, const double *phi, const double *q, const double *x_pred,
                          const double *p_pred, double *xs, double *ps);

/* e' P^-1 e, which has mean n for a consistent estimate (NEES); NaN where P is singular. */
NAV_API double nav_kf_nees(int n, const double *error, const double *p);

#ifdef __cplusplus
}
#endif

#endif
