/* Errors of the platform's parts, and their faults: torquers, drifts, angle sensor, level sensors, stops. */
#include "platform_rig.h"

#include <string.h>

static const struct site still = {.g_mps2 = 9.81}; /* an Earth that does not turn */

static struct platform up(const struct platform_cfg *c, uint64_t seed)
{
    struct platform p;
    const struct vehicle_cfg v = parked(0.0, 0.0, 0.0);
    platform_init(&p, c, &v, &still, seed);
    return p;
}

static void the_default_is_the_articles(void **state)
{
    (void)state;
    const struct platform_cfg c = platform_default();
    assert_false(c.present);
    near(c.drift_degph[PLATFORM_LEVEL], 25.0, 0.0);
    near(c.gm_sigma_degph, 0.2, 0.0);
    near(c.gm_tau_s, 1000.0, 0.0);
    near(c.level_tilt_arcmin[0], 10.0, 0.0);
    near(c.level_repeat_arcmin, 1.0, 0.0);
    near(c.angle_zero_arcmin, 6.0, 0.0);
    near(c.angle_set_arcmin, 3.0, 0.0);
    assert_int_equal(c.step_ns, STEP_NS);
}

/* Rates about x_p and z_p, on an Earth that stands still: what is asked, cut, scaled, less the drift. */
static void torquers_saturate_and_have_a_scale(void **state)
{
    (void)state;
    static const struct {
        double u_dps, gain, w_dps;
        bool over;
    } rows[] = {
        {1.0, 1.0, 1.01 - 0.5, false},  {-1.0, 1.0, -1.01 - 0.5, false}, {19.99, 1.0, 19.99 * 1.01 - 0.5, false},
        {25.0, 1.0, 20.2 - 0.5, true},  {-1e9, 1.0, -20.2 - 0.5, true},  {5.0, 0.0, -0.5, false},
        {5.0, 0.5, 2.525 - 0.5, false},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned axis = 0; axis < PLATFORM_AXES; axis++) {
            struct platform_cfg c = ideal();
            c.torquer_scale[axis] = 0.01;
            c.drift_degph[axis] = 1800.0;
            struct platform p = up(&c, 1);
            const double u_radps = rows[i].u_dps * RAD_PER_DEG;
            platform_set_torquer(&p, (enum platform_axis)axis, rows[i].gain, 0);
            const bool over =
                axis == PLATFORM_LEVEL ? platform_torque(&p, u_radps, 0.0, 0) : platform_torque(&p, 0.0, u_radps, 0);
            assert_int_equal(over, rows[i].over);
            near(look(&p, 0.5).w_ip_p_radps[axis == PLATFORM_LEVEL ? 0 : 2], rows[i].w_dps * RAD_PER_DEG, 1e-15);
            near(look(&p, 0.5).torque_radps[axis], fmin(fmax(u_radps, -20.0 * RAD_PER_DEG), 20.0 * RAD_PER_DEG), 1e-16);
        }
    }
}

/* Without anybody to hold it a platform drifts by its drifts; a step of them is a fault's. */
static void drifts_move_it(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.drift_degph[PLATFORM_LEVEL] = 25.0;
    c.drift_degph[PLATFORM_AZIMUTH] = -40.0;
    struct platform p = up(&c, 1);
    near(look(&p, 60.0).beta_rad, -25.0 * DEGPH * 60.0, 1e-12);
    near(look(&p, 60.0).alpha_rad, 40.0 * DEGPH * 60.0, 2e-7);
    platform_step_drift(&p, PLATFORM_LEVEL, 5.0, ns(60.0));
    near(look(&p, 120.0).beta_rad, -55.0 * DEGPH * 60.0, 1e-12);
    near(look(&p, 120.0).drift_radps[PLATFORM_LEVEL], 30.0 * DEGPH, 1e-18);
}

/* A force along an axis of the gyroscope: mass unbalance turns it about that axis, quadrature about the other. On a vehicle of
 * 30 degrees of roll the platform, level in beta, has f = g (-sin 30, 0, cos 30). */
