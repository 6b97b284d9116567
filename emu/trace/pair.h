/* A line that leaves its board as a differential pair (RS-422), and the receiver at the pair's far end.
 *
 * The driver has the line on wire A and its inverse on wire B. The receiver's output follows after a delay, of rises and of
 * falls; a pulse that is shorter than the difference of the two does not come out. line_fault.h has the pairs of a trace. No
 * allocation, one thread. */
#ifndef PSABENCH_TRACE_PAIR_H
#define PSABENCH_TRACE_PAIR_H

#include <stdbool.h>
#include <stdint.h>

#define PAIR_DELAY_MAX_NS 1000 /* E0: 100 m of cable at 5 ns/m, and twice that again */
#define PAIR_EDGES        64u /* within PAIR_DELAY_MAX_NS: pulses of 15.6 ns, the shortest of a receiver for 32 MHz (E2) */

struct pair_cfg {
    unsigned line, a, b;      /* numbers of signals: the receiver's output, the wires */
    int64_t rise_ns, fall_ns; /* from the driver's input to the receiver's output */
};

struct pair {
    struct pair_cfg cfg;
    bool in, out;
    int64_t due_ns[PAIR_EDGES]; /* when the output changes, from `first` on */
    unsigned first, count;
};

/* Levels that are old: nothing is under way. */
void pair_settle(struct pair *p, bool level);

/* The receiver's input has this level from t_ns on. */
void pair_input(struct pair *p, bool level, int64_t t_ns);

int64_t pair_due_ns(const struct pair *p); /* when its output changes next; INT64_MAX: nothing is under way */
void pair_run(struct pair *p, int64_t t_ns);

static inline bool pair_delays(const struct pair *p)
{
    return p->cfg.rise_ns > 0 || p->cfg.fall_ns > 0;
}

#endif
