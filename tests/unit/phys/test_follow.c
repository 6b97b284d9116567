/* The follow-up of a gimbal: each piece of the motor's law by its own solution, and all of them against small steps. */
#include "platform_rig.h"

#include "base/rng.h"
#include "phys/motion/follow.h"

#define DEG        RAD_PER_DEG
#define ARCSEC_RAD (RAD_PER_DEG / 3600.0)
#define GAIN       (2.0 * 3.141592653589793 * 5.0)

static const struct follow_cfg motor = {.hz = 5.0, .dead_arcsec = 20.0, .limit_dps = 10.0};

static void each_piece_has_its_own_solution(void **state)
{
    (void)state;
    const double dead = 20.0 * ARCSEC_RAD;
    const struct {
        double e, rotor, carrier, h_s, want;
    } rows[] = {
        {0.0, 0.0, 0.0, 1.0, 0.0},
        {0.5 * dead, 0.0, 0.0, 1.0, 0.5 * dead},                /* in the dead zone it stays */
        {0.0, dead, 0.0, 0.5, 0.5 * dead},                      /* or goes with the rotor */
        {0.0, dead, 2.0 * dead, 0.5, -0.5 * dead},              /* less the carrier */
        {0.0, 3.0 * DEG, 0.0, 10.0, dead + 3.0 * DEG / GAIN},   /* lags by rate over gain, and the dead zone */
        {0.0, -3.0 * DEG, 0.0, 10.0, -dead - 3.0 * DEG / GAIN}, /* either way */
        {dead + 0.1 * DEG, 0.0, 0.0, 0.1, dead + 0.1 * DEG * exp(-GAIN * 0.1)}, /* comes back */
        {dead + 2.0 * DEG, 0.0, 0.0, 0.1, dead + 1.0 * DEG},                    /* no faster than its limit */
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        near(follow_after(&motor, rows[i].e, rows[i].rotor, rows[i].carrier, rows[i].h_s), rows[i].want, 1e-12);
    }
    /* A carrier beyond the limit leaves it behind, by the difference a second. */
    const double one = follow_after(&motor, 0.0, 0.0, 12.0 * DEG, 10.0),
                 two = follow_after(&motor, 0.0, 0.0, 12.0 * DEG, 11.0);
    near(two - one, -2.0 * DEG, 1e-12);
}

static double by_small_steps(double e, double rate, double h_s)
{
    const double dead = motor.dead_arcsec * ARCSEC_RAD, limit = motor.limit_dps * DEG;
    const unsigned n = 40000;
    for (unsigned i = 0; i < n; i++) {
        const double x = fmax(fabs(e) - dead, 0.0), m = fmin(GAIN * x, limit);
        e += (rate - (e > 0.0 ? m : -m)) * h_s / n;
    }
    return e;
}

static void it_is_the_integral_of_the_motor_s_law(void **state)
{
    (void)state;
    struct rng r = rng_stream(3, 0, "follow");
    for (unsigned i = 0; i < 200; i++) {
        const double e = 0.4 * DEG * rng_gauss(&r), rate = (i % 3 ? 8.0 : 0.05) * DEG * rng_gauss(&r), h_s = 0.2;
        near(follow_after(&motor, e, rate, 0.0, h_s), by_small_steps(e, rate, h_s), 3e-6);
    }
}

/* In two steps or in one. */
static void its_result_does_not_depend_on_the_step(void **state)
{
    (void)state;
    struct rng r = rng_stream(4, 0, "follow");
    for (unsigned i = 0; i < 500; i++) {
        const double e = 0.4 * DEG * rng_gauss(&r), rate = (i % 3 ? 8.0 : 0.05) * DEG * rng_gauss(&r);
        const double half = follow_after(&motor, e, rate, 0.0, 0.03);
        near(follow_after(&motor, half, rate, 0.0, 0.07), follow_after(&motor, e, rate, 0.0, 0.1), 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_piece_has_its_own_solution),
        cmocka_unit_test(it_is_the_integral_of_the_motor_s_law),
        cmocka_unit_test(its_result_does_not_depend_on_the_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
