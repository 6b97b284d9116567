/* One unit of the bench: a PSA-2 board, the sensors on its three channels, and its seat on an instrument of the lab.
 *
 * The unit wires sensors to the board (psa2_io.accel, psa2_io.temp_degc); who wants its frames sets the two callbacks. A
 * sensor on channel X has the unit's axes (x, y, z), on Y (y, z, x), on Z (z, x, y). Several units share a lab. Owned
 * by the caller, about 300 kB, never moved after unit_init. One thread. */
#ifndef PSABENCH_BOARD_UNIT_H
#define PSABENCH_BOARD_UNIT_H

#include "board/psa2.h"
#include "phys/lab.h"
#include "phys/mems.h"
#include "phys/quartz.h"
#include "phys/sensor_fault.h"

#define UNIT_AXES  3u
#define UNIT_TEMPS 4u /* sensors X, Y, Z, converter board */

/* Without a sensor the channel is shorted: 0 V or 0 A. Quartz gives a current: afe.input has to be current. */
enum unit_sensor { UNIT_NO_SENSOR, UNIT_MEMS, UNIT_QUARTZ };

struct unit_axis_cfg {
    enum unit_sensor sensor;
    struct mems_g mems;
    struct quartz_g quartz;
    bool quartz_given; /* the scenario says something of it */
    double at_m[3];    /* where it is in the unit, its case's axes */
};

struct unit_cfg {
    const char *name;                   /* kept by pointer */
    const struct psa2_profile *profile; /* checked by the caller: psa2_profile_check(); NULL: "article" */
    struct psa2_unit_cfg board;         /* afe, noise scales, seed, serial */
    struct unit_axis_cfg axis[UNIT_AXES];
    double temp_degc[UNIT_TEMPS];     /* where the lab has no chamber */
    double tau_case_s, tau_element_s; /* in the chamber; 0: the chamber's own */
    struct lab_seat seat;
    uint8_t node; /* CAN node id, for those above */
};

/* Who wants to hear of the board's events. Owned by the listener. */
struct unit_listener {
    void (*fn)(void *ctx, enum psa2_event e, int64_t t_ns); /* as psa2_io.event; it may end any listening */
    void *ctx;
    struct unit_listener *next;
};

struct unit {
    struct unit_cfg cfg;
    struct lab *lab;
    struct chamber_body body;
    int64_t warm_step[UNIT_AXES]; /* at which the sensor's temperature was taken */
    struct psa2 board;
    struct mems mems[UNIT_AXES];
    struct quartz quartz[UNIT_AXES];
    struct sensor_fault *sensor_faults[UNIT_AXES]; /* psa2_sample_until() before each change */
    double cos_alpha0[UNIT_AXES], sin_alpha0[UNIT_AXES];
    void *ctx;
    void (*frame)(void *ctx, const struct psa2_frame *f, int64_t t_ns);
    void (*fault)(void *ctx, uint16_t code, int64_t t_ns);
    struct unit_listener *listeners; /* in order of coming */
    struct unit_listener *told_next; /* cursor of the event under way */
};

/* A board of profile "article" at 25 degC with nominal chains, no sensor, no noise but the converters'. */
struct unit_cfg unit_default(const char *name);

void unit_init(struct unit *u, const struct unit_cfg *cfg, struct lab *lab, struct sched *s);

/* From the next event on, after those who listen already; the board computes events only while somebody listens. A frame
 * that is about to begin may begin untold. */
void unit_listen(struct unit *u, struct unit_listener *l);
void unit_unlisten(struct unit *u, struct unit_listener *l); /* harmless for one that does not listen */

/* What the sensor of a channel measures, a = -f on its own axes: at rest the projections of gravity. Truth. */
void unit_gravity_mps2(struct unit *u, unsigned axis, int64_t t_ns, double a_mps2[3]);

/* What the sensor of a channel would give without noise: volts, or amperes if it is a quartz. Truth. */
double unit_sensor_out(struct unit *u, unsigned axis, int64_t t_ns);

#endif
