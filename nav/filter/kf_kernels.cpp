#include "nav/filter/kf_kernels.h"

#include "nav/common/nav_width.hpp"

template <int LANES> struct lanes {
    typedef double v __attribute__((vector_size(8 * LANES), may_alias));
};

constexpr int TILE_ROWS = 3,
              TILE_VECTORS = 3; /* of y that stay in registers: nine sums hide the latency of an addition */

template <int LANES, int ROWS, int VECTORS> INLINE void add_tile(const struct kf_sum *s, int row, int column)
{
    using vec = typename lanes<LANES>::v;
    double *y = s->y + row * s->y_stride + column;
    const double *a = s->a + row * s->a_stride;
    vec sum[ROWS][VECTORS];
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < VECTORS; j++) sum[i][j] = ((const vec *)(y + i * s->y_stride))[j];
    for (int k = 0; k < s->count; k++) {
        const int at = s->at[k];
        const vec *p = (const vec *)(s->p + at * s->p_stride + column);
        for (int i = 0; i < ROWS; i++)
            for (int j = 0; j < VECTORS; j++) sum[i][j] += a[i * s->a_stride + at] * p[j];
    }
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < VECTORS; j++) ((vec *)(y + i * s->y_stride))[j] = sum[i][j];
}

template <int LANES, int VECTORS> INLINE void add_columns(const struct kf_sum *s, int column)
{
    int row = 0;
    for (; row + TILE_ROWS <= s->rows; row += TILE_ROWS) add_tile<LANES, TILE_ROWS, VECTORS>(s, row, column);
    for (; row < s->rows; row++) add_tile<LANES, 1, VECTORS>(s, row, column);
}

template <int LANES> INLINE void add_rows(const struct kf_sum *s)
{
    constexpr int TILE = LANES * TILE_VECTORS;
    int column = 0;
    for (; column + TILE <= s->columns; column += TILE) add_columns<LANES, TILE_VECTORS>(s, column);
    for (; column < s->columns; column += LANES) add_columns<LANES, 1>(s, column);
}

/* -v_i v_j and -v_j v_i are the same number: p stays symmetric to the last bit. Half and a mirror would cost more. */
template <int LANES, int VECTORS, bool NEXT> INLINE void subtract_tile(const struct kf_square *s, int column)
{
    using vec = typename lanes<LANES>::v;
    vec v[VECTORS];
    vec sum[VECTORS];
    for (int j = 0; j < VECTORS; j++) {
        v[j] = ((const vec *)(s->v + column))[j];
        sum[j] = vec{};
    }
    for (int k = 0; k < s->n; k++) {
        vec *p = (vec *)(s->p + k * s->stride + column);
        const double a = -s->v[k];
        const double h = NEXT ? s->h[k] : 0.0;
        for (int j = 0; j < VECTORS; j++) {
            const vec left = p[j] + a * v[j];
            p[j] = left;
            if (NEXT) sum[j] += h * left;
        }
    }
    for (int j = 0; NEXT && j < VECTORS; j++) ((vec *)(s->y + column))[j] = sum[j];
}

template <int LANES, bool NEXT> INLINE void subtract_columns(const struct kf_square *s)
{
    constexpr int TILE = LANES * TILE_VECTORS;
    int column = 0;
    for (; column + TILE <= s->stride; column += TILE) subtract_tile<LANES, TILE_VECTORS, NEXT>(s, column);
    for (; column < s->stride; column += LANES) subtract_tile<LANES, 1, NEXT>(s, column);
}

template <int LANES> INLINE void subtract_square(const struct kf_square *s)
{
    if (s->h) subtract_columns<LANES, true>(s);
    else subtract_columns<LANES, false>(s);
}

BY_WIDTH(add, (const struct kf_sum *s), add_rows<WIDTH>(s))
BY_WIDTH(square, (const struct kf_square *s), subtract_square<WIDTH>(s))

const struct kf_kernels kf_kernels[KF_WIDTHS] = {{add_by_width[0], square_by_width[0]},
                                                 {add_by_width[1], square_by_width[1]},
                                                 {add_by_width[2], square_by_width[2]}};

int kf_width(void)
{
    return nav_width();
}
