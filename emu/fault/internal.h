/* What the files of the fault engine share. Not for others. */
#ifndef PSABENCH_FAULT_INTERNAL_H
#define PSABENCH_FAULT_INTERNAL_H

#include "fault/fault.h"

extern const struct fault_table fault_sensor, fault_analog, fault_chip, fault_controller, fault_line, fault_link,
    fault_supply, fault_platform;

static inline struct unit *fault_unit(const struct fault *f)
{
    return f->engine->bench->unit[f->point.unit];
}

/* fault/check.c: whether the values are those of its kind; false with the error. */
bool fault_values_fit(const struct fault *f, struct control_error *why);

#endif
