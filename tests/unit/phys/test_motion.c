/* One axis: where commands take it, limits, and continuity whatever comes when. */
#include "rig.h"

#include "base/rng.h"
#include "base/sched.h"
#include "phys/motion/motion.h"

#include <math.h>

static const struct motion_limits limits = {.rate_radps = 2.0, .accel_radps2 = 4.0};
static const struct motion_limits bounded = {2.0, 4.0, true, -1.0, 3.0};

static int64_t ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e9);
}

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static void expect(const struct motion *m, double t_s, double angle, double rate, double accel)
{
    const struct motion_state s = motion_at(m, ns(t_s));
    near(s.angle_rad, angle, 1e-12);
    near(s.rate_radps, rate, 1e-12);
    near(s.accel_radps2, accel, 1e-12);
}

static struct motion axis(const struct motion_limits *l)
{
    struct motion m;
    motion_init(&m, l);
    return m;
}

/* 10 rad: up to 2 rad/s in 0.5 s and 0.5 rad, 4.5 s at 2 rad/s, down. */
static void a_long_way_is_a_trapezium(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_true(motion_at_rest(&m, 0));
    assert_int_equal(motion_position(&m, 10.0, 0.0, ns(1)), MOTION_OK);
    expect(&m, 1.25, 0.125, 1.0, 4.0);
    expect(&m, 2.5, 0.5 + 2.0, 2.0, 0.0);
    expect(&m, 6.25, 9.875, 1.0, -4.0);
    expect(&m, 6.5, 10.0, 0.0, 0.0);
    assert_int_equal(motion_rest_ns(&m), ns(6.5));
    assert_false(motion_at_rest(&m, ns(6.5) - 1));
    assert_true(motion_at_rest(&m, ns(6.5)));
    assert_int_equal(motion_mode(&m), MOTION_POSITION);
}

static void a_short_way_is_a_triangle(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_position(&m, -0.25, 0.0, 0), MOTION_OK);
    expect(&m, 0.25, -0.125, -1.0, 4.0);
    expect(&m, 0.5, -0.25, 0.0, 0.0);
}

static void a_command_may_ask_for_less_rate(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_position(&m, 2.0, 0.5, 0), MOTION_OK);
    expect(&m, 1.0, 0.03125 + 0.4375, 0.5, 0.0);
}

static void a_rate_goes_on_and_a_stop_ends_it(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_rate(&m, -1.0, 0), MOTION_OK);
    assert_true(motion_rest_ns(&m) == INT64_MAX);
    expect(&m, 100.0, -0.125 - 99.75, -1.0, 0.0);
    motion_stop(&m, ns(100));
    expect(&m, 100.25, -100.0, 0.0, 0.0);
    assert_int_equal(motion_rest_ns(&m), ns(100.25));
    assert_int_equal(motion_mode(&m), MOTION_STOPPED);
}

static void a_bounded_axis_stops_at_its_limit(void **state)
{
    (void)state;
    struct motion m = axis(&bounded);
    assert_int_equal(motion_rate(&m, 2.0, 0), MOTION_OK);
    expect(&m, 1.0, 1.5, 2.0, 0.0);
    expect(&m, 2.0, 3.0, 0.0, 0.0);
    assert_int_equal(motion_rate(&m, -1.0, ns(3)), MOTION_OK);
    expect(&m, 8.0, -1.0, 0.0, 0.0);
}

/* 0 to 1 rad/s at 1 s, -1 at 3 s, 0 at 5 s. */
static void a_profile_is_rates_with_ramps(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    const double t[] = {1.0, 3.0, 5.0};
    const double w[] = {1.0, -1.0, 0.0};
    assert_int_equal(motion_profile(&m, t, w, 3, ns(10)), MOTION_OK);
    expect(&m, 10.9, 0.0, 0.0, 0.0);
    expect(&m, 12.0, 0.875, 1.0, 0.0);
    expect(&m, 13.25, 1.875 + 0.125, 0.0, -4.0);
    expect(&m, 14.0, 1.875 - 0.5, -1.0, 0.0);
    expect(&m, 16.0, 0.375 - 0.125, 0.0, 0.0);
    assert_int_equal(motion_rest_ns(&m), ns(15.25));
}

