/* The gyro unit on a platform: runs of positions, what they measure, and what it says when something is wrong. */
#include "gyro_rig.h"

#define LATITUDE_DEG 50.0

static struct rig r;

static int up(void **state)
{
    const struct platform_cfg c = rig_platform();
    (void)state;
    rig_up(&r, &c, LATITUDE_DEG);
    return 0;
}

static struct platform_state truth(void)
{
    struct platform_state s;
    platform_at(&r.p, r.s.now_ns, &s);
    return s;
}

/* ---- runs */

static void a_run_goes_through_its_positions_phase_by_phase(void **state)
{
    (void)state;
    r.b.set.repeat = 2;
    r.b.set.settle_s = 3.0;
    r.b.set.window_s = 2.0;
    rig_mode(&r, GYRO_COMPASS);
    r.readings = 0;
    rig_run(&r, 120.0);
    unsigned steps[8] = {0}, position = 0;
    enum gyro_phase phase = GYRO_IDLE;
    for (unsigned i = 0; i < r.readings && r.reading[i].mode == GYRO_COMPASS; i++) {
        const struct gyro_reading *g = &r.reading[i];
        assert_int_equal(g->flags, 0);
        assert_true(g->position == position || g->position == position + 1);
        if (g->position != position) assert_int_equal(g->phase, GYRO_SLEWING);
        else assert_true(g->phase == phase || g->phase == phase + 1);
        if (g->phase == GYRO_WINDOW) steps[g->position]++;
        position = g->position;
        phase = g->phase;
    }
    assert_int_equal(position, 6);
    for (unsigned i = 1; i <= 6; i++) assert_int_equal(steps[i], 200);
    assert_int_equal(r.b.counters.windows, 6);
    assert_int_equal(r.repositions, 6);
    assert_int_equal(r.events[GYRO_EV_WINDOW], 6);
    assert_int_equal(r.events[GYRO_EV_WINDOW_END], 6);
    assert_int_equal(rig_last(&r)->mode, GYRO_HOLD);
    assert_int_equal(rig_last(&r)->position, 0);
    assert_true(fabs(rig_last(&r)->encoder_rad - 180.0 * RAD_PER_DEG) < 1.0 * ARCMIN);
}

static void windows_tell_the_rate_of_the_earth_and_the_drift(void **state)
{
    (void)state;
    const double we_degph = 15.041067 * cos(LATITUDE_DEG * RAD_PER_DEG);
    double sum = 0.0;
    unsigned n = 0;
    rig_mode(&r, GYRO_COMPASS);
    r.readings = 0;
    for (unsigned windows = 0; windows < 3;) {
        rig_run(&r, 0.01);
        const struct gyro_reading *g = rig_last(&r);
        if (g->phase == GYRO_WINDOW) {
            sum += -r.b.set.m1_per_s * g->beta_rad / DEGPH;
            n++;
            continue;
        }
        if (n == 0) continue;
        const struct platform_state s = truth();
        const double want =
            we_degph * (sin(s.alpha_rad) * cos(s.gamma_rad) + cos(s.alpha_rad) * sin(s.gamma_rad) * sin(s.beta_rad)) +
            25.0;
        if (!(fabs(sum / n - want) < 2e-3)) fail_msg("S %.5f deg/h, want %.5f", sum / n, want);
        sum = 0.0;
        n = 0;
        windows++;
    }
}

static void a_frozen_window_drives_the_azimuth_as_before_it(void **state)
{
    (void)state;
    const struct gyro_place w = gyro_place_of(LATITUDE_DEG, 0.0, 0.0);
    unsigned n = 0;
    r.b.set.freeze = 1.0;
    rig_mode(&r, GYRO_COMPASS);
    for (unsigned i = 0; i < 3000; i++) {
        rig_run(&r, 0.01);
        const struct gyro_reading *g = rig_last(&r);
        if (g->phase != GYRO_WINDOW) continue;
        const struct gyro_level l = gyro_level_of(sin(g->beta_rad), -sin(g->gamma_rad) * cos(g->beta_rad));
        const double servo_radps = g->u2_radps - gyro_law_vertical(&l, w.up_radps, 0.0);
        assert_true(fabs(servo_radps - r.b.run.frozen_radps) < 1e-15);
        n++;
    }
    assert_int_equal(n, 1000);
    assert_true(fabs(r.b.run.frozen_radps / DEGPH - 25.0) < 1.0);
}

