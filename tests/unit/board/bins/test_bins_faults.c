/* Faults of the inertial unit's gyros: each shows in its axis alone, at its size, and ends. */
#include "bins_rig.h"

#include "control/control.h"
#include "fault/fault.h"

#include <stdio.h>
#include <stdlib.h>

#define DPS        RAD_PER_DEG
#define TURN_DPS   10.0
#define COUNT_RAD  (0.01 * RAD_PER_ARCSEC)
#define ROUNDING_S 2.0 /* of a mean: two counts are off by less in that time */

static struct rig r;

static struct {
    struct can_bus bus;
    struct control_bench view;
    struct fault_engine engine;
    struct control control;
} c;

static bool no_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    (void)i;
    (void)out;
    return false;
}

/* On a bench that stands still in space, turning about its x, y or z. */
static void turning(const struct bins_profile *p, unsigned axis, double rate_dps)
{
    rig_up(&r, p, false, 1);
    memset(&c, 0, sizeof c);
    can_bus_init(&c.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    c.view = (struct control_bench){.lab = &r.lab,
                                    .bus = {&c.bus},
                                    .buses = 1,
                                    .unit = {&r.u},
                                    .unit_name = {"a"},
                                    .units = 1,
                                    .sched = &r.s,
                                    .seed = 7,
                                    .faults = &c.engine,
                                    .clients.nth = no_client};
    fault_init(&c.engine, &c.view, &r.s);
    control_init(&c.control, control_tables, &c.view);
    rig_run(&r, 0.5);
    if (rate_dps != 0.0) rig_rate(&r, axis, rate_dps);
    rig_run(&r, 5.0); /* the ramp is over */
}

/* The number of the fault. Single quotes for double ones. */
static uint32_t added(const char *kind, unsigned axis, const char *values)
{
    char json[200];
    snprintf(json, sizeof json, "{'kind':'%s','point':'a.gyro.%c'%s%s}", kind, "xyz"[axis], *values ? "," : "", values);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    cJSON *const args = cJSON_Parse(json), *const result = cJSON_CreateObject();
    assert_non_null(args);
    if (control_call(&c.control, "fault.add", args, result, r.s.now_ns) != CONTROL_DONE)
        fail_msg("%s: %s", kind, c.control.error.why);
    const uint32_t id = (uint32_t)cJSON_GetObjectItemCaseSensitive(result, "id")->valuedouble;
    cJSON_Delete(args);
    cJSON_Delete(result);
    return id;
}

static void clear(uint32_t id)
{
    fault_clear(&c.engine, fault_find(&c.engine, id), r.s.now_ns);
}

/* Mean rates of two seconds; the readings of before are over by then. */
static void mean_rates(double w_radps[3])
{
    rig_run(&r, 0.1);
    rig_forget(&r);
    rig_run(&r, ROUNDING_S);
    for (unsigned i = 0; i < 3; i++) w_radps[i] = rig_angle_rad(&r, i) / rig_span_s(&r);
}

static void assert_rates(const double due_radps[3], const char *what)
{
    double w_radps[3];
    mean_rates(w_radps);
    for (unsigned i = 0; i < 3; i++) {
        if (fabs(w_radps[i] - due_radps[i]) <= 1.01 * COUNT_RAD / rig_span_s(&r)) continue;
        fail_msg("%s: %c: %.12g rad/s, expected %.12g", what, "xyz"[i], w_radps[i], due_radps[i]);
    }
    assert_int_equal(r.flags, 0); /* no flag of the frame is of a gyro */
}

static const struct row {
    const char *kind, *values;
    double due_radps; /* at TURN_DPS */
} rows[] = {
    {"gyro.stuck", "", 0.0},
    {"gyro.saturation", "'limit_dps':4", 4.0 * DPS},
    {"gyro.bias", "'drift_degph':100", TURN_DPS *DPS + 100.0 * DEGPH},
    {"gyro.scale", "'scale_ppm':-5000", TURN_DPS *DPS * 0.995},
    {"gyro.lock_in", "'lock_in_degph':21600", 8.0 * DPS}, /* 6 deg/s: 10^2 - 6^2 = 8^2 */
};

static void each_kind_shows_in_its_axis_alone_and_ends(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    for (unsigned axis = 0; axis < 3; axis++) {
        turning(&p, axis, TURN_DPS);
        double due[3] = {0.0, 0.0, 0.0};
        for (size_t i = 0; i < COUNT(rows); i++) {
            due[axis] = TURN_DPS * DPS;
            assert_rates(due, "before");
            const uint32_t id = added(rows[i].kind, axis, rows[i].values);
            due[axis] = rows[i].due_radps;
            assert_rates(due, rows[i].kind);
            clear(id);
        }
        due[axis] = TURN_DPS * DPS;
        assert_rates(due, "after");
    }
}

static void each_kind_of_the_table_has_a_row_here(void **state)
{
    const struct fault_kind *k;
    size_t kinds = 0;
    (void)state;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) kinds += k->places == FAULT_BIT(FAULT_AT_GYRO);
    assert_int_equal(kinds, COUNT(rows));
}

