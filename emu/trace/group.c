#include "trace/group.h"

/* A source that reports may have more to say than its sinks asked for: once awake, it stays. */
static bool may_sleep(const struct trace *t)
{
    return !t->sinks && !t->filter && t->pending_count == 0 && !t->source.report;
}

void trace_advance_group(struct trace_group *g, int64_t t_ns)
{
    if (t_ns > g->done_ns) g->done_ns = t_ns;
    for (struct trace **at = &g->awake; *at;) {
        struct trace *t = *at;
        trace_advance(t, t_ns);
        if (*at == t && may_sleep(t)) { /* a sink may have woken others */
            *at = t->next_awake;
            t->room = 0;
        } else at = &t->next_awake;
    }
}
