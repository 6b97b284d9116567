/* Dividing head: equation (12) of the calibration article, the faces, and the head's own errors. */
#include "rig.h"

#include "base/detmath.h"
#include "base/rng.h"
#include "phys/motion/head.h"

#include <math.h>

#define G              9.80665
#define RAD_PER_DEG    0.017453292519943295
#define ARCSEC_PER_DEG 3600.0

static struct head head_up(const struct head_cfg *cfg)
{
    struct head h;
    head_init(&h, cfg, &(struct site){.g_mps2 = G}, rng_stream(1, 0, "head"));
    return h;
}

static const struct head_cfg exact = {.resolution_arcsec = 0.0};

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.12g, want %.12g within %g", got, want, tol);
}

/* alpha, alpha0, then a_x, a_y, a_z in g for each face; s = sin 0.1121 deg, c = its cosine. */
static void faces_project_gravity_on_the_sensors_axes(void **state)
{
    (void)state;
    const double s = 0.0019565107;
    const double c = 0.9999980860;
    const struct {
        double alpha_deg, alpha0_deg;
        enum head_face face;
        double a_g[3];
    } rows[] = {
        {0, 0, HEAD_DIRECT, {0, -1, 0}},
        {90, 0, HEAD_DIRECT, {-1, 0, 0}},
        {180, 0, HEAD_DIRECT, {0, 1, 0}},
        {270, 0, HEAD_DIRECT, {1, 0, 0}},
        {30, 0, HEAD_DIRECT, {-0.5, -0.8660254, 0}},
        {395, 0, HEAD_DIRECT, {-0.5735764, -0.8191520, 0}},
        {0, 0.1121, HEAD_DIRECT, {-s, -c, 0}},
        {90, 0.1121, HEAD_DIRECT, {-c, s, 0}},
        {0, 0.1121, HEAD_REVERSED, {-s, c, 0}},
        {90, 0.1121, HEAD_REVERSED, {-c, -s, 0}},
        {0, 0.1121, HEAD_SIDE, {-s, 0, -c}},
        {90, 0.1121, HEAD_SIDE, {-c, 0, s}},
        {0, 0.1121, HEAD_SIDE_REVERSED, {-s, 0, c}},
        {180, 0, HEAD_SIDE_REVERSED, {0, 0, -1}},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct head h = head_up(&exact);
        double m[3];
        double a[3];
        head_turn(&h, rows[i].alpha_deg, 0);
        head_gravity_mps2(&h, 0, m);
        const double a0 = rows[i].alpha0_deg * RAD_PER_DEG;
        head_sensor_mps2(rows[i].face, det_cos(a0), det_sin(a0), m, a);
        for (int k = 0; k < 3; k++) near(a[k] / G, rows[i].a_g[k], 1e-7);
    }
}

