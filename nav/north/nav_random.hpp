/* Random numbers of the Monte-Carlo: number k of a stream is splitmix64's finaliser of start + k steps, so that any number of
 * them can be made at once, and Gaussian ones come in pairs (Box and Muller 1958), without a branch. Loops over these become
 * vectors; the operations and their order are the same for every processor. */
#ifndef PSABENCH_NAV_RANDOM_HPP
#define PSABENCH_NAV_RANDOM_HPP

#include "nav/common/nav_math.hpp"
#include "nav/common/nav_width.hpp"

#include <cstring>

constexpr uint64_t RANDOM_STEP = UINT64_C(0x9E3779B97F4A7C15);

INLINE uint64_t random_mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

/* Where the stream of run k of a seed starts. */
INLINE uint64_t random_run(uint64_t seed, uint64_t run)
{
    return random_mix(random_mix(seed + RANDOM_STEP) ^ (run * UINT64_C(0xD1342543DE82EF95)));
}

INLINE double random_double_of(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

INLINE uint64_t random_bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* [0, 1), 52 bits; by the exponent of 1: conversions of 64-bit integers are no vectors before AVX-512. */
INLINE double random_unit(uint64_t bits)
{
    return random_double_of((bits >> 12) | UINT64_C(0x3FF0000000000000)) - 1.0;
}

/* Natural logarithm of 2^-52 <= x <= 1, to 1e-11: x = 2^k m, 0.6875 <= m < 1.375, k ln 2 + 2 atanh((m - 1)/(m + 1)). The exponent is
 * taken out by integer arithmetic alone, the number 1024 keeps it positive. */
INLINE double random_log(double x)
{
    const uint64_t bits = random_bits_of(x);
    const uint64_t biased = (bits - UINT64_C(0x3FE6000000000000) + (UINT64_C(1024) << 52)) >> 52;
    const double k = random_double_of(biased | UINT64_C(0x4330000000000000)) - (4503599627370496.0 + 1024.0);
    const double m = random_double_of(bits - (biased << 52) + (UINT64_C(1024) << 52));
    const double s = (m - 1.0) / (m + 1.0);
    const double z = s * s;
    const double sum = z * (1.0 / 3 + z * (1.0 / 5 + z * (1.0 / 7 + z * (1.0 / 9 + z * (1.0 / 11 + z * (1.0 / 13))))));
    return k * 0.6931471805599453 + 2.0 * (s + s * sum);
}

/* cos and sin of 2 pi turn, [0, 1), to 1e-9: of a quarter of the angle from the middle by Taylor, doubled twice. */
INLINE void random_direction(double turn, double *cos_out, double *sin_out)
{
    const double x = 0.5 * NAV_PI * (turn - 0.5);
    const double z = x * x;
    const double s =
        x - x * z * (1.0 / 6 - z * (1.0 / 120 - z * (1.0 / 5040 - z * (1.0 / 362880 - z * (1.0 / 39916800)))));
    const double c = 1.0 - z * (0.5 - z * (1.0 / 24 - z * (1.0 / 720 - z * (1.0 / 40320 - z * (1.0 / 3628800)))));
    const double s2 = 2.0 * s * c;
    const double c2 = 1.0 - 2.0 * s * s;
    *cos_out = 2.0 * s2 * s2 - 1.0; /* the middle is half a turn: both are negated */
    *sin_out = -2.0 * s2 * c2;
}

/* Two of one number: its upper 36 bits are the radius, up to 7 sigma, its lower 28 the direction. */
INLINE void random_pair(uint64_t bits, double *first, double *second)
{
    const double radius = std::sqrt(-2.0 * random_log(1.0 - random_unit(bits >> 28 << 28)));
    double c;
    double s;
    random_direction(random_unit(bits << 36), &c, &s);
    *first = radius * c;
    *second = radius * s;
}

/* n Gaussian numbers, n even, of the n/2 numbers after state; returns the state after them. */
uint64_t random_fill(uint64_t state, int n, double *out);

/* Numbers one by one. */
struct random_stream {
    uint64_t state;
    int left;
    double store[64];

    explicit random_stream(uint64_t start) : state(start), left(0)
    {
    }

    uint64_t bits()
    {
        state += RANDOM_STEP;
        return random_mix(state);
    }

    double uniform() /* [0, 1) */
    {
        return random_unit(bits());
    }

    double sign()
    {
        return bits() >> 63 ? 1.0 : -1.0;
    }

    double gauss()
    {
        if (left == 0) {
            left = 64;
            state = random_fill(state, left, store);
        }
        return store[--left];
    }
};

#endif
