/* What the gyro unit tells of its own angle sensor, torquers and level in navigation, and what it leaves alone. */
#include "gyro_rig.h"

#define LATITUDE_DEG 50.0
#define DRIFT_DEGPH  25.0

static struct rig r;

static int up_with(const struct platform_cfg *c, double latitude_deg)
{
    rig_up(&r, c, latitude_deg);
    return 0;
}

static int up(void **state)
{
    const struct platform_cfg c = rig_platform();
    (void)state;
    return up_with(&c, LATITUDE_DEG);
}

static double alpha_deg(void)
{
    struct platform_state s;
    platform_at(&r.p, r.s.now_ns, &s);
    return s.alpha_rad / RAD_PER_DEG;
}

static struct vehicle *vehicle(void)
{
    return platform_vehicle(&r.p, r.s.now_ns);
}

static void tell(double latitude_deg, double speed_mps, double track_deg)
{
    r.b.set.latitude_deg = latitude_deg;
    r.b.set.speed_mps = speed_mps;
    r.b.set.track_deg = track_deg;
    gyro_settings_changed(&r.b);
}

/* A host that looks at its receiver. */
static void aid(void)
{
    struct vehicle_state v;
    vehicle_at(&r.p.vehicle, r.s.now_ns, &v);
    tell(v.latitude_rad / RAD_PER_DEG, v.speed_mps, v.heading_rad / RAD_PER_DEG);
}

/* Level, then navigating with what is right. */
static void navigate(void)
{
    if (r.b.run.mode != GYRO_LEVEL) rig_mode(&r, GYRO_LEVEL);
    rig_run(&r, 15.0);
    r.b.set.azimuth_deg = alpha_deg();
    r.b.set.drift1_degph = r.b.set.drift2_degph = DRIFT_DEGPH;
    gyro_settings_changed(&r.b);
    rig_mode(&r, GYRO_NAVIGATE);
}

static void fly(double speed_mps, double track_deg)
{
    rig_mode(&r, GYRO_LEVEL);
    vehicle_attitude(vehicle(), track_deg, 0.0, 0.0, r.s.now_ns);
    vehicle_fly(vehicle(), speed_mps, track_deg, r.s.now_ns);
    rig_run(&r, 180.0);
    aid();
    navigate();
}

static void on_for(double s)
{
    r.readings = 0;
    rig_run(&r, s);
}

/* Seconds until the flag is set; -1: not by then. */
static double until(enum gyro_flag what, double limit_s)
{
    for (double s = 1.0; s <= limit_s; s += 1.0) {
        on_for(1.0);
        if (r.conditions & what) return s;
    }
    return -1.0;
}

static const char *test_result(void)
{
    static const char *const words[] = {"none", "passed", "failed", "unclear"};
    const char *why = gyro_self_test(&r.b, r.s.now_ns);
    if (why) return why;
    for (unsigned i = 0; i < 10 && r.b.nod.way != GYRO_NOD_NONE; i++) on_for(1.0);
    return words[r.b.nod.result];
}

/* ---- the azimuth torquer ---- */

static void a_dead_azimuth_torquer_is_found_before_it_costs_a_degree(void **state)
{
    static const struct {
        double latitude_deg, drift2_degph, speed_mps, track_deg, limit_s;
    } rows[] = {{50, 25, 0, 0, 120}, {50, -25, 0, 0, 240},   {-50, 0, 0, 0, 300},
                {10, 0, 0, 0, 1000}, {50, 25, 140, 90, 120}, {60, 0, 140, -60, 600}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct platform_cfg c = rig_platform();
        (void)state;
        c.drift_degph[PLATFORM_AZIMUTH] = rows[i].drift2_degph;
        (void)up_with(&c, rows[i].latitude_deg);
        if (rows[i].speed_mps > 0.0) fly(rows[i].speed_mps, rows[i].track_deg);
        else navigate();
        r.b.set.drift2_degph = rows[i].drift2_degph;
        on_for(200.0);
        assert_int_equal(r.conditions, 0);
        const double begun_deg = alpha_deg();
        platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.0, r.s.now_ns);
        const double took_s = until(GYRO_ENCODER_FAULT, rows[i].limit_s);
        const double lost_deg = fabs(alpha_deg() - begun_deg);
        if (took_s < 0.0 || lost_deg > 0.8) fail_msg("row %u: %.0f s, %.2f deg", i, took_s, lost_deg);
        assert_int_equal(rig_last(&r)->mode, GYRO_NAVIGATE); /* it is a doubt, no reason to drop the azimuth */
        assert_true(rig_last(&r)->flags & GYRO_ENCODER_FAULT);
        assert_int_equal(r.b.counters.encoder_faults, 1);
        on_for(300.0);
        assert_int_equal(r.b.counters.encoder_faults, 1); /* told once */
    }
}

