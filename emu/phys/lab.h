/* Everything around the boards: the Earth, the instruments, and the kinematics of a unit on one of them.
 *
 * A unit sits on the dividing head, on the rate table, on the gyro-stabilised platform or on the bench itself. Its mounting says
 * where: the lever arm from the instrument's centre (where the axes meet) to the unit's origin, in the mount's axes, and how
 * its case is askew there. Mount's axes: of the head x and y in the plane of turning, z its axis (head.h); of the table t
 * (table.h); of the bench x towards the site's azimuth and z down; of the platform p (platform.h), where the case is turned by
 * the tilt errors of the level sensors first. Sensors get the exact specific force and inertial rate at their own point; of a
 * lever arm on the platform the centripetal part alone.
 * Plain struct, one thread; never moved once bodies are in the chamber. */
#ifndef PSABENCH_PHYS_LAB_H
#define PSABENCH_PHYS_LAB_H

#include "phys/chamber.h"
#include "phys/motion/head.h"
#include "phys/motion/platform.h"
#include "phys/motion/table.h"
#include "phys/supply.h"

enum lab_mount { LAB_HEAD, LAB_TABLE, LAB_FIXED, LAB_PLATFORM };

struct lab_cfg {
    struct site site;
    struct head_cfg head;
    struct table_cfg table;
    struct chamber_cfg chamber;
    struct supply_cfg supply;
    struct platform_cfg platform;
    struct vehicle_cfg vehicle; /* under the platform */
};

struct lab {
    struct site site;
    struct head head;
    struct table table;
    struct chamber chamber;
    struct supply supply;
    struct pose bench;
    struct platform platform; /* if cfg.present */
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

/* A site of 9.81 m/s^2 that is not placed, a head without error, a table of no axes, no chamber, no supply; the figures of
 * those that are not there are their defaults. */
struct lab_cfg lab_default(void);

void lab_init(struct lab *l, const struct lab_cfg *cfg, uint64_t seed);

/* At at_m from the unit's origin, in its case's axes. */
void lab_kinematics(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], int64_t t_ns,
                    struct kinematics *out);

/* What an accelerometer at at_m measures by the convention of mems.h, a = -f, if it is set in the unit with the error alpha0
 * (by cosine and sine): a turn about the mount's z before the face. On the head without lever arms it is the head's own
 * arithmetic, and the fast way. */
void lab_sensor_mps2(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], double cos_alpha0,
                     double sin_alpha0, int64_t t_ns, double a_mps2[3]);

/* "head", "table", "fixed", "platform"; NULL for none. */
const char *lab_mount_name(enum lab_mount on);

#endif
