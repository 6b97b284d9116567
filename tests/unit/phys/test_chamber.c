/* Thermal chamber: ramps, limits, and bodies that follow. tests/py/lab/test_physics.py integrates the lags by itself. */
#include "rig.h"

#include "base/rng.h"
#include "base/sched.h"
#include "phys/chamber.h"

#include <math.h>

static int64_t ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e9);
}

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static struct chamber up(double tau_case_s, double tau_element_s)
{
    struct chamber c;
    struct chamber_cfg cfg = chamber_default();
    cfg.present = true;
    cfg.tau_case_s = tau_case_s;
    cfg.tau_element_s = tau_element_s;
    chamber_init(&c, &cfg);
    return c;
}

/* 1 K/min at power-on; heating up to 5, cooling up to 3. */
static void the_air_goes_straight_to_its_set_point(void **state)
{
    (void)state;
    struct chamber c = up(0, 0);
    assert_true(chamber_stable(&c, 0));
    assert_int_equal(chamber_set(&c, 85.0, ns(60)), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(60)), 25.0, 0.0);
    near(chamber_air_degc(&c, ns(1860)), 55.0, 1e-12);
    assert_int_equal(chamber_stable_ns(&c), ns(3660));
    assert_false(chamber_stable(&c, ns(3659)));
    near(chamber_air_degc(&c, ns(1e6)), 85.0, 0.0);
}

static void the_lesser_of_ramp_and_limit_holds(void **state)
{
    (void)state;
    struct chamber c = up(0, 0);
    near(chamber_ramp_max_k_per_min(&c), 5.0, 0.0);
    assert_int_equal(chamber_ramp(&c, 5.0, 0), CHAMBER_OK);
    assert_int_equal(chamber_set(&c, 85.0, 0), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(120)), 35.0, 1e-12);
    assert_int_equal(chamber_set(&c, -60.0, ns(120)), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(240)), 29.0, 1e-12);
    assert_int_equal(chamber_ramp(&c, 1.5, ns(240)), CHAMBER_OK); /* goes on slower */
    near(chamber_air_degc(&c, ns(360)), 26.0, 1e-12);
}

static void what_is_out_of_range_is_refused_and_changes_nothing(void **state)
{
    (void)state;
    struct chamber c = up(0, 0);
    assert_int_equal(chamber_set(&c, 50.0, 0), CHAMBER_OK);
    const double bad_degc[] = {85.1, -60.1, NAN, INFINITY};
    for (size_t i = 0; i < COUNT(bad_degc); i++) {
        assert_int_equal(chamber_set(&c, bad_degc[i], ns(60)), CHAMBER_OUT_OF_RANGE);
    }
    const double bad_ramp[] = {0.0, -1.0, 5.1, NAN};
    for (size_t i = 0; i < COUNT(bad_ramp); i++) {
        assert_int_equal(chamber_ramp(&c, bad_ramp[i], ns(60)), CHAMBER_OUT_OF_RANGE);
    }
    near(chamber_air_degc(&c, ns(120)), 27.0, 1e-12);
    near(c.set_degc, 50.0, 0.0);
}

static void the_thermometer_has_an_offset_and_steps(void **state)
{
    (void)state;
    struct chamber_cfg cfg = chamber_default();
    cfg.readout_offset_k = 0.33;
    cfg.readout_resolution_k = 0.5;
    struct chamber c;
    chamber_init(&c, &cfg);
    near(chamber_shown_degc(&c, 0), 25.5, 0.0);
    near(chamber_air_degc(&c, 0), 25.0, 0.0);
}

/* After a step that is as good as one, a single lag is 1 - exp(-t/tau); two equal ones are 1 - (1 + t/tau) exp(-t/tau). */
static void lags_answer_a_step(void **state)
{
    (void)state;
    struct chamber c = up(100.0, 100.0);
    c.cfg.heating_max_k_per_min = c.ramp_k_per_min = 6e7; /* 10 K in 10 us */
    struct chamber_body two;
    struct chamber_body element_only;
    chamber_put_in(&c, &two, 0, 0);
    chamber_put_in(&c, &element_only, 1e-9, 50.0);
    assert_int_equal(chamber_set(&c, 35.0, 0), CHAMBER_OK);
    near(chamber_case_degc(&c, &two, ns(100)), 35.0 - 10.0 * exp(-1.0), 1e-6);
    near(chamber_element_degc(&c, &two, ns(100)), 35.0 - 20.0 * exp(-1.0), 1e-6);
    near(chamber_case_degc(&c, &element_only, ns(100)), 35.0, 1e-6);
    near(chamber_element_degc(&c, &element_only, ns(100)), 35.0 - 10.0 * exp(-2.0), 1e-6);
    near(chamber_element_degc(&c, &two, ns(1e7)), 35.0, 1e-12);
}