static void calibration_tells_the_drift_about_the_azimuth_axis(void **state)
{
    (void)state;
    double sum = 0.0;
    unsigned n = 0;
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 10.0);
    rig_mode(&r, GYRO_CALIBRATE);
    rig_run(&r, 75.0);
    for (unsigned i = 0; i < r.readings; i++) {
        if (r.reading[i].mode != GYRO_CALIBRATE || r.reading[i].phase != GYRO_WINDOW) continue;
        sum += r.reading[i].u2_radps / DEGPH;
        n++;
    }
    assert_int_equal(n, 6000);
    const struct platform_state s = truth();
    const struct gyro_place w = gyro_place_of(LATITUDE_DEG, 0.0, 0.0);
    const struct gyro_level l = gyro_level_of(sin(s.beta_rad), -sin(s.gamma_rad) * cos(s.beta_rad));
    const double drift = sum / n - gyro_law_keep(&l, &w, sin(s.alpha_rad), cos(s.alpha_rad)) / DEGPH;
    if (fabs(drift - 25.0) > 5e-3) fail_msg("drift 2 is %.5f deg/h", drift);
    assert_int_equal(rig_last(&r)->mode, GYRO_HOLD);
}

/* ---- navigation */

static void navigation_keeps_the_azimuth_in_flight_as_well(void **state)
{
    static const struct {
        double speed_mps, track_deg;
    } rows[] = {{0, 0}, {140, 90}, {140, -45}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        up(state);
        rig_mode(&r, GYRO_LEVEL);
        vehicle_fly(platform_vehicle(&r.p, r.s.now_ns), rows[i].speed_mps, rows[i].track_deg, r.s.now_ns);
        rig_run(&r, 120.0); /* at its speed, and level again */
        const double alpha_rad = truth().alpha_rad;
        r.b.set.azimuth_deg = alpha_rad / RAD_PER_DEG;
        r.b.set.drift1_degph = r.b.set.drift2_degph = 25.0;
        rig_mode(&r, GYRO_NAVIGATE);
        for (unsigned k = 0; k < 900; k++) { /* the host aids */
            struct vehicle_state v;
            vehicle_at(&r.p.vehicle, r.s.now_ns, &v);
            r.b.set.speed_mps = v.speed_mps;
            r.b.set.track_deg = v.heading_rad / RAD_PER_DEG;
            r.b.set.latitude_deg = v.latitude_rad / RAD_PER_DEG;
            gyro_settings_changed(&r.b);
            rig_run(&r, 1.0);
        }
        const double off_deg = (truth().alpha_rad - alpha_rad) / RAD_PER_DEG;
        if (fabs(off_deg) > 0.01) fail_msg("row %u: %.4f deg in a quarter of an hour", i, off_deg);
        struct vehicle_state v;
        vehicle_at(&r.p.vehicle, r.s.now_ns, &v);
        const double heading_deg = gyro_heading_deg(&r.b) - v.heading_rad / RAD_PER_DEG;
        assert_true(fabs(gyro_wrap_rad(heading_deg * RAD_PER_DEG)) < 0.5 * RAD_PER_DEG);
    }
}

static void a_wrong_drift_turns_the_azimuth_away_by_as_much(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_LEVEL);
    rig_run(&r, 15.0);
    const double alpha_rad = truth().alpha_rad;
    r.b.set.azimuth_deg = alpha_rad / RAD_PER_DEG;
    r.b.set.drift1_degph = 25.0;
    r.b.set.drift2_degph = 26.0;
    gyro_settings_changed(&r.b);
    rig_mode(&r, GYRO_NAVIGATE);
    rig_run(&r, 360.0);
    assert_true(fabs((truth().alpha_rad - alpha_rad) / RAD_PER_DEG - 0.1) < 0.002);
}

/* ---- what is refused */

static const char *mode(enum gyro_mode m)
{
    return gyro_set_mode(&r.b, m, r.s.now_ns);
}

