/* Slow noise of a sensor, in the sensor's unit u (V, A, rad/s): terms of IEEE Std 952, each with its Allan deviation over an
 * averaging time tau (sources 5.4).
 *
 *   bias instability B    sqrt(2 ln 2 / pi) B = 0.664 B     flicker, two-sided PSD B^2 / (2 pi f)
 *   random walk K         K sqrt(tau / 3)
 *   ramp R                R tau / sqrt(2)
 *
 * and the quantum of the output, which adds q^2 / 12 to each look if there is noise to cover a step. White noise is the
 * sensor's own (mems.h): it depends on how long a look takes; these do not. Flicker is a sum of Gauss-Markov processes whose
 * times lie a factor of 5 apart, flat within 3 % from 1 s to 300 s. Walk and flicker move in steps of 10 ms counted from
 * t = 0, so that reading does not change them. Plain struct, one thread. */
#ifndef PSABENCH_PHYS_SENSOR_NOISE_H
#define PSABENCH_PHYS_SENSOR_NOISE_H

#include "base/draws.h"

#include <stdbool.h>
#include <stdint.h>

#define NOISE_STEP_NS INT64_C(10000000)
#define NOISE_MARKOVS 9u

struct noise_cfg {
    double bias_instability_u; /* B */
    double walk_u_rts;         /* K, u per square root of a second */
    double ramp_u_per_s;       /* R */
    double quantum_u;          /* q */
};

struct noise {
    struct noise_cfg cfg;
    struct draws draws;
    int64_t step; /* of the values below */
    double markov_u[NOISE_MARKOVS];
    double keep[NOISE_MARKOVS], kick_u[NOISE_MARKOVS]; /* of one step */
    double walk_u, walk_kick_u;
    bool moves; /* flicker or walk is there */
};

/* Flicker starts in its stationary state, the walk at zero. */
void noise_init(struct noise *n, const struct noise_cfg *cfg, struct draws draws);

/* Flicker, walk and ramp at t_ns; never earlier than the last call by more than its step. */
double noise_slow_u(struct noise *n, int64_t t_ns);

/* The nearest multiple of the quantum. */
double noise_quantise_u(const struct noise *n, double u);

#endif