static void without_lags_the_body_is_as_warm_as_the_air(void **state)
{
    (void)state;
    struct chamber c = up(0, 0);
    struct chamber_body b;
    chamber_put_in(&c, &b, 0, 0);
    assert_int_equal(chamber_set(&c, 85.0, 0), CHAMBER_OK);
    near(chamber_case_degc(&c, &b, ns(600)), 35.0, 1e-12);
    near(chamber_element_degc(&c, &b, ns(600)), 35.0, 1e-12);
}

/* Commands that change nothing may come as often as they like. */
static void temperatures_do_not_depend_on_how_often_the_course_is_cut(void **state)
{
    (void)state;
    struct chamber a = up(180.0, 360.0);
    struct chamber b = up(180.0, 360.0);
    struct chamber_body in_a;
    struct chamber_body in_b;
    chamber_put_in(&a, &in_a, 0, 0);
    chamber_put_in(&b, &in_b, 0, 0);
    assert_int_equal(chamber_set(&a, 85.0, 0), CHAMBER_OK);
    assert_int_equal(chamber_set(&b, 85.0, 0), CHAMBER_OK);
    for (int i = 1; i <= 5000; i++) {
        assert_int_equal(chamber_set(&b, 85.0, ns(i)), CHAMBER_OK);
        near(chamber_air_degc(&b, ns(i)), chamber_air_degc(&a, ns(i)), 1e-9);
        near(chamber_case_degc(&b, &in_b, ns(i)), chamber_case_degc(&a, &in_a, ns(i)), 1e-9);
        near(chamber_element_degc(&b, &in_b, ns(i)), chamber_element_degc(&a, &in_a, ns(i)), 1e-9);
    }
}

/* -60 and +85 degC and back to where it began, twice, soaked; then as far as +50 degC and back: 0.8 of the way to hot. */
static void a_cycle_is_cold_then_hot_and_a_part_of_one_stays(void **state)
{
    (void)state;
    static const struct {
        double set_degc, after_s, cycles;
    } rows[] = {
        {85, 20000, 0}, /* hot without having been cold */
        {-60, 20000, 0}, {85, 9600, 1},    {25, 9000, 1},     {-60, 20000, 1}, {85, 20000, 2},
        {-60, 20000, 2}, {50, 20000, 2.8}, {-60, 20000, 2.8}, {0, 20000, 2.8}, {85, 20000, 3},
    };
    struct chamber c = up(180.0, 360.0);
    struct chamber_body b;
    chamber_put_in(&c, &b, 0, 0);
    double t_s = 0.0, was = 0.0;
    for (size_t i = 0; i < COUNT(rows); i++) {
        assert_int_equal(chamber_set(&c, rows[i].set_degc, ns(t_s)), CHAMBER_OK);
        for (double past_s = 600.0; past_s < rows[i].after_s; past_s += 60.0) { /* a look is nothing to the body */
            const double now = chamber_body_cycles(&c, &b, ns(t_s + past_s));
            assert_true(now >= was);
            was = now;
        }
        t_s += rows[i].after_s;
        near(chamber_body_cycles(&c, &b, ns(t_s)), rows[i].cycles, 1e-3);
    }
}

/* In the air of the article's run-in, but too fast for the element: it never gets cold. */
static void air_alone_makes_no_cycle(void **state)
{
    (void)state;
    struct chamber c = up(180.0, 3600.0);
    struct chamber_body b;
    chamber_put_in(&c, &b, 0, 0);
    assert_int_equal(chamber_set(&c, -60.0, 0), CHAMBER_OK);
    assert_int_equal(chamber_set(&c, 85.0, ns(5200)), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(5200)), -60.0, 1e-9);
    near(chamber_body_cycles(&c, &b, ns(1e6)), 0.0, 0.0);
}

/* What is felt, of a random life in the chamber: the fold over steps of 1 s misses what the element moves in a second. Lags of
 * any ratio, also none and equal ones; commands at random instants, an overshoot now and then. */
