/* Run-in on the sensor model: what a job means, and what is refused. */
#include "api/psabench.h"
#include "rig.h"

#include <math.h>

enum { STARTS = 3 };

static struct psabench_quartz_job one_unit(double play_k)
{
    return (struct psabench_quartz_job){.size = sizeof(struct psabench_quartz_job),
                                        .cycles = STARTS - 1,
                                        .seed = 5,
                                        .first_serial = 1,
                                        .units = 1,
                                        .g_mps2 = 9.8094,
                                        .cold_degc = -60,
                                        .hot_degc = 85,
                                        .read_degc = 30,
                                        .ramp_k_per_min = 1,
                                        .soak_min = 60,
                                        .rest_min = 120,
                                        .reading_s = 1,
                                        .play_k = play_k};
}

static void run_job(const struct psabench_quartz_job *job, double truth[STARTS][3])
{
    double mean_a[STARTS * PSABENCH_QUARTZ_POSITIONS], sd_a[STARTS * PSABENCH_QUARTZ_POSITIONS];
    assert_int_equal(psabench_quartz_run_in(job, NULL, 0, mean_a, sd_a, truth[0]), PSABENCH_OK);
    for (unsigned i = 0; i < STARTS * PSABENCH_QUARTZ_POSITIONS; i++)
        assert_true(isfinite(mean_a[i]) && sd_a[i] >= 0.0);
}

/* The first start is at the temperature where everything began; after a cycle the element has come from above, and feels up to
 * its play more: the bias moves by that much of its slope, once. */
static void a_play_moves_every_start_but_the_first(void **state)
{
    (void)state;
    double with[STARTS][3], without[STARTS][3];
    const struct psabench_quartz_job plain = one_unit(0.0), play = one_unit(0.3);
    run_job(&plain, without);
    run_job(&play, with);
    assert_true(with[0][0] == without[0][0]);
    const double moved_ug = with[1][0] - without[1][0];
    assert_true(fabs(moved_ug) > 0.1 && fabs(moved_ug) < 20.0);
    assert_true(fabs(with[2][0] - without[2][0] - moved_ug) < 1e-6);
}

static void fields_out_of_range_are_refused(void **state)
{
    (void)state;
    double mean_a[STARTS * PSABENCH_QUARTZ_POSITIONS], sd_a[STARTS * PSABENCH_QUARTZ_POSITIONS];
    struct psabench_quartz_job bad[4];
    for (unsigned i = 0; i < COUNT(bad); i++) bad[i] = one_unit(0.3);
    bad[0].size = 1;
    bad[1].play_k = -1.0;
    bad[2].hot_degc = 1000.0;
    bad[3].reading_s = NAN;
    for (unsigned i = 0; i < COUNT(bad); i++)
        assert_int_equal(psabench_quartz_run_in(&bad[i], NULL, 0, mean_a, sd_a, NULL), PSABENCH_BAD_ARGUMENT);
    const double batch[2] = {0};
    const struct psabench_quartz_job good = one_unit(0.3);
    assert_int_equal(psabench_quartz_run_in(&good, batch, 2, mean_a, sd_a, NULL), PSABENCH_BAD_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_play_moves_every_start_but_the_first),
        cmocka_unit_test(fields_out_of_range_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
