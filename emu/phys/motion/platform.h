/* Two-axis gyro-stabilised platform with a dynamically tuned gyroscope, of the gyrocompass article (docs/instruments.md).
 *
 * The outer axis z_c is the vehicle's; the suspension axis x_p is across it; the gyroscope makes the platform turn about x_p
 * and z_p, relative to inertial space, at the rates of its torquers less its drifts. Frames: l east, north, up (vehicle.h);
 * p: x_p, y_p along, z_p normal. From l: alpha about z (counter-clockwise seen from above: the azimuth of y_p is
 * -alpha), beta about x, gamma about y, in this order. gamma is no state: x_p is across z_c. q, the gimbal angle, is
 * x_p's from x_c about z_c: for a level platform alpha + heading.
 *
 * Integrated on a fixed grid from power-on, computed on demand: torques and drifts are held over a step. A command
 * that comes after a look ahead is still in time: the steps after it are computed again. So nothing depends on who asks
 * when. Plain struct, one thread; commands in order of time. An instant up to PLATFORM_HISTORY - 2 steps back is answered. */
#ifndef PSABENCH_PHYS_MOTION_PLATFORM_H
#define PSABENCH_PHYS_MOTION_PLATFORM_H

#include "base/rng.h"
#include "phys/motion/follow.h"
#include "phys/motion/pose.h"
#include "phys/motion/vehicle.h"

#define PLATFORM_HISTORY  128u
#define PLATFORM_STOP_DEG 45.0 /* of beta: it stays there until it is turned back */

enum platform_axis { PLATFORM_LEVEL, PLATFORM_AZIMUTH, PLATFORM_AXES }; /* torquers: about x_p, about z_p */

struct platform_cfg {
    bool present;
    uint32_t step_ns; /* 1 to 20 ms; below 5 ms less than half a second back is known */
    double alpha0_deg, beta0_deg;
    double drift_degph[PLATFORM_AXES]; /* systematic, about x_p (the article's first) and z_p */
    double unbalance_degph_per_g
        [PLATFORM_AXES]; /* of the rotor's mass along its axis: by the force along the drift's axis */
    double quadrature_degph_per_g[PLATFORM_AXES]; /* by the force along the other of the two axes */
    double gm_sigma_degph, gm_tau_s;              /* Gauss-Markov drift of each axis, independent; sigma 0: none */
    bool gm_from_zero;                            /* else it starts with a draw of its stationary distribution */
    double torquer_scale[PLATFORM_AXES];          /* relative error */
    double torquer_limit_dps;
    struct follow_cfg servo;     /* of both motors */
    double level_tilt_arcmin[2]; /* of the level sensors: they show so much more beta, and gamma */
    double level_repeat_arcmin;  /* the same, drawn for each setting */
    double angle_zero_arcmin;    /* the gimbal's angle sensor shows so much more q */
    double angle_set_arcmin;     /* random, of a setting: error of the angle that the azimuth loop works with */
    double angle_read_arcmin;    /* random, of a setting: error of what the encoder tells */
    double angle_step_arcsec;    /* of the encoder; 0: none */
};

/* At a grid point; what is held from there on. */
struct platform_node {
    double alpha_rad, beta_rad;
    double sin_a, cos_a, sin_b, cos_b;
    double rate_radps[2], rate_end_radps[2]; /* of alpha, beta at the two ends of the step that begins here */
    double torque_radps[PLATFORM_AXES];      /* asked, within the limit */
    double torquer_gain[PLATFORM_AXES];      /* 1; a fault makes it 0 */
    double drift_step_radps[PLATFORM_AXES];  /* a fault's */
    double by_force_radps[PLATFORM_AXES];    /* of the specific force here */
    double behind_rad[PLATFORM_AXES],
        carrier_radps[PLATFORM_AXES]; /* of the servo: rotor from platform; what carries it */
    double gm_radps[PLATFORM_AXES];
    struct rng gm[PLATFORM_AXES];
};

