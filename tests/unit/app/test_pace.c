#include "rig.h"

#include "app/pace.h"
#include "base/rng.h"

#include <string.h>

static struct pace_hist h;

static int fresh(void **state)
{
    (void)state;
    memset(&h, 0, sizeof h);
    return 0;
}

static void an_empty_histogram_tells_zero(void **state)
{
    (void)state;
    assert_true(pace_hist_us(&h, 0.5) == 0.0);
}

static void a_percentile_is_not_below_the_truth_and_at_most_a_bucket_above(void **state)
{
    (void)state;
    static const int64_t us[] = {0, 1, 3, 4, 7, 8, 10, 15, 100, 999, 12345, 1000000, 60000000};
    for (size_t i = 0; i < COUNT(us); i++) {
        memset(&h, 0, sizeof h);
        for (int k = 0; k < 100; k++) pace_hist_add(&h, us[i] * 1000);
        pace_hist_add(&h, INT64_C(3600) * 1000000000); /* else the largest would answer for all */
        const double p50 = pace_hist_us(&h, 0.5);
        assert_true(p50 >= (double)us[i]);
        assert_true(p50 <= 1.25 * (double)us[i] + 1.0);
    }
}

static void percentiles_of_a_known_distribution(void **state)
{
    (void)state;
    for (int64_t us = 1; us <= 1000; us++) pace_hist_add(&h, us * 1000); /* 1 .. 1000 us, once each */
    assert_int_equal(h.total, 1000);
    assert_true(pace_hist_us(&h, 0.5) >= 500 && pace_hist_us(&h, 0.5) <= 640);
    assert_true(pace_hist_us(&h, 0.99) >= 990 && pace_hist_us(&h, 0.99) <= 1000); /* never above the largest */
    assert_true(pace_hist_us(&h, 1.0) == 1000.0);
}

static void what_is_early_counts_as_on_time_and_the_largest_is_exact(void **state)
{
    (void)state;
    pace_hist_add(&h, -5000);
    pace_hist_add(&h, 1234567);
    assert_int_equal(h.count[0], 1);
    assert_int_equal(h.max_ns, 1234567);
    pace_hist_add(&h, INT64_MAX); /* beyond the last bucket */
    assert_int_equal(h.total, 3);
}

static void an_event_a_millisecond_late_is_late(void **state)
{
    (void)state;
    struct pace p;
    pace_init(&p, PACE_WALL);
    pace_event(&p, 0, PACE_LATE_NS - 1);
    assert_int_equal(p.late, 0);
    pace_event(&p, 0, PACE_LATE_NS);
    assert_int_equal(p.late, 1);
    assert_int_equal(p.events.total, 2);
}

static void far_behind_time_slips_once_and_then_follows(void **state)
{
    (void)state;
    struct pace p;
    pace_init(&p, PACE_WALL);
    pace_start(&p, 0);
    p.origin_ns -= 10 * (int64_t)PACE_SLIP_NS; /* as if the process had stood still */
    assert_int_equal(pace_target_ns(&p, 42), 42);
    assert_int_equal(p.slips, 1);
    const int64_t next_ns = pace_target_ns(&p, 42);
    assert_true(next_ns >= 42 && next_ns < PACE_SLIP_NS);
    assert_int_equal(p.slips, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(an_empty_histogram_tells_zero, fresh),
        cmocka_unit_test_setup(a_percentile_is_not_below_the_truth_and_at_most_a_bucket_above, fresh),
        cmocka_unit_test_setup(percentiles_of_a_known_distribution, fresh),
        cmocka_unit_test_setup(what_is_early_counts_as_on_time_and_the_largest_is_exact, fresh),
        cmocka_unit_test_setup(an_event_a_millisecond_late_is_late, fresh),
        cmocka_unit_test_setup(far_behind_time_slips_once_and_then_follows, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