static void a_face_is_a_rotation_about_ox(void **state)
{
    static const char *const names[HEAD_FACES] = {"direct", "reversed", "side", "side_reversed"};
    (void)state;
    for (unsigned f = 0; f < HEAD_FACES; f++) {
        const double e[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        double r[3][3];
        for (int k = 0; k < 3; k++) head_sensor_mps2((enum head_face)f, 1.0, 0.0, e[k], r[k]);
        near(r[0][0], 1, 0);
        near(r[1][1] * r[2][2] - r[1][2] * r[2][1], 1, 0);
        assert_string_equal(head_face_name((enum head_face)f), names[f]);
    }
    assert_null(head_face_name(HEAD_FACES));
}

static void a_turn_takes_its_time_and_moves_smoothly(void **state)
{
    (void)state;
    const struct head_cfg cfg = {.turn_s = 2.0};
    struct head h = head_up(&cfg);
    head_turn(&h, 40.0, 1000000000);
    const struct {
        int64_t t_ns;
        double angle_deg;
        bool rest;
    } rows[] = {{500000000, 0, false},      {1000000000, 0, false},  {1500000000, 6.25, false}, {2000000000, 20, false},
                {2500000000, 33.75, false}, {2999999999, 40, false}, {3000000000, 40, true},    {9000000000, 40, true}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        near(head_angle_rad(&h, rows[i].t_ns) / RAD_PER_DEG, rows[i].angle_deg, 1e-6);
        assert_int_equal(head_at_rest(&h, rows[i].t_ns), rows[i].rest);
        double m[3];
        head_gravity_mps2(&h, rows[i].t_ns, m); /* the cache must not outlive its instant */
        near(m[0] / G, -sin(rows[i].angle_deg * RAD_PER_DEG), 2e-8);
    }
    assert_int_equal(head_rest_ns(&h), 3000000000);
}

static void an_instant_before_a_command_sees_the_state_of_then(void **state)
{
    (void)state;
    struct head h = head_up(&exact);
    double m[3];
    head_turn(&h, 90.0, 0);
    head_gravity_mps2(&h, 5000, m);
    head_turn(&h, 180.0, 10000);
    head_gravity_mps2(&h, 9999, m);
    near(m[0], -G, 1e-12);
    head_gravity_mps2(&h, 10000, m);
    near(m[1], G, 1e-12);
    head_mount(&h, HEAD_REVERSED, 20000);
    assert_int_equal(head_face(&h, 19999), HEAD_DIRECT);
    assert_int_equal(head_face(&h, 20000), HEAD_REVERSED);
}

static void the_scale_has_steps_and_the_circle_an_error(void **state)
{
    (void)state;
    const struct head_cfg cfg = {.resolution_arcsec = 2.0, .periodic_arcsec = 5.0, .periodic_order = 2};
    const struct {
        double command_deg, scale_arcsec, true_arcsec;
    } rows[] = {{0, 0, 0},
                {0.0008, 2, 2.0 + 5.0 * 1.939e-5},
                {45, 162000, 162005},
                {90, 324000, 324000},
                {135, 486000, 485995}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct head h = head_up(&cfg);
        head_turn(&h, rows[i].command_deg, 0);
        near(head_angle_rad(&h, 0) / RAD_PER_DEG * ARCSEC_PER_DEG, rows[i].true_arcsec, 1e-3);
        near(head_read_deg(&h, 0) * ARCSEC_PER_DEG, rows[i].scale_arcsec, 1e-6);
    }
}

static void setting_and_mounting_errors_have_their_rms(void **state)
{
    (void)state;
    enum { N = 4000 };
    const struct head_cfg cfg = {.setting_error_arcsec_rms = 3.0, .mount_error_arcsec_rms = 10.0};
    struct head h = head_up(&cfg);
    double set2 = 0.0;
    double mount2 = 0.0;
    for (int i = 0; i < N; i++) {
        head_turn(&h, 10.0, i);
        set2 += pow(h.setting_rad / RAD_PER_DEG * ARCSEC_PER_DEG, 2);
        head_mount(&h, HEAD_DIRECT, i);
        mount2 += pow(head_angle_rad(&h, i) / RAD_PER_DEG * ARCSEC_PER_DEG - 36000.0 -
                          h.setting_rad / RAD_PER_DEG * ARCSEC_PER_DEG,
                      2);
    }
    near(sqrt(set2 / N), 3.0, 3.0 * 4.0 / sqrt(2.0 * N));
    near(sqrt(mount2 / N), 10.0, 10.0 * 4.0 / sqrt(2.0 * N));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faces_project_gravity_on_the_sensors_axes),
        cmocka_unit_test(a_face_is_a_rotation_about_ox),
        cmocka_unit_test(a_turn_takes_its_time_and_moves_smoothly),
        cmocka_unit_test(an_instant_before_a_command_sees_the_state_of_then),
        cmocka_unit_test(the_scale_has_steps_and_the_circle_an_error),
        cmocka_unit_test(setting_and_mounting_errors_have_their_rms),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
