/* Sensor faults: a list, each working on the output of those added before it.
 *
 * The output is volts or amperes, as the sensor gives it, and so are the values. A fault is a plain struct owned by
 * its injector, linked in while it lasts; an empty list costs one comparison. Pure. */
#ifndef PSABENCH_PHYS_SENSOR_FAULT_H
#define PSABENCH_PHYS_SENSOR_FAULT_H

#include "base/draws.h"
#include "base/looks.h"

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
    struct draws noise;
    struct sensor_fault *next; /* read-only outside sensor/fault.c */
};

/* Links in as the last. kind, value, value_high, zero, from_ns and noise are filled in by the caller. */
void sensor_fault_add(struct sensor_fault **list, struct sensor_fault *f);
void sensor_fault_remove(struct sensor_fault **list, struct sensor_fault *f); /* harmless if it is not linked */

/* Makes a row of outputs the faulty ones. */
void sensor_fault_row(const struct sensor_fault *list, const struct looks *at, double *out);

#endif
