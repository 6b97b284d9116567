/* Everything around the boards: the Earth, the instruments, and the kinematics of a unit on one of them.
 *
 * A unit sits on the dividing head, on the rate table, on the gyro-stabilised platform, in an aircraft or on the bench itself. Its mounting says
 * where: the lever arm from the instrument's centre (where the axes meet) to the unit's origin, in the mount's axes, and how
 * its case is askew there. Mount's axes: of the head x and y in the plane of turning, z its axis (head.h); of the table t
 * (table.h); of the bench x towards the site's azimuth and z down; of the platform p (platform.h), where the case is turned by
 * the tilt errors of the level sensors first; of the aircraft b (flight/flight.h). Sensors get the exact specific force and inertial rate at their own point; of a
 * lever arm on the platform the centripetal part alone.
 * Plain struct, one thread; never moved once bodies are in the chamber. */
#ifndef PSABENCH_PHYS_LAB_H
#define PSABENCH_PHYS_LAB_H

#include "phys/chamber.h"
#include "phys/flight/flight.h"
#include "phys/motion/head.h"
#include "phys/motion/platform.h"
#include "phys/motion/table.h"
#include "phys/sensor/magnetic.h"
#include "phys/supply.h"

enum lab_mount { LAB_HEAD, LAB_TABLE, LAB_FIXED, LAB_PLATFORM, LAB_FLIGHT };

struct lab_cfg {
    struct site site;
    struct head_cfg head;
    struct table_cfg table;
    struct chamber_cfg chamber;
    struct supply_cfg supply;
    struct platform_cfg platform;
    struct vehicle_cfg vehicle;   /* under the platform */
    struct magnetic_cfg magnetic; /* on the vehicle */
    struct flight_cfg flight;     /* can be flown: flight_init() */
};

#define LAB_ROW 32u /* instants of a row that are kept */

/* -f in a mount's axes at its centre, at the instants that the last row of looks asked for: three converters on one clock, and
 * units beside each other, ask for the same ones. A row is asked for before the physics change, never after for the same instants. */
struct lab_row {
    enum lab_mount on;
    unsigned n; /* 0: none */
    int64_t t_ns[LAB_ROW];
    double a_mps2[LAB_ROW][3];
};

/* A case that is askew, as it was last: the same angles give the same pose. */
struct lab_tilt {
    double misalignment_rad[3];
    struct pose pose;
};

/* The aircraft as it was asked for last. */
struct lab_aircraft {
    int64_t t_ns; /* negative: not yet */
    struct flight_state at;
};

struct lab {
    struct site site;
    struct head head;
    struct table table;
    struct chamber chamber;
    struct supply supply;
    struct pose bench;
    struct platform platform; /* if cfg.present */
    struct magnetic magnetic; /* if cfg.present */
    struct flight flight;     /* if cfg.present */
    struct lab_aircraft aircraft;
    struct lab_row row;
    struct lab_tilt tilt;
};

/* A unit's place. All zero: in the centre of the head, square. */
struct lab_mounting {
    enum lab_mount on;
    double lever_m[3];          /* from the instrument's centre to the unit's origin, mount's axes */
    double misalignment_rad[3]; /* turns of the case about its x, then y, then z, after the face */
};

/* Specific force and rate relative to inertial space at a point of the unit, in the axes of its case. */
struct kinematics {
    double f_mps2[3];
    double w_radps[3];
};

/* A site of 9.81 m/s^2 that is not placed, a head without error, a table of no axes, no chamber, no supply, no aircraft; the figures of
 * those that are not there are their defaults. */
struct lab_cfg lab_default(void);

void lab_init(struct lab *l, const struct lab_cfg *cfg, uint64_t seed);

/* Random errors of the instruments come from another seed from t_ns on: settings of the head, readings of the table, drift and
 * settings of the platform. */
void lab_reseed(struct lab *l, uint64_t seed, int64_t t_ns);

/* At at_m from the unit's origin, in its case's axes. */
void lab_kinematics(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], int64_t t_ns,
                    struct kinematics *out);

/* Up to which instant after t_ns rate and force of a unit there are smooth functions of time, if no command comes; INT64_MAX: for
 * good. Who integrates them cuts there. Of a moving vehicle the platform's grid alone. */
int64_t lab_smooth_ns(const struct lab *l, const struct lab_mounting *mounting, int64_t t_ns);

/* At the centre of its mount, where lever arms play no part. */
bool lab_is_centred(const struct lab_mounting *mounting, const double at_m[3]);

/* Where an accelerometer is, and how it was set. */
struct lab_sensor {
    const struct lab_mounting *mounting; /* of its unit */
    const double *at_m;                  /* from the unit's origin, its case's axes */
    double cos_alpha0, sin_alpha0;       /* of the error of setting: a turn about the mount's z before the face */
};

/* What it measures at n instants in a row by the convention of mems.h, a = -f. Returns how many are written: 1 if the first holds
 * for all, else n. On the head without lever arms it is the head's own arithmetic, and the fast way. */
unsigned lab_sensor_row_mps2(struct lab *l, const struct lab_sensor *s, const int64_t *t_ns, unsigned n,
                             double a_mps2[][3]);

/* The same at one instant. */
void lab_sensor_mps2(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], double cos_alpha0,
                     double sin_alpha0, int64_t t_ns, double a_mps2[3]);

/* State of the aircraft, if there is one; valid until the next call. */
const struct flight_state *lab_aircraft(struct lab *l, int64_t t_ns);

/* "head", "table", "fixed", "platform", "flight"; NULL for none. */
const char *lab_mount_name(enum lab_mount on);

#endif
