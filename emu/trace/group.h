/* Many traces whose time one owner moves. Only those that are awake are advanced: a trace without sinks, filter and pending
 * steps costs nothing, and catches up when it wakes. A trace joins by its `group`, before its first step. */
#ifndef PSABENCH_TRACE_GROUP_H
#define PSABENCH_TRACE_GROUP_H

#include "trace/trace.h"

struct trace_group {
    struct trace *awake;
    int64_t done_ns;  /* of all of them */
    uint64_t changes; /* of what is watched, in any of them */
};

/* All of a group, as trace_advance(). */
void trace_advance_group(struct trace_group *g, int64_t t_ns);

#endif
