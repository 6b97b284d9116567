/* The filter's kernels for each width of vectors that this processor has, beside plain loops: the same bytes. */
#include "rig.h"

#include "nav/filter/kf_kernels.h"

#include <string.h>

#define MAX 64

static uint64_t seed;

/* -1 to 1 times 2^-20 to 2^19, now and then zero: rounding shows another order or a fused operation. */
static double draw(void)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    const double unit = (double)(seed >> 11) / 4503599627370496.0 - 1.0;
    const int power = (int)(seed >> 5 & 31);
    double scale = power < 20 ? 1.0 / (double)(1 << power) : (double)(1 << (power - 12));
    if ((seed & 0xf000000000) == 0) scale = 0.0;
    return unit * scale;
}

/* Rows of columns, zero beyond n. */
static void fill(int rows, int n, int columns, double *a)
{
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < columns; j++) a[i * columns + j] = j < n ? draw() : 0.0;
}

static void add_plainly(const struct kf_sum *s)
{
    for (int i = 0; i < s->rows; i++)
        for (int j = 0; j < s->columns; j++)
            for (int k = 0; k < s->count; k++) {
                volatile double product = s->a[i * s->a_stride + s->at[k]] * s->p[s->at[k] * s->p_stride + j];
                s->y[i * s->y_stride + j] += product;
            }
}

static void subtract_plainly(const struct kf_square *s)
{
    for (int j = 0; s->h && j < s->stride; j++) s->y[j] = 0.0;
    for (int i = 0; i < s->n; i++)
        for (int j = 0; j < s->stride; j++) {
            double *p = s->p + i * s->stride + j;
            volatile double product = -s->v[i] * s->v[j];
            *p += product;
            if (!s->h) continue;
            volatile double next = s->h[i] * *p;
            s->y[j] += next;
        }
}

static const int sizes[] = {1, 2, 7, 8, 9, 15, 24, 33, 45, 64};

struct arrays {
    _Alignas(KF_ALIGN_BYTES) double p[MAX * MAX], y[MAX * MAX], a[MAX * MAX];
};
static struct arrays given, plain, found;

static void test_sums_of_rows(void **state)
{
    (void)state;
    for (size_t c = 0; c < COUNT(sizes); c++)
        for (int rows = 0; rows <= 8; rows++) {
            const int n = sizes[c];
            const int columns = KF_PADDED(n);
            int at[MAX];
            int count = 0;
            seed = (uint64_t)n * 100 + (uint64_t)rows;
            for (int k = 0; k < n; k++)
                if (k % 5 != 3) at[count++] = k;
            fill(n, n, columns, given.p);
            fill(rows, n, columns, given.y);
            fill(rows, n, n, given.a);
            struct kf_sum s = {rows, columns, count, at, given.a, given.p, plain.y, n, columns, columns};
            memcpy(plain.y, given.y, sizeof given.y);
            add_plainly(&s);
            s.y = found.y;
            for (int w = 0; w <= kf_width(); w++) {
                memcpy(found.y, given.y, sizeof given.y);
                kf_kernels[w].add_rows(&s);
                assert_memory_equal(found.y, plain.y, sizeof *plain.y * (size_t)(rows * columns));
            }
        }
}

static void check_square(int n, bool next)
{
    const int columns = KF_PADDED(n);
    fill(n, n, columns, given.p);
    fill(2, n, columns, given.a); /* v, h */
    struct kf_square s = {n, columns, given.a, next ? given.a + columns : NULL, plain.p, plain.y};
    memcpy(plain.p, given.p, sizeof given.p);
    subtract_plainly(&s);
    s.p = found.p;
    s.y = found.y;
    for (int w = 0; w <= kf_width(); w++) {
        memcpy(found.p, given.p, sizeof given.p);
        memset(found.y, 0xff, sizeof found.y);
        kf_kernels[w].subtract_square(&s);
        assert_memory_equal(found.p, plain.p, sizeof *plain.p * (size_t)(n * columns));
        if (next) assert_memory_equal(found.y, plain.y, sizeof *plain.y * (size_t)columns);
    }
}

static void test_squares(void **state)
{
    (void)state;
    for (size_t c = 0; c < COUNT(sizes); c++)
        for (int next = 0; next < 2; next++) {
            seed = (uint64_t)sizes[c] * 2 + (uint64_t)next;
            check_square(sizes[c], next);
        }
}

int main(void)
{
    print_message("vectors of up to %d doubles\n", 2 << kf_width());
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sums_of_rows),
        cmocka_unit_test(test_squares),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