static void a_sine_starts_at_rest_at_its_lowest_point(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_sine(&m, 0.25, 0.5, 0), MOTION_OK);
    expect(&m, 0.5, -0.25, 0.0, 0.25 * 9.8696044010893586); /* after the way to -0.25 */
    near(motion_at(&m, ns(1.5)).angle_rad, 0.25, 1e-12);
    near(motion_at(&m, ns(1.0)).rate_radps, 0.25 * 3.141592653589793, 1e-12);
    near(motion_at(&m, ns(86400.5)).angle_rad, -0.25, 1e-9); /* a day of whole cycles later */
    assert_true(motion_rest_ns(&m) == INT64_MAX);
}

static void what_exceeds_a_limit_is_refused_and_changes_nothing(void **state)
{
    (void)state;
    struct motion m = axis(&bounded);
    const double t[] = {0.0, 0.5, 2.0};
    const double soon[] = {0.0, 0.5, 1.0};
    const double steep[] = {1.0, -1.5, 0.0};
    const double far[] = {2.0, 2.0, 0.0};
    const double nan_s[] = {NAN};
    const double falling[] = {1.0, 0.5};
    assert_int_equal(motion_position(&m, 1.0, 1.0, 0), MOTION_OK);
    const struct motion_state was = motion_at(&m, ns(0.3));
    assert_int_equal(motion_position(&m, 1.0, 2.1, ns(0.2)), MOTION_RATE_LIMIT);
    assert_int_equal(motion_position(&m, 3.1, 0.0, ns(0.2)), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_position(&m, -1.1, 0.0, ns(0.2)), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_rate(&m, -2.1, ns(0.2)), MOTION_RATE_LIMIT);
    assert_int_equal(motion_sine(&m, 0.5, 0.7, ns(0.2)), MOTION_RATE_LIMIT);
    assert_int_equal(motion_sine(&m, 0.1, 1.1, ns(0.2)), MOTION_ACCEL_LIMIT);
    assert_int_equal(motion_sine(&m, 2.5, 0.01, ns(0.2)), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_sine(&m, 0.0, 1.0, ns(0.2)), MOTION_BAD_SINE);
    assert_int_equal(motion_sine(&m, 0.1, NAN, ns(0.2)), MOTION_BAD_SINE);
    assert_int_equal(motion_profile(&m, soon, steep, 3, ns(0.2)), MOTION_ACCEL_LIMIT);
    assert_int_equal(motion_profile(&m, t, far, 3, ns(0.2)), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_profile(&m, nan_s, steep, 1, ns(0.2)), MOTION_BAD_PROFILE);
    assert_int_equal(motion_profile(&m, falling, steep, 2, ns(0.2)), MOTION_BAD_PROFILE);
    assert_int_equal(motion_profile(&m, t, steep, 0, ns(0.2)), MOTION_BAD_PROFILE);
    assert_int_equal(motion_position(&m, NAN, 0.0, ns(0.2)), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_position(&m, 1.0, NAN, ns(0.2)), MOTION_RATE_LIMIT);
    assert_int_equal(motion_rate(&m, NAN, ns(0.2)), MOTION_RATE_LIMIT);
    assert_int_equal(motion_sine(&m, NAN, 1.0, ns(0.2)), MOTION_BAD_SINE);
    const struct motion_state is = motion_at(&m, ns(0.3));
    near(is.angle_rad, was.angle_rad, 0.0);
    near(is.rate_radps, was.rate_radps, 0.0);
    for (int i = MOTION_OK; i <= MOTION_NO_AXIS; i++) assert_non_null(motion_result_text((enum motion_result)i));
}

/* A way of 30 million years ends at no instant that can be told; a turn beyond counting is refused. */
static void what_lies_beyond_the_nanoseconds_is_never(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_position(&m, 1.1e9, 0.0, 0), MOTION_ANGLE_LIMIT);
    assert_int_equal(motion_position(&m, 1e9, 1e-6, 0), MOTION_OK);
    assert_true(motion_rest_ns(&m) == INT64_MAX);
    near(motion_at(&m, ns(86400)).angle_rad, 0.0864, 1e-9);
    motion_stop(&m, ns(86400));
    assert_true(motion_rest_ns(&m) < ns(86401));
}

