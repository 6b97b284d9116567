/* Supply: volts, and the exact instants at which what it feeds goes off and on. */
#include "rig.h"

#include "base/rng.h"
#include "base/sched.h"
#include "phys/supply.h"

#include <math.h>

static int64_t ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e9);
}

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static struct supply up(double slew_v_per_s)
{
    struct supply s;
    struct supply_cfg c = supply_default(); /* 12 V, off below 9 V, on from 9.5 V */
    c.present = true;
    c.slew_v_per_s = slew_v_per_s;
    supply_init(&s, &c);
    return s;
}

static void a_supply_that_is_not_there_feeds_always(void **state)
{
    (void)state;
    struct supply s;
    const struct supply_cfg c = supply_default();
    supply_init(&s, &c);
    supply_output(&s, false, 0);
    assert_true(supply_feeds(&s, true, 5));
    assert_true(supply_feeds(&s, false, 5));
    assert_true(supply_next_ns(&s, true, 0) == INT64_MAX);
    assert_int_equal(supply_next_ns(&s, false, 7), 7);
}

static void the_output_goes_off_and_on_with_hysteresis(void **state)
{
    (void)state;
    struct supply s = up(0);
    near(supply_volts(&s, 0), 12.0, 0.0);
    assert_true(supply_next_ns(&s, true, 0) == INT64_MAX);
    supply_output(&s, false, 100);
    assert_int_equal(supply_next_ns(&s, true, 100), 100);
    near(supply_volts(&s, 99), 12.0, 0.0);
    near(supply_volts(&s, 100), 0.0, 0.0);
    supply_output(&s, true, 200);
    assert_int_equal(supply_set(&s, 9.2, 200), SUPPLY_OK);
    assert_true(supply_next_ns(&s, false, 200) == INT64_MAX); /* between the thresholds nothing changes */
    assert_true(supply_next_ns(&s, true, 200) == INT64_MAX);
    assert_int_equal(supply_set(&s, 9.5, 300), SUPPLY_OK);
    assert_int_equal(supply_next_ns(&s, false, 300), 300);
}

/* 12 V down at 3 V/s: 9 V after 1 s, the next nanosecond is below it. */
static void a_slewing_output_crosses_where_the_line_does(void **state)
{
    (void)state;
    struct supply s = up(3.0);
    supply_output(&s, false, ns(1));
    near(supply_volts(&s, ns(2)), 9.0, 1e-12);
    assert_true(llabs(supply_next_ns(&s, true, ns(1)) - ns(2)) <= 1);
    near(supply_volts(&s, ns(6)), 0.0, 0.0);
    supply_output(&s, true, ns(6));
    assert_true(llabs(supply_next_ns(&s, false, ns(6)) - ns(6 + 9.5 / 3)) <= 1);
}

static void a_dip_is_felt_from_its_first_to_its_last_nanosecond(void **state)
{
    (void)state;
    struct supply s = up(0);
    assert_int_equal(supply_dip(&s, 2.0, 500, 100, 0), SUPPLY_OK);
    assert_true(supply_next_ns(&s, true, 0) == INT64_MAX); /* 10 V is enough */
    assert_int_equal(supply_dip(&s, 2.0, 550, 100, 0), SUPPLY_OK);
    assert_int_equal(supply_next_ns(&s, true, 0), 550); /* both: 8 V */
    near(supply_volts(&s, 599), 8.0, 0.0);
    near(supply_volts(&s, 600), 10.0, 0.0);
    assert_int_equal(supply_next_ns(&s, false, 550), 600);
}

/* Two that begin together: each ends by itself. One may be deeper than the supply is high. */
static void dips_that_begin_together_end_apart(void **state)
{
    (void)state;
    struct supply s = up(0);
    assert_int_equal(supply_dip(&s, 4.0, 500, 100, 0), SUPPLY_OK);
    assert_int_equal(supply_dip(&s, 5.0, 500, 900, 0), SUPPLY_OK);
    assert_int_equal(supply_dip(&s, 5.0, 500, 900, 0), SUPPLY_OK);
    supply_dip_end(&s, 4.0, 500, 100, 600); /* over already: nothing */
    near(supply_volts(&s, 600), 2.0, 0.0);
    supply_dip_end(&s, 5.0, 500, 900, 700);
    near(supply_volts(&s, 700), 7.0, 0.0);
    supply_dip_end(&s, 5.0, 500, 900, 800);
    near(supply_volts(&s, 800), 12.0, 0.0);
    assert_int_equal(supply_dip(&s, 50.0, 900, 100, 800), SUPPLY_OK);
    near(supply_volts(&s, 900), 0.0, 0.0);
}