static void a_mode_that_cannot_be_is_refused_with_the_reason(void **state)
{
    (void)state;
    r.b.set.count = 32;
    r.b.set.repeat = 4;
    assert_non_null(strstr(mode(GYRO_COMPASS), "127"));
    r.b.set.repeat = 3;
    assert_null(mode(GYRO_COMPASS));
    r.b.set.count = 1;
    r.b.set.repeat = GYRO_RUN_MAX;
    assert_null(mode(GYRO_COMPASS)); /* as many as there may be */
    r.mute = true;
    rig_run(&r, 0.2);
    assert_non_null(strstr(mode(GYRO_LEVEL), "silent"));
    assert_null(mode(GYRO_OFF));
    r.mute = false;
    rig_run(&r, 0.1);
    r.b.base.cfg.level_node = 0;
    assert_non_null(strstr(mode(GYRO_HOLD), "no level unit"));
    gyro_reset(&r.b, r.s.now_ns);
    assert_non_null(strstr(mode(GYRO_OFF), "runs up"));
    assert_int_equal(r.b.counters.refused, 4);
}

/* A hold keeps the gimbal where it is; every other servoed mode goes on from the reference of the one before it. */
static void a_mode_takes_over_the_reference_of_the_servo(void **state)
{
    (void)state;
    assert_null(mode(GYRO_LEVEL)); /* no servo */
    r.b.run.q_ref_rad = 1.0;
    assert_null(mode(GYRO_CALIBRATE));
    assert_true(r.b.run.q_ref_rad == r.b.servo_rad);
    r.b.run.q_ref_rad = r.b.servo_rad + 0.25;
    assert_null(mode(GYRO_CALIBRATE));
    assert_true(r.b.run.q_ref_rad == r.b.servo_rad + 0.25);
    assert_null(mode(GYRO_HOLD));
    assert_true(r.b.run.q_ref_rad == r.b.servo_rad);
}

/* ---- what goes wrong */

static void a_lost_frame_is_told_with_the_step_that_lacks_it(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_LEVEL);
    rig_run(&r, 2.0);
    r.readings = 0;
    r.lose = 1;
    rig_run(&r, 2.5);
    unsigned lacking = 0;
    for (unsigned i = 0; i < r.readings; i++) lacking += r.reading[i].flags & GYRO_LEVEL_LOST ? 1 : 0;
    assert_int_equal(lacking, 1);
    assert_int_equal(r.b.counters.level_lost, 1);
    assert_int_equal(r.conditions, 0); /* told, and over after a second */
    assert_int_equal(r.events[GYRO_EV_FAULT], 1);
}

static void without_the_level_unit_the_levelling_rate_stays(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 15.0);
    r.mute = true;
    rig_run(&r, 0.1);
    const double u1_radps = rig_last(&r)->u1_radps;
    assert_true(u1_radps != 0.0 && rig_last(&r)->flags == GYRO_LEVEL_LOST);
    rig_run(&r, 10.0);
    assert_true(rig_last(&r)->u1_radps == u1_radps);
    assert_int_equal(r.conditions, GYRO_LEVEL_LOST);
    assert_int_equal(r.b.counters.level_silent, 1);
    r.mute = false;
    rig_run(&r, 2.0);
    assert_int_equal(r.conditions, 0);
}

static void a_stuck_angle_sensor_ends_the_run_in_its_first_turn(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 5.0);
    platform_stick(&r.p, true, r.s.now_ns);
    r.b.set.position_deg[0] = 90.0;
    rig_mode(&r, GYRO_COMPASS);
    rig_run(&r, 2.0);
    assert_int_equal(r.conditions & GYRO_ENCODER_FAULT, GYRO_ENCODER_FAULT);
    assert_int_equal(rig_last(&r)->mode, GYRO_LEVEL);
    assert_true(rig_last(&r)->flags & GYRO_ENCODER_FAULT);
    assert_int_equal(r.b.counters.windows, 0);
    platform_stick(&r.p, false, r.s.now_ns);
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 5.0);
    assert_int_equal(rig_last(&r)->flags, 0);
}

static void a_dead_azimuth_torquer_is_found_in_the_turn(void **state)
{
    (void)state;
    platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.0, r.s.now_ns);
    r.b.set.position_deg[0] = 150.0;
    rig_mode(&r, GYRO_COMPASS);
    rig_run(&r, 5.0);
    assert_int_equal(r.conditions & GYRO_ENCODER_FAULT, GYRO_ENCODER_FAULT);
}

