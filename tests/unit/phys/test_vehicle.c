/* The vehicle under the platform: attitude, rates and accelerations against differences and against Newton in inertial space. */
#include "rig.h"
#include "site.h"

#include "base/rng.h"
#include "base/sched.h"
#include "phys/motion/vehicle.h"

#include <math.h>

#define RAD_PER_DEG 0.017453292519943295
#define DEGPH       (RAD_PER_DEG / 3600.0)
#define PI          3.141592653589793

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static int64_t ns(double t_s)
{
    return (int64_t)nearbyint(t_s * 1e9);
}

static struct vehicle at_latitude(double latitude_deg, const struct vehicle_cfg *cfg)
{
    struct vehicle v;
    const struct site site = site_at(latitude_deg * RAD_PER_DEG, 0.0, 1.0);
    vehicle_init(&v, cfg, &site);
    return v;
}

static struct vehicle_state state(const struct vehicle *v, double t_s)
{
    struct vehicle_state s;
    vehicle_at(v, ns(t_s), &s);
    return s;
}

/* Nose by heading and pitch; right side down for a positive roll; and z_c as sources instruments 1.3 has it. */
static void axes_point_where_the_angles_say(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = 40.0;
    c.pitch_deg = 5.0;
    c.roll_deg = -4.0;
    const struct vehicle v = at_latitude(50.0, &c);
    const struct vehicle_state s = state(&v, 0.0);
    const double psi = 40.0 * RAD_PER_DEG, th = 5.0 * RAD_PER_DEG, ro = -4.0 * RAD_PER_DEG;
    near(atan2(s.C_lc[0][1], s.C_lc[1][1]), psi, 1e-15);
    near(s.C_lc[2][1], sin(th), 1e-15);
    near(s.C_lc[2][0], -sin(ro) * cos(th), 1e-15);
    near(s.C_lc[0][2], -sin(psi) * sin(th) * cos(ro) + cos(psi) * sin(ro), 1e-15);
    near(s.C_lc[1][2], -cos(psi) * sin(th) * cos(ro) - sin(psi) * sin(ro), 1e-15);
    near(s.C_lc[2][2], cos(th) * cos(ro), 1e-15);
    near(s.w_il_l_radps[0], 0.0, 0.0);
    near(s.w_il_l_radps[1], EARTH_RATE_RADPS * cos(50.0 * RAD_PER_DEG), 1e-19);
    near(s.w_il_l_radps[2], EARTH_RATE_RADPS * sin(50.0 * RAD_PER_DEG), 1e-19);
    for (unsigned k = 0; k < 3; k++) {
        near(s.w_lc_l_radps[k], 0.0, 0.0);
        near(s.accel_l_mps2[k], 0.0, 0.0);
    }
    assert_true(vehicle_steady(&v, 0));
}

/* All that can move, moving: three turns, two sways. C' C^T is the cross product with the rate. */
static void rates_are_those_of_the_attitude(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.sway = (struct vehicle_sway){.pitch_arcmin = 300.0, .pitch_s = 3.1, .roll_arcmin = 200.0, .roll_s = 1.7};
    struct vehicle v = at_latitude(50.0, &c);
    vehicle_attitude(&v, -170.0, 20.0, -15.0, ns(0.3));
    for (double t_s = 0.5; t_s < 20.0; t_s += 0.37) {
        const double h_s = 1e-5;
        const struct vehicle_state s = state(&v, t_s);
        const struct vehicle_state before = state(&v, t_s - h_s);
        const struct vehicle_state after = state(&v, t_s + h_s);
        double skew[3][3];
        for (unsigned i = 0; i < 3; i++) {
            for (unsigned j = 0; j < 3; j++) {
                skew[i][j] = 0.0;
                for (unsigned k = 0; k < 3; k++) {
                    skew[i][j] += (after.C_lc[i][k] - before.C_lc[i][k]) / (2.0 * h_s) * s.C_lc[j][k];
                }
            }
        }
        near(s.w_lc_l_radps[0], skew[2][1], 1e-9);
        near(s.w_lc_l_radps[1], skew[0][2], 1e-9);
        near(s.w_lc_l_radps[2], skew[1][0], 1e-9);
    }
    near(state(&v, 100.0).heading_rad, -170.0 * RAD_PER_DEG, 1e-15);
    near(state(&v, 100.0).pitch_rad - 300.0 / 60.0 * RAD_PER_DEG * sin(2.0 * PI * 100.0 / 3.1), 20.0 * RAD_PER_DEG,
         1e-12);
}

