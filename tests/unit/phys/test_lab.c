/* The laboratory: what a unit feels on each mount. Kinematics with lever arms: tests/py/lab/test_physics.py. */
#include "rig.h"
#include "site.h"

#include "base/detmath.h"
#include "base/rng.h"
#include "base/sched.h"
#include "phys/lab.h"

#include <math.h>

#define RAD_PER_DEG 0.017453292519943295

static const double origin[3] = {0.0, 0.0, 0.0};

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static void near3(const double got[3], const double want[3], double tol)
{
    for (unsigned k = 0; k < 3; k++) near(got[k], want[k], tol);
}

static struct lab up(void)
{
    struct lab l;
    struct lab_cfg c = lab_default();
    c.site = site_at(55.7 * RAD_PER_DEG, 150.0, 20.0 * RAD_PER_DEG);
    c.head.turn_s = 2.0;
    c.head.mount_error_arcsec_rms = 5.0;
    c.table = table_default(3);
    lab_init(&l, &c, 1);
    return l;
}

/* To the bit, turning or not, whatever the face and alpha0. */
static void on_the_head_without_lever_arm_it_is_the_heads_own_arithmetic(void **state)
{
    (void)state;
    const double c0 = det_cos(0.002);
    const double s0 = det_sin(0.002);
    for (unsigned face = 0; face < HEAD_FACES; face++) {
        struct lab l = up();
        struct head h;
        head_init(&h, &l.head.cfg, &l.site, rng_stream(1, 0, "head"));
        head_mount(&h, (enum head_face)face, 0);
        head_mount(&l.head, (enum head_face)face, 0);
        head_turn(&h, 123.0, 0);
        head_turn(&l.head, 123.0, 0);
        for (int64_t t_ns = 0; t_ns < 3 * NS_PER_S; t_ns += NS_PER_S / 7) {
            double mount[3];
            double want[3];
            double got[3];
            head_gravity_mps2(&h, t_ns, mount);
            head_sensor_mps2((enum head_face)face, c0, s0, mount, want);
            lab_sensor_mps2(&l, &(struct lab_mounting){0}, origin, c0, s0, t_ns, got);
            assert_memory_equal(got, want, sizeof got);
        }
    }
}

static void row_is_its_looks(struct lab *l, const struct lab_mounting *m, int64_t from_ns, unsigned n)
{
    int64_t t_ns[LAB_ROW + 8];
    double row[LAB_ROW + 8][3], one[3];
    for (unsigned i = 0; i < n; i++) t_ns[i] = from_ns + i * 31250;
    const struct lab_sensor s = {m, origin, 1.0, 0.0};
    const unsigned written = lab_sensor_row_mps2(l, &s, t_ns, n, row);
    assert_true(written == n || written == 1);
    for (unsigned i = 0; i < n; i++) {
        lab_sensor_mps2(l, m, origin, 1.0, 0.0, t_ns[i], one);
        assert_memory_equal(row[written == 1 ? 0 : i], one, sizeof one);
    }
}

/* Of units beside each other, on different mounts and askew, at rest and in motion, with rows that are kept and too long for it. */
static void a_row_is_its_looks_whoever_asked_before(void **state)
{
    (void)state;
    struct lab l = up();
    const struct lab_mounting mounts[] = {{.on = LAB_HEAD},
                                          {.on = LAB_HEAD, .misalignment_rad = {0.01, 0.02, 0.0}},
                                          {.on = LAB_TABLE},
                                          {.on = LAB_FIXED}};
    (void)table_rate(&l.table, 0, 20.0, 0);
    for (int64_t k = 0; k < 8; k++) {
        const int64_t from_ns = k * 400000000;
        if (k == 1) head_turn(&l.head, 77.0, from_ns - 1);
        for (size_t i = 0; i < COUNT(mounts); i++) row_is_its_looks(&l, &mounts[i], from_ns, 32);
        for (size_t i = 0; i < COUNT(mounts); i++) row_is_its_looks(&l, &mounts[i], from_ns, 32);
        for (size_t i = 0; i < COUNT(mounts); i++) row_is_its_looks(&l, &mounts[i], from_ns + 31250, LAB_ROW + 8);
    }
}

