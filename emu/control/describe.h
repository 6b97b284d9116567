/* The state of the bench as JSON. Reads only. */
#ifndef PSABENCH_CONTROL_DESCRIBE_H
#define PSABENCH_CONTROL_DESCRIBE_H

#include "control/control.h"

/* One more, empty, in a list. */
static inline cJSON *add_object(cJSON *list)
{
    cJSON *j = cJSON_CreateObject();
    cJSON_AddItemToArray(list, j);
    return j;
}

static inline void add_count(cJSON *to, const char *name, uint64_t n)
{
    cJSON_AddNumberToObject(to, name, (double)n);
}

static inline void add_real(cJSON *to, const char *name, double v)
{
    cJSON_AddNumberToObject(to, name, v);
}

/* Rows of the tables, with their arguments and SCPI headers. */
void describe_rows(const struct control_table *const *tables, cJSON *list);

/* Handlers of `help` and `units`. */
enum control_outcome describe_commands(const struct control_call *call);
enum control_outcome describe_units(const struct control_call *call);

void describe_arg(const struct control_arg *a, bool optional, cJSON *list);
struct fault_kind;

/* A kind of fault without its points; its arguments. */
void describe_kind(const struct fault_kind *k, cJSON *to);
void describe_kind_args(const struct fault_kind *k, cJSON *to);

void describe_clients(const struct control_bench *b, cJSON *to);
void describe_pace(const struct control_bench *b, cJSON *to);
void describe_bus(const struct control_bench *b, cJSON *to, int64_t t_ns);
void describe_unit_counters(const struct control_bench *b, unsigned unit, cJSON *to);

/* What an operator sees at a glance: pace, frames, readings of the instruments that are there. */
void describe_status(const struct control_bench *b, cJSON *to, int64_t t_ns);

#endif
