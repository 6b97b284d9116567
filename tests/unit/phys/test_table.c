/* Rate table: what its operator sees, where its errors go. tests/py/lab/test_physics.py holds its kinematics against numerical
 * differentiation of attitudes of its own. */
#include "rig.h"

#include "base/sched.h"
#include "phys/motion/table.h"

#include <math.h>

#define RAD_PER_DEG    0.017453292519943295
#define RAD_PER_ARCSEC (RAD_PER_DEG / 3600.0)

static const struct site still = {.g_mps2 = 9.8};

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static struct table_cfg exact(unsigned axes)
{
    struct table_cfg c = table_default(axes);
    for (unsigned i = 0; i < TABLE_AXES_MAX; i++) {
        c.axis[i].wobble_arcsec = 0.0;
        c.axis[i].readout_resolution_arcsec = 0.0;
    }
    return c;
}

static struct table up(const struct table_cfg *c)
{
    struct table t;
    table_init(&t, c, &still, 1);
    return t;
}

/* Heading, pitch and roll: z carries y carries x. */
static void three_axes_are_heading_pitch_roll(void **state)
{
    (void)state;
    const struct table_cfg c = exact(3);
    struct table t = up(&c);
    assert_int_equal(table_position(&t, 0, 90.0, 0.0, 0), MOTION_OK);
    assert_int_equal(table_position(&t, 1, 30.0, 0.0, 0), MOTION_OK);
    const struct pose *p = table_pose(&t, 100 * NS_PER_S);
    near(p->C_nb[1][0], sqrt(0.75), 1e-12); /* x east and up */
    near(p->C_nb[2][0], -0.5, 1e-12);
    near(p->C_nb[0][1], -1.0, 1e-12); /* y to the south */
}

static void a_turning_table_turns_what_is_on_it(void **state)
{
    (void)state;
    const struct table_cfg c = exact(2);
    struct table t = up(&c);
    assert_int_equal(table_position(&t, 0, 90.0, 0.0, 0), MOTION_OK);
    assert_int_equal(table_rate(&t, 1, 50.0, 10 * NS_PER_S), MOTION_OK);
    const struct pose *p = table_pose(&t, 20 * NS_PER_S);
    near(p->w_ib_b_radps[2] / RAD_PER_DEG, 50.0, 1e-12);
    near(p->C_nb[0][2], 1.0, 1e-12); /* z lies level, to the north */
    assert_true(table_read(&t, 0, 20 * NS_PER_S).at_rest);
    assert_false(table_read(&t, 1, 20 * NS_PER_S).at_rest);
}

static void the_readout_has_zero_resolution_and_delay(void **state)
{
    (void)state;
    struct table_cfg c = exact(1);
    c.axis[0].readout_zero_arcsec = 7200.0;
    c.axis[0].readout_resolution_arcsec = 360.0;
    c.axis[0].readout_delay_s = 0.5;
    struct table t = up(&c);
    near(table_read(&t, 0, 0).angle_deg, 2.0, 1e-12);
    assert_int_equal(table_rate(&t, 0, 400.0, NS_PER_S), MOTION_OK); /* 400 deg/s in 1 s and 200 deg */
    near(table_read(&t, 0, NS_PER_S + NS_PER_S / 2).angle_deg, 2.0, 1e-12);
    const struct table_reading r = table_read(&t, 0, 4 * NS_PER_S); /* of 3.5 s: 800 deg */
    near(r.angle_deg, 802.0, 1e-9);
    near(r.rate_dps, 400.0, 1e-12);
    assert_int_equal(r.mode, MOTION_RATE);
    assert_false(r.at_rest);
    near(r.rest_in_s, -1.0, 0.0);
    assert_int_equal(table_position(&t, 0, 802.04, 0.0, 4 * NS_PER_S), MOTION_OK);
    near(table_axis(&t, 0, 100 * NS_PER_S).angle_rad / RAD_PER_DEG, 800.04, 1e-9); /* where the readout shows it */
    near(table_read(&t, 0, 100 * NS_PER_S).angle_deg, 802.0, 1e-9);                /* in steps of 0.1 deg */
    near(table_read(&t, 0, 100 * NS_PER_S).rest_in_s, 0.0, 0.0);
}

static void zero_makes_the_present_angle_what_it_is_told(void **state)
{
    (void)state;
    struct table_cfg c = exact(1);
    c.axis[0].readout_zero_arcsec = 100.0;
    struct table t = up(&c);
    assert_int_equal(table_position(&t, 0, 45.0, 0.0, 0), MOTION_OK);
    assert_int_equal(table_zero(&t, 0, 10.0, 60 * NS_PER_S), MOTION_OK);
    near(table_read(&t, 0, 60 * NS_PER_S).angle_deg, 10.0, 1e-12);
    const double was_rad = table_axis(&t, 0, 60 * NS_PER_S).angle_rad;
    assert_int_equal(table_position(&t, 0, 0.0, 0.0, 60 * NS_PER_S), MOTION_OK);
    near(table_axis(&t, 0, 99 * NS_PER_S).angle_rad - was_rad, -10.0 * RAD_PER_DEG, 1e-12);
}

static void noise_of_the_readout_is_a_function_of_the_instant(void **state)
{
    (void)state;
    struct table_cfg c = exact(1);
    c.axis[0].readout_noise_arcsec_rms = 10.0;
    struct table a = up(&c);
    struct table b = up(&c);
    const double first = table_read(&a, 0, 5).angle_deg;
    (void)table_read(&b, 0, 4);
    near(table_read(&b, 0, 5).angle_deg, first, 0.0);
    near(table_read(&a, 0, 5).angle_deg, first, 0.0);
    assert_true(table_read(&a, 0, 6).angle_deg != first);
    table_init(&b, &c, &still, 2);
    assert_true(table_read(&b, 0, 5).angle_deg != first);
}

