/* Rate table of one to three axes, outer to inner, with their errors.
 *
 * Frames: l is the bench's level frame (earth.h); the base is on it with a tilt; each axis turns what it carries about its
 * x, y or z, so that at zero angles all frames are parallel but for the errors; t is what the innermost axis carries, and
 * the units on it. All axes meet in one point, the origin of lever arms. An operator's angles are the readout's: a command
 * moves the axis to where the readout, without noise, shows the angle. Axes count from 0. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_MOTION_TABLE_H
#define PSABENCH_PHYS_MOTION_TABLE_H

#include "phys/motion/motion.h"
#include "phys/motion/pose.h"

#define TABLE_AXES_MAX 3u

struct table_axis_cfg {
    enum pose_axis along; /* of the frame that carries it */
    double rate_max_dps, accel_max_dps2;
    double angle_min_deg, angle_max_deg; /* true angles; both 0: without end */
    double nonorthogonality_arcsec;      /* off square to the axis outside it; of the outermost: no meaning */
    double wobble_arcsec;                /* the axis describes a cone of this half-angle as it turns */
    unsigned wobble_order;               /* times a turn; 0 is taken as 1 */
    double wobble_phase_deg;             /* of the cone at angle 0 */
    double readout_noise_arcsec_rms;     /* independent from one nanosecond to the next */
    double readout_resolution_arcsec;    /* 0: none */
    double readout_delay_s;              /* age of the angle that it shows */
    double readout_zero_arcsec;          /* added to the true angle */
};

struct table_cfg {
    unsigned axes; /* 0: there is no table */
    bool coarse;   /* it shows no angles */
    double base_tilt_x_arcsec, base_tilt_y_arcsec;
    struct table_axis_cfg axis[TABLE_AXES_MAX]; /* from the outermost */
};

/* Readout of an axis. */
struct table_reading {
    double angle_deg; /* with noise, resolution, delay and zero */
    double rate_dps;  /* of the servo: delayed, without noise */
    enum motion_mode mode;
    bool at_rest;
    double rest_in_s; /* 0 at rest; negative if this motion does not end */
};

/* Fault of a servo: a sine in the rate of an axis. Owned by its injector, linked in while it lasts. */
struct table_ripple {
    unsigned axis;
    double rate_radps, hz; /* amplitude */
    int64_t from_ns;       /* begins with rate and angle as they are without it */
    struct table_ripple *next;
};

/* Turns of an axis at an angle: kept while it rests. */
struct table_turns {
    double angle_rad;   /* NaN: none are kept */
    double cone_rad[2]; /* about the two axes across */
    struct pose_angle cone[2], angle;
};

struct table {
    struct table_cfg cfg;
    struct site site;
    uint64_t seed; /* of the readout's noise */
    struct motion axis[TABLE_AXES_MAX];
    double set_zero_rad[TABLE_AXES_MAX]; /* by table_zero() */
    struct table_ripple *ripples;
    struct pose base; /* at the site, tilted */
    struct table_turns turns[TABLE_AXES_MAX];
    int64_t cached_from_ns, cached_to_ns;
    struct pose cached;
};

/* Figures of a precise table (docs/instruments.md): one axis z; two: y carries z; three: z carries y carries x. */
struct table_cfg table_default(unsigned axes);

void table_init(struct table *t, const struct table_cfg *cfg, const struct site *site, uint64_t seed);

/* Commands as in motion.h, in degrees of the readout. Not MOTION_OK: nothing has changed. */
enum motion_result table_position(struct table *t, unsigned axis, double angle_deg, double rate_dps, int64_t t_ns);
enum motion_result table_rate(struct table *t, unsigned axis, double rate_dps, int64_t t_ns);
enum motion_result table_profile(struct table *t, unsigned axis, const double *times_s, const double *rates_dps,
                                 unsigned n, int64_t t_ns);
enum motion_result table_sine(struct table *t, unsigned axis, double amplitude_deg, double frequency_hz, int64_t t_ns);
enum motion_result table_stop(struct table *t, unsigned axis, int64_t t_ns);

/* What the readout, without noise and delay, shows above the true angle. */
double table_offset_deg(const struct table *t, unsigned axis);

/* From now on the readout, without noise, shows angle_deg where the axis is. */
enum motion_result table_zero(struct table *t, unsigned axis, double angle_deg, int64_t t_ns);

void table_ripple_add(struct table *t, struct table_ripple *r);
void table_ripple_remove(struct table *t, struct table_ripple *r); /* the axis is where it would be without */

/* Pure: the same instant shows the same noise. The axis exists. */
struct table_reading table_read(const struct table *t, unsigned axis, int64_t t_ns);

/* From which instant on table_read() can be asked. */
int64_t table_known_ns(const struct table *t, unsigned axis);

/* Truth. */
struct motion_state table_axis(const struct table *t, unsigned axis, int64_t t_ns);

/* The first instant after t_ns at which an acceleration may jump without a further command; INT64_MAX: none. */
int64_t table_smooth_ns(const struct table *t, int64_t t_ns);

/* Attitude and motion of t. Cached: valid until the next call. */
const struct pose *table_pose(struct table *t, int64_t t_ns);

#endif
