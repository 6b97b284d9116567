/* What the files of the fault engine share. Not for others. */
#ifndef PSABENCH_FAULT_INTERNAL_H
#define PSABENCH_FAULT_INTERNAL_H

#include "fault/fault.h"

extern const struct fault_table fault_sensor, fault_analog, fault_chip, fault_controller, fault_line, fault_link,
    fault_lab, fault_scpi, fault_receiver, fault_gyro;

static inline struct unit *fault_unit(const struct fault *f)
{
    return f->engine->bench->unit[f->point.unit];
}

/* Whether the other one is active, and lasts, at the same point. */
static inline bool fault_lasts_at(const struct fault *f, const struct fault *other)
{
    return other->id != 0 && other->state == FAULT_ACTIVE && !other->kind->once &&
           other->point.place == f->point.place && other->point.unit == f->point.unit &&
           other->point.index == f->point.index;
}

#endif