static void random_command(struct motion *m, struct rng *r, int64_t t_ns)
{
    const double t[] = {0.5 * rng_uniform(r), 3.0 + rng_uniform(r), 6.0};
    const double w[] = {rng_gauss(r), 0.5 * rng_gauss(r), rng_gauss(r)};
    switch (rng_u64(r) % 5) {
    case 0:
        motion_position(m, 2.0 * rng_gauss(r), 2.0 * rng_uniform(r), t_ns);
        break;
    case 1:
        motion_rate(m, rng_gauss(r), t_ns);
        break;
    case 2:
        motion_sine(m, rng_uniform(r), rng_uniform(r), t_ns);
        break;
    case 3:
        motion_profile(m, t, w, 3, t_ns);
        break;
    default:
        motion_stop(m, t_ns);
    }
}

/* Between two looks the angle moves as the rate says and the rate as the limit allows, commands or not. */
static void angle_and_rate_are_continuous_and_within_limits(void **state)
{
    (void)state;
    enum { LOOKS = 200000, DT_NS = 1000000 };
    struct rng r = rng_stream(rig_seed(1), 0, "commands");
    const struct motion_limits *each[] = {&limits, &bounded};
    for (unsigned k = 0; k < COUNT(each); k++) {
        struct motion m = axis(each[k]);
        struct motion_state was = motion_at(&m, 0);
        const double dt_s = DT_NS * 1e-9;
        for (int64_t i = 1; i <= LOOKS; i++) {
            const struct motion_state s = motion_at(&m, i * DT_NS);
            near(s.angle_rad, was.angle_rad + 0.5 * (s.rate_radps + was.rate_radps) * dt_s, 4.0 * dt_s * dt_s);
            near(s.rate_radps, was.rate_radps, 4.0 * dt_s + 1e-9);
            near(s.rate_radps, 0.0, 2.0 + 1e-12);
            near(s.accel_radps2, 0.0, 4.0 + 1e-12);
            if (each[k]->bounded) near(s.angle_rad, 1.0, 2.0 + 1e-9);
            if (rng_u64(&r) % 1500 == 0) random_command(&m, &r, i * DT_NS);
            const struct motion_state after = motion_at(&m, i * DT_NS);
            near(after.angle_rad, s.angle_rad, 1e-9);
            near(after.rate_radps, s.rate_radps, 1e-9);
            was = after;
        }
    }
}

static void the_past_is_remembered(void **state)
{
    (void)state;
    struct motion m = axis(&limits);
    assert_int_equal(motion_rate(&m, 1.0, 0), MOTION_OK);
    assert_int_equal(motion_rate(&m, -1.0, ns(1.0)), MOTION_OK);
    motion_stop(&m, ns(1.001));
    expect(&m, 0.95, 0.825, 1.0, 0.0);
    expect(&m, 1.0005, 0.875 + 1.0 * 0.0005 - 2.0 * 0.0005 * 0.0005, 1.0 - 4.0 * 0.0005, -4.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_long_way_is_a_trapezium),
        cmocka_unit_test(a_short_way_is_a_triangle),
        cmocka_unit_test(a_command_may_ask_for_less_rate),
        cmocka_unit_test(a_rate_goes_on_and_a_stop_ends_it),
        cmocka_unit_test(a_bounded_axis_stops_at_its_limit),
        cmocka_unit_test(a_profile_is_rates_with_ramps),
        cmocka_unit_test(a_sine_starts_at_rest_at_its_lowest_point),
        cmocka_unit_test(what_exceeds_a_limit_is_refused_and_changes_nothing),
        cmocka_unit_test(what_lies_beyond_the_nanoseconds_is_never),
        cmocka_unit_test(angle_and_rate_are_continuous_and_within_limits),
        cmocka_unit_test(the_past_is_remembered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
