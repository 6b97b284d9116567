/* White draws by number: draw n of a source is a function of (seed, unit, source, n) and needs no draw before it, so that noise
 * does not depend on who looked when, and a row of draws can be taken anywhere.
 *
 * Philox2x64 with 7 rounds (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11: crush-resistant from 6 on),
 * each source with its own key and its own upper half of the counter. The Gaussian variate is that of rng.h. Pure; the same
 * bytes with any compiler. Not for secrets. */
#ifndef PSABENCH_BASE_DRAWS_H
#define PSABENCH_BASE_DRAWS_H

#include <stdint.h>

struct draws {
    uint64_t key, high;
};

struct draws_pair {
    uint64_t even, odd;
};

/* The draws of one noise source: unit is the unit's serial number, source a short constant name ("adc.x", "mems"). */
struct draws draws_of(uint64_t seed, uint64_t unit, const char *source);

/* From here on the same source's draws of another seed, independent of those before. */
void draws_reseed(struct draws *d, uint64_t seed);

/* The block of 128 bits for a counter and a key, after so many rounds. */
struct draws_pair draws_philox(uint64_t low, uint64_t high, uint64_t key, unsigned rounds);

#define DRAWS_GAUSS_MAX 8.3 /* no Gaussian draw is larger: 52 bits end at 8.21 standard deviations */

uint64_t draws_u64(const struct draws *d, int64_t n);
double draws_gauss(const struct draws *d, int64_t n); /* mean 0, standard deviation 1 */

/* Draws first ... first + n - 1 in one go. */
void draws_row(const struct draws *d, int64_t first, unsigned n, uint64_t *out);

#endif