/* What was drawn for a setting. */
struct platform_setting {
    int64_t from_ns;
    struct pose level; /* how the block of the level sensors is on the platform */
    double set_rad, read_rad;
};

struct platform {
    struct platform_cfg cfg;
    struct vehicle vehicle; /* commands: by way of platform_vehicle() */
    struct rng draws;
    struct platform_setting setting, setting_before;
    double gm_keep, gm_kick_radps; /* of a step */
    double step_s;
    bool feels_force; /* its drift depends on it */
    bool stuck;       /* the angle sensor */
    double stuck_rad;
    struct vehicle_state ground;
    int64_t ground_from_ns, ground_to_ns; /* while it holds */
    int64_t force_ns;                     /* of force_mps2; -1: none */
    double force_mps2[3];
    int64_t newest; /* grid point of the newest node */
    struct platform_node node[PLATFORM_HISTORY];
};

/* Truth. */
struct platform_state {
    double alpha_rad, beta_rad, gamma_rad; /* alpha goes on over turns */
    double alpha_radps, beta_radps, gamma_radps;
    double q_rad; /* in (-pi, pi] */
    double w_ip_p_radps[3];
    double drift_radps[PLATFORM_AXES];  /* all of it */
    double torque_radps[PLATFORM_AXES]; /* asked, within the limit */
    double C_lp[3][3];
};

/* The article's figures and ours (docs/instruments.md); not present. */
struct platform_cfg platform_default(void);

void platform_init(struct platform *p, const struct platform_cfg *cfg, const struct vehicle_cfg *vehicle,
                   const struct site *site, uint64_t seed);

/* Rates asked of the torquers, from the first grid point not before t_ns until the next call. True: one was over the limit. */
bool platform_torque(struct platform *p, double u1_radps, double u2_radps, int64_t t_ns);

/* A new setting begins: draws the errors of level, setting and reading. The first is drawn at power-on. */
void platform_reposition(struct platform *p, int64_t t_ns);

/* Drift and errors of settings come from another seed from the first grid point not before t_ns on; the present setting stays. */
void platform_reseed(struct platform *p, uint64_t seed, int64_t t_ns);

/* The vehicle, to be given a command for t_ns: vehicle_fly(platform_vehicle(p, t_ns), ..., t_ns). */
struct vehicle *platform_vehicle(struct platform *p, int64_t t_ns);

void platform_at(struct platform *p, int64_t t_ns, struct platform_state *out);

/* The first instant after t_ns at which a rate may jump without a further command: the next grid point. */
int64_t platform_smooth_ns(const struct platform *p, int64_t t_ns);

/* The angle sensor's q: as the azimuth loop has it, with zero and setting error; as the encoder tells it, with zero, reading
 * error and step. Both in (-pi, pi]. */
double platform_servo_rad(struct platform *p, int64_t t_ns);
double platform_encoder_rad(struct platform *p, int64_t t_ns);

/* How the block of the level sensors is on the platform, by its tilt errors: p in the place of n. */
const struct pose *platform_level(const struct platform *p, int64_t t_ns);

/* Specific force in p at the centre, where the axes meet: at rest g (-sin g cos b, sin b, cos g cos b). */
void platform_force_mps2(struct platform *p, int64_t t_ns, double f_mps2[3]);

/* Attitude and rate of p; accelerations of the angles are left out. */
void platform_pose(struct platform *p, int64_t t_ns, struct pose *out);

/* Faults: gain of a torquer (1: whole, 0: dead) and a step of drift, from the grid point on; an angle sensor that tells what it
 * told at t_ns. */
void platform_set_torquer(struct platform *p, enum platform_axis axis, double gain, int64_t t_ns);
void platform_step_drift(struct platform *p, enum platform_axis axis, double degph, int64_t t_ns);
void platform_stick(struct platform *p, bool stuck, int64_t t_ns);

#endif
