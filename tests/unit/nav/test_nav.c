/* libpsabench-nav as a C program gets it; tests/py/test_nav_*.py hold its numbers against a reference of its own. */
#include "rig.h"

#include "base/detmath.h"
#include "nav/nav.h"
#include "nav/nav_mc.h"

#include <math.h>
#include <string.h>

#define DEG   0.017453292519943295
#define DEGPH (DEG / 3600.0)

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

/* Three positions of a platform with the errors of the article's level sensors, at rest. */
static void positions_of(struct nav_position p[3], double level_error_rad)
{
    const double psi = 40 * DEG;
    for (int i = 0; i < 3; i++) {
        struct nav_rest at = {.latitude_rad = 50 * DEG, .drift1_radps = 25 * DEGPH, .m1_per_s = 1.0};
        at.alpha_rad = (33 + 90 * i) * DEG;
        at.gamma_rad = nav_gamma(at.alpha_rad, 0.0, psi, 5 * DEG, -4 * DEG);
        at.beta_error_rad = at.gamma_error_rad = level_error_rad;
        double beta;
        p[i] = (struct nav_position){.s_radps = nav_rest_s_radps(&at, &beta), .delta_rad = 90 * i * DEG};
        p[i].beta_rad = beta + level_error_rad;
        p[i].gamma_rad = at.gamma_rad + level_error_rad;
        p[i].t_mid_s = 20 * i;
        p[i].window_s = 10;
    }
}

/* Check case (sources instruments 1.4): latitude 50, heading 40, pitch 5, roll -4, alpha 33 deg, level sensors wrong by 10'. */
static void the_check_case_gives_its_rates_and_comes_back(void **state)
{
    (void)state;
    const double want_degph[3] = {30.2727, 33.1364, 19.7994};
    struct nav_position p[3];
    positions_of(p, 10 * DEG / 60);
    for (int i = 0; i < 3; i++) near(p[i].s_radps / DEGPH, want_degph[i], 2e-3);
    const struct nav_gyrocompass_cfg cfg = {.latitude_rad = 50 * DEG, .method = NAV_CLOSED3};
    struct nav_compass r;
    assert_int_equal(nav_gyrocompass(p, 3, &cfg, &r), NAV_OK);
    near(r.alpha1_rad / DEG, 33.0, 0.01);
    near(r.drift1_radps / DEGPH, 25.0345, 1e-3);
    positions_of(p, 0.0);
    assert_int_equal(nav_gyrocompass(p, 3, &cfg, &r), NAV_OK);
    near(r.alpha1_rad / DEG, 33.0, 1e-9);
    near(r.drift1_radps / DEGPH, 25.0, 1e-9);
    assert_int_equal(r.flags, NAV_NO_NOISE);
}

static void a_refusal_leaves_the_result_as_it_was_and_has_a_sentence(void **state)
{
    (void)state;
    struct nav_position p[3];
    positions_of(p, 0.0);
    struct nav_gyrocompass_cfg cfg = {.latitude_rad = 50 * DEG, .method = NAV_LSQ};
    struct nav_compass r = {.alpha1_rad = 7.0};
    assert_int_equal(nav_gyrocompass(p, 2, &cfg, &r), NAV_TOO_FEW);
    p[2].delta_rad = p[1].delta_rad - 2 * 3.14159265358979323846;
    assert_int_equal(nav_gyrocompass(p, 3, &cfg, &r), NAV_COINCIDENT);
    cfg.latitude_rad = 90 * DEG;
    assert_int_equal(nav_gyrocompass(p, 3, &cfg, &r), NAV_LATITUDE);
    p[0].s_radps = NAN;
    assert_int_equal(nav_gyrocompass(p, 3, &cfg, &r), NAV_NOT_FINITE);
    near(r.alpha1_rad, 7.0, 0.0);
    for (int s = 0; s >= NAV_SINGULAR; s--) assert_true(strlen(nav_status_text(s)) > 3);
    assert_string_equal(nav_status_text(1), nav_status_text(NAV_SINGULAR - 1));
    for (uint32_t f = 1; f <= NAV_NOT_CONVERGED; f *= 2) assert_true(strlen(nav_flag_text(f)) > 10);
    assert_string_equal(nav_flag_text(0), "");
}

static void a_check_says_what_the_call_will_say_and_why(void **state)
{
    (void)state;
    struct nav_position p[3];
    positions_of(p, 0.0);
    const struct nav_gyrocompass_cfg cfg = {.latitude_rad = 50 * DEG, .method = NAV_LSQ};
    struct nav_refusal why = {.status = 1};
    assert_int_equal(nav_gyrocompass_check(p, 3, &cfg, &why), NAV_OK);
    assert_int_equal(why.status, NAV_OK);
    assert_string_equal(why.field, "");
    p[1].gamma_rad = -1.5;
    assert_int_equal(nav_gyrocompass_check(p, 3, &cfg, &why), NAV_RANGE);
    assert_int_equal(nav_gyrocompass_check(p, 3, &cfg, NULL), NAV_RANGE);
    assert_int_equal(why.status, NAV_RANGE);
    assert_int_equal(why.position, 1);
    assert_string_equal(why.field, "gamma_rad");
    near(why.value, -1.5, 0.0);
    assert_non_null(strstr(why.want, "45 deg"));
    struct nav_mc_cfg mc;
    nav_mc_default(&mc);
    assert_int_equal(nav_mc_check(&mc, NAV_MC_CLOSED, &why), NAV_OK);
    mc.torquer_scale = 0.3;
    assert_int_equal(nav_mc_check(&mc, NAV_MC_CLOSED, &why), NAV_RANGE);
    assert_string_equal(why.field, "torquer_scale");
    assert_int_equal(why.position, -1);
    assert_int_equal(nav_mc_check(&mc, NAV_MC_SAMPLES, &why), NAV_OK);
}