/* Below the limit and outside the zone a gyro is what it was; backwards they are the same. */
static void limit_and_lock_in_are_symmetric(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    turning(&p, 0, -TURN_DPS);
    const uint32_t limit = added("gyro.saturation", 0, "'limit_dps':4");
    assert_rates((const double[]){-4.0 * DPS, 0.0, 0.0}, "limit");
    clear(limit);
    (void)added("gyro.saturation", 0, "'limit_dps':10.1");
    assert_rates((const double[]){-TURN_DPS * DPS, 0.0, 0.0}, "below the limit");
    const uint32_t wide = added("gyro.lock_in", 0, "'lock_in_degph':21600");
    assert_rates((const double[]){-8.0 * DPS, 0.0, 0.0}, "lock-in");
    (void)added("gyro.lock_in", 0, "'lock_in_degph':14401"); /* 10 deg/s in all */
    assert_rates((const double[]){0.0, 0.0, 0.0}, "locked");
    clear(wide);
    assert_rates((const double[]){-sqrt(100.0 - 14401.0 / 3600.0 * 14401.0 / 3600.0) * DPS, 0.0, 0.0}, "one is left");
}

static void those_at_a_gyro_add_up(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    turning(&p, 0, TURN_DPS);
    const uint32_t bias = added("gyro.bias", 0, "'drift_degph':100");
    (void)added("gyro.bias", 0, "'drift_degph':-30");
    (void)added("gyro.bias", 1, "'drift_degph':7");
    (void)added("gyro.scale", 0, "'scale_ppm':1000");
    (void)added("gyro.scale", 0, "'scale_ppm':2000");
    assert_rates((const double[]){(TURN_DPS * DPS + 70.0 * DEGPH) * 1.003, 7.0 * DEGPH, 0.0}, "sum");
    clear(bias);
    assert_rates((const double[]){(TURN_DPS * DPS - 30.0 * DEGPH) * 1.003, 7.0 * DEGPH, 0.0}, "one is over");
    const uint32_t low = added("gyro.saturation", 0, "'limit_dps':3");
    (void)added("gyro.saturation", 0, "'limit_dps':5");
    assert_rates((const double[]){3.0 * DPS, 7.0 * DEGPH, 0.0}, "the lower limit");
    clear(low);
    assert_rates((const double[]){5.0 * DPS, 7.0 * DEGPH, 0.0}, "the higher limit");
}

/* Readings whose increment of x is not `due` counts, or one beside it. */
struct seen {
    int32_t due;
    unsigned others;
};

static void compare_increment(struct rig *rig, const struct bins_reading *g)
{
    struct seen *s = rig->own;
    s->others += abs(g->gyro[0] - s->due) > 1;
}

static unsigned others_than(int32_t due)
{
    struct seen s = {.due = due};
    rig_run(&r, 0.1);
    r.own = &s;
    r.on_reading = compare_increment;
    rig_run(&r, 2.0);
    r.on_reading = NULL;
    return s.others;
}

/* The noise is the gyro's, the fault the counter's. */
static void a_counter_that_does_not_follow_shows_no_noise(void **state)
{
    struct bins_profile p = rig_ideal();
    (void)state;
    p.gyro_noise_degph = 10.0; /* 100 counts a reading */
    turning(&p, 0, TURN_DPS);
    assert_true(others_than(36000) > 150);
    const uint32_t stuck = added("gyro.stuck", 0, "");
    assert_int_equal(others_than(0), 0);
    clear(stuck);
    const uint32_t limit = added("gyro.saturation", 0, "'limit_dps':3.6");
    assert_int_equal(others_than(12960), 0);
    clear(limit);
    assert_true(others_than(36000) > 150);
}

static void a_fault_outlasts_reset_and_power(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    turning(&p, 0, TURN_DPS);
    const uint32_t stuck = added("gyro.stuck", 0, "");
    bins_reset(rig_bins(&r), r.s.now_ns);
    rig_run(&r, 0.5);
    assert_rates((const double[]){0.0, 0.0, 0.0}, "after Res");
    unit_power_down(&r.u, r.s.now_ns);
    rig_run(&r, 0.5);
    unit_power_up(&r.u, r.s.now_ns);
    rig_run(&r, 0.5);
    assert_rates((const double[]){0.0, 0.0, 0.0}, "after power");
    clear(stuck);
    assert_rates((const double[]){TURN_DPS * DPS, 0.0, 0.0}, "over");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_kind_shows_in_its_axis_alone_and_ends),
        cmocka_unit_test(each_kind_of_the_table_has_a_row_here),
        cmocka_unit_test(limit_and_lock_in_are_symmetric),
        cmocka_unit_test(those_at_a_gyro_add_up),
        cmocka_unit_test(a_counter_that_does_not_follow_shows_no_noise),
        cmocka_unit_test(a_fault_outlasts_reset_and_power),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
