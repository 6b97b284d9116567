#include "rig.h"

#include "base/detmath.h"
#include "base/rng.h"

#include <math.h>

/* Bytes of the streams are part of the promise "same seed, same bytes": these must never change. */
static void streams_are_pinned(void **state)
{
    (void)state;
    struct rng r = rng_stream(1, 1, "adc.x");
    const uint64_t first = rng_u64(&r);
    struct rng again = rng_stream(1, 1, "adc.x");
    assert_int_equal(rng_u64(&again), first);
    struct rng other[] = {rng_stream(2, 1, "adc.x"), rng_stream(1, 2, "adc.x"), rng_stream(1, 1, "adc.y")};
    for (size_t i = 0; i < COUNT(other); i++) assert_int_not_equal(rng_u64(&other[i]), first);
    struct rng g = rng_stream(42, 7, "pinned");
    double sum = 0.0;
    for (int i = 0; i < 1000; i++) sum += rng_gauss(&g);
    char hex[40];
    snprintf(hex, sizeof hex, "%a", sum);
    assert_string_equal(hex, "0x1.1c9b06bd175cap+3");
}

static void gauss_has_the_moments_and_tails_of_the_normal_law(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(3), 0, "gauss");
    enum { N = 2000000 };
    double m1 = 0, m2 = 0, m3 = 0, m4 = 0;
    int beyond2 = 0, beyond4 = 0;
    for (int i = 0; i < N; i++) {
        const double z = rng_gauss(&r);
        m1 += z;
        m2 += z * z;
        m3 += z * z * z;
        m4 += z * z * z * z;
        beyond2 += fabs(z) > 2.0;
        beyond4 += fabs(z) > 4.0;
    }
    const double root_n = sqrt((double)N);
    assert_true(fabs(m1 / N) < 5.0 / root_n);
    assert_true(fabs(m2 / N - 1.0) < 5.0 * sqrt(2.0) / root_n);
    assert_true(fabs(m3 / N) < 5.0 * sqrt(15.0) / root_n);
    assert_true(fabs(m4 / N - 3.0) < 5.0 * sqrt(96.0) / root_n);
    assert_true(fabs(beyond2 / (double)N - 0.0455003) < 5.0 * 0.2084 / root_n);
    assert_in_range(beyond4, 127 - 57, 127 + 57); /* 2e6 * 6.334e-5 = 126.7, 5 sigma */
}

static void streams_of_two_sources_are_uncorrelated(void **state)
{
    (void)state;
    struct rng x = rng_stream(1, 1, "adc.x");
    struct rng y = rng_stream(1, 1, "adc.y");
    enum { N = 100000 };
    double sum = 0.0;
    for (int i = 0; i < N; i++) sum += rng_gauss(&x) * rng_gauss(&y);
    assert_true(fabs(sum) < 5.0 * sqrt((double)N));
}

static double ulps(double got, double want)
{
    int e;
    frexp(want, &e);
    return fabs(got - want) / ldexp(1.0, e - 53);
}

static void elementary_functions_agree_with_libm(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(4), 0, "detmath");
    for (int i = 0; i < 200000; i++) {
        const double u = rng_uniform(&r);
        const double big = ldexp(u, (int)(rng_u64(&r) % 600) - 300);
        assert_true(ulps(det_log(big), log(big)) <= 4.0 || fabs(det_log(big) - log(big)) < 1e-16);
        const double x = (u - 0.5) * 60.0;
        assert_true(ulps(det_exp(x), exp(x)) <= 4.0);
        const double a = (u - 0.5) * 2e3;
        assert_true(fabs(det_sin(a) - sin(a)) < 4e-16);
        assert_true(fabs(det_cos(a) - cos(a)) < 4e-16);
        const struct det_pair p = det_sin_cos(a);
        assert_true(p.sin == det_sin(a) && p.cos == det_cos(a));
        const double small = ldexp(u, (int)(i % 60) - 50);
        assert_true(ulps(det_atan2(u - 0.5, small), atan2(u - 0.5, small)) <= 4.0);
        assert_true(ulps(det_atan2(small, u - 0.5), atan2(small, u - 0.5)) <= 4.0);
        assert_true(ulps(det_atan2(-small, u - 0.5), atan2(-small, u - 0.5)) <= 4.0);
    }
    assert_true(det_atan2(0.0, 0.0) == 0.0);
    assert_true(det_atan2(0.0, -1.0) == atan2(0.0, -1.0));
    assert_true(det_atan2(-1.0, 0.0) == atan2(-1.0, 0.0));
    assert_true(det_sin(0.0) == 0.0);
    assert_true(det_cos(0.0) == 1.0);
    assert_true(det_sin_cos(0.0).sin == 0.0 && det_sin_cos(0.0).cos == 1.0);
    assert_true(signbit(det_sin_cos(-0.0).sin) && signbit(det_sin(-0.0)));
    assert_true(det_log(1.0) == 0.0);
    assert_true(det_exp(0.0) == 1.0);
}

/* A walk in small steps with jumps, against libm and against a fresh one at each angle: to the bit. */
static void the_near_sine_does_not_depend_on_what_is_kept(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(6), 0, "near");
    struct det_near walk = {0};
    double x = 0.0;
    for (int i = 0; i < 200000; i++) {
        x += i % 1000 ? 0.01 * (rng_uniform(&r) - 0.45) : 200.0 * (rng_uniform(&r) - 0.5);
        struct det_near fresh = {0};
        const struct det_pair p = det_sin_cos_near(&walk, x), q = det_sin_cos_near(&fresh, x);
        assert_true(p.sin == q.sin && p.cos == q.cos);
        if (fabs(p.sin - sin(x)) > 4e-16 || fabs(p.cos - cos(x)) > 4e-16) fail_msg("at %.17g", x);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(streams_are_pinned),
        cmocka_unit_test(gauss_has_the_moments_and_tails_of_the_normal_law),
        cmocka_unit_test(streams_of_two_sources_are_uncorrelated),
        cmocka_unit_test(elementary_functions_agree_with_libm),
        cmocka_unit_test(the_near_sine_does_not_depend_on_what_is_kept),
    };
    return cmocka_run_group_tests_name("rng", tests, NULL, NULL);
}
