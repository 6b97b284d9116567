/* The list of legs, and what it becomes: speed, height, track and angle of attack as functions of time.
 *
 * The aircraft begins parked at the site, and is at rest again when the last leg is over. Its nose is along its track: no wind
 * in flight, no sideslip. Angles clockwise from above, nose up, right side down. */
#ifndef PSABENCH_PHYS_FLIGHT_PLAN_H
#define PSABENCH_PHYS_FLIGHT_PLAN_H

#include "phys/flight/channel.h"
#include "phys/flight/swing.h"

#include <stdbool.h>
#include <stddef.h>

#define FLIGHT_LEGS_MAX     64u
#define FLIGHT_SWINGS       (2u * FLIGHT_LEGS_MAX)
#define FLIGHT_BANK_MAX_DEG 60.0

enum flight_leg_kind {
    FLIGHT_PARK,    /* s */
    FLIGHT_TAXI,    /* m, along the track, the change of speed included */
    FLIGHT_STOP,    /* s at rest, after it has braked */
    FLIGHT_TURN,    /* deg, to the right */
    FLIGHT_TAKEOFF, /* m/s, at which the nose comes up */
    FLIGHT_CLIMB,   /* m */
    FLIGHT_DESCEND, /* m */
    FLIGHT_FLY,     /* s, straight and level */
    FLIGHT_SNAKE,   /* s, the track swings about its mean */
    FLIGHT_LAND,    /* m/s at touchdown: down to the field, nose down, braked */
    FLIGHT_KINDS
};

/* Parameters of a leg; which kind has which, with defaults: flight_kind(). */
enum flight_param {
    FLIGHT_SPEED_MPS,     /* ground speed at the end; in flight 0: as it is */
    FLIGHT_ACCEL_MPS2,    /* of a change of speed, along the track */
    FLIGHT_RATE_MPS,      /* of a change of height */
    FLIGHT_BANK_DEG,      /* of a turn in flight */
    FLIGHT_RADIUS_M,      /* of a turn on the ground */
    FLIGHT_AMPLITUDE_DEG, /* of a snake's track */
    FLIGHT_PERIOD_S,
    FLIGHT_ROLL_DEG, /* sway, amplitude */
    FLIGHT_ROLL_S,   /* period */
    FLIGHT_PITCH_DEG,
    FLIGHT_PITCH_S,
    FLIGHT_PARAMS
};

struct flight_leg {
    enum flight_leg_kind kind;
    double value;                /* in the kind's unit */
    double param[FLIGHT_PARAMS]; /* those that the kind has */
};

struct flight_plan_cfg {
    double heading_deg;         /* at the beginning */
    double jerk_mps3;           /* longest time derivative of the acceleration dv/dt */
    double roll_rate_dps;       /* of bank into and out of turns */
    double angle_of_attack_deg; /* in flight: pitch above the path */
    unsigned legs;
    struct flight_leg leg[FLIGHT_LEGS_MAX];
};

struct flight_kind {
    const char *key; /* of its value in a list */
    uint32_t params; /* bits by enum flight_param */
    double standard[FLIGHT_PARAMS];
};

/* A table row; and a leg of that kind with its defaults. */
const struct flight_kind *flight_kind(enum flight_leg_kind kind);
struct flight_leg flight_leg_of(enum flight_leg_kind kind, double value);

struct flight_plan {
    struct flight_plan_cfg cfg;
    struct channel speed_mps, height_m, track_rad, attack_rad;
    unsigned swings;
    struct swing swing[FLIGHT_SWINGS];
    int64_t leg_ns[FLIGHT_LEGS_MAX + 1]; /* beginnings; the last: end of the flight */
    bool banked[FLIGHT_LEGS_MAX];        /* its turns are in flight */
};

/* Which leg cannot be flown, which of its keys is at fault, and "expected ..., got ...". */
struct flight_error {
    unsigned leg;
    const char *key;
    char text[160];
};

/* False, with the error. height_m: of the field. */
bool flight_plan_make(struct flight_plan *p, const struct flight_plan_cfg *cfg, double height_m,
                      struct flight_error *e);

/* The leg under way; of the time after the flight the last one. */
unsigned flight_plan_leg(const struct flight_plan *p, int64_t t_ns);

/* The next instant at which one of the functions is another polynomial or sine; INT64_MAX: none. */
int64_t flight_plan_next_ns(const struct flight_plan *p, int64_t t_ns);

/* Sum of the swings of a kind. */
struct jet flight_plan_swing(const struct flight_plan *p, enum swing_of of, int64_t t_ns);

#endif