/* An aircraft that taxies through a turn. */
static struct lab flying(double azimuth_rad)
{
    struct lab l;
    struct lab_cfg c = lab_default();
    c.site = site_at(55.7 * RAD_PER_DEG, 150.0, azimuth_rad);
    c.flight.present = true;
    c.flight.plan.heading_deg = azimuth_rad / RAD_PER_DEG;
    c.flight.plan.leg[c.flight.plan.legs++] = flight_leg_of(FLIGHT_PARK, 10.0);
    c.flight.plan.leg[c.flight.plan.legs++] = flight_leg_of(FLIGHT_TAXI, 60.0);
    c.flight.plan.leg[c.flight.plan.legs++] = flight_leg_of(FLIGHT_TURN, 90.0);
    c.flight.plan.leg[c.flight.plan.legs++] = flight_leg_of(FLIGHT_STOP, 10.0);
    lab_init(&l, &c, 1);
    return l;
}

/* Parked it is the bench; in a turn a lever arm adds the motion of a rigid body, and rows are their looks. */
static void in_the_aircraft_it_is_the_flight_s_motion(void **state)
{
    (void)state;
    struct lab l = flying(70.0 * RAD_PER_DEG);
    struct kinematics kin, far, bench;
    struct flight_state s;
    const struct lab_mounting centre = {.on = LAB_FLIGHT}, fixed = {.on = LAB_FIXED};
    const struct lab_mounting arm = {
        .on = LAB_FLIGHT, .lever_m = {3.0, 0.5, -0.2}, .misalignment_rad = {0.0, 0.0, 0.1}};
    lab_kinematics(&l, &centre, origin, NS_PER_S, &kin);
    lab_kinematics(&l, &fixed, origin, NS_PER_S, &bench);
    near3(kin.f_mps2, bench.f_mps2, 1e-14);
    near3(kin.w_radps, bench.w_radps, 1e-18);
    const int64_t t_ns = l.flight.plan.leg_ns[2] + NS_PER_S / 2; /* the rate rises */
    flight_at(&l.flight, t_ns, &s);
    lab_kinematics(&l, &centre, origin, t_ns, &kin);
    near3(kin.f_mps2, s.f_b_mps2, 0.0);
    lab_kinematics(&l, &arm, origin, t_ns, &far);
    const double w = s.pose.w_ib_b_radps[2], dw = s.pose.dw_ib_b_radps2[2];
    assert_true(w > 0.03 && dw > 0.1);
    const double x = s.f_b_mps2[0] - w * w * 3.0 - dw * 0.5, y = s.f_b_mps2[1] - w * w * 0.5 + dw * 3.0;
    near(far.f_mps2[0], cos(0.1) * x + sin(0.1) * y, 1e-4); /* the Earth's rate */
    near(far.f_mps2[1], cos(0.1) * y - sin(0.1) * x, 1e-4);
    for (unsigned i = 0; i < 2; i++) row_is_its_looks(&l, i ? &arm : &centre, t_ns, 32);
    assert_true(lab_smooth_ns(&l, &centre, 0) == 10 * NS_PER_S);
    assert_string_equal(lab_mount_name(LAB_FLIGHT), "flight");
}

/* In motion the head's gravity is that of its angle, by libm. */
static void a_turning_head_is_exact(void **state)
{
    (void)state;
    struct lab l = up();
    head_turn(&l.head, 333.0, 0);
    for (int64_t t_ns = 0; t_ns < 2 * NS_PER_S; t_ns += 1234567) {
        double m[3];
        head_gravity_mps2(&l.head, t_ns, m);
        const double alpha = head_angle_rad(&l.head, t_ns);
        assert_true(fabs(m[0] + l.site.g_mps2 * sin(alpha)) < 5e-15);
        assert_true(fabs(m[1] + l.site.g_mps2 * cos(alpha)) < 5e-15);
    }
}

