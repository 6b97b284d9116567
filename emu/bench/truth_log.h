/* The true state of the bench in a file, one line of JSON for each unit at equal steps of simulated time: for graders.
 *
 *     {"t_ns":20000000,"unit":"a",...}        the fields of the command truth.state
 *
 * An event of its own that looks and changes nothing. The same run writes the same bytes. */
#ifndef PSABENCH_BENCH_TRUTH_LOG_H
#define PSABENCH_BENCH_TRUTH_LOG_H

#include "control/control.h"

#include <stdint.h>
#include <stdio.h>

struct truth_log {
    FILE *out; /* NULL: not in use */
    struct control *truth;
    struct sched *sched;
    int64_t every_ns;
    int error; /* errno of the first line that could not be written; what follows is not */
    uint64_t lines;
    bool reported; /* the owner's: that it failed was said */
    struct sched_ev ev;
};

/* Writes at every multiple of every_ns from now on: at 0, too, where time begins. out is closed by truth_log_close(); truth:
 * commands of the truth port. */
void truth_log_open(struct truth_log *l, FILE *out, int64_t every_ns, struct control *truth, struct sched *s);

/* 0, or the errno of the first line that is missing. */
int truth_log_close(struct truth_log *l);

#endif
