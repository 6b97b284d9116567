/* Optical dividing head with a unit on its mount, in the gravity of the site.
 *
 * The head turns the mount about a horizontal axis, Oz of the mount; at angle alpha gravity has in the mount the projections
 * (12) of the article: ax = -g sin(alpha + alpha0), ay = -g cos(alpha + alpha0), az = 0. alpha0 belongs to the
 * sensor and tilts it before the face is applied, so that a face turns the sensor about its own axis Ox: this is what makes
 * reversal separate alpha0 from ky (sources instruments 2.4). Plain struct, one thread. A converter may ask for an instant
 * shortly before the latest command: it gets the state of then, if the command before was over. */
#ifndef PSABENCH_PHYS_MOTION_HEAD_H
#define PSABENCH_PHYS_MOTION_HEAD_H

#include "base/detmath.h"
#include "base/rng.h"
#include "phys/motion/earth.h"
#include "phys/motion/motion.h"

#include <stdbool.h>
#include <stdint.h>

#define HEAD_QUARTER_RAD 1.5707963267948966

enum head_face {
    HEAD_DIRECT,        /* sensor axes = mount axes */
    HEAD_REVERSED,      /* turned by 180 deg about Ox: y and z change sign */
    HEAD_SIDE,          /* turned by 90 deg about Ox: Oz takes the place of Oy */
    HEAD_SIDE_REVERSED, /* the side face turned by a further 180 deg about Ox */
    HEAD_FACES
};

struct head_cfg {
    double resolution_arcsec;        /* step of the scale: commands and readings are multiples of it; 0: none */
    double setting_error_arcsec_rms; /* random, drawn at each turn */
    double periodic_arcsec;          /* error of the divided circle: amplitude of sin(periodic_order * angle) */
    unsigned periodic_order;         /* 0 is taken as 1 */
    double mount_error_arcsec_rms;   /* random tilt in the plane of turning, drawn at each mounting */
    double turn_s;                   /* duration of a turn, whatever its angle; 0: at once */
};

struct head {
    struct head_cfg cfg;
    struct site site;
    struct rng error;
    enum head_face face, face_before;
    int64_t face_ns;         /* of the latest mounting */
    double scale_rad;        /* what the operator set */
    double from_rad, to_rad; /* true angle of the mount before and after the turn */
    double setting_rad;      /* error drawn at the last turn */
    bool stuck;              /* of a faulty one: it stays where it is */
    double slip_step_rad;    /* of a faulty one: each turn leaves the mount so much short of the scale; 0: none */
    double slip_from_rad, slip_to_rad;  /* by which the scale is ahead of the mount, before and after the turn */
    double mount_rad, mount_before_rad; /* error drawn at the latest mounting and the one before */
    int64_t start_ns, end_ns;           /* of the turn */
    bool rest_known;                    /* gravity at rest, until the next command */
    double rest_g_mps2[3];
    struct det_near near; /* of an angle in motion */
};

void head_init(struct head *h, const struct head_cfg *cfg, const struct site *site, struct rng error);

/* Starts a turn to the angle; 395 deg and 35 deg are the same attitude, reached by different turns. */
void head_turn(struct head *h, double angle_deg, int64_t t_ns);

/* Puts the unit on the mount with another face, at once; the angle stays. */
void head_mount(struct head *h, enum head_face face, int64_t t_ns);

/* Faults. A head that sticks stops at once and stays; a turn then takes its time and moves nothing, and the scale shows it. In one
 * that slips each turn leaves the mount short of the scale by so much, one after another; the first turn without makes it good. */
void head_stick(struct head *h, bool stuck, int64_t t_ns);
void head_slip(struct head *h, double step_deg);

enum head_face head_face(const struct head *h, int64_t t_ns);
bool head_at_rest(const struct head *h, int64_t t_ns);
int64_t head_rest_ns(const struct head *h); /* when the present turn ends or the last one ended */

/* The first instant after t_ns at which the acceleration may jump without a further command; INT64_MAX: none. */
int64_t head_smooth_ns(const struct head *h, int64_t t_ns);

/* True angle of the mount, the unit's tilt of mounting included: the bench's truth. */
double head_angle_rad(const struct head *h, int64_t t_ns);

/* The same with rate and acceleration. */
struct motion_state head_motion(const struct head *h, int64_t t_ns);

/* What the operator reads off the scale, degrees, at the resolution of the scale. */
double head_read_deg(const struct head *h, int64_t t_ns);

/* Projections of gravity on the mount's axes, alpha0 = 0. Cached at rest: the hot path of a resting head is a copy. */
void head_gravity_mps2(struct head *h, int64_t t_ns, double a_m_mps2[3]);

/* The same for n instants in a row; returns how many are written: 1 if it rests throughout, else n. */
unsigned head_gravity_row_mps2(struct head *h, const int64_t *t_ns, unsigned n, double a_m_mps2[][3]);

/* Projections on the axes of a sensor that was set with error alpha0 (given by cosine and sine) and mounted with the face. */
void head_sensor_mps2(enum head_face face, double cos_alpha0, double sin_alpha0, const double a_m_mps2[3],
                      double a_s_mps2[3]);

/* Angle about Ox by which a face turns the unit: 0, 180, -90 and +90 deg. */
double head_face_rad(enum head_face face);

/* "direct", "reversed", "side", "side_reversed"; NULL for none. */
const char *head_face_name(enum head_face face);

#endif