static void drift_by_force_is_that_of_the_force_on_the_platform(void **state)
{
    (void)state;
    static const struct {
        double unbalance[2], quadrature[2], drift_degph[2];
    } rows[] = {
        {{2.0, 0.0}, {0.0, 0.0}, {2.0 * -0.5, 0.0}},
        {{0.0, 2.0}, {0.0, 0.0}, {0.0, 2.0 * 0.86602540378443865}},
        {{0.0, 0.0}, {2.0, 0.0}, {2.0 * 0.86602540378443865, 0.0}},
        {{0.0, 0.0}, {0.0, 2.0}, {0.0, 2.0 * -0.5}},
    };
    const struct site g = {.g_mps2 = 9.80665};
    const struct vehicle_cfg v = parked(0.0, 0.0, 30.0);
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct platform_cfg c = ideal();
        struct platform p;
        memcpy(c.unbalance_degph_per_g, rows[i].unbalance, sizeof c.unbalance_degph_per_g);
        memcpy(c.quadrature_degph_per_g, rows[i].quadrature, sizeof c.quadrature_degph_per_g);
        platform_init(&p, &c, &v, &g, 1);
        for (unsigned axis = 0; axis < PLATFORM_AXES; axis++) {
            near(look(&p, 0.0).drift_radps[axis], rows[i].drift_degph[axis] * DEGPH, 1e-12);
            near(look(&p, 10.0).drift_radps[axis], rows[i].drift_degph[axis] * DEGPH,
                 3e-10); /* it has turned a little */
        }
    }
}

/* It follows an acceleration within a step: 2 m/s^2 to the east along x_p. */
static void drift_by_force_follows_the_vehicle(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.unbalance_degph_per_g[PLATFORM_LEVEL] = 10.0;
    struct platform p = up(&c, 1);
    vehicle_fly(platform_vehicle(&p, ns(1.0)), 100.0, 90.0, ns(1.0));
    near(look(&p, 0.995).drift_radps[0], 0.0, 1e-12);
    near(look(&p, 40.0).drift_radps[0], 10.0 * 2.0 / 9.80665 * DEGPH, 1e-9);
    near(look(&p, 60.0).drift_radps[0], 0.0, 1e-9);
}

/* Asked to turn at 3 deg/s, a platform with motors of 5 Hz comes after its rotor by 3 / (2 pi 5) deg and its dead zone. */
static void motors_follow_the_gyroscope(void **state)
{
    (void)state;
    for (unsigned axis = 0; axis < PLATFORM_AXES; axis++) {
        struct platform_cfg c = ideal();
        c.servo = (struct follow_cfg){.hz = 5.0, .dead_arcsec = 20.0, .limit_dps = 10.0};
        struct platform p = up(&c, 1);
        const double u_radps = 3.0 * RAD_PER_DEG, behind_rad = u_radps / (2.0 * 3.141592653589793 * 5.0) + 20.0 * DEGPH;
        (void)(axis == PLATFORM_LEVEL ? platform_torque(&p, u_radps, 0.0, 0) : platform_torque(&p, 0.0, u_radps, 0));
        const struct platform_state s = look(&p, 5.0);
        near(axis == PLATFORM_LEVEL ? s.beta_rad : s.alpha_rad, 5.0 * u_radps - behind_rad, 1e-9);
        near(s.w_ip_p_radps[axis == PLATFORM_LEVEL ? 0 : 2], u_radps, 1e-9);
        (void)platform_torque(&p, 0.0, 0.0, ns(5.0));
        const struct platform_state after = look(&p, 10.0); /* to the edge of the dead zone */
        near(axis == PLATFORM_LEVEL ? after.beta_rad : after.alpha_rad, 5.0 * u_radps - 20.0 * DEGPH, 1e-9);
    }
}

/* A vehicle that turns drags the platform with it by as much, and no further; faster than the motor, it takes it along. */
static void a_turning_vehicle_drags_the_platform(void **state)
{
    (void)state;
    static const struct {
        double limit_dps, dragged_deg;
    } rows[] = {{10.0, 3.0 / (2.0 * 3.141592653589793 * 5.0)}, {2.0, 9.0}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct platform_cfg c = ideal();
        c.servo = (struct follow_cfg){.hz = 5.0, .limit_dps = rows[i].limit_dps};
        struct platform p = up(&c, 1);
        vehicle_attitude(platform_vehicle(&p, ns(1.0)), 90.0, 0.0, 0.0, ns(1.0));
        /* Heading grows clockwise, alpha the other way. With 2 deg/s of 3 it loses 1 deg/s, and what the gain needs. */
        const double lost_rad = -look(&p, 10.0).alpha_rad;
        near(lost_rad, rows[i].dragged_deg * RAD_PER_DEG, i ? 0.08 * RAD_PER_DEG : 1e-6);
        near(look(&p, 60.0).alpha_rad, 0.0, 1e-9); /* and comes back to the rotor */
    }
}

/* The random drift of an axis at an instant, deg/h. */
static double random_degph(struct platform *p, unsigned axis, double t_s)
{
    return look(p, t_s).drift_radps[axis] / DEGPH - p->cfg.drift_degph[axis];
}

