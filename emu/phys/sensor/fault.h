/* Sensor faults: a list, each working on the output of those added before it.
 *
 * The output is volts or amperes, as the sensor gives it, and so are the values. A fault is a plain struct owned by
 * its injector, linked in while it lasts; an empty list costs one comparison. Pure but for the noise's stream. One
 * thread. */
#ifndef PSABENCH_PHYS_SENSOR_FAULT_H
#define PSABENCH_PHYS_SENSOR_FAULT_H

#include "base/rng.h"

#include <stdbool.h>
#include <stdint.h>

enum sensor_fault_kind {
    SENSOR_STUCK,      /* the output stays at value */
    SENSOR_BIAS,       /* value is added */
    SENSOR_DRIFT,      /* value per second is added, from from_ns on */
    SENSOR_SCALE,      /* the deviation from zero is multiplied by (1 + value) */
    SENSOR_NOISE,      /* white noise of one-sided density value is added */
    SENSOR_SATURATION, /* the output does not leave value ... value_high */
    SENSOR_FAULTS
};

struct sensor_fault {
    enum sensor_fault_kind kind;
    double value, value_high;
    double zero;     /* output of the sensor without acceleration: a wrong scale turns about it */
    int64_t from_ns; /* before it no effect */
    struct rng noise;
    /* read-only outside sensor/fault.c */
    double held;     /* noise of the present pull */
    int64_t held_ns; /* of held; negative before the first pull */
    struct sensor_fault *next;
};

/* Links in as the last. kind, value, value_high, zero, from_ns and noise are filled in by the caller. */
void sensor_fault_add(struct sensor_fault **list, struct sensor_fault *f);
void sensor_fault_remove(struct sensor_fault **list, struct sensor_fault *f); /* harmless if it is not linked */

/* The faulty output for the output `out`; t_ns never earlier than the last call. */
double sensor_fault_out(struct sensor_fault *list, double out, int64_t t_ns);

#endif
