/* Seeded noise: one independent stream per unit and source.
 *
 * xoshiro256** seeded by splitmix64 from (seed, unit, source); the Gaussian variate is the inverse normal distribution
 * (Wichura 1988, AS 241, PPND16) of one uniform draw, so that each call consumes exactly one number and the same seed
 * gives the same bytes with any compiler. Not for secrets. */
#ifndef PSABENCH_BASE_RNG_H
#define PSABENCH_BASE_RNG_H

#include <stdint.h>

struct rng {
    uint64_t s[4];
};

/* The stream of one noise source: unit is the unit's serial number, source a short constant name ("adc.x", "mems"). */
struct rng rng_stream(uint64_t seed, uint64_t unit, const char *source);

uint64_t rng_u64(struct rng *r);
double rng_uniform(struct rng *r); /* open interval (0, 1), 53 bits */
double rng_gauss(struct rng *r);   /* mean 0, standard deviation 1 */

#endif