static void a_torquer_that_is_back_in_time_is_no_fault(void **state)
{
    (void)state;
    navigate();
    for (unsigned i = 0; i < 3; i++) { /* one block or less each */
        platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.0, r.s.now_ns);
        on_for(20.0);
        platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 1.0, r.s.now_ns);
        on_for(600.0);
    }
    assert_int_equal(r.b.counters.encoder_faults, 0);
}

/* As slow as a great circle near a pole. */
static void a_turn_of_the_vehicle_at_the_rate_of_a_dead_torquer_has_to_be_told(void **state)
{
    for (unsigned told = 0; told < 2; told++) {
        (void)up(state);
        navigate();
        on_for(1.0);
        vehicle()->cfg.turn_dps = rig_last(&r)->u2_radps / RAD_PER_DEG;
        vehicle_attitude(vehicle(), 20.0, 5.0, -4.0, r.s.now_ns);
        for (unsigned i = 0; i < 120; i++) {
            on_for(5.0);
            if (told) aid();
        }
        assert_int_equal(r.conditions, told ? 0 : GYRO_ENCODER_FAULT);
    }
}

/* ---- the angle sensor, aided ---- */

static void a_track_that_turns_without_the_angle_sensor_is_a_fault(void **state)
{
    (void)state;
    fly(140.0, 60.0);
    platform_stick(&r.p, true, r.s.now_ns);
    on_for(700.0);
    assert_int_equal(r.conditions, 0); /* straight on nothing is to be seen */
    vehicle_fly(vehicle(), 140.0, 100.0, r.s.now_ns);
    on_for(30.0);
    aid();
    on_for(100.0);
    assert_int_equal(r.conditions, 0); /* it may have been told ahead */
    on_for(40.0);
    assert_int_equal(r.conditions, GYRO_ENCODER_FAULT);
}

static void a_track_told_ahead_or_late_is_none(void **state)
{
    (void)state;
    fly(140.0, 60.0);
    on_for(900.0);
    tell(50.0, 140.0, 100.0); /* a minute ahead */
    on_for(60.0);
    vehicle_fly(vehicle(), 140.0, 100.0, r.s.now_ns);
    on_for(900.0);
    vehicle_fly(vehicle(), 140.0, 190.0, r.s.now_ns);
    on_for(500.0); /* late by as much */
    aid();
    on_for(900.0);
    assert_int_equal(r.b.counters.encoder_faults, 0);
    tell(50.0, 0.0, 300.0); /* of a vehicle that is parked a track says nothing */
    platform_stick(&r.p, true, r.s.now_ns);
    on_for(900.0);
    tell(50.0, 0.0, 30.0);
    on_for(900.0);
    assert_int_equal(r.b.counters.encoder_faults, 0);
}

/* ---- level ---- */

static void navigation_that_loses_its_level_says_so(void **state)
{
    (void)state;
    navigate();
    on_for(100.0);
    platform_set_torquer(&r.p, PLATFORM_LEVEL, 0.0, r.s.now_ns);
    const double took_s = until(GYRO_NOT_SETTLED, 100.0);
    assert_true(took_s > 40.0 && took_s < 70.0); /* 5' at 25 deg/h and the Earth's, and 40 s */
    assert_true(rig_last(&r)->flags & GYRO_NOT_SETTLED);
    assert_int_equal(rig_last(&r)->mode, GYRO_NAVIGATE);
    platform_set_torquer(&r.p, PLATFORM_LEVEL, 1.0, r.s.now_ns);
    on_for(60.0);
    assert_int_equal(r.conditions, GYRO_NOT_SETTLED); /* the azimuth was off meanwhile: it stays */
    rig_mode(&r, GYRO_LEVEL);
    assert_int_equal(r.conditions, 0);
}

/* ---- what is no fault ---- */

