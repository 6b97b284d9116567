#include "nav/nav_random.hpp"

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
        if (f < det_exp(-0.5 * x * x)) return x;
        const uint64_t u = bits();
        layer = u & 0xFF;
        x = (double)((int64_t)u >> 11) * 0x1p-52 * ZIGGURAT.x[layer];
        if (std::fabs(x) < ZIGGURAT.x[layer + 1]) return x;
    }
}
