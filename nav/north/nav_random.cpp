#include "nav/north/nav_random.hpp"

INLINE void fill_uniform(uint64_t state, int n, double *out)
{
    const int half = n / 2;
    for (int k = 0; k < half; k++)
        random_pair(random_mix(state + (uint64_t)(k + 1) * RANDOM_STEP), &out[k], &out[half + k]);
}

BY_WIDTH(fill, (uint64_t state, int n, double *out), fill_uniform(state, n, out))

uint64_t random_fill(uint64_t state, int n, double *out)
{
    fill_by_width[nav_width()](state, n, out);
    return state + (uint64_t)(n / 2) * RANDOM_STEP;
}
