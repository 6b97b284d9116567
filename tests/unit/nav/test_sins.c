/* kf.h and sins.h as a C program gets them: memory of the caller's, rejections, bad input. Numbers: tests/py/nav/test_sins_*.py. */
#include "rig.h"

#include "nav/sins.h"

#include <math.h>
#include <string.h>

#define DEG   0.017453292519943295
#define DEGPH (DEG / 3600.0)

static const double NORTH[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}; /* z1 north, z3 up */

struct sins_rig {
    struct nav_sins_cfg cfg;
    void *memory;
    nav_sins *s;
};

static int set_up(void **state)
{
    struct sins_rig *r = calloc(1, sizeof *r);
    r->memory = malloc(nav_sins_bytes());
    nav_sins_default(&r->cfg);
    r->cfg.clone = 1;
    *state = r;
    return 0;
}

static int tear_down(void **state)
{
    struct sins_rig *r = *state;
    free(r->memory);
    free(r);
    return 0;
}

static void start(struct sins_rig *r, int feedback)
{
    assert_int_equal(nav_sins_start(r->memory, nav_sins_bytes(), &r->cfg, NORTH, feedback, &r->s), NAV_OK);
}

/* At rest: the Earth's rate and gravity in b. */
static void rest(const struct sins_rig *r, double dtheta[3], double dv[3])
{
    const double dt = r->cfg.sample_s;
    const double up[3] = {0, 0, r->cfg.gravity_mps2 * dt};
    const double turn[3] = {NAV_EARTH_RADPS * cos(r->cfg.latitude_rad) * dt, 0,
                            NAV_EARTH_RADPS * sin(r->cfg.latitude_rad) * dt};
    memcpy(dtheta, turn, sizeof turn);
    memcpy(dv, up, sizeof up);
}

static double sd_of(const struct sins_rig *r, int block, int k)
{
    struct nav_sins_rows at[NAV_SINS_BLOCKS];
    double p[NAV_KF_MAX * NAV_KF_MAX];
    const int n = nav_sins_layout(&r->cfg, at);
    assert_int_equal(nav_sins_covariance(r->s, NULL, p), NAV_OK);
    return sqrt(p[(at[block].offset + k) * (n + 1)]);
}

static void a_plan_gives_the_accuracy_of_the_article(void **state)
{
    struct sins_rig *r = *state;
    const double w = 10 * DEG;
    const struct nav_sins_turn plan[] = {
        {{1, 0, 0}, w, 450, 0},  {{1, 0, 0}, -w, 450, 0}, {{0, 0, 1}, -w, 9, 0},  {{0, 1, 0}, w, 450, 0},
        {{0, 1, 0}, -w, 450, 0}, {{1, 0, 0}, -w, 9, 0},   {{0, 0, 1}, w, 450, 0}, {{0, 0, 1}, -w, 450, 0},
    };
    r->cfg.sample_s = 0.05;
    r->cfg.accel_noise_multiplier = 4;
    for (int form = NAV_KF_JOSEPH; form <= NAV_KF_UD; form++) {
        r->cfg.form = form;
        start(r, 0);
        assert_int_equal(nav_sins_plan(r->s, plan, COUNT(plan)), NAV_OK);
        assert_true(fabs(sd_of(r, NAV_SINS_GAMMA, 0) / 1.36e-5 - 1) < 0.03);
        assert_true(fabs(sd_of(r, NAV_SINS_DF, 0) / 9.24e-5 - 1) < 0.03);
        assert_true(sd_of(r, NAV_SINS_NU, 1) < 0.011 * DEGPH);
    }
}

static void a_unit_at_rest_keeps_its_attitude_and_learns_the_level(void **state)
{
    struct sins_rig *r = *state;
    double dtheta[3], dv[3];
    start(r, 1);
    rest(r, dtheta, dv);
    for (int k = 0; k < 3000; k++) assert_int_equal(nav_sins_samples(r->s, 5.0 + k * 0.01, dtheta, dv, 1), NAV_OK);
    struct nav_sins_state is;
    assert_int_equal(nav_sins_get(r->s, &is), NAV_OK);
    for (int k = 0; k < 9; k++) assert_true(fabs(is.c_nb[k] - NORTH[k]) < 1e-12);
    assert_true(fabs(is.t_s - 34.95) < 1e-9); /* the middle of the last step */
    assert_int_equal(is.count_accel, 900);
    assert_true(is.nis_accel < 1e-6);
    assert_int_equal(is.last[3].variance, 0);
    assert_true(sd_of(r, NAV_SINS_BETA, 0) < 0.2 * DEG);
    assert_true(sd_of(r, NAV_SINS_BETA, 2) > 2.0 * DEG); /* heading 3 deg and drift 0.5 deg/h share the rate of tilt */
    assert_int_equal(nav_sins_again(r->s), NAV_OK);      /* the same data once more */
    assert_true(fabs(sd_of(r, NAV_SINS_BETA, 0) - DEG) < 1e-12);
    assert_int_equal(nav_sins_samples(r->s, 5.0, dtheta, dv, 1), NAV_OK);
}

