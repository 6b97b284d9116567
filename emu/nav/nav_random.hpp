/* Random numbers of the Monte-Carlo: one stream for each run, Gaussian by the ziggurat of Marsaglia and Tsang, 256 layers, in
 * the form of Doornik (2005); tables are made by the compiler. splitmix64 from a mixed start: a run costs nothing to begin. */
#ifndef PSABENCH_NAV_RANDOM_HPP
#define PSABENCH_NAV_RANDOM_HPP

#include "nav/nav_math.hpp"

#include <cstdint>

constexpr uint64_t random_mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

constexpr double ziggurat_log(double x) /* natural, 1e-16, for 1e-3 < x < 10: by halves and atanh */
{
    int k = 0;
    while (x < 0.7071067811865476) {
        x *= 2.0;
        k--;
    }
    while (x > 1.4142135623730951) {
        x *= 0.5;
        k++;
    }
    const double s = (x - 1.0) / (x + 1.0);
    double sum = 0.0;
    for (int n = 25; n >= 1; n -= 2) sum = sum * s * s + 1.0 / n;
    return k * 0.6931471805599453 + 2.0 * s * sum;
}

constexpr double ziggurat_exp(double x) /* of -8 < x <= 0 */
{
    double sum = 1.0;
    for (int n = 24; n >= 1; n--) sum = 1.0 + sum * (x / 16.0) / n;
    for (int i = 0; i < 4; i++) sum *= sum;
    return sum;
}

constexpr double ziggurat_sqrt(double x)
{
    double r = x > 1.0 ? x : 1.0;
    for (int i = 0; i < 60; i++) r = 0.5 * (r + x / r);
    return r;
}

struct ziggurat_table {
    double x[257]; /* edges of the layers, x[0] of the base layer with its tail, x[256] = 0 */
    double f[257]; /* e^(-x^2/2) there */
};

constexpr double ZIGGURAT_R = 3.6541528853610088; /* where the tail begins, and the area of a layer, of 256 */
constexpr double ZIGGURAT_V = 0.00492867323399;

constexpr struct ziggurat_table ziggurat_make()
{
    struct ziggurat_table t = {};
    const double f_r = ziggurat_exp(-0.5 * ZIGGURAT_R * ZIGGURAT_R);
    t.x[0] = ZIGGURAT_V / f_r;
    t.f[0] = f_r;
    t.x[1] = ZIGGURAT_R;
    t.f[1] = f_r;
    for (int i = 2; i < 256; i++) {
        t.f[i] = t.f[i - 1] + ZIGGURAT_V / t.x[i - 1];
        t.x[i] = ziggurat_sqrt(-2.0 * ziggurat_log(t.f[i]));
    }
    t.f[256] = 1.0;
    return t;
}

inline constexpr struct ziggurat_table ZIGGURAT = ziggurat_make();

struct random_stream {
    uint64_t state;

    uint64_t bits()
    {
        state += UINT64_C(0x9E3779B97F4A7C15);
        return random_mix(state);
    }

    double uniform() /* (0, 1) */
    {
        return ((double)(bits() >> 12) + 0.5) * 0x1p-52;
    }

    double gauss()
    {
        const uint64_t u = bits();
        const unsigned layer = u & 0xFF;
        const double signed_unit =
            (double)((int64_t)u >> 11) * 0x1p-52; /* [-1, 1), 53 bits, the layer's not among them */
        const double x = signed_unit * ZIGGURAT.x[layer];
        return std::fabs(x) < ZIGGURAT.x[layer + 1] ? x : gauss_at_edge(layer, x);
    }

    double gauss_at_edge(unsigned layer, double x); /* the one draw in a hundred that needs more */

    double sign()
    {
        return bits() >> 63 ? 1.0 : -1.0;
    }
};

/* The stream of run k of a seed. */
inline struct random_stream random_run(uint64_t seed, uint64_t run)
{
    return {random_mix(random_mix(seed + UINT64_C(0x9E3779B97F4A7C15)) ^ (run * UINT64_C(0xD1342543DE82EF95)))};
}

#endif
