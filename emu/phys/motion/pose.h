/* Attitude and motion of a frame that hangs on the Earth by a chain of turns: outer axis first, each turn about an axis of
 * the frame before it. A fixed angle is a turn without rate. Exact kinematics of a rigid body; the origin of the chain, where
 * all its axes meet, is fixed to the Earth. Gravity is taken as uniform over the bench (its gradient is 3e-7 g a metre).
 *
 * C_nb takes coordinates in the frame, b, to n. Plain struct. */
#ifndef PSABENCH_PHYS_MOTION_POSE_H
#define PSABENCH_PHYS_MOTION_POSE_H

#include "base/detmath.h"
#include "phys/motion/earth.h"

enum pose_axis { POSE_X, POSE_Y, POSE_Z };

struct pose {
    double C_nb[3][3];
    double w_ib_b_radps[3];   /* rate relative to inertial space */
    double dw_ib_b_radps2[3]; /* time derivative of its components */
};

/* The bench's level frame: x towards the site's azimuth, z down. */
void pose_start(struct pose *p, const struct site *site);

/* The frame that is turned by the angle about one axis of the present one, right-handed, with rate and acceleration. */
void pose_turn(struct pose *p, enum pose_axis axis, double angle_rad, double rate_radps, double accel_radps2);

/* The angle as it is turned by, with its sine and cosine: for one that stays. */
struct pose_angle {
    double angle_rad;
    struct det_pair of;
};
struct pose_angle pose_angle(double angle_rad);

/* The same bits as pose_turn() of that angle. */
void pose_turn_by(struct pose *p, enum pose_axis axis, const struct pose_angle *a, double rate_radps,
                  double accel_radps2);

/* Turns about x, then y, then z by fixed angles: small ones are a rotation vector. */
void pose_tilt(struct pose *p, const double angle_rad[3]);

/* Specific force at a point that is fixed in the frame, r_m from the origin, in the frame's axes. At rest: -g along down. */
void pose_force_mps2(const struct pose *p, double g_mps2, const double r_m[3], double f_mps2[3]);

/* out = a x b; out is neither of them. */
void pose_cross(const double a[3], const double b[3], double out[3]);

/* v = C_nb^T v_n and back. */
void pose_into(const struct pose *p, const double v_n[3], double v_b[3]);
void pose_out_of(const struct pose *p, const double v_b[3], double v_n[3]);

#endif