static void time_neither_runs_back_nor_leaves_a_gap(void **state)
{
    struct sins_rig *r = *state;
    double dtheta[3], dv[3];
    start(r, 0);
    rest(r, dtheta, dv);
    assert_int_equal(nav_sins_samples(r->s, 1.0, dtheta, dv, 1), NAV_OK);
    assert_int_equal(nav_sins_samples(r->s, 1.0, dtheta, dv, 1), NAV_TIMES);  /* twice */
    assert_int_equal(nav_sins_samples(r->s, 0.99, dtheta, dv, 1), NAV_TIMES); /* back */
    assert_int_equal(nav_sins_samples(r->s, 1.02, dtheta, dv, 1), NAV_TIMES); /* one is missing */
    assert_int_equal(nav_sins_samples(r->s, NAN, dtheta, dv, 1), NAV_NOT_FINITE);
    assert_int_equal(nav_sins_samples(r->s, 1.014, dtheta, dv, 1), NAV_OK); /* jitter of 0.4 of a sample */
    const struct nav_sins_params model = {.tau_s = 0.01};
    assert_int_equal(nav_sins_about(r->s, &model), NAV_TIMES); /* only before the data */
}

static void what_is_not_finite_changes_nothing(void **state)
{
    struct sins_rig *r = *state;
    double dtheta[6], dv[6];
    start(r, 0);
    rest(r, dtheta, dv);
    rest(r, dtheta + 3, dv + 3);
    struct nav_sins_state before, after;
    assert_int_equal(nav_sins_samples(r->s, 0.0, dtheta, dv, 2), NAV_OK);
    assert_int_equal(nav_sins_get(r->s, &before), NAV_OK);
    dtheta[4] = NAN;
    assert_int_equal(nav_sins_samples(r->s, 0.02, dtheta, dv, 2), NAV_NOT_FINITE);
    dtheta[4] = 0.0;
    dv[5] = INFINITY;
    assert_int_equal(nav_sins_samples(r->s, 0.02, dtheta, dv, 2), NAV_NOT_FINITE);
    assert_int_equal(nav_sins_get(r->s, &after), NAV_OK);
    assert_memory_equal(before.c_nb, after.c_nb, sizeof before.c_nb);
    assert_int_equal(nav_sins_samples(r->s, 0.02, dtheta, dv, 1), NAV_OK);
    struct nav_sins_params model = {.theta = {[4] = NAN}};
    start(r, 0);
    assert_int_equal(nav_sins_about(r->s, &model), NAV_NOT_FINITE);
}

static void a_start_that_cannot_be_is_rejected(void **state)
{
    struct sins_rig *r = *state;
    const size_t size = nav_sins_bytes();
    const double flipped[9] = {0, 1, 0, 1, 0, 0, 0, 0, 1}; /* a reflection */
    const double long_row[9] = {0, -1.1, 0, 1, 0, 0, 0, 0, 1};
    const double none[9] = {NAN};
    assert_int_equal(nav_sins_start(r->memory, size - 1, &r->cfg, NORTH, 0, &r->s), NAV_RANGE);
    assert_int_equal(nav_sins_start(NULL, size, &r->cfg, NORTH, 0, &r->s), NAV_RANGE);
    assert_int_equal(nav_sins_start(r->memory, size, &r->cfg, flipped, 0, &r->s), NAV_RANGE);
    assert_int_equal(nav_sins_start(r->memory, size, &r->cfg, long_row, 0, &r->s), NAV_RANGE);
    assert_int_equal(nav_sins_start(r->memory, size, &r->cfg, none, 0, &r->s), NAV_NOT_FINITE);
    struct nav_refusal why;
    r->cfg.df_sd_mps2 = -1;
    assert_int_equal(nav_sins_check(&r->cfg, &why), NAV_RANGE);
    assert_string_equal(why.field, "df_sd_mps2");
    assert_int_equal(nav_sins_start(r->memory, size, &r->cfg, NORTH, 0, &r->s), NAV_RANGE);
    r->cfg.df_sd_mps2 = NAN;
    assert_int_equal(nav_sins_check(&r->cfg, &why), NAV_NOT_FINITE);
    assert_null(r->s);
}

/* All priors zero: everything is known, and stays so. */
static void a_prior_of_zeros_is_a_known_unit(void **state)
{
    struct sins_rig *r = *state;
    const struct nav_sins_turn turn = {{1, 0, 0}, 10 * DEG, 5, 0};
    r->cfg.beta_sd_rad[0] = r->cfg.beta_sd_rad[1] = r->cfg.beta_sd_rad[2] = 0;
    r->cfg.nu_sd_radps = r->cfg.theta_scale_sd = r->cfg.theta_angle_sd_rad = r->cfg.df_sd_mps2 = 0;
    r->cfg.gamma_scale_sd = r->cfg.gamma_angle_sd_rad = r->cfg.gyro_noise_radps_rts = 0;
    for (r->cfg.form = NAV_KF_JOSEPH; r->cfg.form <= NAV_KF_UD; r->cfg.form++) {
        start(r, 0);
        assert_int_equal(nav_sins_plan(r->s, &turn, 1), NAV_OK);
        assert_true(sd_of(r, NAV_SINS_THETA, 0) == 0.0 && sd_of(r, NAV_SINS_BETA, 0) == 0.0);
    }
}