/* The fast way and the way through the pose are the same physics. */
static void a_vanishing_lever_arm_changes_nothing(void **state)
{
    (void)state;
    for (unsigned face = 0; face < HEAD_FACES; face++) {
        struct lab l = up();
        const struct lab_mounting square = {LAB_HEAD, {0}, {0}};
        const struct lab_mounting nearly = {LAB_HEAD, {1e-300, 0, 0}, {0}};
        head_mount(&l.head, (enum head_face)face, 0);
        head_turn(&l.head, -77.0, 0);
        for (int64_t t_ns = 0; t_ns < 3 * NS_PER_S; t_ns += NS_PER_S / 7) {
            double a[3];
            double b[3];
            struct kinematics kin;
            lab_sensor_mps2(&l, &square, origin, det_cos(0.01), det_sin(0.01), t_ns, a);
            lab_sensor_mps2(&l, &nearly, origin, det_cos(0.01), det_sin(0.01), t_ns, b);
            near3(a, b, 1e-13);
            lab_sensor_mps2(&l, &square, origin, 1.0, 0.0, t_ns, a);
            lab_kinematics(&l, &square, origin, t_ns, &kin);
            for (unsigned k = 0; k < 3; k++) near(kin.f_mps2[k], -a[k], 1e-13);
        }
    }
}

static void misalignment_turns_what_the_case_feels(void **state)
{
    (void)state;
    const double small = 1e-3;
    for (unsigned on = LAB_HEAD; on <= LAB_FIXED; on++) {
        struct lab l = up();
        struct kinematics square;
        struct kinematics askew;
        double a[3];
        struct lab_mounting mounting = {.on = (enum lab_mount)on};
        lab_kinematics(&l, &mounting, origin, 0, &square);
        mounting.misalignment_rad[2] = small; /* about z */
        lab_kinematics(&l, &mounting, origin, 0, &askew);
        const double f[3] = {square.f_mps2[0] * cos(small) + square.f_mps2[1] * sin(small),
                             square.f_mps2[1] * cos(small) - square.f_mps2[0] * sin(small), square.f_mps2[2]};
        near3(askew.f_mps2, f, 1e-14);
        near(askew.w_radps[2], square.w_radps[2], 0.0);
        lab_sensor_mps2(&l, &mounting, origin, 1.0, 0.0, 0, a);
        for (unsigned k = 0; k < 3; k++) near(a[k], -f[k], 1e-14);
    }
}

static void mounts_feel_gravity_down_their_own_axes(void **state)
{
    (void)state;
    struct lab l = up();
    const double g = l.site.g_mps2;
    const double down_z[3] = {0.0, 0.0, -g};
    const double down_y[3] = {0.0, g, 0.0}; /* of the head at 0 deg: y points up */
    struct kinematics kin;
    lab_kinematics(&l, &(struct lab_mounting){.on = LAB_FIXED}, origin, 0, &kin);
    near3(kin.f_mps2, down_z, 1e-12);
    l.table.cfg.axis[0].wobble_arcsec = l.table.cfg.axis[1].wobble_arcsec = l.table.cfg.axis[2].wobble_arcsec = 0.0;
    lab_kinematics(&l, &(struct lab_mounting){.on = LAB_TABLE}, origin, 0, &kin);
    near3(kin.f_mps2, down_z, 1e-12);
    lab_kinematics(&l, &(struct lab_mounting){.on = LAB_HEAD}, origin, 0, &kin);
    near3(kin.f_mps2, down_y, 1e-12);
    lab_kinematics(&l, &(struct lab_mounting){.on = LAB_FIXED}, (const double[3]){10.0, 0.0, 0.0}, 0, &kin);
    near(kin.f_mps2[0], -10.0 * EARTH_RATE_RADPS * EARTH_RATE_RADPS, 6e-8); /* of the Earth, a part across the axis */
}

