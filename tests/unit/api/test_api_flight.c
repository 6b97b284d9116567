/* A flight without a bench: what a job means, and what is refused. The motion itself: test_flight.c. */
#include "api/psabench.h"
#include "rig.h"

#include <math.h>
#include <string.h>

enum { LEGS = 3, WHY = 128, PARK = 0, TAXI = 1, STOP = 2, KEYS = 10 + PSABENCH_FLIGHT_PARAMS };

static double legs[LEGS][PSABENCH_FLIGHT_LEG];

/* Parked, taxi, stop; parameters by default. */
static struct psabench_flight_job a_job(void)
{
    const double given[LEGS][2] = {{PARK, 20.0}, {TAXI, 200.0}, {STOP, 5.0}};
    for (unsigned i = 0; i < LEGS; i++) {
        for (unsigned k = 0; k < PSABENCH_FLIGHT_LEG; k++) legs[i][k] = k < 2 ? given[i][k] : (double)NAN;
    }
    return (struct psabench_flight_job){.size = sizeof(struct psabench_flight_job),
                                        .legs = LEGS,
                                        .place = {55.7, 37.5, 150.0},
                                        .plan = {90.0, 4.0, 8.0, 4.0},
                                        .baro = {0.5, 0.0, 0.0, 0.0},
                                        .leg = legs[0]};
}

static void a_flight_goes_leg_by_leg(void **state)
{
    (void)state;
    const struct psabench_flight_job job = a_job();
    psabench_flight *f = psabench_flight_new(&job, NULL, 0);
    assert_non_null(f);
    assert_int_equal(psabench_flight_leg_ns(f, TAXI), INT64_C(20000000000));
    const int64_t t_ns[2] = {0, psabench_flight_leg_ns(f, LEGS)};
    double rows[2][PSABENCH_FLIGHT_STATE], increment[6];
    assert_int_equal(psabench_flight_states(f, t_ns, 2, rows[0]), PSABENCH_OK);
    assert_true(rows[1][1] > rows[0][1]); /* to the east */
    assert_int_equal(psabench_flight_increments(f, 0, 10000000, 1, increment), PSABENCH_OK);
    assert_true(fabs(increment[5] / 0.01 + rows[0][28]) < 1e-3); /* the force holds the weight */
    assert_int_equal(psabench_flight_leg_ns(f, LEGS + 1), PSABENCH_BAD_ARGUMENT);
    psabench_flight_free(f);
    psabench_flight_free(NULL);
}

static void what_cannot_be_flown_is_said(void **state)
{
    (void)state;
    struct psabench_flight_job bad[6];
    char why[WHY];
    for (unsigned i = 0; i < COUNT(bad); i++) bad[i] = a_job();
    bad[0].size--;
    bad[1].legs = 0;
    bad[2].legs = 65;
    bad[3].leg = NULL;
    bad[4].place[0] = (double)NAN;
    bad[5].plan[1] = -1.0;
    for (unsigned i = 0; i < COUNT(bad); i++) assert_null(psabench_flight_new(&bad[i], why, WHY));
    assert_string_equal(why, "jerk_mps3: expected 0.1 to 100, got -1");
    const struct psabench_flight_job job = a_job();
    legs[1][0] = 1e300;
    assert_null(psabench_flight_new(&job, why, 12));
    assert_string_equal(why, "legs[1].kin");
    assert_null(psabench_flight_new(NULL, why, WHY));
}

static void times_and_numbers_out_of_range_are_refused(void **state)
{
    (void)state;
    const struct psabench_flight_job job = a_job();
    psabench_flight *f = psabench_flight_new(&job, NULL, 0);
    const int64_t before = -1, late = INT64_MAX;
    double out[PSABENCH_FLIGHT_STATE];
    assert_int_equal(psabench_flight_states(f, &before, 1, out), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_flight_states(f, &late, 1, out), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_flight_states(NULL, &before, 1, out), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_flight_increments(f, 0, 0, 1, out), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_flight_increments(f, late, 1, 1, out), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(psabench_flight_increments(f, 0, 1, SIZE_MAX, out), PSABENCH_BAD_ARGUMENT);
    psabench_flight_free(f);
    unsigned keys = 0;
    while (psabench_flight_key(keys)) keys++;
    assert_int_equal(keys, KEYS);
    assert_string_equal(psabench_flight_key(TAXI), "taxi_m");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_flight_goes_leg_by_leg),
        cmocka_unit_test(what_cannot_be_flown_is_said),
        cmocka_unit_test(times_and_numbers_out_of_range_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
