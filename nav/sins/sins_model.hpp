/* What the parts of the calibration share: its state, where the blocks are, the motion between steps. */
#ifndef PSABENCH_NAV_SINS_MODEL_HPP
#define PSABENCH_NAV_SINS_MODEL_HPP

#include "nav/common/nav_rotation.hpp"
#include "nav/filter/kf_form.hpp"
#include "nav/sins.h"

#include <Eigen/Dense>

using sens_drift = Eigen::Matrix<double, 3, 12>; /* of beta to nu and Theta, row-major */
using sens_accel = Eigen::Matrix<double, 3, 25>; /* of z_a to df, Gamma, lever, q, delay */

constexpr int SINS_AT_QUAD = 21, SINS_AT_DELAY = 24; /* columns of sens_accel */

constexpr int SINS_RING = 256;    /* samples of attitude that the stand's angles are compared with */
constexpr int SINS_PENDING = 256; /* angles of the stand that wait for the motion after them */

struct sins_gauge {
    int count;
    int at[9];      /* kept elements of Gamma, row-major */
    int dropped[3]; /* one of each pair (23, 32), (13, 31), (12, 21); count 9: none */
};
extern const struct sins_gauge sins_gauges[3];

/* Integrals over part of a step. */
struct sins_span {
    sens_drift drift;
    double time_s;
};

struct sins_ring_entry {
    double t_s;   /* end of the sample */
    mat3 c;       /* at the end */
    vec3 w_rel_b; /* rate relative to n over the sample */
};

struct sins_angle {
    double t_s;
    mat3 c_st;
};

struct nav_sins {
    struct nav_sins_cfg cfg;
    struct nav_sins_rows at[NAV_SINS_BLOCKS];
    int n, dynamic, per_step, feedback;
    double start_s;
    int64_t samples; /* since the start */
    int64_t steps;
    bool started;

    mat3_rows c0_prior, c0; /* as given; as the model has it */
    mat3 c;                 /* Chat now */
    vec3 earth_n, gravity_n;
    mat3 earth_turn; /* exp(-u dt) */
    struct nav_sins_params model;
    mat3 gyro_back, accel_back; /* (I + Theta)^-1, (I + Gamma)^-1 of the model */

    vec3 dtheta_before, w_before;
    struct sins_span carry, now; /* of the end of the step before, of this step */
    vec3 z_sum;
    sens_accel accel;

    struct sins_ring_entry ring[SINS_RING];
    struct sins_angle pending[SINS_PENDING];
    int pending_first, pending_count;

    double phi[KF_MAX * KF_MAX], q[KF_MAX * KF_MAX], h[6 * KF_MAX];
    struct nav_sins_state found; /* counts and last innovations */
    struct nav_kf kf;
};

/* How far back the ring must reach: from the sample before the guard to the one after the filter's step. */
double sins_kept_s(const struct nav_sins_cfg *cfg);

/* ---- the model and the state */

void sins_use_model(struct nav_sins *s);                                  /* after a change of s->model */
void sins_add_state(const struct nav_sins *s, struct nav_sins_params *p); /* p += x */
void sins_feed_back(struct nav_sins *s);                                  /* x into the model, x = 0 */
int sins_reset(struct nav_sins *s);       /* filter and motion at the start, about s->model */
int sins_forget_beta(struct nav_sins *s); /* as in the prior, of no correlation */

/* ---- parts of a step */

void sins_take_sample(struct nav_sins *s, const vec3 &dtheta, const vec3 &dv); /* integrates, accumulates */
void sins_middle(struct nav_sins *s);
int sins_finish_step(struct nav_sins *s);
int sins_take_angles(struct nav_sins *s, double t_filter_s); /* those of the stand whose time has come */

#endif