/* Sanitizers watch the casts (SAN=undefined has float-cast-overflow here). */
static void what_is_no_angle_gives_what_is_no_number(void **state)
{
    (void)state;
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e30, -1e30, 1.000001e6};
    for (size_t k = 0; k < COUNT(bad); k++)
        for (int at = 0; at < 5; at++) {
            double x[5] = {0.1, 0.2, 0.01, 0.02, 0.03};
            x[at] = bad[k];
            assert_true(isnan(nav_alpha(x[0], x[1], x[2], x[3], x[4])));
            assert_true(isnan(nav_gamma(x[0], x[1], x[2], x[3], x[4])));
            assert_true(isnan(nav_heading(x[0], x[1], x[2], x[3], x[4])));
            if (at > 0) assert_true(isnan(nav_azimuth_drift(0.0, x[1], x[2], x[3], x[4])));
            struct nav_rest rest = {x[0], x[1], x[2], x[3], 1e-4, 1.0, 0.0, x[4], 0.0};
            assert_true(isnan(nav_rest_s_radps(&rest, NULL)));
            if (at < 2) assert_true(isnan(nav_azimuth_drift_sd(x[0], x[1], 1e-3, 1e-3)));
            if (at == 0) assert_true(isnan(nav_transport_radps(100.0, x[0])));
        }
    near(nav_heading(1e-17, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0); /* [0, 2 pi): not the whole turn */
    assert_true(isnan(nav_gm_integral_sd_rad(1e-6, 0.0, 0.0, 1)));
    near(nav_gm_window_cov(1.0, 1e-3, 10.0, 10.0, 10.0), 1e-8, 1e-13); /* neighbours: (tau/T)^2, without overflow */
    struct nav_attitude a;
    const double q[2] = {0.0, 0.1};
    const double gamma[2] = {0.7, -0.7};
    assert_int_equal(nav_attitude_from_level(q, NULL, gamma, 2, 0, &a), NAV_RANGE);
}

/* Whatever the batch, run k is run k; and the arrays that are not asked for are not needed. */
static void a_run_is_the_same_in_every_batch(void **state)
{
    (void)state;
    struct nav_mc_cfg cfg;
    nav_mc_default(&cfg);
    double all[100];
    double part[37];
    int (*const models[])(const struct nav_mc_cfg *, uint64_t, uint64_t, uint64_t,
                          const struct nav_mc_out *) = {nav_mc_closed, nav_mc_samples};
    for (size_t m = 0; m < COUNT(models); m++) {
        assert_int_equal(models[m](&cfg, 5, 0, 100, &(struct nav_mc_out){.heading_rad = all}), NAV_OK);
        assert_int_equal(models[m](&cfg, 5, 50, 37, &(struct nav_mc_out){.heading_rad = part}), NAV_OK);
        assert_memory_equal(all + 50, part, sizeof part);
        assert_int_equal(models[m](&cfg, 6, 50, 37, &(struct nav_mc_out){.heading_rad = part}), NAV_OK);
        assert_memory_not_equal(all + 50, part, sizeof part);
    }
    struct nav_mc_hold_cfg hold;
    nav_mc_hold_default(&hold);
    assert_int_equal(nav_mc_hold(&hold, 5, 0, 100, &(struct nav_mc_hold_out){.end_rad = all}), NAV_OK);
    assert_int_equal(nav_mc_hold(&hold, 5, 50, 37, &(struct nav_mc_hold_out){.end_rad = part}), NAV_OK);
    assert_memory_equal(all + 50, part, sizeof part);
}

static void what_the_models_cannot_do_is_refused(void **state)
{
    (void)state;
    struct nav_mc_cfg cfg;
    const struct nav_mc_out none = {0};
    nav_mc_default(&cfg);
    cfg.count = 2;
    assert_int_equal(nav_mc_closed(&cfg, 1, 0, 1, &none), NAV_TOO_FEW);
    assert_int_equal(nav_mc_samples(&cfg, 1, 0, 1, &none), NAV_TOO_FEW);
    nav_mc_default(&cfg);
    cfg.angle_sys = 9;
    assert_int_equal(nav_mc_closed(&cfg, 1, 0, 1, &none), NAV_RANGE);
    nav_mc_default(&cfg);
    cfg.latitude_rad = 1.55;
    assert_int_equal(nav_mc_samples(&cfg, 1, 0, 1, &none), NAV_LATITUDE);
    struct nav_mc_hold_cfg hold;
    nav_mc_hold_default(&hold);
    hold.step_s = 0.0;
    assert_int_equal(nav_mc_hold(&hold, 1, 0, 1, &(struct nav_mc_hold_out){0}), NAV_RANGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_check_case_gives_its_rates_and_comes_back),
        cmocka_unit_test(a_refusal_leaves_the_result_as_it_was_and_has_a_sentence),
        cmocka_unit_test(a_check_says_what_the_call_will_say_and_why),
        cmocka_unit_test(what_is_no_angle_gives_what_is_no_number),
        cmocka_unit_test(a_run_is_the_same_in_every_batch),
        cmocka_unit_test(what_the_models_cannot_do_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
