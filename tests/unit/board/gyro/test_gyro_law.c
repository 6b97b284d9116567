/* The controller's arithmetic, by itself. */
#include "rig.h"

#include "base/rng.h"
#include "board/gyro/law.h"

#include <math.h>

#define DEG (3.14159265358979323846 / 180.0)

static double uniform(struct rng *r, double low, double high)
{
    return low + (high - low) * (double)(rng_u64(r) >> 11) * 0x1p-53;
}

static void level_angles_come_back_from_what_the_sensors_show(void **state)
{
    struct rng r = rng_stream(rig_seed(1), 0, "gyro law");
    (void)state;
    for (unsigned i = 0; i < 1000; i++) {
        const double beta = uniform(&r, -1.4, 1.4), gamma = uniform(&r, -1.4, 1.4);
        const struct gyro_level l = gyro_level_of(sin(beta), -sin(gamma) * cos(beta));
        assert_true(fabs(l.beta_rad - beta) < 1e-12 && fabs(l.gamma_rad - gamma) < 1e-11);
        assert_true(fabs(l.cos_b - cos(beta)) < 1e-12 && fabs(l.cos_g - cos(gamma)) < 1e-12);
    }
    const struct gyro_level upright = gyro_level_of(2.0, 1.0); /* more than g: a fault, but no crash */
    assert_true(upright.beta_rad > 1.57 && upright.sin_g == 0.0);
}

/* Earth rate along z of the platform, by turning a vector with the three matrices of the article's fig. 2. */
static double along_z(const struct gyro_place *w, double a, double b, double g)
{
    const double e = cos(a) * w->east_radps + sin(a) * w->north_radps;
    const double n = -sin(a) * w->east_radps + cos(a) * w->north_radps, u = w->up_radps;
    const double n1 = cos(b) * n + sin(b) * u, u1 = -sin(b) * n + cos(b) * u;
    (void)n1;
    return sin(g) * e + cos(g) * u1;
}

static void what_keeps_the_azimuth_is_the_rate_of_the_level_frame_along_z(void **state)
{
    struct rng r = rng_stream(rig_seed(2), 0, "gyro law");
    (void)state;
    for (unsigned i = 0; i < 500; i++) {
        const double a = uniform(&r, -3.0, 3.0), b = uniform(&r, -0.2, 0.2), g = uniform(&r, -0.2, 0.2);
        const struct gyro_place w =
            gyro_place_of(uniform(&r, -80.0, 80.0), uniform(&r, 0.0, 300.0), uniform(&r, -180.0, 180.0));
        const struct gyro_level l = gyro_level_of(sin(b), -sin(g) * cos(b));
        assert_true(fabs(gyro_law_keep(&l, &w, sin(a), cos(a)) - along_z(&w, a, b, g)) < 1e-16);
    }
}

static void rates_of_the_level_frame_are_those_of_earth_and_flight(void **state)
{
    const double degph = DEG / 3600.0;
    (void)state;
    const struct gyro_place parked = gyro_place_of(50.0, 0.0, 0.0);
    assert_true(fabs(parked.north_radps / degph - 15.041067 * cos(50.0 * DEG)) < 1e-5);
    assert_true(fabs(parked.up_radps / degph - 15.041067 * sin(50.0 * DEG)) < 1e-5);
    assert_true(parked.east_radps == 0.0);
    const struct gyro_place east = gyro_place_of(50.0, 500.0 / 3.6, 90.0); /* sources: 5.36 deg/h */
    assert_true(fabs((east.up_radps - parked.up_radps) / degph - 5.36) < 0.01);
    const struct gyro_place north = gyro_place_of(50.0, 100.0, 0.0);
    assert_true(fabs(north.east_radps + 100.0 / 6371008.8) < 1e-12);
}

static void a_turn_is_continuous_keeps_its_limits_and_ends_where_it_should(void **state)
{
    static const struct {
        double from_deg, to_deg, by_deg;
    } rows[] = {{0, 90, 90},    {90, 0, -90},  {270, 0, 90}, {0, 270, -90}, {0, 180, 180},
                {90, 270, 180}, {10, -350, 0}, {0, 1, 1},    {350, 10, 20}, {180, 0, 180}};
    (void)state;
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct gyro_turn turn =
            gyro_turn_of(rows[i].from_deg * DEG, rows[i].to_deg * DEG, 9.0 * DEG, 20.0 * DEG, 1000);
        double last, rate, was = rows[i].from_deg * DEG;
        assert_true(fabs(turn.by_rad - rows[i].by_deg * DEG) < 1e-12);
        for (int64_t t_ns = 0; t_ns < 25000000000; t_ns += 5000000) {
            const double at = gyro_turn_at(&turn, t_ns, &rate);
            assert_true(fabs(rate) <= 9.0 * DEG + 1e-12);
            assert_true(fabs(at - was) <= 9.0 * DEG * 0.005 + 1e-12);
            was = at;
        }
        last = gyro_turn_at(&turn, 1000 + (int64_t)(turn.total_s * 1e9) + 1, &rate);
        assert_true(last == turn.from_rad + turn.by_rad && rate == 0.0);
    }
}

static void angles_wrap_into_half_turns(void **state)
{
    static const double rows[][2] = {{0, 0}, {180, 180}, {-180, 180}, {181, -179}, {540, 180}, {-541, 179}};
    (void)state;
    for (unsigned i = 0; i < COUNT(rows); i++)
        assert_true(fabs(gyro_wrap_rad(rows[i][0] * DEG) - rows[i][1] * DEG) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(level_angles_come_back_from_what_the_sensors_show),
        cmocka_unit_test(what_keeps_the_azimuth_is_the_rate_of_the_level_frame_along_z),
        cmocka_unit_test(rates_of_the_level_frame_are_those_of_earth_and_flight),
        cmocka_unit_test(a_turn_is_continuous_keeps_its_limits_and_ends_where_it_should),
        cmocka_unit_test(angles_wrap_into_half_turns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