static void hours_on_a_parked_vehicle_that_sways_raise_no_flag(void **state)
{
    struct platform_cfg c = rig_platform();
    (void)state;
    c.gm_sigma_degph = 0.2;
    c.torquer_scale[PLATFORM_LEVEL] = c.torquer_scale[PLATFORM_AZIMUTH] = 0.0005;
    c.angle_step_arcsec = 30.0;
    (void)up_with(&c, LATITUDE_DEG);
    navigate();
    vehicle_sway(vehicle(), &(struct vehicle_sway){.pitch_arcmin = 10, .pitch_s = 7, .roll_arcmin = 10, .roll_s = 11},
                 r.s.now_ns);
    for (unsigned i = 0; i < 48; i++) {
        on_for(300.0);
        assert_string_equal(test_result(), "passed");
    }
    assert_int_equal(r.b.counters.encoder_faults, 0);
    for (unsigned i = 0; i < GYRO_FLAGS; i++) assert_int_equal(r.b.past[i].begun, 0);
}

static void a_flight_with_turns_raises_no_flag(void **state)
{
    static const double track_deg[] = {90, 180, 170, 165, 300, -20, 60, 59, 240, 200, 0, 45};
    (void)state;
    fly(140.0, 90.0);
    for (unsigned i = 0; i < COUNT(track_deg); i++) {
        vehicle_fly(vehicle(), i % 4 == 3 ? 220.0 : 140.0, track_deg[i], r.s.now_ns);
        on_for(5.0);
        assert_string_not_equal(test_result(), "failed"); /* in the turn: passed or unclear */
        on_for(290.0);
        assert_string_equal(test_result(), "passed");
        aid();
    }
    assert_int_equal(r.b.counters.encoder_faults, 0);
    assert_int_equal(r.b.counters.unsettled, 0);
    assert_int_equal(r.conditions & ~(unsigned)GYRO_SATURATED, 0);
}

/* But a wrong drift that turns the platform at what is asked, backwards, looks as a dead torquer does: between 0.75 and 1.25. */
static void a_vehicle_that_is_towed_and_a_wrong_drift_are_no_faults(void **state)
{
    (void)state;
    navigate();
    for (unsigned i = 0; i < 10; i++) {
        vehicle_attitude(vehicle(), 40.0 + 33.0 * i, 3.0, -2.0, r.s.now_ns);
        on_for(60.0);
    }
    assert_int_equal(r.b.counters.encoder_faults, 0);
    for (double off_degph = -60.0; off_degph <= 60.0; off_degph += 7.0) {
        const double asked_degph = 15.041067 * sin(LATITUDE_DEG * RAD_PER_DEG) + DRIFT_DEGPH + off_degph;
        const double part = -off_degph / asked_degph;
        r.b.set.drift2_degph = DRIFT_DEGPH + off_degph;
        rig_mode(&r, GYRO_NAVIGATE);
        on_for(400.0);
        const bool flagged = r.conditions & GYRO_ENCODER_FAULT;
        if (flagged != (part > 0.74 && part < 1.26)) fail_msg("%.0f deg/h, %.2f of it", off_degph, part);
    }
}

/* ---- a nod ---- */

static void a_nod_leaves_the_azimuth_where_it_was(void **state)
{
    (void)state;
    navigate();
    on_for(10.0);
    const double begun_deg = alpha_deg();
    double far_deg = 0.0;
    assert_null(gyro_self_test(&r.b, r.s.now_ns));
    assert_non_null(strstr(gyro_self_test(&r.b, r.s.now_ns), "under way"));
    for (unsigned i = 0; i < 150; i++) {
        on_for(0.01);
        far_deg = fmax(far_deg, fabs(alpha_deg() - begun_deg));
    }
    assert_int_equal(r.b.nod.result, GYRO_TEST_PASSED);
    assert_true(fabs(far_deg - 0.1) < 0.002);
    if (!(fabs(alpha_deg() - begun_deg) < 1e-5)) fail_msg("%.3g deg", alpha_deg() - begun_deg);
    assert_int_equal(rig_last(&r)->flags, 0);
    vehicle_attitude(vehicle(), 200.0, 5.0, -4.0, r.s.now_ns);
    on_for(10.0);
    assert_string_equal(test_result(), "passed"); /* while the vehicle turns at 3 deg/s */
}

static void a_nod_finds_a_stuck_sensor_and_a_dead_torquer_at_once(void **state)
{
    for (unsigned dead = 0; dead < 2; dead++) {
        (void)up(state);
        navigate();
        assert_string_equal(test_result(), "passed");
        if (dead) platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.0, r.s.now_ns);
        else platform_stick(&r.p, true, r.s.now_ns);
        assert_string_equal(test_result(), "failed");
        assert_true(r.conditions & GYRO_ENCODER_FAULT);
        assert_int_equal(r.b.nod.nods, 3);
        if (dead) continue;
        platform_stick(&r.p, false, r.s.now_ns);
        assert_string_equal(test_result(), "passed");
        assert_true(r.conditions & GYRO_ENCODER_FAULT); /* it was there: until the next mode */
    }
}