/* Longitude gained over the second from t_s, by Simpson's rule. */
static double longitude_of_a_second(const struct vehicle *v, double t_s)
{
    double rate_radps[3];
    for (unsigned j = 0; j < 3; j++) {
        const struct vehicle_state s = state(v, t_s + 0.5 * j);
        rate_radps[j] = s.speed_mps * sin(s.heading_rad) / (EARTH_RADIUS_M * cos(s.latitude_rad));
    }
    return (rate_radps[0] + 4.0 * rate_radps[1] + rate_radps[2]) / 6.0;
}

static void position_i(double latitude_rad, double angle_rad, double r_m[3])
{
    r_m[0] = EARTH_RADIUS_M * cos(latitude_rad) * cos(angle_rad);
    r_m[1] = EARTH_RADIUS_M * cos(latitude_rad) * sin(angle_rad);
    r_m[2] = EARTH_RADIUS_M * sin(latitude_rad);
}

/* Position in inertial space, twice differentiated, less that of a point at rest on the Earth, whose -w^2 r is in the plumb
 * line: Newton knows nothing of Coriolis. At t_s the meridian lies in the plane of x and z. */
static void newton_l(const struct vehicle *v, double t_s, double a_l_mps2[3])
{
    double r_m[3][3];
    double a[3];
    position_i(state(v, t_s - 1.0).latitude_rad, -EARTH_RATE_RADPS - longitude_of_a_second(v, t_s - 1.0), r_m[0]);
    position_i(state(v, t_s).latitude_rad, 0.0, r_m[1]);
    position_i(state(v, t_s + 1.0).latitude_rad, EARTH_RATE_RADPS + longitude_of_a_second(v, t_s), r_m[2]);
    for (unsigned k = 0; k < 3; k++) a[k] = r_m[2][k] - 2.0 * r_m[1][k] + r_m[0][k];
    a[0] += EARTH_RATE_RADPS * EARTH_RATE_RADPS * r_m[1][0];
    const double sin_lat = sin(state(v, t_s).latitude_rad);
    const double cos_lat = cos(state(v, t_s).latitude_rad);
    a_l_mps2[0] = a[1];
    a_l_mps2[1] = a[2] * cos_lat - a[0] * sin_lat;
    a_l_mps2[2] = a[2] * sin_lat + a[0] * cos_lat;
}

/* Speed until 2500 s and heading until 3000 s under way. */
static void a_flight_feels_what_newton_says(void **state_)
{
    (void)state_;
    struct vehicle v = at_latitude(50.0, &(struct vehicle_cfg){.turn_dps = 0.02, .tilt_dps = 2.0, .accel_mps2 = 0.1});
    vehicle_fly(&v, 250.0, 60.0, 0);
    for (double t_s = 300.0; t_s < 4000.0; t_s += 317.0) {
        double want[3];
        newton_l(&v, t_s, want);
        const struct vehicle_state s = state(&v, t_s);
        for (unsigned k = 0; k < 3; k++) near(s.accel_l_mps2[k], want[k], 1e-7);
    }
}

/* Also what it does to the felt vertical, arcmin. */
static void transport_rate_is_that_of_the_sources(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = 90.0;
    struct vehicle v = at_latitude(50.0, &c);
    vehicle_fly(&v, 500.0 / 3.6, 90.0, 0);
    const struct vehicle_state s = state(&v, 3600.0);
    near(s.latitude_rad / RAD_PER_DEG, 50.0, 1e-9); /* along the parallel */
    near(s.w_il_l_radps[2] / DEGPH - 15.041067 * sin(s.latitude_rad), 5.36, 0.005);
    assert_false(vehicle_steady(&v, ns(3600.0)));
    near(hypot(s.accel_l_mps2[0], s.accel_l_mps2[1]) / v.site.g_mps2 / RAD_PER_DEG * 60.0, 6.7, 0.05);
    v = at_latitude(50.0, &c);
    vehicle_fly(&v, 500.0 / 3.6, 0.0, 0);
    const struct vehicle_state north = state(&v, 100.0);
    near(hypot(north.accel_l_mps2[0], north.accel_l_mps2[1]) / v.site.g_mps2 / RAD_PER_DEG * 60.0, 5.4, 0.05);
}

