/* What a capture of lines waits for, as probe.arm is given it. Pure.
 *
 *     fault                  any fault begins
 *     fault:line.stuck       a fault of that kind begins
 *     event:DRD_A            an event of the unit's board
 *     line:Int:falling       rising, falling, edge: the line changes; high, low: it has that level, perhaps already */
#ifndef PSABENCH_CONTROL_ARM_TEXT_H
#define PSABENCH_CONTROL_ARM_TEXT_H

#include "command/error.h"
#include "trace/capture.h"

enum arm_kind { ARM_FAULT, ARM_EVENT, ARM_LINE };

struct arm_text {
    enum arm_kind kind;
    char name[32]; /* of the fault's kind, "" any; of the event; of the line */
    enum capture_when when;
};

/* False with the error; *out is untouched. */
bool arm_text_parse(const char *text, struct arm_text *out, struct control_error *why);

#endif
