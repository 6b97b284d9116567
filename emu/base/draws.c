#include "base/draws.h"

#include "base/lanes.h"
#include "base/rng.h"

#include <stdbool.h>

#define ROUNDS     7u
#define MULTIPLIER UINT64_C(0xD2B74407B1CE6E93)
#define WEYL       UINT64_C(0x9E3779B97F4A7C15)

__extension__ typedef unsigned __int128 product;

struct draws draws_of(uint64_t seed, uint64_t unit, const char *source)
{
    struct rng r = rng_stream(seed, unit, source);
    const uint64_t key = rng_u64(&r);
    return (struct draws){key, rng_u64(&r)};
}

void draws_reseed(struct draws *d, uint64_t seed)
{
    *d = draws_of(seed, d->key ^ d->high, "reseeded");
}

static inline struct draws_pair philox_block(uint64_t low, uint64_t high, uint64_t key, unsigned rounds)
{
#pragma GCC unroll 7
    for (unsigned i = 0; i < rounds; i++, key += WEYL) {
        const product p = (product)low * MULTIPLIER;
        low = (uint64_t)(p >> 64) ^ key ^ high;
        high = (uint64_t)p;
    }
    return (struct draws_pair){low, high};
}

struct draws_pair draws_philox(uint64_t low, uint64_t high, uint64_t key, unsigned rounds)
{
    return philox_block(low, high, key, rounds);
}

static inline struct draws_pair block_at(const struct draws *d, uint64_t pair)
{
    return philox_block(pair, d->high, d->key, ROUNDS);
}

uint64_t draws_u64(const struct draws *d, int64_t n)
{
    const struct draws_pair p = block_at(d, (uint64_t)n >> 1);
    return n & 1 ? p.odd : p.even;
}

double draws_gauss(const struct draws *d, int64_t n)
{
    return rng_normal(draws_u64(d, n));
}

/* Blocks from number `block` on, the same arithmetic with either instruction for the product. The keys of the rounds are those of
 * all blocks. */
LANES_BODY void row_of_blocks(const struct draws *d, uint64_t block, unsigned blocks, uint64_t *out)
{
    const uint64_t key[ROUNDS] = {
        d->key,           d->key + WEYL, d->key + 2 * WEYL, d->key + 3 * WEYL, d->key + 4 * WEYL, d->key + 5 * WEYL,
        d->key + 6 * WEYL};
    const uint64_t counter = d->high;
    for (unsigned i = 0; i < blocks; i++, out += 2) {
        uint64_t low = block + i, high = counter;
#pragma GCC unroll 7
        for (unsigned r = 0; r < ROUNDS; r++) {
            const product p = (product)low * MULTIPLIER;
            low = (uint64_t)(p >> 64) ^ key[r] ^ high;
            high = (uint64_t)p;
        }
        out[0] = low;
        out[1] = high;
    }
}

LANES_BMI2 static void row_of_blocks_bmi2(const struct draws *d, uint64_t block, unsigned blocks, uint64_t *out)
{
    row_of_blocks(d, block, blocks, out);
}

void draws_row(const struct draws *d, int64_t first, unsigned n, uint64_t *out)
{
    const unsigned odd = n > 0 && (first & 1);
    if (odd) out[0] = draws_u64(d, first);
    if (lanes_bmi2()) row_of_blocks_bmi2(d, (uint64_t)(first + odd) >> 1, (n - odd) / 2, out + odd);
    else row_of_blocks(d, (uint64_t)(first + odd) >> 1, (n - odd) / 2, out + odd);
    if ((n - odd) & 1) out[n - 1] = draws_u64(d, first + n - 1);
}
