/* koi.h as a C program gets it: memory of the caller's and none else, rejections, bad input. Numbers: tests/py/nav/test_koi*.py. */
#include "rig.h"

#include "nav/koi.h"

#include <malloc.h>
#include <math.h>
#include <string.h>

#define DEG 0.017453292519943295

struct koi_rig {
    struct nav_koi_cfg cfg;
    struct nav_state at;
    void *memory;
    nav_koi *k;
    double dtheta[30], dv[30]; /* a tenth of a second at rest */
};

static int set_up(void **state)
{
    struct koi_rig *r = calloc(1, sizeof *r);
    r->memory = malloc(nav_koi_bytes());
    assert_int_equal(nav_koi_default(NAV_KOI_GOOD, &r->cfg), NAV_OK);
    r->at = (struct nav_state){55.7 * DEG, 37.5 * DEG, 150, {0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < 30; i += 3) {
        r->dtheta[i + 1] = NAV_EARTH_RADPS * cos(r->at.lat_rad) * 0.01;
        r->dtheta[i + 2] = NAV_EARTH_RADPS * sin(r->at.lat_rad) * 0.01;
        r->dv[i + 2] = nav_gravity_mps2(r->at.lat_rad, r->at.h_m) * 0.01;
    }
    *state = r;
    return 0;
}

static int tear_down(void **state)
{
    struct koi_rig *r = *state;
    free(r->memory);
    free(r);
    return 0;
}

static int start(struct koi_rig *r)
{
    return nav_koi_start(r->memory, nav_koi_bytes(), &r->cfg, 0, &r->at, NULL, NULL, NULL, &r->k);
}

static struct nav_koi_measurement stop_at(double t_s)
{
    return (struct nav_koi_measurement){.kind = NAV_KOI_STOP, .valid = 1, .t_s = t_s};
}

static void a_minute_at_rest_takes_no_memory_and_moves_nothing(void **state)
{
    struct koi_rig *r = *state;
    struct nav_koi_state is;
    for (r->cfg.form = NAV_KF_JOSEPH; r->cfg.form <= NAV_KF_UD; r->cfg.form++) {
        const size_t before = mallinfo2().uordblks;
        assert_int_equal(start(r), NAV_OK);
        for (int k = 1; k <= 600; k++) {
            const struct nav_koi_measurement m = stop_at(0.1 * k), h = {NAV_KOI_HEIGHT, 1, 0.1 * k, {150}, {0}};
            assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, 10), NAV_OK);
            assert_int_equal(nav_koi_take(r->k, &m), NAV_KOI_ACCEPTED);
            assert_int_equal(nav_koi_take(r->k, &h), NAV_KOI_ACCEPTED);
        }
        assert_int_equal(mallinfo2().uordblks, before);
        assert_int_equal(nav_koi_get(r->k, &is), NAV_OK);
        assert_true(fabs(is.t_s - 60) < 1e-9);
        assert_true(is.last[NAV_KOI_STOP].counts[NAV_KOI_ACCEPTED] == 600 && is.last[NAV_KOI_STOP].nis < 1e-6);
        assert_true(fabs(is.autonomous.h_m - 150) < 1e-3 && fabs(is.hybrid.v_n_mps[1]) < 1e-5);
        assert_int_equal(is.last[NAV_KOI_POSITION].reason, -1);
    }
}

