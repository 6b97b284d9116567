/* Draws by number: the published vectors of Philox, rows, and the law of what comes out. */
#include "rig.h"

#include "base/draws.h"
#include "base/rng.h"

#include <math.h>

/* Random123's known answers: counter, key and result of 7 and of 10 rounds. */
static void philox_gives_the_published_answers(void **state)
{
    (void)state;
    const struct {
        unsigned rounds;
        uint64_t low, high, key;
        struct draws_pair want;
    } rows[] = {
        {7, 0, 0, 0, {UINT64_C(0xb41da69fbfefc666), UINT64_C(0x511e9ce1a5534056)}},
        {7, UINT64_MAX, UINT64_MAX, UINT64_MAX, {UINT64_C(0xa4696cc04462015d), UINT64_C(0x724782dae17169e9)}},
        {7,
         UINT64_C(0x243f6a8885a308d3),
         UINT64_C(0x13198a2e03707344),
         UINT64_C(0xa4093822299f31d0),
         {UINT64_C(0x98ed1534392bf372), UINT64_C(0x67528b1568882fd5)}},
        {10, 0, 0, 0, {UINT64_C(0xca00a0459843d731), UINT64_C(0x66c24222c9a845b5)}},
        {10, UINT64_MAX, UINT64_MAX, UINT64_MAX, {UINT64_C(0x65b021d60cd8310f), UINT64_C(0x4d02f3222f86df20)}},
        {10,
         UINT64_C(0x243f6a8885a308d3),
         UINT64_C(0x13198a2e03707344),
         UINT64_C(0xa4093822299f31d0),
         {UINT64_C(0x0a5e742c2997341c), UINT64_C(0xb0f883d38000de5d)}},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct draws_pair got = draws_philox(rows[i].low, rows[i].high, rows[i].key, rows[i].rounds);
        assert_int_equal(got.even, rows[i].want.even);
        assert_int_equal(got.odd, rows[i].want.odd);
    }
}

/* "Same seed, same bytes": these must never change. */
static void draws_are_pinned(void **state)
{
    (void)state;
    const struct draws d = draws_of(42, 7, "pinned");
    double sum = 0.0;
    for (int64_t n = 0; n < 1000; n++) sum += draws_gauss(&d, n);
    char hex[40];
    snprintf(hex, sizeof hex, "%a", sum);
    assert_string_equal(hex, "-0x1.2be08c42814d4p+4");
}

static void a_row_is_its_draws_one_by_one(void **state)
{
    (void)state;
    const struct draws d = draws_of(1, 1, "adc.x");
    for (int64_t first = 0; first < 5; first++) {
        for (unsigned n = 0; n < 40; n++) {
            uint64_t row[41];
            row[n] = 77;
            draws_row(&d, first, n, row);
            for (unsigned i = 0; i < n; i++) assert_int_equal(row[i], draws_u64(&d, first + i));
            assert_int_equal(row[n], 77);
        }
    }
}

static void each_source_has_its_own(void **state)
{
    (void)state;
    const struct draws one = draws_of(1, 1, "adc.x");
    const struct draws others[] = {draws_of(2, 1, "adc.x"), draws_of(1, 2, "adc.x"), draws_of(1, 1, "adc.y")};
    enum { N = 100000 };
    for (size_t k = 0; k < COUNT(others); k++) {
        double sum = 0.0;
        for (int64_t n = 0; n < N; n++) sum += draws_gauss(&one, n) * draws_gauss(&others[k], n);
        assert_true(fabs(sum) < 5.0 * sqrt((double)N));
    }
}

/* By sample number, and by instants of a clock, as converters count. */
static void neighbours_are_normal_and_uncorrelated(void **state)
{
    (void)state;
    const int64_t strides[] = {1, 2, 31250, 244};
    enum { N = 400000 };
    const struct draws d = draws_of(rig_seed(3), 0, "gauss");
    for (size_t k = 0; k < COUNT(strides); k++) {
        double m1 = 0, m2 = 0, m4 = 0, lag = 0, last = 0;
        for (int64_t n = 0; n < N; n++) {
            const double z = draws_gauss(&d, n * strides[k]);
            m1 += z;
            m2 += z * z;
            m4 += z * z * z * z;
            lag += z * last;
            last = z;
        }
        const double root_n = sqrt((double)N);
        assert_true(fabs(m1 / N) < 5.0 / root_n);
        assert_true(fabs(m2 / N - 1.0) < 5.0 * sqrt(2.0) / root_n);
        assert_true(fabs(m4 / N - 3.0) < 5.0 * sqrt(96.0) / root_n);
        assert_true(fabs(lag / N) < 5.0 / root_n);
    }
}

static void no_draw_is_larger_than_the_largest(void **state)
{
    (void)state;
    const double ends[] = {rng_normal(0), rng_normal(UINT64_MAX)};
    assert_true(ends[0] == -ends[1]);
    assert_true(ends[1] > DRAWS_GAUSS_MAX - 0.2 && ends[1] < DRAWS_GAUSS_MAX);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(philox_gives_the_published_answers), cmocka_unit_test(draws_are_pinned),
        cmocka_unit_test(a_row_is_its_draws_one_by_one),      cmocka_unit_test(each_source_has_its_own),
        cmocka_unit_test(no_draw_is_larger_than_the_largest), cmocka_unit_test(neighbours_are_normal_and_uncorrelated),
    };
    return cmocka_run_group_tests_name("draws", tests, NULL, NULL);
}
