/* What the files of the fault engine share. Not for others. */
#ifndef PSABENCH_CONTROL_FAULT_PARTS_H
#define PSABENCH_CONTROL_FAULT_PARTS_H

#include "control/fault.h"

#define FAULT_BIT(i)  (UINT64_C(1) << (i))
#define FAULT_PPM_MAX 500000.0 /* of a chip's clock */

/* What is less changes no code of any board: one of PSA-2 is 10 V / 2^23 = 1.19 uV at the load, or more by the tolerances of
 * the chain. Boards of coarser codes want more: board_type.code_v. */
#define FAULT_LEAST_V   2e-6
#define FAULT_LEAST_PPM 1.0

extern const struct fault_table fault_sensor, fault_analog, fault_chip, fault_controller, fault_line, fault_link,
    fault_supply, fault_platform;

static inline bool fault_given(const struct fault *f, enum fault_arg arg)
{
    return (f->given & FAULT_BIT(arg)) != 0;
}

static inline struct unit *fault_unit(const struct fault *f)
{
    return f->engine->bench->unit[f->point.unit];
}

/* commands_fault.c: of the arguments of fault.add. */
const char *fault_arg_name(enum fault_arg arg);
const char *fault_arg_what(enum fault_arg arg);

/* fault_check.c: whether the values are those of its kind; false with the refusal. */
bool fault_values_fit(const struct fault *f, struct control_refusal *why);

#endif
