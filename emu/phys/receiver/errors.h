/* Errors of a satellite receiver's solutions, as its user sees them: white and slow noise, outliers, jumps, outages, and a
 * latency of the position and another of the velocity. No signal, no constellation: docs/boards/receiver.md.
 *
 * A solution has a number, k = 0, 1, 2 ... from power-up, and its instant. All draws are by number, and slow errors go on from
 * solution to solution whether it is valid or not, so that faults shift no noise. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_RECEIVER_ERRORS_H
#define PSABENCH_PHYS_RECEIVER_ERRORS_H

#include "base/draws.h"
#include "phys/receiver/place.h"

#include <stdbool.h>

struct receiver_errors_cfg {
    /* standard deviations: of each horizontal axis; of the vertical one they are vertical_ratio times as large */
    double white_m, slow_m, white_mps, slow_mps, vertical_ratio;
    double slow_s;                    /* time constant of the slow ones, Gauss-Markov of first order; above 0 */
    double outliers_per_h, outlier_m; /* one solution off by outlier_m in a random direction of the horizon */
    double jumps_per_h, jump_m;       /* a step of the position that stays, standard deviation of each axis */
    double outages_per_h, outage_s;   /* mean duration, exponentially distributed */
    int64_t position_delay_ns, velocity_delay_ns; /* dt1; dt2 of the velocity behind the position */
    int64_t period_ns;                            /* of the solutions */
};

/* From outside: a spoofed position that runs away, consistent with its velocity, and a step. East, north; metres. */
struct receiver_offset {
    double rate_mps[2], base_m[2]; /* base at from_ns */
    int64_t from_ns;
    double jump_m[2];
};

struct receiver_errors {
    struct receiver_errors_cfg cfg;
    struct draws noise, slow, event;
    int64_t number;      /* of the next solution */
    double slow_unit[6]; /* position and velocity, each of standard deviation 1 */
    double jump_m[3];    /* the sum so far */
    int64_t outage_until_ns;
    struct receiver_offset offset;
};

struct receiver_solution {
    bool valid; /* false: outage, place is not written */
    struct place place;
};

void receiver_errors_init(struct receiver_errors *e, const struct receiver_errors_cfg *cfg, uint64_t seed,
                          uint32_t serial);

/* From power-up: solution 0 again, other slow errors, as after a start of the receiver. */
void receiver_errors_restart(struct receiver_errors *e);

/* The next solution, at t_ns. Looks at the truth at t_ns less the delays, not before 0. */
void receiver_errors_solve(struct receiver_errors *e, place_at_fn *place_at, void *ctx, int64_t t_ns,
                           struct receiver_solution *out);

/* What the receiver believes its errors are, standard deviations of the model. */
double receiver_errors_sd_m(const struct receiver_errors_cfg *c);
double receiver_errors_sd_mps(const struct receiver_errors_cfg *c);

#endif
