/* Strapdown integration of an ideal unit's increments over the three cycles of the calibration: attitude beside the table's, and a
 * velocity that is zero in truth. */
#ifndef PSABENCH_TESTS_BINS_INS_H
#define PSABENCH_TESTS_BINS_INS_H

#include "bins_rig.h"

#include "phys/motion/pose.h"

struct ins {
    double C_nb[3][3]; /* n of pose.h: north, east, down */
    double v_mps[3];
    double before_rad[3];       /* increment of the reading before */
    double tilt_rad, speed_mps; /* worst */
};

static inline void multiply(double a[3][3], double b[3][3], double out[3][3])
{
    double p[3][3];
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) p[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    memcpy(out, p, sizeof p);
}

static inline double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* I + sin a/a [v x] + (1 - cos a)/a^2 [v x]^2 */
static inline void rotation(const double v[3], double out[3][3])
{
    const double a = length(v), s = a > 1e-12 ? sin(a) / a : 1.0;
    const double c = a > 1e-12 ? 2.0 * sin(a / 2) * sin(a / 2) / (a * a) : 0.5;
    double x[3][3] = {{0, -v[2], v[1]}, {v[2], 0, -v[0]}, {-v[1], v[0], 0}};
    double square[3][3];
    multiply(x, x, square);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) out[i][j] = (i == j) + s * x[i][j] + c * square[i][j];
}

static inline void turned(double C[3][3], const double v[3], double out[3])
{
    for (unsigned i = 0; i < 3; i++) out[i] = C[i][0] * v[0] + C[i][1] * v[1] + C[i][2] * v[2];
}

/* The mean of a vector that turns by the angle is shorter across it by sin(a/2)/(a/2). */
static inline void unsmeared(const double theta_rad[3], const double dv_mps[3], double out[3])
{
    const double a = length(theta_rad), k = a > 1e-9 ? (a / 2) / sin(a / 2) : 1.0;
    const double along =
        a > 1e-9 ? (theta_rad[0] * dv_mps[0] + theta_rad[1] * dv_mps[1] + theta_rad[2] * dv_mps[2]) / (a * a) : 0.0;
    for (unsigned i = 0; i < 3; i++) {
        const double parallel = along * theta_rad[i];
        out[i] = parallel + k * (dv_mps[i] - parallel);
    }
}

static inline void earth_turn(double t_s, double out[3][3])
{
    const double back_rad[3] = {-EARTH_RATE_RADPS * cos(RIG_LATITUDE) * t_s, 0.0,
                                EARTH_RATE_RADPS * sin(RIG_LATITUDE) * t_s};
    rotation(back_rad, out);
}

static inline void check_against_table(struct rig *rig, struct ins *n, int64_t t_ns)
{
    const struct pose *p = table_pose(&rig->lab.table, t_ns);
    double error[3][3], T[3][3];
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) T[i][j] = p->C_nb[j][i];
    multiply(n->C_nb, T, error);
    const double tilt[3] = {(error[2][1] - error[1][2]) / 2, (error[0][2] - error[2][0]) / 2,
                            (error[1][0] - error[0][1]) / 2};
    n->tilt_rad = fmax(n->tilt_rad, length(tilt));
    n->speed_mps = fmax(n->speed_mps, length(n->v_mps));
}

static inline void navigate(struct rig *rig, const struct bins_reading *g)
{
    struct ins *n = rig->own;
    const double count_rad = rig_bins(rig)->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC;
    const double code = bins_accel_mps_per_code(rig_bins(rig));
    double theta[3], dv[3], phi[3], half[3], coning[3], f[3], turn[3][3], middle[3][3], earth[3][3], v_n[3];
    for (unsigned i = 0; i < 3; i++) theta[i] = g->gyro[i] * count_rad;
    for (unsigned i = 0; i < 3; i++) dv[i] = (g->accel[i] + 0.5 * g->words) * code;
    pose_cross(n->before_rad, theta, coning);
    for (unsigned i = 0; i < 3; i++) phi[i] = theta[i] + coning[i] / 12.0;
    for (unsigned i = 0; i < 3; i++) half[i] = 0.5 * theta[i];
    unsmeared(theta, dv, f);
    rotation(half, turn);
    multiply(n->C_nb, turn, middle);
    earth_turn(RIG_PERIOD_S / 2, earth);
    multiply(earth, middle, middle);
    turned(middle, f, v_n);
    v_n[2] += RIG_G_MPS2 * RIG_PERIOD_S;
    for (unsigned i = 0; i < 3; i++) n->v_mps[i] += v_n[i];
    rotation(phi, turn);
    multiply(n->C_nb, turn, n->C_nb);
    earth_turn(RIG_PERIOD_S, earth);
    multiply(earth, n->C_nb, n->C_nb);
    memcpy(n->before_rad, theta, sizeof theta);
    if (g->seq % 100 == 0) check_against_table(rig, n, g->t_ns);
}

static inline void cycle(struct rig *r, double half_s)
{
    for (unsigned i = 0; i < 2; i++) {
        rig_rate(r, 0, i == 0 ? 10.0 : -10.0);
        rig_run(r, half_s);
    }
    rig_rate(r, 0, 0.0);
    rig_run(r, 0.1);
}

/* Each axis of the unit in turn along the table's, which is horizontal. */
static inline void three_cycles(struct rig *r, double half_s, struct ins *n)
{
    const struct bins_profile p = rig_ideal();
    rig_up(r, &p, true, 1);
    rig_run(r, 1.0);
    memcpy(n->C_nb, table_pose(&r->lab.table, r->last.t_ns)->C_nb, sizeof n->C_nb);
    r->own = n;
    r->on_reading = navigate;
    cycle(r, half_s);
    rig_position(r, 2, -90.0, 10.0);
    rig_run(r, 9.5);
    cycle(r, half_s);
    rig_position(r, 2, 0.0, 10.0);
    rig_position(r, 1, 90.0, 10.0);
    rig_run(r, 9.5);
    cycle(r, half_s);
    rig_run(r, 1.0);
    assert_int_equal(r->flags, 0);
    print_message("%.0f s: attitude %.2e rad, velocity %.2e m/s\n", 1e-9 * (double)r->last.t_ns, n->tilt_rad,
                  n->speed_mps);
}

#endif
