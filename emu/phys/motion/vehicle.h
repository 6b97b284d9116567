/* The vehicle that carries the platform: parked, swaying or flying, in closed form of the instant.
 *
 * Frames: l is the level frame of the gyrocompass article, east, north, up (xi, eta, zeta): not the north-east-down of
 * earth.h. c is the vehicle: x to the right, y ahead, z up. From l: heading (clockwise seen from above), pitch (nose up), roll
 * (right side down), about -z, x, y in this order. It moves where its nose points, level, over a sphere: no sideslip, no
 * climb. A command starts from the angles, the speed and the latitude of its instant, so all are continuous (rates are not).
 * Plain struct, one thread; commands in order of time; an instant before the latest VEHICLE_HISTORY commands gets the
 * oldest of them. */
#ifndef PSABENCH_PHYS_MOTION_VEHICLE_H
#define PSABENCH_PHYS_MOTION_VEHICLE_H

#include "phys/motion/earth.h"

#include <stdbool.h>
#include <stdint.h>

#define VEHICLE_HISTORY          4u
#define VEHICLE_MG_MPS2          9.80665e-3 /* standard gravity */
#define VEHICLE_LATITUDE_MAX_DEG 85.0       /* a flight towards a pole goes on along this parallel */

/* Sines from the command on; a period of 0: none. Of the angles about their means, and of the acceleration along the level axes,
 * which the sensors feel. The way that it makes is left out: 0.3 mg over 20 s are 3 cm and turn l by 0.0003 deg/h. */
struct vehicle_sway {
    double pitch_arcmin, pitch_s;
    double roll_arcmin, roll_s;
    double east_mg, east_s; /* of standard gravity */
    double north_mg, north_s;
};

struct vehicle_cfg {
    double heading_deg, pitch_deg, roll_deg; /* at power-on; pitch and roll within +-30 */
    struct vehicle_sway sway;
    double turn_dps;   /* rate of a change of heading; above 0 */
    double tilt_dps;   /* of pitch and roll; above 0 */
    double accel_mps2; /* of a change of speed; above 0 */
};

/* Goes from one value to another at a constant rate, then stays. */
struct vehicle_ramp {
    int64_t from_ns;
    double from, to;
    double rate; /* a second, with its sign */
};

struct vehicle_sine {
    int64_t from_ns;
    double amplitude; /* rad or m/s^2; 0: none */
    double rate_radps;
};

struct vehicle_plan {
    int64_t from_ns;
    struct vehicle_ramp heading_rad, pitch_rad, roll_rad, speed_mps;
    struct vehicle_sine pitch_sway, roll_sway, push[2]; /* east, north */
    double latitude_rad;                                /* at from_ns */
};

struct vehicle {
    struct vehicle_cfg cfg;
    struct site site;
    struct vehicle_plan plan[VEHICLE_HISTORY];
    unsigned commands; /* so many so far; the latest is plan[commands % VEHICLE_HISTORY] */
};

struct vehicle_state {
    double heading_rad, pitch_rad, roll_rad; /* heading in (-pi, pi] */
    double speed_mps, latitude_rad;
    double C_lc[3][3];      /* columns: x_c, y_c, z_c */
    double w_lc_l_radps[3]; /* the vehicle relative to l */
    double w_il_l_radps[3]; /* l relative to inertial space: Earth and transport rate */
    double accel_l_mps2[3]; /* specific force less that of rest: dv/dt + (2 w_ie + w_el) x v + push */
};

/* Parked, level, heading north, without sway; rates of a change: 3 deg/s, 2 deg/s, 2 m/s^2 (E0). */
struct vehicle_cfg vehicle_default(void);

void vehicle_init(struct vehicle *v, const struct vehicle_cfg *cfg, const struct site *site);

/* New mean angles: the heading by the shorter way. */
void vehicle_attitude(struct vehicle *v, double heading_deg, double pitch_deg, double roll_deg, int64_t t_ns);

void vehicle_sway(struct vehicle *v, const struct vehicle_sway *sway, int64_t t_ns);

/* To a ground speed, not negative, and a track, which is the heading; 0 m/s: parked again when it has come to rest. */
void vehicle_fly(struct vehicle *v, double speed_mps, double track_deg, int64_t t_ns);

void vehicle_at(const struct vehicle *v, int64_t t_ns, struct vehicle_state *out);

/* What vehicle_at() says at t_ns it says of every later instant, if no command comes. */
bool vehicle_steady(const struct vehicle *v, int64_t t_ns);

#endif
