/* What a scenario does to its own bench: the commands of its timeline, each at its time, and its faults.
 *
 * They take the one way of all commands, control_call(), so that an entry is worth what the same line on the control socket
 * would be. They are part of the scenario and stay out of the journal. Plain struct, one thread; never moved once started. */
#ifndef PSABENCH_BENCH_TIMELINE_H
#define PSABENCH_BENCH_TIMELINE_H

#include "bench/bench.h"
#include "control/control.h"

struct timeline {
    struct bench *bench;
    struct control_bench view; /* of the service, without the journal */
    struct control control;
    struct sched_ev ev;
    unsigned order[SCENARIO_EVENTS_MAX]; /* by time, then as written */
    unsigned next;
    void (*say)(const char *text); /* an entry was rejected: one line */
};

/* Whether the entries are commands that change the bench, with such arguments. False with file:line:column in why. */
bool timeline_check(struct bench *b, char *why, size_t cap);

/* At power-on, after bench_power_up(): gives the faults and arms the first entry. say has been filled in. */
void timeline_start(struct timeline *t, struct bench *b, const struct control_bench *view);

#endif