/* The closed form against a fine sum through ramps and turns, a turn back and a stop. */
static void latitude_is_the_integral_of_the_northern_speed(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = 20.0;
    struct vehicle v = at_latitude(50.0, &c);
    static const struct {
        double t_s, speed_mps, track_deg;
    } legs[] = {{10.0, 200.0, -30.0}, {40.0, 120.0, 100.0}, {60.0, 0.0, 100.0}, {400.0, 50.0, 180.0}};
    double sum_rad = 50.0 * RAD_PER_DEG;
    unsigned leg = 0;
    const double h_s = 0.005;
    for (long i = 0; i < 120000; i++) {
        const double t_s = (double)i * h_s;
        if (leg < COUNT(legs) && t_s >= legs[leg].t_s) {
            vehicle_fly(&v, legs[leg].speed_mps, legs[leg].track_deg, ns(t_s));
            leg++;
        }
        if (i % 1000 == 0) near(state(&v, t_s).latitude_rad, sum_rad, 1e-11);
        const struct vehicle_state s = state(&v, t_s + 0.5 * h_s);
        sum_rad += h_s * s.speed_mps * cos(s.heading_rad) / EARTH_RADIUS_M;
    }
    near(state(&v, 370.0).speed_mps, 0.0, 0.0);
    assert_false(vehicle_steady(&v, ns(430.0)));
}

/* Whatever commands come in whatever state: a nanosecond moves nothing by more than its rate allows. */
static void commands_never_jump(void **state_)
{
    (void)state_;
    struct rng r = rng_stream(rig_seed(5), 0, "vehicle");
    struct vehicle_cfg c = vehicle_default();
    c.sway = (struct vehicle_sway){.pitch_arcmin = 60.0, .pitch_s = 2.0, .roll_arcmin = 60.0, .roll_s = 3.0};
    struct vehicle v = at_latitude(-30.0, &c);
    double t_s = 0.0;
    for (unsigned i = 0; i < 2000; i++) {
        t_s += 20.0 * rng_uniform(&r);
        const struct vehicle_state before = state(&v, t_s);
        const double a = 360.0 * rng_uniform(&r) - 180.0;
        const double b = 30.0 * rng_uniform(&r);
        if (i % 3 == 0) vehicle_attitude(&v, a, b, -b, ns(t_s));
        if (i % 3 == 1) vehicle_sway(&v, &(struct vehicle_sway){b, 1.0 + b, 2.0 * b, 3.0 + b, b, b, b, b}, ns(t_s));
        if (i % 3 == 2) vehicle_fly(&v, 10.0 * b, a, ns(t_s));
        const struct vehicle_state after = state(&v, t_s);
        near(after.latitude_rad, before.latitude_rad, 1e-14);
        near(after.speed_mps, before.speed_mps, 1e-12);
        for (unsigned k = 0; k < 3; k++)
            for (unsigned j = 0; j < 3; j++) near(after.C_lc[k][j], before.C_lc[k][j], 1e-12);
    }
}

static void an_instant_before_a_command_gets_what_held_then(void **state_)
{
    (void)state_;
    const struct vehicle_cfg c = vehicle_default();
    struct vehicle v = at_latitude(50.0, &c);
    vehicle_attitude(&v, 90.0, 10.0, 5.0, ns(1.0));
    const struct vehicle_state turning = state(&v, 1.9);
    vehicle_fly(&v, 100.0, 0.0, ns(2.0));
    vehicle_sway(&v, &(struct vehicle_sway){.pitch_arcmin = 60.0, .pitch_s = 2.0}, ns(2.0));
    near(state(&v, 1.9).heading_rad, turning.heading_rad, 0.0);
    near(state(&v, 1.9).pitch_rad, turning.pitch_rad, 0.0);
    near(state(&v, 0.5).heading_rad, 0.0, 0.0);
    near(turning.heading_rad, 0.9 * 3.0 * RAD_PER_DEG, 1e-15);
}

static struct vehicle_sway push(double east_mg, double east_s, double north_mg, double north_s)
{
    return (struct vehicle_sway){.east_mg = east_mg, .east_s = east_s, .north_mg = north_mg, .north_s = north_s};
}

/* Whatever the heading: along the level axes, from the command on, the same in hours, on top of what a flight feels; and it
 * turns nothing. A new sway ends it. */
