/* What the parts of the integration share: its state, and the way between the errors of errors.h and the article's. */
#ifndef PSABENCH_NAV_KOI_MODEL_HPP
#define PSABENCH_NAV_KOI_MODEL_HPP

#include "nav/common/nav_rotation.hpp"
#include "nav/errors.h"
#include "nav/filter/kf_form.hpp"
#include "nav/koi.h"

/* Moving states of errors.h with a vertical, and of the article: where each of the former is among the latter. */
enum koi_error { ERR_E, ERR_N, ERR_U, ERR_VE, ERR_VN, ERR_VU, ERR_BE, ERR_BN, ERR_BU, KOI_ERRORS };
enum koi_moving { KOI_R1, KOI_R2, KOI_V1, KOI_V2, KOI_A1, KOI_A2, KOI_B3, KOI_R3, KOI_V3, KOI_MOVING };
constexpr int KOI_OF_ERROR[KOI_ERRORS] = {KOI_R1, KOI_R2, KOI_R3, KOI_V1, KOI_V2, KOI_V3, KOI_A1, KOI_A2, KOI_B3};

constexpr double KOI_NEVER_S = -1e300;
constexpr int KOI_STEP_MAX = 64; /* samples */

/* What T hangs on: t = tan(lat)/(N + h) and V. */
struct koi_map {
    double t_per_m, east_mps, north_mps;
};

/* Rows of h, innovations by the hybrid solution and variances. */
struct koi_rows {
    int count;
    double h[3 * KF_MAX], y[3], r[3];
};

/* Refused measurements of a kind, one after the other, that agree with the first of them. */
struct koi_refused {
    double first[3], since_s;
    int64_t count;
};

struct nav_koi {
    struct nav_koi_cfg cfg;
    struct nav_errors_cfg errors;
    struct nav_sins_rows at[NAV_KOI_BLOCKS];
    int n, dynamic, per_step, in_step;
    int n_errors, column[KF_MAX]; /* states of errors.h, and where each is here */
    double start_s, started_alone_s;
    int64_t steps;

    struct nav_strapdown unit; /* at the last increment */
    struct nav_state before;   /* at the last step */
    double acceleration_mps2[3];
    vec3 arm_mps;            /* of the antenna about the unit at the last step, in b */
    vec3 antenna_mps2;       /* its acceleration over the last step */
    vec3 dtheta_sum, dv_sum; /* since the last step, corrected */

    struct nav_koi_sensors sensors;
    mat3 gyro_back, accel_back; /* (I + Theta)^-1, (I + Gamma)^-1 */

    double prior_sd[KF_MAX];
    double phi[KF_MAX * KF_MAX], q[KF_MAX * KF_MAX];
    double phi_errors[KOI_ERRORS * KF_MAX], q_errors[KOI_ERRORS * KOI_ERRORS];
    struct nav_koi_last last[NAV_KOI_KINDS];
    struct koi_refused refused[NAV_KOI_KINDS];
    struct nav_kf kf;
};

double koi_time_s(const struct nav_koi *k); /* of the last step */
struct koi_map koi_map_at(const struct nav_state *at);

/* a = T a: rows of `columns`, in the order of errors.h before and after. */
void koi_map_rows(const struct koi_map &m, int columns, double *a);
/* a = a T^-1 */
void koi_unmap_columns(const struct koi_map &m, int rows, int columns, double *a);

/* Errors in the order of errors.h by moving states in the article's. */
void koi_errors_of(const struct koi_map &m, const double *x, double errors[KOI_ERRORS]);
struct nav_state koi_less(const struct nav_state &at, const double errors[KOI_ERRORS]);
struct nav_state koi_hybrid(const struct nav_koi *k);

/* Errors of errors.h and P by a, KOI_ERRORS square in their order. */
int koi_move_errors(struct nav_koi *k, const double *a);
/* Notes a measurement that is refused. True: so many have agreed for so long that P was widened until the gate is open for this one. */
bool koi_reopen(struct nav_koi *k, int kind, double t_s, const struct koi_rows *rows);

void koi_use_sensors(struct nav_koi *k); /* after a change of k->sensors */
void koi_add_sensors(const struct nav_koi *k, const double *x, const unsigned char *take, struct nav_koi_sensors *to);
int koi_index_columns(const struct nav_koi_cfg *cfg, const struct nav_sins_rows *at,
                      int *column); /* returns their number */
struct nav_errors_cfg koi_errors_cfg(const struct nav_koi_cfg *cfg);

#endif
