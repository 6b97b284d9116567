/* An aircraft as a function of time over the WGS 84 ellipsoid: position, velocity, attitude, exact specific force and rate.
 *
 * Frames: n is north-east-down at the aircraft (earth.h); b is the aircraft's, x ahead, y to the right, z down: parked with its
 * heading along the bench's x it is the bench's level frame. Velocities and accelerations of the Earth-fixed path come as east,
 * north, up. Speed, height, track and pitch are closed forms of time (plan.h); latitude and longitude are their integral, on
 * nodes that flight_init() computes, between them a quintic of value and two derivatives: within 1e-5 m. Gravity is that
 * of the level ellipsoid along its normal, plus what the site's differs from it. State is a function of time alone: any order of
 * calls gives the same bits. Plain struct, about 300 kB, one thread; nothing is allocated. */
#ifndef PSABENCH_PHYS_FLIGHT_FLIGHT_H
#define PSABENCH_PHYS_FLIGHT_FLIGHT_H

#include "phys/flight/baro.h"
#include "phys/flight/plan.h"
#include "phys/motion/pose.h"

#define FLIGHT_NODES            2048u
#define FLIGHT_LATITUDE_MAX_DEG 85.0

struct flight_cfg {
    bool present; /* false: there is no aircraft */
    struct flight_plan_cfg plan;
    struct baro_cfg baro;
};

/* Latitude and longitude with two time derivatives. */
struct flight_node {
    int64_t t_ns;
    double lat[3], lon[3];
};

struct flight {
    struct flight_cfg cfg;
    struct site site;
    double anomaly_mps2; /* of gravity */
    struct flight_plan plan;
    struct baro baro;
    unsigned nodes;
    struct flight_node node[FLIGHT_NODES];
};

struct flight_state {
    double lat_rad, lon_rad, h_m;
    double v_enu_mps[3];
    double a_enu_mps2[3];                    /* time derivatives of v_enu_mps: in the turning frame */
    double heading_rad, pitch_rad, roll_rad; /* heading in (-pi, pi] */
    struct pose pose;                        /* C_nb, w_ib_b_radps, dw_ib_b_radps2 */
    double f_b_mps2[3];                      /* specific force at the origin of b */
    unsigned leg;                            /* of the scenario's list */
};

/* No flight; jerk 4 m/s^3, roll rate 8 deg/s, angle of attack 4 deg (E0). */
struct flight_cfg flight_default(void);

/* site: placed. False, with the error: nothing may be asked of it. */
bool flight_init(struct flight *f, const struct flight_cfg *cfg, const struct site *site, struct flight_error *e);

/* Of a time after the last leg: at rest where it ended. */
void flight_at(const struct flight *f, int64_t t_ns, struct flight_state *out);

/* Shown by the barometric altimeter. */
double flight_baro_m(const struct flight *f, int64_t t_ns);

/* Up to which instant after t_ns rate and force have all derivatives; INT64_MAX: for good. */
int64_t flight_smooth_ns(const struct flight *f, int64_t t_ns);

#endif