static void a_push_is_a_sine_along_each_level_axis(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = 77.0;
    c.pitch_deg = 5.0;
    struct vehicle v = at_latitude(50.0, &c);
    const struct vehicle still = v;
    const struct vehicle_sway sway = push(0.3, 20.0, 0.5, 7.0);
    vehicle_sway(&v, &sway, ns(2.0));
    assert_false(vehicle_steady(&v, ns(3.0)));
    static const double at_s[] = {1.0, 2.0, 7.0, 12.0, 13.3, 29.75, 36007.0};
    for (unsigned i = 0; i < COUNT(at_s); i++) {
        const double since_s = fmax(at_s[i] - 2.0, 0.0);
        const struct vehicle_state s = state(&v, at_s[i]);
        near(s.accel_l_mps2[0], 0.3 * 9.80665e-3 * sin(2.0 * PI * since_s / 20.0),
             1e-13); /* 10^4 rad are known to 4e-12 */
        near(s.accel_l_mps2[1], 0.5 * 9.80665e-3 * sin(2.0 * PI * since_s / 7.0), 1e-13);
        near(s.accel_l_mps2[2], 0.0, 0.0);
        assert_memory_equal(s.C_lc, state(&still, at_s[i]).C_lc, sizeof s.C_lc);
        for (unsigned k = 0; k < 3; k++) near(s.w_lc_l_radps[k], 0.0, 0.0);
    }
    vehicle_sway(&v, &(struct vehicle_sway){.pitch_s = 3.0}, ns(40000.0));
    near(state(&v, 40007.0).accel_l_mps2[0], 0.0, 0.0);
    assert_true(vehicle_steady(&v, ns(40000.0)));
}

/* With or without a period, with or without an amplitude; at power-on as by command; in flight on top. */
static void a_push_needs_both_its_numbers(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.sway = push(0.3, 0.0, 0.0, 7.0);
    struct vehicle v = at_latitude(50.0, &c);
    assert_true(vehicle_steady(&v, 0));
    near(state(&v, 3.0).accel_l_mps2[0], 0.0, 0.0);
    c.sway = push(0.4, 8.0, 0.0, 0.0);
    v = at_latitude(50.0, &c);
    assert_false(vehicle_steady(&v, 0));
    c.sway = push(0.0, 0.0, 0.4, 8.0);
    v = at_latitude(50.0, &c);
    assert_false(vehicle_steady(&v, 0));
    near(state(&v, 2.0).accel_l_mps2[1], 0.4 * 9.80665e-3, 1e-16);
    struct vehicle calm = at_latitude(50.0, &(struct vehicle_cfg){.turn_dps = 3.0, .tilt_dps = 2.0, .accel_mps2 = 2.0});
    vehicle_fly(&v, 250.0, 60.0, 0);
    vehicle_fly(&calm, 250.0, 60.0, 0);
    near(state(&v, 50.0).accel_l_mps2[1] - state(&calm, 50.0).accel_l_mps2[1], 0.4 * 9.80665e-3, 1e-14);
    near(state(&v, 50.0).accel_l_mps2[0], state(&calm, 50.0).accel_l_mps2[0], 0.0);
}

static void headings_go_the_shorter_way_and_poles_are_not_crossed(void **state_)
{
    (void)state_;
    struct vehicle_cfg c = vehicle_default();
    c.heading_deg = 170.0;
    struct vehicle v = at_latitude(84.0, &c);
    vehicle_attitude(&v, -170.0, 0.0, 0.0, 0);
    near(state(&v, 2.0).heading_rad, 176.0 * RAD_PER_DEG, 1e-14);
    near(state(&v, 4.0).heading_rad, -178.0 * RAD_PER_DEG, 1e-14);
    vehicle_fly(&v, 250.0, 0.0, ns(10.0));
    near(state(&v, 7200.0).latitude_rad / RAD_PER_DEG, VEHICLE_LATITUDE_MAX_DEG, 1e-12);
    vehicle_fly(&v, 250.0, 180.0, ns(7200.0));
    assert_true(state(&v, 7500.0).latitude_rad / RAD_PER_DEG < VEHICLE_LATITUDE_MAX_DEG);
}

static void on_an_earth_that_stands_still_a_parked_vehicle_has_no_rate(void **state_)
{
    (void)state_;
    struct vehicle v;
    const struct vehicle_cfg c = vehicle_default();
    vehicle_init(&v, &c, &(struct site){.g_mps2 = 9.81});
    const struct vehicle_state s = state(&v, 5.0);
    for (unsigned k = 0; k < 3; k++) near(s.w_il_l_radps[k], 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(axes_point_where_the_angles_say),
        cmocka_unit_test(rates_are_those_of_the_attitude),
        cmocka_unit_test(a_flight_feels_what_newton_says),
        cmocka_unit_test(transport_rate_is_that_of_the_sources),
        cmocka_unit_test(latitude_is_the_integral_of_the_northern_speed),
        cmocka_unit_test(commands_never_jump),
        cmocka_unit_test(an_instant_before_a_command_gets_what_held_then),
        cmocka_unit_test(a_push_is_a_sine_along_each_level_axis),
        cmocka_unit_test(a_push_needs_both_its_numbers),
        cmocka_unit_test(headings_go_the_shorter_way_and_poles_are_not_crossed),
        cmocka_unit_test(on_an_earth_that_stands_still_a_parked_vehicle_has_no_rate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
