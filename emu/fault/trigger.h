/* Which event of a board a fault waits for: the n-th of a kind, counted again from each event of another. Pure. */
#ifndef PSABENCH_FAULT_TRIGGER_H
#define PSABENCH_FAULT_TRIGGER_H

#include <stdbool.h>

#define FAULT_NO_EVENT (-1)

struct fault_trigger {
    int after;      /* number of the event that is counted */
    int since;      /* of the one that starts the count again; FAULT_NO_EVENT: counted from the beginning */
    unsigned count; /* which one it is to be, from 1 */
    /* read-only outside */
    unsigned seen;
    bool counting;
};

static inline struct fault_trigger fault_trigger(int after, int since, unsigned count)
{
    return (struct fault_trigger){.after = after, .since = since, .count = count, .counting = since == FAULT_NO_EVENT};
}

/* True: this is the event. */
static inline bool fault_trigger_event(struct fault_trigger *t, int event)
{
    if (event == t->since) {
        t->counting = true;
        t->seen = 0;
        return false;
    }
    if (event != t->after || !t->counting) return false;
    return ++t->seen == t->count;
}

#endif
