/* The tables of the commands, one for each file commands_*.c, and what they share. */
#ifndef PSABENCH_CONTROL_COMMANDS_H
#define PSABENCH_CONTROL_COMMANDS_H

#include "control/control.h"

extern const struct control_table commands_bench, commands_head, commands_table, commands_chamber, commands_supply,
    commands_platform, commands_watch, commands_fault, commands_snapshot, commands_bus, commands_can, commands_truth;

/* "unit" of commands that need to be told only where there is more than one. */
#define CONTROL_UNIT_ARG(is_optional)                                                                                  \
    {                                                                                                                  \
        .name = "unit", .type = CONTROL_UNIT, .optional = (is_optional), .what = "name of a unit of the scenario"      \
    }

/* The largest integer that JSON carries without loss. */
#define CONTROL_COUNT_MAX 9007199254740991.0

/* commands_bus.c: what came of a cycle that is over. */
enum control_outcome control_cycle_result(struct control *c, const struct control_cycle *k, cJSON *result);

/* control.c: a cycle has come to its end: whoever waits for it is answered. */
void control_cycle_over(struct control *c, struct control_cycle *k, int64_t t_ns);

bool control_by_step(const struct control_bench *b); /* time moves only when told */

/* The converters take their inputs in blocks: what was before a change of their world must be sampled before it. */
void control_settle_inputs(const struct control_bench *b, int64_t t_ns);

#endif
