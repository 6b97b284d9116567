/* The only clock: how simulated time follows real time, and how well.
 *
 * wall: simulated time is the time since pace_start(); step: it moves only by commands; free: it moves as fast as it goes.
 * Nothing of the real clock reaches the simulation in step and free pace. Lateness goes into a histogram of fixed size. */
#ifndef PSABENCH_APP_PACE_H
#define PSABENCH_APP_PACE_H

#include <stdbool.h>
#include <stdint.h>

enum pace_kind { PACE_WALL, PACE_STEP, PACE_FREE };

#define PACE_QUANTUM_NS 100000    /* wall: events nearer than this to the last wake-up share the next one */
#define PACE_LATE_NS    1000000   /* an event this late is counted as late */
#define PACE_REST_NS    100000000 /* wall: the longest sleep; well below PACE_SLIP_NS */
#define PACE_SLIP_NS    500000000 /* behind by more than this: simulated time gives up catching up, counted */
#define PACE_BATCH_NS   10000000  /* wall: simulated time run at most between looks at input */

/* Four buckets an octave of microseconds: a percentile is right within 19 %. */
#define PACE_BUCKETS 128u

struct pace_hist {
    uint64_t count[PACE_BUCKETS], total;
    int64_t max_ns;
};

struct pace {
    enum pace_kind kind;
    int64_t origin_ns; /* real time at which simulated time was 0 */
    uint64_t turns, late, slips;
    struct pace_hist events, frames; /* wall pace only */
};

void pace_init(struct pace *p, enum pace_kind kind);

/* Monotonic real time; for timers of links, and for nothing that the simulation sees. */
int64_t pace_clock_ns(void);

/* Wall pace: simulated time sim_ns is now. */
void pace_start(struct pace *p, int64_t sim_ns);

/* Wall pace: the simulated time that corresponds to now, given that the simulation is at sim_ns; slips if it is too
 * far ahead. */
int64_t pace_target_ns(struct pace *p, int64_t sim_ns);

/* An event that was due at due_ns ran when real time stood at target_ns. */
void pace_event(struct pace *p, int64_t due_ns, int64_t target_ns);

void pace_hist_add(struct pace_hist *h, int64_t late_ns);

/* Lateness in us that a share (0 .. 1) of all did not exceed; 0 when there are none. */
double pace_hist_us(const struct pace_hist *h, double share);

const char *pace_name(enum pace_kind kind);

#endif