static void a_spinning_table_presses_outwards(void **state)
{
    (void)state;
    struct lab l = up();
    const struct lab_mounting mounting = {.on = LAB_TABLE, .lever_m = {0.2, 0.0, 0.0}};
    struct kinematics kin;
    assert_int_equal(table_rate(&l.table, 0, 360.0, 0), MOTION_OK);
    lab_kinematics(&l, &mounting, (const double[3]){0.1, 0.0, 0.0}, NS_PER_S / 2, &kin); /* 200 deg/s, 400 deg/s^2 */
    const double w = 200.0 * RAD_PER_DEG;
    near(kin.f_mps2[0], -0.3 * w * w, 1e-3);
    near(kin.f_mps2[1], 0.3 * 400.0 * RAD_PER_DEG, 1e-3);
    near(kin.w_radps[2] / RAD_PER_DEG, 200.0, 0.005);
}

static void mounts_have_names(void **state)
{
    static const char *const names[] = {"head", "table", "fixed", "platform", "flight"};
    (void)state;
    for (unsigned on = LAB_HEAD; on <= LAB_FLIGHT; on++) {
        assert_string_equal(lab_mount_name((enum lab_mount)on), names[on]);
    }
    assert_null(lab_mount_name((enum lab_mount)5));
}

/* What is random from an instant on: angle of a later setting of the head, reading of the table, drift of the platform. */
struct random_part {
    double head_rad, table_deg, drift_radps;
};

static struct random_part random_at(struct lab *l, int64_t t_ns)
{
    struct platform_state s;
    head_turn(&l->head, 77.0, t_ns);
    platform_at(&l->platform, t_ns + 20 * NS_PER_S, &s);
    return (struct random_part){head_motion(&l->head, t_ns + 20 * NS_PER_S).angle_rad,
                                table_read(&l->table, 0, t_ns + 20 * NS_PER_S).angle_deg, s.drift_radps[0]};
}

static struct lab up_with_errors(void)
{
    struct lab l;
    struct lab_cfg c = lab_default();
    c.site = site_at(55.7 * RAD_PER_DEG, 150.0, 0.0);
    c.head.setting_error_arcsec_rms = 2.0;
    c.table = table_default(1);
    c.table.axis[0].readout_noise_arcsec_rms = 3.0;
    c.platform.present = true;
    c.platform.gm_sigma_degph = 0.2;
    c.platform.gm_tau_s = 100.0;
    lab_init(&l, &c, 1);
    return l;
}

static void a_seed_changes_what_is_random_from_its_instant_on(void **state)
{
    (void)state;
    struct lab plain = up_with_errors(), seventh = up_with_errors(), again = up_with_errors(),
               eighth = up_with_errors();
    struct platform_state before, after;
    lab_reseed(&seventh, 7, 10 * NS_PER_S);
    lab_reseed(&again, 7, 10 * NS_PER_S);
    lab_reseed(&eighth, 8, 10 * NS_PER_S);
    platform_at(&plain.platform, 10 * NS_PER_S, &before);
    platform_at(&seventh.platform, 10 * NS_PER_S, &after);
    assert_memory_equal(&after, &before, sizeof after);
    const struct random_part p = random_at(&plain, 10 * NS_PER_S), s = random_at(&seventh, 10 * NS_PER_S),
                             a = random_at(&again, 10 * NS_PER_S), e = random_at(&eighth, 10 * NS_PER_S);
    assert_memory_equal(&s, &a, sizeof s);
    assert_true(p.head_rad != s.head_rad && p.table_deg != s.table_deg && p.drift_radps != s.drift_radps);
    assert_true(e.head_rad != s.head_rad && e.table_deg != s.table_deg && e.drift_radps != s.drift_radps);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_the_head_without_lever_arm_it_is_the_heads_own_arithmetic),
        cmocka_unit_test(a_row_is_its_looks_whoever_asked_before),
        cmocka_unit_test(in_the_aircraft_it_is_the_flight_s_motion),
        cmocka_unit_test(a_turning_head_is_exact),
        cmocka_unit_test(a_vanishing_lever_arm_changes_nothing),
        cmocka_unit_test(misalignment_turns_what_the_case_feels),
        cmocka_unit_test(mounts_feel_gravity_down_their_own_axes),
        cmocka_unit_test(a_spinning_table_presses_outwards),
        cmocka_unit_test(mounts_have_names),
        cmocka_unit_test(a_seed_changes_what_is_random_from_its_instant_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