/* The axis itself describes a cone: its direction in n goes round once a turn, or twice. */
static void wobble_is_a_cone(void **state)
{
    (void)state;
    for (unsigned order = 1; order <= 2; order++) {
        struct table_cfg c = exact(1);
        c.axis[0].wobble_arcsec = 20.0;
        c.axis[0].wobble_order = order;
        struct table t = up(&c);
        for (unsigned i = 0; i < 8; i++) {
            const int64_t t_ns = (int64_t)(i + 1) * 10 * NS_PER_S;
            assert_int_equal(table_position(&t, 0, 45.0 * i, 0.0, t_ns - 5 * NS_PER_S), MOTION_OK);
            const struct pose *p = table_pose(&t, t_ns);
            const double phase = order * 45.0 * i * RAD_PER_DEG;
            near(hypot(p->C_nb[0][2], p->C_nb[1][2]), 20.0 * RAD_PER_ARCSEC, 1e-11);
            const double direction = atan2(p->C_nb[1][2], p->C_nb[0][2]); /* tilted about x: towards -y */
            near(remainder(direction - (phase - 90.0 * RAD_PER_DEG), 360.0 * RAD_PER_DEG), 0.0, 1e-4);
        }
    }
}

static void nonorthogonal_axes_are_off_by_their_angle(void **state)
{
    (void)state;
    struct table_cfg c = exact(2); /* y carries z */
    c.axis[1].nonorthogonality_arcsec = 60.0;
    struct table t = up(&c);
    const struct pose *p = table_pose(&t, 0);
    near(p->C_nb[1][2], -60.0 * RAD_PER_ARCSEC, 1e-11); /* of z along y */
}

/* Days at the highest rate, and a cone of many turns in one. */
static void a_table_may_turn_for_long(void **state)
{
    (void)state;
    struct table_cfg c = exact(1);
    c.axis[0].wobble_arcsec = 1.0;
    c.axis[0].wobble_order = 3600;
    struct table t = up(&c);
    assert_int_equal(table_rate(&t, 0, 1000.0, 0), MOTION_OK);
    const struct pose *p = table_pose(&t, 100 * 86400 * NS_PER_S);
    near(p->C_nb[2][2], 1.0, 1e-9);
    near(p->w_ib_b_radps[2] / RAD_PER_DEG, 1000.0, 0.1);
}

/* An axis from -100 to +100 deg whose readout was commanded to show 90 deg at 0. */
static void limits_are_those_of_the_axis_wherever_its_readout_is(void **state)
{
    (void)state;
    struct table_cfg c = exact(1);
    c.axis[0].angle_min_deg = -100.0;
    c.axis[0].angle_max_deg = 100.0;
    c.axis[0].readout_zero_arcsec = 720.0;
    struct table t = up(&c);
    assert_int_equal(table_zero(&t, 0, 90.0, 0), MOTION_OK);
    near(table_offset_deg(&t, 0), 90.0, 1e-12);
    assert_int_equal(table_position(&t, 0, 190.0, 0.0, 0), MOTION_OK);
    near(table_axis(&t, 0, 100 * NS_PER_S).angle_rad / RAD_PER_DEG, 100.0, 1e-12);
    assert_int_equal(table_position(&t, 0, -10.0, 0.0, 100 * NS_PER_S), MOTION_OK);
    assert_int_equal(table_position(&t, 0, 190.001, 0.0, 200 * NS_PER_S), MOTION_ANGLE_LIMIT);
    assert_int_equal(table_position(&t, 0, -10.001, 0.0, 200 * NS_PER_S), MOTION_ANGLE_LIMIT);
}

static void a_table_has_the_axes_it_has(void **state)
{
    (void)state;
    const struct table_cfg c = exact(1);
    struct table t = up(&c);
    const double one = 1.0;
    assert_int_equal(table_position(&t, 1, 0.0, 0.0, 0), MOTION_NO_AXIS);
    assert_int_equal(table_rate(&t, 1, 0.0, 0), MOTION_NO_AXIS);
    assert_int_equal(table_sine(&t, 1, 1.0, 1.0, 0), MOTION_NO_AXIS);
    assert_int_equal(table_profile(&t, 1, &one, &one, 1, 0), MOTION_NO_AXIS);
    assert_int_equal(table_stop(&t, 1, 0), MOTION_NO_AXIS);
    assert_int_equal(table_zero(&t, 1, 0.0, 0), MOTION_NO_AXIS);
    assert_int_equal(table_rate(&t, 0, 1001.0, 0), MOTION_RATE_LIMIT);
    assert_true(table_read(&t, 0, 0).at_rest);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(three_axes_are_heading_pitch_roll),
        cmocka_unit_test(a_turning_table_turns_what_is_on_it),
        cmocka_unit_test(the_readout_has_zero_resolution_and_delay),
        cmocka_unit_test(zero_makes_the_present_angle_what_it_is_told),
        cmocka_unit_test(noise_of_the_readout_is_a_function_of_the_instant),
        cmocka_unit_test(wobble_is_a_cone),
        cmocka_unit_test(nonorthogonal_axes_are_off_by_their_angle),
        cmocka_unit_test(a_table_may_turn_for_long),
        cmocka_unit_test(limits_are_those_of_the_axis_wherever_its_readout_is),
        cmocka_unit_test(a_table_has_the_axes_it_has),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
