#include "phys/motion/pose.h"

#include "base/detmath.h"

#include <math.h>
#include <string.h>

#define REDUCE_ABOVE 1000.0 /* rad: a table that has been turning for long; det_sin() takes up to 1e6 */

void pose_start(struct pose *p, const struct site *site)
{
    *p = (struct pose){.C_nb = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    earth_rate_n(site, p->w_ib_b_radps);
    pose_turn(p, POSE_Z, site->azimuth_rad, 0.0, 0.0);
}

/* A vector's two components across the axis, in the turned frame. */
static void turn_pair(double *i, double *j, double c, double s)
{
    const double was = *i;
    *i = c * was + s * *j;
    *j = c * *j - s * was;
}

struct pose_angle pose_angle(double angle_rad)
{
    if (fabs(angle_rad) > REDUCE_ABOVE) angle_rad = fmod(angle_rad, TURN_RAD); /* exact */
    return (struct pose_angle){angle_rad, angle_rad != 0.0 ? det_sin_cos(angle_rad) : (struct det_pair){0.0, 1.0}};
}

/* w' = R^T w + e rate; dw' = R^T dw - e rate x (R^T w) + e accel. */
void pose_turn_by(struct pose *p, enum pose_axis axis, const struct pose_angle *a, double rate_radps,
                  double accel_radps2)
{
    const unsigned k = (unsigned)axis;
    const unsigned i = (k + 1) % 3;
    const unsigned j = (k + 2) % 3;
    double *w = p->w_ib_b_radps;
    double *dw = p->dw_ib_b_radps2;
    if (a->angle_rad != 0.0) {
        for (unsigned row = 0; row < 3; row++) turn_pair(&p->C_nb[row][i], &p->C_nb[row][j], a->of.cos, a->of.sin);
        turn_pair(&w[i], &w[j], a->of.cos, a->of.sin);
        turn_pair(&dw[i], &dw[j], a->of.cos, a->of.sin);
    }
    dw[i] += rate_radps * w[j];
    dw[j] -= rate_radps * w[i];
    dw[k] += accel_radps2;
    w[k] += rate_radps;
}

void pose_turn(struct pose *p, enum pose_axis axis, double angle_rad, double rate_radps, double accel_radps2)
{
    const struct pose_angle a = pose_angle(angle_rad);
    pose_turn_by(p, axis, &a, rate_radps, accel_radps2);
}

void pose_tilt(struct pose *p, const double angle_rad[3])
{
    for (unsigned k = 0; k < 3; k++) pose_turn(p, (enum pose_axis)k, angle_rad[k], 0.0, 0.0);
}

void pose_cross(const double a[3], const double b[3], double out[3])
{
    for (unsigned k = 0; k < 3; k++) {
        const unsigned i = (k + 1) % 3;
        const unsigned j = (k + 2) % 3;
        out[k] = a[i] * b[j] - a[j] * b[i];
    }
}

/* f = -g + dw x r + w x (w x r) */
void pose_force_mps2(const struct pose *p, double g_mps2, const double r_m[3], double f_mps2[3])
{
    double tangential[3];
    double speed[3];
    double centripetal[3];
    pose_cross(p->dw_ib_b_radps2, r_m, tangential);
    pose_cross(p->w_ib_b_radps, r_m, speed);
    pose_cross(p->w_ib_b_radps, speed, centripetal);
    for (unsigned k = 0; k < 3; k++) f_mps2[k] = -g_mps2 * p->C_nb[2][k] + tangential[k] + centripetal[k];
}

void pose_into(const struct pose *p, const double v_n[3], double v_b[3])
{
    double out[3];
    for (unsigned k = 0; k < 3; k++) out[k] = p->C_nb[0][k] * v_n[0] + p->C_nb[1][k] * v_n[1] + p->C_nb[2][k] * v_n[2];
    memcpy(v_b, out, sizeof out);
}

void pose_out_of(const struct pose *p, const double v_b[3], double v_n[3])
{
    double out[3];
    for (unsigned k = 0; k < 3; k++) out[k] = p->C_nb[k][0] * v_b[0] + p->C_nb[k][1] * v_b[1] + p->C_nb[k][2] * v_b[2];
    memcpy(v_n, out, sizeof out);
}
