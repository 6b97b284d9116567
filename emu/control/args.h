/* Arguments of commands, for the other files of control: their types by name, values as JSON, and the ranges in force. */
#ifndef PSABENCH_CONTROL_ARGS_H
#define PSABENCH_CONTROL_ARGS_H

#include "control/control.h"

const char *control_type_name(enum control_type type);
bool control_type_numeric(enum control_type type); /* has a range, perhaps a unit */

/* The i-th word that an argument takes, asked for in order; NULL past the last, and where any will do. */
const char *control_choice(const struct control_arg *a, unsigned i);

/* Writes down a refusal and returns false. */
__attribute__((format(printf, 3, 4))) bool control_refuse_in(struct control_refusal *r, const char *code,
                                                             const char *format, ...);

/* The arguments that were given, as they would be sent. The caller deletes it. */
cJSON *control_args_json(const struct control_command *row, const struct control_value *v);

/* The range of an argument on this bench; v: the arguments before it. */
void control_arg_limits(const struct control_bench *b, const struct control_arg *a, const struct control_value *v,
                        double *min, double *max);

#endif