static void the_stand_takes_rotations_in_order_and_no_more_than_can_wait(void **state)
{
    struct sins_rig *r = *state;
    const double skew[9] = {1, 0.01, 0, 0, 1, 0, 0, 0, 1};
    start(r, 0);
    assert_int_equal(nav_sins_stand(r->s, 0.0, NORTH), NAV_RANGE); /* not in the model */
    r->cfg.stand = 1;
    start(r, 0);
    assert_int_equal(nav_sins_stand(r->s, NAN, NORTH), NAV_NOT_FINITE);
    assert_int_equal(nav_sins_stand(r->s, 0.0, skew), NAV_RANGE);
    int count = 0;
    while (nav_sins_stand(r->s, count * 0.1, NORTH) == NAV_OK) count++;
    assert_int_equal(count, 256);
    start(r, 0);
    assert_int_equal(nav_sins_stand(r->s, 1.0, NORTH), NAV_OK);
    assert_int_equal(nav_sins_stand(r->s, 1.0, NORTH), NAV_TIMES);
    assert_int_equal(nav_sins_stand(r->s, 0.9, NORTH), NAV_TIMES);
}

static void plans_and_passes_that_cannot_be_are_rejected(void **state)
{
    struct sins_rig *r = *state;
    const struct nav_sins_turn bad[] = {
        {{1, 1, 0}, 0.1, 1, 0}, {{0, 0, 0}, 0.1, 1, 0},  {{NAN, 0, 1}, 0.1, 1, 0},
        {{1, 0, 0}, NAN, 1, 0}, {{1, 0, 0}, 0.1, -1, 0}, {{1, 0, 0}, 0.1, INFINITY, 0},
    };
    start(r, 0);
    for (size_t k = 0; k < COUNT(bad); k++) assert_int_equal(nav_sins_plan(r->s, &bad[k], 1), NAV_RANGE);
    assert_int_equal(nav_sins_plan(r->s, bad, -1), NAV_RANGE);
    r->cfg.clone = 0;
    start(r, 1);
    assert_int_equal(nav_sins_plan(r->s, bad, 0), NAV_RANGE); /* a plan has no data to feed back */
    assert_int_equal(nav_sins_again(r->s), NAV_RANGE);        /* no beta at the start */
}

static void a_filter_of_the_largest_size_runs_in_the_callers_memory(void **state)
{
    (void)state;
    enum { N = NAV_KF_MAX, MOVING = 20 };
    static double p[N * N], phi[MOVING * N], q[MOVING * MOVING], h[N];
    void *memory = malloc(nav_kf_bytes());
    nav_kf *kf;
    const double z = 1, r = 1;
    for (int i = 0; i < N; i++) p[i * (N + 1)] = 1;
    for (int i = 0; i < MOVING; i++) phi[i * (N + 1)] = q[i * (MOVING + 1)] = 0.5;
    for (int i = 0; i < N; i++) h[i] = 1;
    for (int form = NAV_KF_JOSEPH; form <= NAV_KF_UD; form++) {
        assert_int_equal(nav_kf_start(memory, nav_kf_bytes(), N, MOVING, form, &kf), NAV_OK);
        assert_int_equal(nav_kf_set(kf, NULL, p), NAV_OK);
        for (int k = 0; k < 50; k++) {
            assert_int_equal(nav_kf_predict(kf, phi, q), NAV_OK);
            assert_int_equal(nav_kf_update(kf, h, &z, &r, 1, NULL), NAV_OK);
        }
        double x[N];
        assert_int_equal(nav_kf_get(kf, x, NULL), NAV_OK);
        assert_true(isfinite(x[0]) && x[N - 1] > 0);
    }
    p[1] = p[N] = 2; /* a correlation of two */
    assert_int_equal(nav_kf_set(kf, NULL, p), NAV_SINGULAR);
    free(memory);
}

int main(void)
{
#define CASE(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        CASE(a_plan_gives_the_accuracy_of_the_article),
        CASE(a_unit_at_rest_keeps_its_attitude_and_learns_the_level),
        CASE(time_neither_runs_back_nor_leaves_a_gap),
        CASE(what_is_not_finite_changes_nothing),
        CASE(a_start_that_cannot_be_is_rejected),
        CASE(a_prior_of_zeros_is_a_known_unit),
        CASE(the_stand_takes_rotations_in_order_and_no_more_than_can_wait),
        CASE(plans_and_passes_that_cannot_be_are_rejected),
        CASE(a_filter_of_the_largest_size_runs_in_the_callers_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
