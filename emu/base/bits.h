/* Bit and byte helpers shared by chips, codecs and frames. Pure. */
#ifndef PSABENCH_BASE_BITS_H
#define PSABENCH_BASE_BITS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Value of the low `bits` (1..32) of v as two's complement. */
static inline int32_t bits_sign_extend(uint32_t v, unsigned bits)
{
    const uint32_t sign = UINT32_C(1) << (bits - 1);
    const uint32_t low = bits == 32 ? v : v & ((UINT32_C(1) << bits) - 1);
    return (int32_t)((int64_t)(low ^ sign) - (int64_t)sign);
}

/* v limited to what `bits` (1..62) of two's complement hold. */
static inline int64_t bits_clip(int64_t v, unsigned bits)
{
    const int64_t max = (INT64_C(1) << (bits - 1)) - 1;
    return v > max ? max : v < -max - 1 ? -max - 1 : v;
}

/* v from min to max; beyond them the end, and *beyond is set, never cleared. Not a number is beyond max. */
static inline double bits_limit(double v, double min, double max, bool *beyond)
{
    if (v >= min && v <= max) return v;
    *beyond = true;
    return v < min ? min : max;
}

/* v / 2^shift rounded to nearest, halves towards plus infinity; defined for negative v. */
static inline int64_t bits_round_shift(int64_t v, unsigned shift)
{
    const uint64_t zero = UINT64_C(1) << 63; /* offset binary: a shift of a negative number is the compiler's choice */
    const uint64_t biased = (uint64_t)v + zero + (shift ? UINT64_C(1) << (shift - 1) : 0);
    return (int64_t)((biased >> shift) - (zero >> shift));
}

static inline unsigned bits_log2(unsigned power_of_two)
{
    unsigned n = 0;
    while (power_of_two >> (n + 1)) n++;
    return n;
}

/* Little-endian put and get of n (1..8) bytes. */
static inline void bits_put_le(uint8_t *p, uint64_t v, size_t n)
{
#if defined __BYTE_ORDER__ && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    memcpy(p, &v, n);
#else
    for (size_t i = 0; i < n; i++) p[i] = (uint8_t)(v >> (8 * i));
#endif
}

static inline uint64_t bits_get_le(const uint8_t *p, size_t n)
{
    uint64_t v = 0;
    for (size_t i = 0; i < n; i++) v |= (uint64_t)p[i] << (8 * i);
    return v;
}

/* Big-endian. */
static inline void bits_put_be(uint8_t *p, uint64_t v, size_t n)
{
    for (size_t i = 0; i < n; i++) p[i] = (uint8_t)(v >> (8 * (n - 1 - i)));
}

static inline uint64_t bits_get_be(const uint8_t *p, size_t n)
{
    uint64_t v = 0;
    for (size_t i = 0; i < n; i++) v = v << 8 | p[i];
    return v;
}

#endif
