/* One unit of the bench: a board of any type, the sensors on its three channels, and its mounting on an instrument of the lab.
 *
 * The unit wires sensors to the board (board_io) and, if asked, the board's CAN side to a bus. A
 * sensor on channel X has the unit's axes (x, y, z), on Y (y, z, x), on Z (z, x, y). Several units share a lab. Owned
 * by the caller, about 300 kB, never moved after unit_init. One thread. */
#ifndef PSABENCH_UNIT_UNIT_H
#define PSABENCH_UNIT_UNIT_H

#include "phys/lab.h"
#include "phys/sensor/cvg.h"
#include "phys/sensor/fault.h"
#include "phys/sensor/mems.h"
#include "phys/sensor/quartz_batch.h"
#include "phys/sensor/series.h"
#include "unit/boards.h"

#define UNIT_AXES  BOARD_AXES
#define UNIT_TEMPS 4u /* sensors X, Y, Z, converter board */

/* Without a sensor the channel is shorted: 0 V or 0 A. Quartz gives a current: afe.input has to be current. Of RECORDED the
 * series is the output itself, V or A by afe.input; a MEMS or quartz sensor with a series feels its m/s^2. A CVG gives volts and
 * takes no series. */
enum unit_sensor { UNIT_NO_SENSOR, UNIT_MEMS, UNIT_QUARTZ, UNIT_RECORDED, UNIT_CVG };

struct unit_axis_cfg {
    enum unit_sensor sensor;
    struct mems_g mems;
    struct quartz_g quartz;
    bool quartz_given; /* the scenario says something of it */
    struct cvg_dps cvg;
    bool cvg_given;
    double at_m[3];       /* where it is in the unit, its case's axes */
    struct series series; /* m/s^2: specific force along the input axis, in place of the lab's; RECORDED: the output */
};

struct unit_cfg {
    const char *name; /* kept by pointer */
    const struct board_type *type;
    const void *profile;    /* of the type, checked by the caller; NULL: the type's default */
    struct board_cfg board; /* afe, noise scales, seed, serial */
    struct unit_axis_cfg axis[UNIT_AXES];
    double temp_degc[UNIT_TEMPS];     /* where the lab has no chamber */
    double tau_case_s, tau_element_s; /* in the chamber; 0: the chamber's own */
    const struct quartz_batch *batch; /* of which its quartz sensors are; kept by pointer; NULL: of none */
    struct lab_mounting mounting;
    uint8_t node; /* CAN node id, for those above */
};

/* Subscriber to the events of the board. Owned by the subscriber. */
struct unit_observer {
    void (*fn)(void *ctx, unsigned event, int64_t t_ns); /* as board_io.event; it may end any subscription */
    void *ctx;
    struct unit_observer *next;
};

struct unit {
    struct unit_cfg cfg;
    struct lab *lab;
    struct chamber_body body;
    bool on;                      /* it has power */
    uint32_t sensors_serial;      /* the board's, until its sensors are exchanged */
    int64_t warm_step[UNIT_AXES]; /* at which the sensor's temperature was taken */
    const struct board_type *type;
    struct board *board; /* in store, of the type */
    void *can;           /* in can_store; NULL: on no bus */
    char profile[32];    /* its name */
    struct mems mems[UNIT_AXES];
    struct quartz quartz[UNIT_AXES];
    struct cvg cvg[UNIT_AXES];
    struct chamber_play play[UNIT_AXES];           /* of the quartz sensors */
    struct sensor_fault *sensor_faults[UNIT_AXES]; /* unit_sample_until() before each change */
    double cos_alpha0[UNIT_AXES], sin_alpha0[UNIT_AXES];
    struct unit_observer *observers;     /* in order of subscription */
    struct unit_observer *next_observer; /* cursor of the event under way */
    union board_store store;
    union board_can_store can_store;
};

/* Names of enum lab_mount, NULL behind the last. */
extern const char *const unit_mounts[];

/* A PSA-2 of profile "article" at 25 degC with nominal chains, no sensor, no noise but the converters'. */
struct unit_cfg unit_default(const char *name);

/* Makes it one of another type: profile, analog chains and node id are the type's defaults. */
void unit_cfg_type(struct unit_cfg *cfg, const struct board_type *type);

void unit_init(struct unit *u, const struct unit_cfg *cfg, struct lab *lab, struct sched *s);

/* Once, before power-up: the board has a node on the bus from then on. */
void unit_connect(struct unit *u, const struct board_can_cfg *cfg, struct can_bus *bus, struct sched *s);

void unit_power_up(struct unit *u, int64_t t_ns); /* board, then its node */
void unit_power_down(struct unit *u, int64_t t_ns);
void unit_sample_until(struct unit *u, int64_t t_ns); /* before the physics change abruptly */
void unit_reseed(struct unit *u, uint64_t seed,
                 int64_t t_ns); /* noise from t_ns on and later starts alone; unit_sample_until() before it */
/* Other quartz sensors on the same board: those with this serial number of its batch, from the shelf, as warm as the ones that
 * they replace; from here on they give what they would give in a unit of that number. False, with the reason: they are of no
 * batch, one has a fault, the chamber is under way. unit_sample_until() before it. */
bool unit_exchange_sensors(struct unit *u, uint32_t serial, int64_t t_ns, const char **why);
/* Why it computes what no one looks at from t_ns on; NULL: it does not. */
const char *unit_why_eager(struct unit *u, int64_t t_ns);
struct trace *unit_trace(const struct unit *u);
struct can_node *unit_node(const struct unit *u); /* NULL: on no bus */
struct co_node *unit_co(const struct unit *u);    /* the same */

/* From the next event on, after the observers there are; the board computes events only while there is an observer. A frame
 * that is about to begin may begin untold. */
void unit_subscribe(struct unit *u, struct unit_observer *l);
void unit_unsubscribe(struct unit *u, struct unit_observer *l); /* harmless without a subscription */

/* What the sensor of a channel would give without noise: volts, or amperes if it is a quartz. Truth. */
double unit_sensor_out(struct unit *u, unsigned axis, int64_t t_ns);

/* How far the zero of a MEMS accelerometer or gyro has moved since t = 0, volts; 0 of other sensors. Truth. */
double unit_zero_moved_v(const struct unit *u, unsigned axis, int64_t t_ns);

#endif
