/* Seeded streams: one independent stream per unit and source, for what is drawn once or event by event. White noise of looks
 * has its draws by number: draws.h.
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

/* From here on the same source's stream of another seed, independent of that before. */
void rng_reseed(struct rng *r, uint64_t seed);

static inline uint64_t rng_rotl(uint64_t x, int k)
{
    return (x << k) | (x >> (64 - k));
}

static inline uint64_t rng_u64(struct rng *r)
{
    uint64_t *s = r->s;
    const uint64_t out = rng_rotl(s[1] * 5, 7) * 9;
    const uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rng_rotl(s[3], 45);
    return out;
}

double rng_uniform(struct rng *r); /* open interval (0, 1), 53 bits */
double rng_gauss(struct rng *r);   /* mean 0, standard deviation 1 */
double rng_normal(uint64_t u);     /* what rng_gauss() makes of the number u */

#endif