static void what_is_out_of_range_is_refused(void **state)
{
    (void)state;
    struct supply s = up(0);
    assert_int_equal(supply_set(&s, 15.1, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_set(&s, -0.1, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_set(&s, NAN, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_ripple(&s, 5.1, 100.0, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_ripple(&s, 1.0, 0.0, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_ripple(&s, 1.0, 1.1e6, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_dip(&s, 0.0, 10, 10, 0), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_dip(&s, 1.0, 10, 10, 11), SUPPLY_OUT_OF_RANGE);
    assert_int_equal(supply_dip(&s, 1.0, 10, 0, 0), SUPPLY_OUT_OF_RANGE);
    near(supply_volts(&s, 5), 12.0, 0.0);
    for (unsigned i = 0; i < SUPPLY_DIPS_MAX; i++) assert_int_equal(supply_dip(&s, 0.1, 10, 10, 0), SUPPLY_OK);
    assert_int_equal(supply_dip(&s, 0.1, 10, 10, 0), SUPPLY_TOO_MANY_DIPS);
    assert_int_equal(supply_dip(&s, 0.1, 30, 10, 20), SUPPLY_OK); /* the old ones are over */
}

/* A ripple of 0 Hz is none; an output that slews for years does so. */
static void figures_of_a_scenario_may_be_extreme(void **state)
{
    (void)state;
    struct supply s;
    struct supply_cfg c = supply_default();
    c.present = true;
    c.ripple_v = 5.0;
    c.slew_v_per_s = 1e-300;
    supply_init(&s, &c);
    near(supply_volts(&s, ns(1)), 12.0, 0.0);
    assert_true(supply_next_ns(&s, true, 0) == INT64_MAX);
    supply_output(&s, false, ns(1));
    near(supply_volts(&s, ns(2)), 12.0, 2e-6);
    assert_true(llabs(supply_next_ns(&s, true, ns(2)) - ns(3e6 + 1)) < ns(1e-3));
}

static void the_voltmeter_has_steps(void **state)
{
    (void)state;
    struct supply s = up(0);
    s.cfg.readout_resolution_v = 0.5;
    assert_int_equal(supply_set(&s, 10.3, 0), SUPPLY_OK);
    near(supply_shown_v(&s, 0), 10.5, 0.0);
}

/* Against a look at every nanosecond-like step: nothing changes before the instant that was reported, and there it does. */
static void random_courses_change_where_they_are_said_to(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "supply");
    unsigned changes = 0;
    for (unsigned run = 0; run < 400; run++) {
        const double slews[] = {0.0, 20.0, 300.0, 5e4};
        struct supply s = up(slews[run % 4]);
        const double hz = 50.0 * exp(7.0 * rng_uniform(&r));
        assert_int_equal(supply_ripple(&s, 3.5 * rng_uniform(&r), hz, 0), SUPPLY_OK);
        assert_int_equal(supply_set(&s, 8.0 + 5.0 * rng_uniform(&r), ns(1e-3)), SUPPLY_OK);
        assert_int_equal(supply_dip(&s, 1.0 + rng_uniform(&r), ns(0.02 * rng_uniform(&r) + 2e-3), ns(1e-4), ns(1e-3)),
                         0);
        bool fed = supply_feeds(&s, true, ns(1e-3));
        int64_t t_ns = ns(1e-3);
        for (unsigned n = 0; n < 5; n++) {
            const int64_t told_ns = supply_next_ns(&s, fed, t_ns);
            const int64_t end_ns = told_ns < ns(0.1) ? told_ns : ns(0.1);
            const int64_t step_ns = (end_ns - t_ns) / 3000 + 1;
            for (int64_t at = t_ns; at < end_ns; at += step_ns) {
                if (supply_feeds(&s, fed, at) != fed)
                    fail_msg("run %u: at %lld, told %lld", run, (long long)at, (long long)told_ns);
            }
            if (told_ns == INT64_MAX || told_ns >= ns(0.1)) break;
            assert_true(supply_feeds(&s, fed, told_ns) != fed);
            assert_true(told_ns == t_ns || supply_feeds(&s, fed, told_ns - 1) == fed);
            fed = !fed;
            t_ns = told_ns;
            changes++;
        }
    }
    assert_true(changes > 300);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_supply_that_is_not_there_feeds_always),
        cmocka_unit_test(the_output_goes_off_and_on_with_hysteresis),
        cmocka_unit_test(a_slewing_output_crosses_where_the_line_does),
        cmocka_unit_test(a_dip_is_felt_from_its_first_to_its_last_nanosecond),
        cmocka_unit_test(dips_that_begin_together_end_apart),
        cmocka_unit_test(what_is_out_of_range_is_refused),
        cmocka_unit_test(figures_of_a_scenario_may_be_extreme),
        cmocka_unit_test(the_voltmeter_has_steps),
        cmocka_unit_test(random_courses_change_where_they_are_said_to),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
