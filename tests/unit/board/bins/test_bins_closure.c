/* An ideal unit closes: what is left is the counts of the gyros and the codes of the accelerometers. */
#include "bins_ins.h"

static struct rig r;

static void a_minute_a_cycle_closes(void **state)
{
    struct ins n = {.tilt_rad = 0.0};
    (void)state;
    three_cycles(&r, 30.0, &n);
    assert_true(n.tilt_rad < 2e-7);    /* 0.04 arcsec: four counts */
    assert_true(n.speed_mps < 1.5e-3); /* half a code of 9.7 um/s^2 on the axis that does not turn */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_minute_a_cycle_closes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
