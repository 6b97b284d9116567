/* The induction sensor: the field's direction on level ground, its vertical part in a plane that is not level, deviation, noise. */
#include "phys/sensor/magnetic.h"
#include "platform_rig.h"

#include <string.h>

static const struct site still = {.g_mps2 = 9.81}; /* an Earth that does not turn: no Coriolis in the pendulum */

static struct magnetic up(const struct magnetic_cfg *c)
{
    struct magnetic m;
    magnetic_init(&m, c, 1);
    return m;
}

static struct vehicle parked_at(double heading_deg, double pitch_deg, double roll_deg)
{
    struct vehicle v;
    const struct vehicle_cfg c = parked(heading_deg, pitch_deg, roll_deg);
    vehicle_init(&v, &c, &still);
    return v;
}

/* tan 60 times the sine of a tilt of 10 degrees gets into a component. */
static void it_shows_the_field_in_its_plane(void **state)
{
    (void)state;
    const double part = tan(60.0 * RAD_PER_DEG) * sin(10.0 * RAD_PER_DEG);
    const struct {
        bool pendulous;
        double declination_deg, heading_deg, pitch_deg, roll_deg, tilt_arcmin[2], shown_rad;
    } rows[] = {
        {false, 0, 40, 0, 0, {0, 0}, 40 * RAD_PER_DEG},      {false, 5, 40, 0, 0, {0, 0}, 35 * RAD_PER_DEG},
        {false, -170, 40, 0, 0, {0, 0}, -150 * RAD_PER_DEG}, {false, 0, 0, 0, 10, {0, 0}, atan2(-part, 1.0)},
        {false, 0, 90, 10, 0, {0, 0}, atan2(1.0, -part)},    {true, 0, 0, 0, 10, {0, 0}, 0.0},
        {true, 0, 90, 10, 0, {0, 0}, 90 * RAD_PER_DEG},      {true, 0, 90, 0, 0, {600, 0}, atan2(1.0, -part)},
        {true, 0, 0, 0, 0, {0, 600}, atan2(-part, 1.0)},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct magnetic_cfg c = magnetic_default();
        c.pendulous = rows[i].pendulous;
        c.declination_deg = rows[i].declination_deg;
        c.dip_deg = 60.0;
        c.noise_ut = 0.0;
        memcpy(c.tilt_arcmin, rows[i].tilt_arcmin, sizeof c.tilt_arcmin);
        const struct magnetic m = up(&c);
        const struct vehicle v = parked_at(rows[i].heading_deg, rows[i].pitch_deg, rows[i].roll_deg);
        near(magnetic_heading_rad(&m, &v, ns(1.0)), rows[i].shown_rad, 1e-14);
    }
}

/* 2 m/s^2 along the nose to the east: the pendulum hangs back, its plane falls off ahead. */
static void a_pendulum_follows_the_apparent_vertical(void **state)
{
    (void)state;
    struct magnetic_cfg c = magnetic_default();
    c.noise_ut = 0.0;
    const struct magnetic m = up(&c);
    struct vehicle v = parked_at(90.0, 0.0, 0.0);
    vehicle_fly(&v, 100.0, 90.0, 0);
    const double part = tan(67.0 * RAD_PER_DEG) * sin(atan(2.0 / 9.81));
    near(magnetic_heading_rad(&m, &v, ns(10.0)), atan2(1.0, part), 1e-5); /* v^2/R lessens gravity by 6e-6 */
    near(magnetic_heading_rad(&m, &v, ns(100.0)), 90.0 * RAD_PER_DEG, 1e-12);
}

static void deviation_is_that_of_the_five_coefficients(void **state)
{
    (void)state;
    struct magnetic_cfg c = magnetic_default();
    const double deg[] = {1.0, 2.0, -3.0, 0.5, -0.25};
    c.noise_ut = 0.0;
    memcpy(c.deviation_deg, deg, sizeof deg);
    const struct magnetic m = up(&c);
    const struct {
        double heading_deg, shown_deg;
    } rows[] = {{0, 1 - 3 - 0.25},
                {90, 90 + 1 + 2 + 0.25},
                {180, -180 + 1 + 3 - 0.25},
                {-90, -90 + 1 - 2 + 0.25},
                {45, 45 + 1 + (2 - 3) * 0.70710678118654752 + 0.5}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct vehicle v = parked_at(rows[i].heading_deg, 0.0, 0.0);
        near(magnetic_heading_rad(&m, &v, 0), rows[i].shown_deg * RAD_PER_DEG, 1e-13);
    }
}

/* A meridian: declination and dip go with the latitude, and the heading shown with them. */
static void the_field_changes_with_latitude(void **state)
{
    (void)state;
    struct magnetic_cfg c = magnetic_default();
    c.declination_deg = 4.0;
    c.declination_slope = 0.5;
    c.noise_ut = 0.0;
    const struct magnetic m = up(&c);
    struct vehicle v = parked_at(0.0, 0.0, 0.0);
    vehicle_fly(&v, 100.0, 0.0, 0);
    struct vehicle_state at;
    vehicle_at(&v, ns(3600.0), &at);
    const double way_rad = at.latitude_rad;
    assert_true(way_rad > 0.05);
    near(magnetic_declination_rad(&m, &v, &at), 4.0 * RAD_PER_DEG + 0.5 * way_rad, 1e-15);
    near(magnetic_heading_rad(&m, &v, ns(3600.0)), -(4.0 * RAD_PER_DEG + 0.5 * way_rad), 1e-12);
}

static double sd_rad(const struct magnetic *m, const struct vehicle *v)
{
    double sum = 0.0;
    for (unsigned i = 0; i < 4000; i++) {
        const double x = magnetic_heading_rad(m, v, ns(0.01 * i));
        sum += x * x;
    }
    return sqrt(sum / 4000);
}

/* Noise of a component over the horizontal field; the same at the same instant, another with another seed. */
static void noise_turns_it_by_its_share_of_the_horizontal_field(void **state)
{
    (void)state;
    struct magnetic_cfg c = magnetic_default();
    c.noise_ut = 0.1;
    c.horizontal_ut = 20.0;
    struct magnetic m = up(&c);
    const struct vehicle v = parked_at(0.0, 0.0, 0.0);
    near(sd_rad(&m, &v), 0.005, 3e-4);
    const double shown = magnetic_heading_rad(&m, &v, ns(1.0));
    assert_true(shown == magnetic_heading_rad(&m, &v, ns(1.0)));
    magnetic_reseed(&m, 2);
    assert_true(shown != magnetic_heading_rad(&m, &v, ns(1.0)));
    near(sd_rad(&m, &v), 0.005, 3e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_shows_the_field_in_its_plane),
        cmocka_unit_test(a_pendulum_follows_the_apparent_vertical),
        cmocka_unit_test(deviation_is_that_of_the_five_coefficients),
        cmocka_unit_test(the_field_changes_with_latitude),
        cmocka_unit_test(noise_turns_it_by_its_share_of_the_horizontal_field),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
