/* What the controller of a gyro unit computes: level angles, rates of the level frame, rates for the torquers, turns. Pure.
 *
 * Frames as in phys/motion/platform.h: east, north, up; alpha, beta, gamma of the platform p. Corrected signs of the article's
 * equations: docs/procedures/gyrocompass.md. */
#ifndef PSABENCH_BOARD_GYRO_LAW_H
#define PSABENCH_BOARD_GYRO_LAW_H

#include <stdint.h>

/* Attitude by the level sensors. */
struct gyro_level {
    double sin_b, cos_b, sin_g, cos_g;
    double beta_rad, gamma_rad;
};

/* From what they show of the specific force along y and x, in g: sin beta and -sin gamma cos beta. Beyond 1 is 1. */
struct gyro_level gyro_level_of(double y_g, double x_g);

/* Rate of the level frame relative to inertial space, east, north, up: Earth, and the motion over a sphere of 6371 km. */
struct gyro_place {
    double east_radps, north_radps, up_radps;
};
struct gyro_place gyro_place_of(double latitude_deg, double speed_mps, double track_deg);

/* u1: -m1 beta less the part of the rate about the vertical that lies along x; turn_radps is its part by a turn. */
double gyro_law_level(double m1, const struct gyro_level *l, double up_radps, double turn_radps);

/* Of u2: the rate about the vertical as it lies along z. */
double gyro_law_vertical(const struct gyro_level *l, double up_radps, double turn_radps);

/* Of u2: the rate of the level frame along z, that keeps the azimuth angle alpha. */
double gyro_law_keep(const struct gyro_level *l, const struct gyro_place *w, double sin_a, double cos_a);

/* A turn from one angle to another: speeds up, goes, brakes. */
struct gyro_turn {
    int64_t from_ns;
    double from_rad, by_rad;
    double rate_radps, accel_radps2; /* with the sign of by_rad */
    double ramp_s, total_s;
};

/* The shorter way, of two alike the positive one; rate and acceleration above 0. */
struct gyro_turn gyro_turn_of(double from_rad, double to_rad, double rate_radps, double accel_radps2, int64_t t_ns);

/* Where it is, and at which rate; before it and after it at rest. */
double gyro_turn_at(const struct gyro_turn *turn, int64_t t_ns, double *rate_radps);

/* The angle by whole turns to (-pi, pi]; |a_rad| below 1e6. */
double gyro_wrap_rad(double a_rad);

#endif