static void play_follows_the_extremes(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(5);
    struct rng r = rng_stream(seed, 0, "play");
    static const struct {
        unsigned every_s;
        double k_per_min;
    } rows[] = {{1500, 1.0}, {400, 3.0}, {100, 5.0}};
    unsigned turned = 0;
    for (unsigned life = 0; life < 32; life++) {
        const double lags_s[] = {0.0, 1e-9, 60.0, 180.0, 180.0, 180.0000001, 360.0, 2000.0};
        struct chamber c = up(lags_s[rng_u64(&r) % COUNT(lags_s)], lags_s[rng_u64(&r) % COUNT(lags_s)]);
        c.ramp_k_per_min = rows[life % COUNT(rows)].k_per_min;
        struct chamber_body b;
        struct chamber_play play[2];
        double felt[2], last = 25.0, way = 0.0;
        chamber_put_in(&c, &b, 0, 0);
        for (unsigned i = 0; i < 2; i++) {
            chamber_play_add(&b, &play[i], i * 3.0 * rng_uniform(&r));
            felt[i] = last;
        }
        for (int t_s = 0; t_s < 10000; t_s++) {
            const double element = chamber_element_degc(&c, &b, ns(t_s));
            if (way * (element - last) < 0.0) turned++;
            if (element != last) way = element - last;
            last = element;
            for (unsigned i = 0; i < 2; i++) {
                felt[i] = fmin(fmax(felt[i], element - play[i].half_k), element + play[i].half_k);
                const double got = chamber_felt_degc(&c, &b, &play[i], ns(t_s));
                if (fabs(got - felt[i]) > (play[i].half_k > 0.0 ? c.ramp_k_per_min / 60.0 : 0.0))
                    fail_msg("TEST_SEED=%llu: life %u, %d s: felt %.9g, want %.9g", (unsigned long long)seed, life, t_s,
                             got, felt[i]);
            }
            if (rng_u64(&r) % rows[life % COUNT(rows)].every_s) continue;
            chamber_overshoot(&c, rng_u64(&r) % 2 ? 0.0 : 8.0 * rng_uniform(&r), ns(t_s));
            assert_int_equal(chamber_set(&c, -60.0 + 145.0 * rng_uniform(&r), ns(t_s)), CHAMBER_OK);
        }
    }
    assert_true(turned > 100);
}

/* 5 K past the set point and back with the ramp the other way; no farther past it than the step was; stable when it is back. */
static void a_faulty_controller_overshoots(void **state)
{
    (void)state;
    struct chamber c = up(0, 0);
    c.ramp_k_per_min = 5.0; /* cooling no faster than 3 */
    chamber_overshoot(&c, 5.0, 0);
    near(chamber_air_degc(&c, ns(600)), 25.0, 0.0);
    assert_int_equal(chamber_set(&c, 45.0, ns(600)), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(600 + 240)), 45.0, 1e-9);
    near(chamber_air_degc(&c, ns(600 + 300)), 50.0, 1e-9);
    near(chamber_air_degc(&c, ns(600 + 360)), 47.0, 1e-9);
    assert_int_equal(chamber_stable_ns(&c), ns(600 + 400));
    near(chamber_air_degc(&c, ns(1e6)), 45.0, 0.0);
    assert_int_equal(chamber_set(&c, 43.0, ns(2e6)), CHAMBER_OK);
    near(chamber_air_degc(&c, ns(2e6 + 80)), 41.0, 1e-9);
    chamber_overshoot(&c, 0.0, ns(2e6 + 80)); /* mended: straight back */
    near(chamber_air_degc(&c, ns(2e6 + 80 + 24)), 43.0, 1e-9);
    assert_int_equal(chamber_stable_ns(&c), ns(2e6 + 80 + 24));
}

/* Up to the heat of a cycle and back by an overshoot: the cycle stays counted; cold the same, before the next command. */
static void a_cycle_that_was_counted_stays(void **state)
{
    (void)state;
    struct chamber c;
    struct chamber_body b;
    struct chamber_cfg cfg = chamber_default();
    cfg.present = true;
    chamber_init(&c, &cfg);
    chamber_put_in(&c, &b, 18.0, 36.0);
    const int64_t hour_ns = 3600 * NS_PER_S;
    assert_int_equal(chamber_set(&c, -48.0, 0), CHAMBER_OK);
    chamber_overshoot(&c, 10.0, 0);
    assert_int_equal(chamber_set(&c, -40.0, hour_ns), CHAMBER_OK);
    assert_int_equal(chamber_set(&c, -48.0, 2 * hour_ns), CHAMBER_OK); /* by way of -58 */
    assert_int_equal(chamber_set(&c, 70.0, 6 * hour_ns), CHAMBER_OK);  /* by way of 80 */
    double was = 0.0;
    for (int64_t t_ns = 6 * hour_ns; t_ns < 12 * hour_ns; t_ns += 60 * NS_PER_S) {
        const double now = chamber_body_cycles(&c, &b, t_ns);
        assert_true(now >= was);
        was = now;
    }
    assert_true(was == 1.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_air_goes_straight_to_its_set_point),
        cmocka_unit_test(the_lesser_of_ramp_and_limit_holds),
        cmocka_unit_test(what_is_out_of_range_is_refused_and_changes_nothing),
        cmocka_unit_test(the_thermometer_has_an_offset_and_steps),
        cmocka_unit_test(lags_answer_a_step),
        cmocka_unit_test(without_lags_the_body_is_as_warm_as_the_air),
        cmocka_unit_test(temperatures_do_not_depend_on_how_often_the_course_is_cut),
        cmocka_unit_test(a_cycle_is_cold_then_hot_and_a_part_of_one_stays),
        cmocka_unit_test(air_alone_makes_no_cycle),
        cmocka_unit_test(play_follows_the_extremes),
        cmocka_unit_test(a_faulty_controller_overshoots),
        cmocka_unit_test(a_cycle_that_was_counted_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