static struct platform_cfg gauss_markov(bool from_zero)
{
    struct platform_cfg c = ideal();
    c.drift_degph[0] = 25.0;
    c.gm_sigma_degph = 0.2;
    c.gm_tau_s = 0.5;
    c.gm_from_zero = from_zero;
    return c;
}

enum { SEEDS = 4000 };

/* sigma^2 at every age, sigma^2 e^(-lag/tau) between two; the axes know nothing of one another. 4 sigma of each estimate. */
static void gauss_markov_drift_is_stationary(void **state)
{
    (void)state;
    const struct platform_cfg c = gauss_markov(false);
    double sum = 0, first = 0, later = 0, lagged = 0, crossed = 0;
    for (unsigned seed = 0; seed < SEEDS; seed++) {
        struct platform p = up(&c, seed);
        const double a = random_degph(&p, 0, 0.0);
        const double b = random_degph(&p, 0, 0.5);
        sum += a;
        first += a * a;
        later += b * b;
        lagged += a * b;
        crossed += b * random_degph(&p, 1, 0.5);
    }
    const double variance = 0.04;
    const double sd_of_mean = 1.0 / sqrt((double)SEEDS);
    near(sum / SEEDS, 0.0, 4.0 * 0.2 * sd_of_mean);
    near(first / SEEDS, variance, 4.0 * sqrt(2.0) * variance * sd_of_mean);
    near(later / SEEDS, variance, 4.0 * sqrt(2.0) * variance * sd_of_mean);
    near(lagged / SEEDS, variance * exp(-1.0), 4.0 * sqrt(1.0 + exp(-2.0)) * variance * sd_of_mean);
    near(crossed / SEEDS, 0.0, 4.0 * variance * sd_of_mean);
}

/* From zero the variance grows as 1 - e^(-2t/tau). */
static void gauss_markov_drift_from_zero_grows(void **state)
{
    (void)state;
    const struct platform_cfg c = gauss_markov(true);
    double first = 0, young = 0, old = 0;
    for (unsigned seed = 0; seed < SEEDS; seed++) {
        struct platform p = up(&c, seed);
        first += fabs(random_degph(&p, 1, 0.0));
        young += pow(random_degph(&p, 1, 0.1), 2);
        old += pow(random_degph(&p, 1, 1.5), 2);
    }
    const double tol = 4.0 * sqrt(2.0 / SEEDS);
    near(first, 0.0, 0.0);
    near(young / SEEDS / (0.04 * (1.0 - exp(-0.4))), 1.0, tol);
    near(old / SEEDS / 0.04, 1.0, tol + 0.003);
}

/* 10 ms or 1 ms: other draws, the same variance. */
static void gauss_markov_law_does_not_depend_on_the_step(void **state)
{
    (void)state;
    double got[2] = {0, 0};
    for (unsigned i = 0; i < 2; i++) {
        struct platform_cfg c = gauss_markov(true);
        c.step_ns = i ? STEP_NS / 10 : STEP_NS;
        for (unsigned seed = 0; seed < SEEDS; seed++) {
            struct platform p = up(&c, seed);
            got[i] += pow(random_degph(&p, 0, 0.1), 2);
        }
    }
    near(got[0] / got[1], 1.0, 4.0 * sqrt(2.0 * 2.0 / SEEDS));
}

static void the_angle_sensor_has_its_errors(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.alpha0_deg = 179.99;
    struct platform p = up(&c, 1);
    near(platform_servo_rad(&p, 0), 179.99 * RAD_PER_DEG, 1e-14);
    near(platform_encoder_rad(&p, 0), 179.99 * RAD_PER_DEG, 1e-14);
    c.angle_zero_arcmin = 6.0;
    p = up(&c, 1);
    near(platform_servo_rad(&p, 0), -179.91 * RAD_PER_DEG, 1e-14); /* over the half turn */
    near(platform_encoder_rad(&p, 0), -179.91 * RAD_PER_DEG, 1e-14);
    c.alpha0_deg = 10.0 + 0.4 / 3600.0;
    c.angle_step_arcsec = 1.0;
    p = up(&c, 1);
    near(platform_encoder_rad(&p, 0), 10.1 * RAD_PER_DEG, 1e-14);
    near(platform_servo_rad(&p, 0), (10.1 + 0.4 / 3600.0) * RAD_PER_DEG, 1e-14);
}