static void a_nod_tells_a_torquer_that_gives_less_than_half(void **state)
{
    (void)state;
    navigate();
    platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.6, r.s.now_ns);
    assert_string_equal(test_result(), "passed");
    platform_set_torquer(&r.p, PLATFORM_AZIMUTH, 0.4, r.s.now_ns);
    assert_string_equal(test_result(), "failed");
}

/* A torquer limit below the nod's rate: a smaller nod. */
static void a_slow_torquer_nods_less(void **state)
{
    (void)state;
    r.b.profile.torquer_limit_dps = 0.1;
    navigate();
    assert_string_equal(test_result(), "passed");
    assert_int_equal(r.b.counters.saturated, 0);
    platform_stick(&r.p, true, r.s.now_ns);
    assert_string_equal(test_result(), "failed");
}

static void a_nod_is_of_navigation_and_ends_with_it(void **state)
{
    (void)state;
    assert_non_null(strstr(gyro_self_test(&r.b, r.s.now_ns), "navigation"));
    navigate();
    assert_null(gyro_self_test(&r.b, r.s.now_ns));
    on_for(0.2);
    rig_mode(&r, GYRO_HOLD);
    on_for(2.0);
    assert_int_equal(r.b.nod.way, GYRO_NOD_NONE);
    assert_int_equal(r.b.nod.result, GYRO_TEST_NONE);
    assert_int_equal(r.b.counters.refused, 1);
}

/* ---- what has been ---- */

static void conditions_are_counted_with_their_last_step(void **state)
{
    (void)state;
    navigate();
    on_for(10.0);
    const uint32_t before = r.b.number;
    for (unsigned i = 0; i < 2; i++) {
        r.lose = 1;
        on_for(5.0);
        assert_int_equal(r.conditions, 0); /* nothing is left to see */
    }
    const struct gyro_past *lost = &r.b.past[1];
    assert_int_equal(lost->begun, 2);
    assert_in_range(lost->step, before + 500, before + 502);
    assert_int_equal(r.b.past[0].begun + r.b.past[2].begun + r.b.past[3].begun, 0);
    r.mute = true;
    on_for(5.0);
    r.mute = false;
    on_for(0.02);
    rig_mode(&r, GYRO_NAVIGATE); /* the loss is still active: it is the first of the new mode */
    assert_int_equal(lost->begun, 1);
    on_for(5.0);
    rig_mode(&r, GYRO_NAVIGATE);
    assert_int_equal(lost->begun, 0);
    r.lose = 1;
    on_for(1.0);
    gyro_reset(&r.b, r.s.now_ns);
    assert_int_equal(lost->begun, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_dead_azimuth_torquer_is_found_before_it_costs_a_degree, up),
        cmocka_unit_test_setup(a_torquer_that_is_back_in_time_is_no_fault, up),
        cmocka_unit_test_setup(a_turn_of_the_vehicle_at_the_rate_of_a_dead_torquer_has_to_be_told, up),
        cmocka_unit_test_setup(a_track_that_turns_without_the_angle_sensor_is_a_fault, up),
        cmocka_unit_test_setup(a_track_told_ahead_or_late_is_none, up),
        cmocka_unit_test_setup(navigation_that_loses_its_level_says_so, up),
        cmocka_unit_test_setup(hours_on_a_parked_vehicle_that_sways_raise_no_flag, up),
        cmocka_unit_test_setup(a_flight_with_turns_raises_no_flag, up),
        cmocka_unit_test_setup(a_vehicle_that_is_towed_and_a_wrong_drift_are_no_faults, up),
        cmocka_unit_test_setup(a_nod_leaves_the_azimuth_where_it_was, up),
        cmocka_unit_test_setup(a_nod_finds_a_stuck_sensor_and_a_dead_torquer_at_once, up),
        cmocka_unit_test_setup(a_nod_tells_a_torquer_that_gives_less_than_half, up),
        cmocka_unit_test_setup(a_slow_torquer_nods_less, up),
        cmocka_unit_test_setup(a_nod_is_of_navigation_and_ends_with_it, up),
        cmocka_unit_test_setup(conditions_are_counted_with_their_last_step, up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