static void a_platform_that_never_settles_gives_no_window(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_LEVEL);
    rig_run(&r, 10.0);
    platform_set_torquer(&r.p, PLATFORM_LEVEL, 0.0, r.s.now_ns);
    r.b.set.position_deg[0] = 90.0;
    rig_mode(&r, GYRO_COMPASS);
    rig_run(&r, 60.0);
    assert_int_equal(r.conditions & GYRO_NOT_SETTLED, GYRO_NOT_SETTLED);
    assert_int_equal(rig_last(&r)->mode, GYRO_HOLD);
    assert_int_equal(r.b.counters.windows, 0);
    assert_int_equal(r.b.counters.unsettled, 1);
    rig_mode(&r, GYRO_OFF);
    assert_int_equal(r.conditions & GYRO_NOT_SETTLED, 0);
}

static void a_vehicle_that_turns_is_no_fault_of_the_angle_sensor(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 5.0);
    vehicle_attitude(platform_vehicle(&r.p, r.s.now_ns), 200.0, 3.0, 2.0, r.s.now_ns);
    rig_run(&r, 80.0);
    assert_int_equal(r.b.counters.encoder_faults, 0);
    vehicle_attitude(platform_vehicle(&r.p, r.s.now_ns), 20.0, 0.0, 0.0, r.s.now_ns);
    rig_mode(&r, GYRO_COMPASS);
    rig_run(&r, 90.0);
    assert_int_equal(r.b.counters.encoder_faults, 0);
}

static void rates_are_limited_and_say_so(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_HOLD);
    r.b.profile.torquer_limit_dps = 0.1;
    vehicle_attitude(platform_vehicle(&r.p, r.s.now_ns), 100.0, 0.0, 0.0, r.s.now_ns);
    rig_run(&r, 5.0);
    assert_true(rig_last(&r)->flags & GYRO_SATURATED);
    assert_true(r.conditions & GYRO_SATURATED);
    assert_true(fabs(r.torque_radps[1]) <= 0.1 * RAD_PER_DEG + 1e-15);
    assert_true(r.b.counters.saturated > 100);
}

static void power_and_reset_leave_the_torquers_alone(void **state)
{
    (void)state;
    rig_mode(&r, GYRO_HOLD);
    rig_run(&r, 5.0);
    assert_true(r.torque_radps[1] != 0.0);
    gyro_reset(&r.b, r.s.now_ns);
    assert_true(r.torque_radps[0] == 0.0 && r.torque_radps[1] == 0.0);
    rig_run(&r, 1.0);
    assert_int_equal(rig_last(&r)->mode, GYRO_OFF);
    assert_true(rig_last(&r)->step < 100);
    gyro_power_down(&r.b, r.s.now_ns);
    r.readings = 0;
    rig_run(&r, 1.0);
    assert_int_equal(r.readings, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_run_goes_through_its_positions_phase_by_phase, up),
        cmocka_unit_test_setup(windows_tell_the_rate_of_the_earth_and_the_drift, up),
        cmocka_unit_test_setup(a_frozen_window_drives_the_azimuth_as_before_it, up),
        cmocka_unit_test_setup(calibration_tells_the_drift_about_the_azimuth_axis, up),
        cmocka_unit_test_setup(navigation_keeps_the_azimuth_in_flight_as_well, up),
        cmocka_unit_test_setup(a_wrong_drift_turns_the_azimuth_away_by_as_much, up),
        cmocka_unit_test_setup(a_mode_that_cannot_be_is_refused_with_the_reason, up),
        cmocka_unit_test_setup(a_mode_takes_over_the_reference_of_the_servo, up),
        cmocka_unit_test_setup(a_lost_frame_is_told_with_the_step_that_lacks_it, up),
        cmocka_unit_test_setup(without_the_level_unit_the_levelling_rate_stays, up),
        cmocka_unit_test_setup(a_stuck_angle_sensor_ends_the_run_in_its_first_turn, up),
        cmocka_unit_test_setup(a_dead_azimuth_torquer_is_found_in_the_turn, up),
        cmocka_unit_test_setup(a_platform_that_never_settles_gives_no_window, up),
        cmocka_unit_test_setup(a_vehicle_that_turns_is_no_fault_of_the_angle_sensor, up),
        cmocka_unit_test_setup(rates_are_limited_and_say_so, up),
        cmocka_unit_test_setup(power_and_reset_leave_the_torquers_alone, up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
