/* Micromechanical gyro: its model term by term, its noise, and a unit on a table that feels the rate. */
#include "rig.h"

#include "phys/sensor/cvg.h"
#include "unit/unit.h"

#include "base/detmath.h"

#include <math.h>

#define G 9.81

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.12g, want %.12g within %g", got, want, tol);
}

static struct cvg gyro(struct cvg_dps p)
{
    struct cvg c;
    cvg_init(&c, &p, G, draws_of(1, 1, "cvg.x"), draws_of(1, 1, "cvg.slow.x"));
    return c;
}

static double true_v(struct cvg *c, const double w_dps[3], const double a_g[3], double degc)
{
    const double w[3] = {w_dps[0] * RAD_PER_DEG, w_dps[1] * RAD_PER_DEG, w_dps[2] * RAD_PER_DEG};
    const double a[3] = {a_g[0] * G, a_g[1] * G, a_g[2] * G};
    c->temp_degc = degc;
    return cvg_true_v(c, w, a);
}

/* Rows: one term at a time, computed by hand. */
static void each_term_of_the_model(void **state)
{
    (void)state;
    const struct {
        struct cvg_dps p;
        double w_dps[3], a_g[3], degc, v;
    } rows[] = {
        {{.u0_v = 2.5}, {9, 9, 9}, {1, 1, 1}, 40, 2.5},
        {{.scale_v_per_dps = 0.01}, {-20, 5, 7}, {1, 1, 1}, 25, -0.2},
        {{.scale_v_per_dps = 0.01, .cross_y = 0.02}, {0, 50, 7}, {1, 1, 1}, 25, 0.01},
        {{.scale_v_per_dps = 0.01, .cross_z = -0.03}, {0, 5, 100}, {1, 1, 1}, 25, -0.03},
        {{.scale_v_per_dps = 0.01, .gx_dps_per_g = 0.2}, {0}, {-1, 5, 5}, 25, -0.002},
        {{.scale_v_per_dps = 0.01, .gy_dps_per_g = 0.3}, {0}, {5, 1, 5}, 25, 0.003},
        {{.scale_v_per_dps = 0.01, .gz_dps_per_g = 0.4}, {0}, {5, 5, 1}, 25, 0.004},
        {{.scale_v_per_dps = 0.01, .square_per_dps = 1e-4}, {-10, 0, 0}, {0}, 25, -0.0999},
        {{.scale_v_per_dps = 0.01, .cube_per_dps2 = 1e-5}, {-10, 0, 0}, {0}, 25, -0.1001},
        /* cos 60 deg is 0.5 of the scale, sin 30 deg 0.5 of the quadrature */
        {{.scale_v_per_dps = 0.01, .phase_deg = 60}, {10, 0, 0}, {0}, 25, 0.05},
        {{.scale_v_per_dps = 0.01, .phase_deg = 20, .phase_tc_deg_per_k = 1, .quadrature_dps = 8}, {0}, {0}, 35, 0.04},
        {{.u0_tc_v_per_k = 1e-3}, {0}, {0}, 15, -0.01},
        {{.scale_v_per_dps = 0.01, .scale_tc_ppm_per_k = 1000}, {10, 0, 0}, {0}, 35, 0.101},
        {{.u0_v = 2.5, .scale_v_per_dps = 0.01, .low_v = 0.5, .high_v = 4.0}, {300, 0, 0}, {0}, 25, 4.0},
        {{.u0_v = 2.5, .scale_v_per_dps = 0.01, .low_v = 0.5, .high_v = 4.0}, {-300, 0, 0}, {0}, 25, 0.5},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct cvg c = gyro(rows[i].p);
        near(true_v(&c, rows[i].w_dps, rows[i].a_g, rows[i].degc), rows[i].v, 1e-12);
    }
}

#define LOOKS 4000

/* White noise of density d has the variance d^2 / (2 every), in volts by the scale; a look has one draw for its instant. */
static void white_noise_has_its_density(void **state)
{
    (void)state;
    const double still[3] = {0};
    struct cvg c = gyro((struct cvg_dps){.scale_v_per_dps = -0.01, .noise_dps_rthz = 0.05});
    double sum = 0.0, squares = 0.0;
    for (int64_t i = 1; i <= LOOKS; i++) {
        const double u_v = cvg_out_v(&c, still, still, i * 1000000, 1000000);
        near(cvg_out_v(&c, still, still, i * 1000000, 1000000), u_v, 0.0);
        sum += u_v;
        squares += u_v * u_v;
    }
    const double rms_v = 0.01 * 0.05 * sqrt(500.0);
    near(sqrt(squares / LOOKS), rms_v, 4.0 * rms_v / sqrt(2.0 * LOOKS));
    near(sum / LOOKS, 0.0, 4.0 * rms_v / sqrt(LOOKS));
}

/* What the truth port says of the zero is what the output shows. */
static void the_zero_moves_as_the_output_does(void **state)
{
    (void)state;
    const double still[3] = {0};
    struct cvg c = gyro((struct cvg_dps){.u0_v = 2.5,
                                         .scale_v_per_dps = 0.01,
                                         .bias_instability_dps = 0.1,
                                         .walk_dps_rts = 0.05,
                                         .ramp_dps_per_s = 0.2});
    double moved_v = 0.0;
    for (int64_t i = 1; i <= 50; i++) {
        const double foreseen_v = cvg_zero_moved_v(&c, i * 100000000);
        moved_v = cvg_out_v(&c, still, still, i * 100000000, 1000000) - 2.5;
        near(foreseen_v, moved_v, 1e-15);
    }
    assert_true(fabs(moved_v - 0.01 * 0.2 * 5.0) > 1e-5); /* more than the ramp */
}

/* On a table that turns about z a gyro on channel Z feels the rate, one on X does not; its sign is the table's. */
static void a_channel_has_its_own_axes(void **state)
{
    (void)state;
    struct lab_cfg lc = lab_default();
    struct unit_cfg cfg = unit_default("a");
    static struct lab lab;
    static struct sched sched;
    static struct unit unit;
    lc.table = table_default(1);
    lc.table.axis[0].wobble_arcsec = 0.0;
    lab_init(&lab, &lc, 1);
    sched_init(&sched);
    cfg.mounting.on = LAB_TABLE;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        cfg.axis[i].sensor = UNIT_CVG;
        cfg.axis[i].cvg = (struct cvg_dps){.u0_v = 2.5, .scale_v_per_dps = 0.01, .gx_dps_per_g = 1.0};
    }
    unit_init(&unit, &cfg, &lab, &sched);
    assert_int_equal(table_rate(&lab.table, 0, 30.0, 0), 0);
    const int64_t t_ns = 10000000000;
    near(unit_sensor_out(&unit, 0, t_ns), 2.5, 1e-12);
    near(unit_sensor_out(&unit, 1, t_ns), 2.5, 1e-12);
    near(unit_sensor_out(&unit, 2, t_ns), 2.5 + 0.01 * (30.0 + 1.0), 1e-12);
    assert_true(unit_zero_moved_v(&unit, 2, t_ns) == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_term_of_the_model),
        cmocka_unit_test(white_noise_has_its_density),
        cmocka_unit_test(the_zero_moves_as_the_output_does),
        cmocka_unit_test(a_channel_has_its_own_axes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
