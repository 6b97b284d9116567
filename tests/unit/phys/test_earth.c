/* Gravity and rate of the Earth; tests/py/lab/test_physics.py holds them against a closed form of its own. */
#include "rig.h"
#include "site.h"

#include "base/detmath.h"
#include "phys/motion/earth.h"
#include "phys/motion/pose.h"

#include <math.h>

#define RAD_PER_DEG 0.017453292519943295

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

/* TR8350.2: the equator and the pole; Somigliana's formula with its constants in between. */
static void gravity_on_the_ellipsoid_is_the_published_one(void **state)
{
    (void)state;
    const struct {
        double latitude_deg, g_mps2;
    } rows[] = {{0, 9.7803253359}, {30, 9.7932472692}, {45, 9.8061977694}, {60, 9.8191769531}, {90, 9.8321849378}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        near(earth_gravity_mps2(rows[i].latitude_deg * RAD_PER_DEG, 0.0), rows[i].g_mps2, 1e-9);
        near(earth_gravity_mps2(-rows[i].latitude_deg * RAD_PER_DEG, 0.0), rows[i].g_mps2, 1e-9);
    }
}

static void gravity_falls_by_a_third_of_a_millionth_a_metre(void **state)
{
    (void)state;
    const double per_m = (earth_gravity_mps2(0.8, 1.0) - earth_gravity_mps2(0.8, 0.0));
    near(per_m, -3.086e-6, 0.003e-6);
}

static void a_site_that_is_not_placed_has_its_own_gravity_and_no_rate(void **state)
{
    (void)state;
    double w[3];
    earth_rate_n(&(struct site){.g_mps2 = 9.8, .latitude_rad = 1.0}, w);
    for (unsigned k = 0; k < 3; k++) near(w[k], 0.0, 0.0);
    const struct site placed = site_at(55.7 * RAD_PER_DEG, 150.0, 0.0);
    earth_rate_n(&placed, w);
    near(sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), EARTH_RATE_RADPS, 1e-18);
}

static void the_earths_rate_points_to_the_celestial_pole(void **state)
{
    (void)state;
    double w[3];
    const struct site s = site_at(30.0 * RAD_PER_DEG, 0.0, 0.0);
    earth_rate_n(&s, w);
    near(w[0] / RAD_PER_DEG * 3600.0, 15.041067 * sqrt(0.75), 1e-6);
    near(w[1], 0.0, 0.0);
    near(w[2] / RAD_PER_DEG * 3600.0, -15.041067 / 2, 1e-6);
}

static void turns_compose_and_come_back(void **state)
{
    (void)state;
    struct pose p;
    pose_start(&p, &(struct site){.azimuth_rad = 90.0 * RAD_PER_DEG});
    near(p.C_nb[1][0], 1.0, 1e-15); /* x to the east */
    near(p.C_nb[0][1], -1.0, 1e-15);
    pose_turn(&p, POSE_Y, 1000.0, 2.0, 3.0);
    pose_turn(&p, POSE_Y, -1000.0, -2.0, -3.0);
    near(p.C_nb[1][0], 1.0, 1e-12);
    for (unsigned k = 0; k < 3; k++) near(p.w_ib_b_radps[k], 0.0, 0.0);
    for (unsigned k = 0; k < 3; k++) near(p.dw_ib_b_radps2[k], 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gravity_on_the_ellipsoid_is_the_published_one),
        cmocka_unit_test(gravity_falls_by_a_third_of_a_millionth_a_metre),
        cmocka_unit_test(a_site_that_is_not_placed_has_its_own_gravity_and_no_rate),
        cmocka_unit_test(the_earths_rate_points_to_the_celestial_pole),
        cmocka_unit_test(turns_compose_and_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
