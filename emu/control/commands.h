/* The tables of the commands, one for each file commands_*.c, and what they share. */
#ifndef PSABENCH_CONTROL_COMMANDS_H
#define PSABENCH_CONTROL_COMMANDS_H

#include "control/control.h"

extern const struct control_table commands_bench, commands_head, commands_table, commands_chamber, commands_supply,
    commands_watch, commands_fault, commands_snapshot, commands_truth;

/* "unit" of commands that need to be told only where there is more than one. */
#define CONTROL_UNIT_ARG(is_optional)                                                                                  \
    {                                                                                                                  \
        .name = "unit", .type = CONTROL_UNIT, .optional = (is_optional), .what = "name of a unit of the scenario"      \
    }

/* The largest integer that JSON carries without loss. */
#define CONTROL_COUNT_MAX 9007199254740991.0

/* The converters take their inputs in blocks: what was before a change of their world must be sampled before it. */
void control_settle_inputs(const struct control_bench *b, int64_t t_ns);

#endif