/* Each setting draws its own four numbers; the errors of one that was are still there for who asks late. */
static void a_setting_draws_its_errors(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.level_tilt_arcmin[0] = 10.0;
    c.level_tilt_arcmin[1] = -10.0;
    c.level_repeat_arcmin = 1.0;
    c.angle_set_arcmin = 3.0;
    c.angle_read_arcmin = 0.5;
    struct platform p = up(&c, 1);
    double sum[4] = {0};
    double square[4] = {0};
    enum { N = 4000 };
    static const double mean[4] = {10.0, -10.0, 0.0, 0.0};
    static const double sd[4] = {1.0, 1.0, 3.0, 0.5};
    for (unsigned i = 0; i < N; i++) {
        const int64_t t_ns = (int64_t)(i + 1) * STEP_NS;
        const double servo_rad = platform_servo_rad(&p, t_ns - 1);
        platform_reposition(&p, t_ns);
        platform_reposition(&p, t_ns); /* drawn again, at the same instant */
        near(platform_servo_rad(&p, t_ns - 1), servo_rad, 0.0);
        const struct pose *level = platform_level(&p, t_ns);
        const double got[4] = {atan2(level->C_nb[2][1], level->C_nb[1][1]) / RAD_PER_ARCMIN,
                               atan2(level->C_nb[0][2], level->C_nb[0][0]) / RAD_PER_ARCMIN,
                               platform_servo_rad(&p, t_ns) / RAD_PER_ARCMIN,
                               platform_encoder_rad(&p, t_ns) / RAD_PER_ARCMIN};
        for (unsigned k = 0; k < 4; k++) {
            sum[k] += got[k] - mean[k];
            square[k] += (got[k] - mean[k]) * (got[k] - mean[k]);
        }
    }
    for (unsigned k = 0; k < 4; k++) {
        near(sum[k] / N, 0.0, 4.0 * sd[k] / sqrt((double)N));
        near(sqrt(square[k] / N) / sd[k], 1.0, 4.0 / sqrt(2.0 * N));
    }
}

static void a_stuck_sensor_tells_what_it_told(void **state)
{
    (void)state;
    const struct platform_cfg c = ideal();
    struct platform p = up(&c, 1);
    platform_torque(&p, 0.0, 0.1, 0);
    platform_stick(&p, true, ns(1.0));
    near(platform_servo_rad(&p, ns(2.0)), 0.1, 1e-12);
    near(platform_encoder_rad(&p, ns(2.0)), 0.1, 1e-12);
    near(look(&p, 2.0).q_rad, 0.2, 1e-12);
    platform_stick(&p, false, ns(2.0));
    near(platform_servo_rad(&p, ns(2.5)), 0.25, 1e-12);
}

/* Whatever is asked of it, for as long as it takes: it stays at its stop, finite, and comes back. */
static void it_stops_at_its_stops(void **state)
{
    (void)state;
    const struct platform_cfg c = ideal();
    struct platform p = up(&c, 1);
    vehicle_attitude(platform_vehicle(&p, 0), 0.0, 30.0, 30.0, 0);
    for (int sign = -1; sign <= 1; sign += 2) {
        const double from_s = sign > 0 ? 100.0 : 0.0;
        platform_torque(&p, 20.0 * sign, 20.0, ns(from_s));
        for (double t_s = from_s + 10.0; t_s < from_s + 90.0; t_s += 0.777) {
            const struct platform_state s = look(&p, t_s);
            assert_true(isfinite(s.alpha_rad) && isfinite(s.gamma_rad) && isfinite(s.q_rad));
            assert_true(fabs(s.beta_rad) <= (PLATFORM_STOP_DEG + 1.0) * RAD_PER_DEG);
        }
        platform_torque(&p, 0.0, 0.0, ns(from_s + 95.0));
    }
    platform_torque(&p, -5.0 * RAD_PER_DEG, 0.0, ns(200.0));
    assert_true(fabs(look(&p, 203.0).beta_rad) < (PLATFORM_STOP_DEG - 5.0) * RAD_PER_DEG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_default_is_the_articles),
        cmocka_unit_test(torquers_saturate_and_have_a_scale),
        cmocka_unit_test(drifts_move_it),
        cmocka_unit_test(drift_by_force_is_that_of_the_force_on_the_platform),
        cmocka_unit_test(drift_by_force_follows_the_vehicle),
        cmocka_unit_test(motors_follow_the_gyroscope),
        cmocka_unit_test(a_turning_vehicle_drags_the_platform),
        cmocka_unit_test(gauss_markov_drift_is_stationary),
        cmocka_unit_test(gauss_markov_drift_from_zero_grows),
        cmocka_unit_test(gauss_markov_law_does_not_depend_on_the_step),
        cmocka_unit_test(the_angle_sensor_has_its_errors),
        cmocka_unit_test(a_setting_draws_its_errors),
        cmocka_unit_test(a_stuck_sensor_tells_what_it_told),
        cmocka_unit_test(it_stops_at_its_stops),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
