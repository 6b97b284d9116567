/* Slow noise and what else a sensor's output goes through. Its Allan deviations: tests/py/lab/test_physics.py. */
#include "rig.h"

#include "base/sched.h"
#include "phys/sensor/mems.h"

#include <math.h>
#include <string.h>

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static const struct noise_cfg all = {1e-3, 1e-3, 1e-4, 0.0};

static void the_course_does_not_depend_on_how_often_one_looks(void **state)
{
    (void)state;
    struct noise often;
    struct noise seldom;
    noise_init(&often, &all, draws_of(1, 1, "slow"));
    noise_init(&seldom, &all, draws_of(1, 1, "slow"));
    for (int64_t i = 1; i <= 1000; i++) {
        double last = 0.0;
        for (int64_t k = 0; k < 7; k++) last = noise_slow_u(&often, (i - 1) * 137000000 + k * 22833333);
        (void)last;
        near(noise_slow_u(&often, i * 137000000), noise_slow_u(&seldom, i * 137000000), 0.0);
    }
}

static void terms_that_are_zero_are_not_there(void **state)
{
    (void)state;
    struct noise n;
    noise_init(&n, &(struct noise_cfg){.ramp_u_per_s = 2.0}, draws_of(1, 1, "slow"));
    assert_false(n.moves);
    near(noise_slow_u(&n, 3 * NS_PER_S), 6.0, 1e-15);
    near(noise_quantise_u(&n, 0.123), 0.123, 0.0);
    noise_init(&n, &(struct noise_cfg){.quantum_u = 0.1}, draws_of(1, 1, "slow"));
    near(noise_quantise_u(&n, 0.123), 0.1, 0.0);
    near(noise_quantise_u(&n, -0.17), -0.2, 1e-15);
}

static struct mems sensor(const struct mems_g *g)
{
    const struct mems_cfg c = mems_cfg_si(g, 10.0);
    struct mems m;
    mems_init(&m, &c, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
    return m;
}

static double out_v(struct mems *m, const double a_mps2[3], int64_t t_ns)
{
    double v;
    mems_out_row_v(m, a_mps2, 1, &(struct looks){&t_ns, 1, 31250}, &v);
    return v;
}

/* Zero parameters: the same bits as the model and its white noise alone give. */
static void a_plain_sensor_is_not_touched(void **state)
{
    (void)state;
    const struct mems_g g = {.u0_v = 2.5, .kx_v_per_g = 1.0, .ky_v_per_g = 0.0098, .noise_v_rthz = 1e-4};
    const double a[3] = {3.3, -9.1, 0.7};
    struct mems m = sensor(&g);
    m.temp_degc = 71.3;
    const struct draws d = draws_of(1, 1, "mems.x");
    for (int64_t i = 1; i <= 100; i++) {
        const double scale = 1e-4 * sqrt(1e9 / (2.0 * 31250.0));
        const double want = mems_true_v(&m, a, i * 31250) + scale * draws_gauss(&d, i * 31250);
        const double got = out_v(&m, a, i * 31250);
        assert_memory_equal(&got, &want, sizeof got);
    }
}

static void slow_noise_leaves_the_white_noise_as_it_was(void **state)
{
    (void)state;
    struct mems_g g = {.noise_v_rthz = 1e-4};
    const double a[3] = {0};
    struct mems white = sensor(&g);
    g.bias_instability_v = 1e-3;
    struct mems both = sensor(&g);
    const double offset = out_v(&both, a, 1000) - out_v(&white, a, 1000);
    assert_true(offset != 0.0);
    for (int64_t i = 2; i < 100; i++) {
        near(out_v(&both, a, i * 1000) - out_v(&white, a, i * 1000), offset, 1e-15); /* within 10 ms */
    }
}

static void zero_and_scale_follow_the_temperature(void **state)
{
    (void)state;
    const struct mems_g g = {
        .u0_v = 2.5, .kx_v_per_g = 1.0, .kxx_v_per_g2 = 0.1, .u0_tc_v_per_k = 1e-3, .k_tc_ppm_per_k = 200.0};
    const double a[3] = {-10.0, 0.0, 0.0};
    struct mems m = sensor(&g);
    near(mems_true_v(&m, a, 0), 1.6, 1e-15);
    m.temp_degc = 35.0;
    near(mems_true_v(&m, a, 0), 1.6 + 0.01 - 0.002, 1e-15);
    near(out_v(&m, a, 0), 1.608, 1e-15);
    m.temp_degc = MEMS_REFERENCE_DEGC;
    near(mems_true_v(&m, a, 0), 1.6, 1e-15);
}

static void the_output_stays_within_its_limits(void **state)
{
    (void)state;
    const struct mems_g g = {.u0_v = 2.5, .kx_v_per_g = 1.0, .low_v = 0.2, .high_v = 4.8, .quantum_v = 0.5};
    struct mems m = sensor(&g);
    near(mems_true_v(&m, (const double[3]){30.0, 0.0, 0.0}, 0), 4.8, 0.0);
    near(mems_true_v(&m, (const double[3]){-30.0, 0.0, 0.0}, 0), 0.2, 0.0);
    near(out_v(&m, (const double[3]){6.0, 0.0, 0.0}, 0), 3.0, 0.0);
    near(out_v(&m, (const double[3]){30.0, 0.0, 0.0}, 0), 4.8, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_course_does_not_depend_on_how_often_one_looks),
        cmocka_unit_test(terms_that_are_zero_are_not_there),
        cmocka_unit_test(a_plain_sensor_is_not_touched),
        cmocka_unit_test(slow_noise_leaves_the_white_noise_as_it_was),
        cmocka_unit_test(zero_and_scale_follow_the_temperature),
        cmocka_unit_test(the_output_stays_within_its_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
