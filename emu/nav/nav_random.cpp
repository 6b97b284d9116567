#include "nav/nav_random.hpp"

/* e^x of -8 < x <= 0 by products alone: det_exp() divides, and one draw in eighty comes here. x = 16 y, |y| <= 1/2. */
static double edge_exp(double x)
{
    static constexpr double inverse_factorial[] = {1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880,
                                                   1.0 / 40320,     1.0 / 5040,     1.0 / 720,     1.0 / 120,
                                                   1.0 / 24,        1.0 / 6,        0.5,           1.0};
    const double y = x * (1.0 / 16.0);
    double sum = 1.0 / 6227020800.0;
    for (const double c : inverse_factorial) sum = sum * y + c;
    double e = sum * y + 1.0;
    for (int i = 0; i < 4; i++) e *= e;
    return e;
}

double random_stream::gauss_at_edge(unsigned layer, double x)
{
    for (;;) {
        if (layer == 0) { /* beyond R: Marsaglia's tail */
            double tail;
            double y;
            do {
                tail = -det_log(uniform()) / ZIGGURAT_R;
                y = -det_log(uniform());
            } while (2.0 * y < tail * tail);
            return x < 0.0 ? -ZIGGURAT_R - tail : ZIGGURAT_R + tail;
        }
        const double f = ZIGGURAT.f[layer] + uniform() * (ZIGGURAT.f[layer + 1] - ZIGGURAT.f[layer]);
        if (f < edge_exp(-0.5 * x * x)) return x;
        const uint64_t u = bits();
        layer = u & 0xFF;
        x = (double)((int64_t)u >> 11) * 0x1p-52 * ZIGGURAT.x[layer];
        if (std::fabs(x) < ZIGGURAT.x[layer + 1]) return x;
    }
}
