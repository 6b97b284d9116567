/* What a board adds to the digest of its unit: numbers, byte by byte the same on every machine. */
#ifndef PSABENCH_BOARD_DIGEST_H
#define PSABENCH_BOARD_DIGEST_H

#include "base/draws.h"
#include "base/sha256.h"

#include <string.h>

static inline void board_digest_u64(struct sha256 *s, uint64_t x)
{
    uint8_t bytes[8];
    for (unsigned i = 0; i < 8; i++) bytes[i] = (uint8_t)(x >> (8 * i));
    sha256_add(s, bytes, sizeof bytes);
}

static inline void board_digest_real(struct sha256 *s, double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    board_digest_u64(s, bits);
}

static inline void board_digest_noise(struct sha256 *s, const struct draws *d)
{
    board_digest_u64(s, d->key);
    board_digest_u64(s, d->high);
}

#endif
