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
template <int LANES, int COUNT, int VECTORS> INLINE void subtract_tile(const struct kf_squares *s, int column)
{
    using vec = typename lanes<LANES>::v;
    vec v[COUNT][VECTORS];
    for (int m = 0; m < COUNT; m++)
        for (int j = 0; j < VECTORS; j++) v[m][j] = ((const vec *)(s->v + m * s->v_stride + column))[j];
    for (int k = 0; k < s->n; k++) {
        vec *p = (vec *)(s->p + k * s->stride + column);
        vec left[VECTORS];
        for (int j = 0; j < VECTORS; j++) left[j] = p[j];
        for (int m = 0; m < COUNT; m++)
            for (int j = 0; j < VECTORS; j++) left[j] -= s->v[m * s->v_stride + k] * v[m][j];
        for (int j = 0; j < VECTORS; j++) p[j] = left[j];
    }
}

template <int LANES, int COUNT> INLINE void subtract_columns(const struct kf_squares *s)
{
    constexpr int TILE = LANES * TILE_VECTORS;
    int column = 0;
    for (; column + TILE <= s->stride; column += TILE) subtract_tile<LANES, COUNT, TILE_VECTORS>(s, column);
    for (; column < s->stride; column += LANES) subtract_tile<LANES, COUNT, 1>(s, column);
}

static_assert(KF_GROUP == 3);
template <int LANES> INLINE void subtract_squares(const struct kf_squares *s)
{
    if (s->count == 3) subtract_columns<LANES, 3>(s);
    if (s->count == 2) subtract_columns<LANES, 2>(s);
    if (s->count == 1) subtract_columns<LANES, 1>(s);
}

BY_WIDTH(add, (const struct kf_sum *s), add_rows<WIDTH>(s))
BY_WIDTH(squares, (const struct kf_squares *s), subtract_squares<WIDTH>(s))

const struct kf_kernels kf_kernels[KF_WIDTHS] = {{add_by_width[0], squares_by_width[0]},
                                                 {add_by_width[1], squares_by_width[1]},
                                                 {add_by_width[2], squares_by_width[2]}};

int kf_width(void)
{
    return nav_width();
}