static void a_start_that_cannot_be_is_rejected(void **state)
{
    struct koi_rig *r = *state;
    static double p[NAV_KF_MAX * NAV_KF_MAX];
    struct nav_koi_sensors sensors = {.theta = {[4] = NAN}};
    const size_t size = nav_koi_bytes();
    struct nav_state at = r->at;
    assert_int_equal(nav_koi_start(r->memory, size - 1, &r->cfg, 0, &at, NULL, NULL, NULL, &r->k), NAV_RANGE);
    assert_int_equal(nav_koi_start(NULL, size, &r->cfg, 0, &at, NULL, NULL, NULL, &r->k), NAV_RANGE);
    assert_int_equal(nav_koi_start(r->memory, size, &r->cfg, NAN, &at, NULL, NULL, NULL, &r->k), NAV_NOT_FINITE);
    assert_int_equal(nav_koi_start(r->memory, size, &r->cfg, 0, &at, NULL, NULL, &sensors, &r->k), NAV_NOT_FINITE);
    p[1] = 1; /* not symmetric */
    assert_int_equal(nav_koi_start(r->memory, size, &r->cfg, 0, &at, NULL, p, NULL, &r->k), NAV_SINGULAR);
    at.C_nb[0] = -1; /* a reflection */
    assert_int_equal(nav_koi_start(r->memory, size, &r->cfg, 0, &at, NULL, NULL, NULL, &r->k), NAV_RANGE);
    at = r->at;
    at.lat_rad = 89.95 * DEG;
    assert_int_equal(nav_koi_start(r->memory, size, &r->cfg, 0, &at, NULL, NULL, NULL, &r->k), NAV_RANGE);
    r->cfg.stop_sd_mps = 0;
    struct nav_refusal why;
    assert_int_equal(nav_koi_check(&r->cfg, &why), NAV_RANGE);
    assert_string_equal(why.field, "stop_sd_mps");
    assert_int_equal(start(r), NAV_RANGE);
    assert_null(r->k);
    assert_int_equal(nav_koi_default(NAV_KOI_CLASSES, &r->cfg), NAV_RANGE);
}

static void what_is_not_finite_changes_nothing(void **state)
{
    struct koi_rig *r = *state;
    struct nav_koi_state before, after;
    memset(&before, 0, sizeof before);
    memset(&after, 0, sizeof after);
    assert_int_equal(start(r), NAV_OK);
    assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, 10), NAV_OK);
    assert_int_equal(nav_koi_get(r->k, &before), NAV_OK);
    r->dv[29] = INFINITY;
    assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, 10), NAV_NOT_FINITE);
    assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, -1), NAV_RANGE);
    const struct nav_koi_measurement m = {.kind = NAV_KOI_KINDS, .valid = 1};
    assert_int_equal(nav_koi_take(r->k, &m), NAV_RANGE);
    assert_int_equal(nav_koi_get(r->k, &after), NAV_OK);
    assert_memory_equal(&before, &after, sizeof before);
}

/* A step that turns by more than half a radian, in the second of two. */
static void a_step_that_is_rejected_has_not_come(void **state)
{
    struct koi_rig *r = *state;
    struct nav_koi_state before, after;
    double twice[60] = {0}, force[60];
    memset(&before, 0, sizeof before);
    memset(&after, 0, sizeof after);
    memcpy(twice, r->dtheta, sizeof r->dtheta);
    memcpy(force, r->dv, sizeof r->dv);
    memcpy(force + 30, r->dv, sizeof r->dv);
    for (int i = 30; i < 60; i += 3) twice[i] = 0.06;
    assert_int_equal(start(r), NAV_OK);
    assert_int_equal(nav_koi_push(r->k, twice, force, 10), NAV_OK);
    assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, 10), NAV_OK);
    assert_int_equal(nav_koi_get(r->k, &before), NAV_OK);
    assert_int_equal(start(r), NAV_OK);
    assert_int_equal(nav_koi_push(r->k, twice, force, 20), NAV_RANGE);
    unsigned char take[NAV_KF_MAX] = {0};
    assert_int_equal(nav_koi_correct(r->k, take), NAV_OK); /* between two steps */
    assert_int_equal(nav_koi_push(r->k, r->dtheta, r->dv, 10), NAV_OK);
    assert_int_equal(nav_koi_get(r->k, &after), NAV_OK);
    assert_memory_equal(before.autonomous.C_nb, after.autonomous.C_nb, sizeof before.autonomous.C_nb);
    assert_true(after.t_s == before.t_s);
}

int main(void)
{
#define CASE(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        CASE(a_minute_at_rest_takes_no_memory_and_moves_nothing),
        CASE(a_start_that_cannot_be_is_rejected),
        CASE(what_is_not_finite_changes_nothing),
        CASE(a_step_that_is_rejected_has_not_come),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
