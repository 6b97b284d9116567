/* An hour of the same: three cycles of 20 minutes. */
#include "bins_ins.h"

static struct rig r;

static void an_hour_closes(void **state)
{
    struct ins n = {.tilt_rad = 0.0};
    (void)state;
    three_cycles(&r, 595.0, &n);
    assert_true(r.last.t_ns > 3590 * RIG_S);
    assert_true(n.tilt_rad < 3e-7);
    assert_true(n.speed_mps < 2.5e-2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(an_hour_closes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
