/* The tables of the commands, one for each file commands_*.c, and what they share. */
#ifndef PSABENCH_CONTROL_COMMANDS_H
#define PSABENCH_CONTROL_COMMANDS_H

#include "control/internal.h"

extern const struct control_table commands_bench, commands_head, commands_table, commands_chamber, commands_supply,
    commands_platform, commands_watch, commands_probe, commands_fault, commands_snapshot, commands_bus, commands_truth;

/* "unit" of commands; optional where the bench has one unit. */
#define CONTROL_UNIT_ARG(is_optional)                                                                                  \
    {                                                                                                                  \
        .name = "unit", .type = CONTROL_UNIT, .optional = (is_optional), .what = "unit of the scenario"                \
    }

/* The largest integer that JSON carries without loss. */
#define CONTROL_COUNT_MAX 9007199254740991.0

/* Time moves only by commands. */
static inline bool control_by_step(const struct control_bench *b)
{
    struct control_pace p = {0};
    b->sim.pace(b->ctx, &p);
    return p.by_step;
}

#endif
