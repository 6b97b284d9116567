/* Arguments of commands, their types by name, values as JSON, and the ranges in force. */
#ifndef PSABENCH_COMMAND_ARGS_H
#define PSABENCH_COMMAND_ARGS_H

#include "command/error.h"

const char *control_type_name(enum control_type type);
bool control_type_numeric(enum control_type type); /* has a range, perhaps a unit */

unsigned control_arg_count(const struct control_command *row);

/* Fills v[CONTROL_ARGS_MAX] from a JSON object (NULL: no arguments); strings stay the object's. False with the error. Of
 * the bench it needs unit_name; ranges that depend on the instruments are checked when lab is there. */
bool control_args(const struct control_bench *b, const struct control_command *row, const cJSON *args,
                  struct control_value v[CONTROL_ARGS_MAX], struct control_error *why);

/* The i-th word that an argument takes, asked for in order; NULL past the last, and where any will do. */
const char *control_choice(const struct control_arg *a, unsigned i);

/* The arguments that were given, as they would be sent. The caller deletes it. */
cJSON *control_args_json(const struct control_command *row, const struct control_value *v);

/* The range of the row's i-th argument on this bench; v: the arguments before it. */
void control_arg_limits(const struct control_bench *b, const struct control_command *row, unsigned i,
                        const struct control_value *v, double *min, double *max);

/* ---- rows */

/* The i-th row of the tables; NULL past the last. */
const struct control_command *control_row(const struct control_table *const *tables, unsigned i);
const struct control_command *control_find(const struct control_table *const *tables, const char *name);

#endif
