/* The platform's kinematics, grid and mount. Errors and faults: test_platform_errors; its closed loop: test_platform_loop. */
#include "platform_rig.h"

#include "base/rng.h"
#include "phys/lab.h"

#include <string.h>

static struct platform up(const struct platform_cfg *c, const struct vehicle_cfg *v)
{
    struct platform p;
    const struct site site = at_latitude(50.0);
    platform_init(&p, c, v, &site, 1);
    return p;
}

/* ---- kinematics */

/* m = m R, R the turn by the angle about axis k: the textbook's, not the model's. */
static void turned(double m[3][3], unsigned k, double angle_rad)
{
    const unsigned i = (k + 1) % 3;
    const unsigned j = (k + 2) % 3;
    for (unsigned row = 0; row < 3; row++) {
        const double a = m[row][i];
        const double b = m[row][j];
        m[row][i] = a * cos(angle_rad) + b * sin(angle_rad);
        m[row][j] = b * cos(angle_rad) - a * sin(angle_rad);
    }
}

static void attitude(const struct platform_state *s, double C_lp[3][3])
{
    memset(C_lp, 0, 9 * sizeof(double));
    for (unsigned k = 0; k < 3; k++) C_lp[k][k] = 1.0;
    turned(C_lp, 2, s->alpha_rad);
    turned(C_lp, 0, s->beta_rad);
    turned(C_lp, 1, s->gamma_rad);
}

/* w_ip_p = vee(C_lp^T C_lp') + C_lp^T w_il_l, by central differences of h_s. */
static void rate_by_differences(struct platform *p, double t_s, double h_s, double w_p[3])
{
    double C[3][3][3];
    double skew[3][3];
    struct vehicle_state v;
    for (unsigned i = 0; i < 3; i++) {
        const struct platform_state s = look(p, t_s + ((double)i - 1.0) * h_s);
        attitude(&s, C[i]);
    }
    vehicle_at(&p->vehicle, ns(t_s), &v);
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned j = 0; j < 3; j++) {
            skew[i][j] = 0.0;
            for (unsigned k = 0; k < 3; k++) skew[i][j] += C[1][k][i] * (C[2][k][j] - C[0][k][j]) / (2.0 * h_s);
        }
    }
    for (unsigned i = 0; i < 3; i++) {
        w_p[i] = skew[(i + 2) % 3][(i + 1) % 3];
        for (unsigned k = 0; k < 3; k++) w_p[i] += C[1][k][i] * v.w_il_l_radps[k];
    }
}

/* A vehicle that turns, tilts, sways and flies; torques that change each tenth of a second; drifts and scale errors. */
static struct platform lively(double beta0_deg)
{
    struct platform_cfg c = ideal();
    c.alpha0_deg = 33.0;
    c.beta0_deg = beta0_deg;
    c.drift_degph[0] = 2500.0;
    c.drift_degph[1] = -4000.0;
    c.torquer_scale[0] = 0.01;
    c.torquer_scale[1] = -0.02;
    struct vehicle_cfg v = parked(40.0, 5.0, -4.0);
    v.sway = (struct vehicle_sway){.pitch_arcmin = 120.0, .pitch_s = 2.1, .roll_arcmin = 60.0, .roll_s = 1.3};
    struct platform p = up(&c, &v);
    vehicle_fly(platform_vehicle(&p, 0), 250.0, 120.0, 0);
    vehicle_attitude(platform_vehicle(&p, 0), 120.0, -8.0, 10.0, 0);
    return p;
}

/* (3) of the article, and the gyroscope's two rates out of it, against rotation matrices differentiated numerically. */
static void rates_are_those_of_the_rotation_matrices(void **state)
{
    (void)state;
    for (double beta0_deg = -6.0; beta0_deg <= 6.0; beta0_deg += 3.0) {
        struct platform p = lively(beta0_deg);
        for (unsigned i = 0; i < 60; i++) {
            const double u1 = 0.05 * sin(1.7 * i);
            const double u2 = 0.2 * cos(0.9 * i);
            platform_torque(&p, u1, u2, ns(0.1 * i));
            const double t_s = 0.1 * i + 0.033;
            const struct platform_state s = look(&p, t_s);
            double w_p[3];
            rate_by_differences(&p, t_s, 1e-4, w_p);
            for (unsigned k = 0; k < 3; k++) near(s.w_ip_p_radps[k], w_p[k], 3e-9);
            near(s.w_ip_p_radps[0], u1 * 1.01 - 2500.0 * DEGPH, 1e-15);
            near(s.w_ip_p_radps[2], u2 * 0.98 + 4000.0 * DEGPH, 1e-15);
        }
    }
}

/* The printed (3) with its dots over beta, and only the Earth under it. */
static void equation_3_holds_as_corrected(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.alpha0_deg = 33.0;
    c.beta0_deg = 3.0;
    const struct vehicle_cfg v = parked(40.0, 5.0, -4.0);
    struct platform p = up(&c, &v);
    platform_torque(&p, 0.01, 0.15, 0);
    for (double t_s = 0.0; t_s < 20.0; t_s += 0.77) {
        const struct platform_state s = look(&p, t_s);
        const double We = EARTH_RATE_RADPS * cos(50.0 * RAD_PER_DEG);
        const double Wz = EARTH_RATE_RADPS * sin(50.0 * RAD_PER_DEG);
        const double sa = sin(s.alpha_rad), ca = cos(s.alpha_rad), sb = sin(s.beta_rad), cb = cos(s.beta_rad);
        const double sg = sin(s.gamma_rad), cg = cos(s.gamma_rad);
        near(s.beta_radps * cg + We * (sa * cg + ca * sg * sb) - (Wz + s.alpha_radps) * cb * sg, 0.01, 1e-15);
        near((Wz + s.alpha_radps) * cb * cg + We * (sa * sg - ca * cg * sb) + s.beta_radps * sg, 0.15, 1e-15);
    }
}

/* The gimbals: x_p = cos q x_c + sin q y_c, so it is across z_c; C_lp is that of the three angles; gamma' is gamma's. */
static void the_suspension_axis_is_in_the_outer_frame(void **state)
{
    (void)state;
    struct platform p = lively(4.0);
    platform_torque(&p, 0.01, 0.1, 0);
    for (double t_s = 0.05; t_s < 9.0; t_s += 0.31) {
        const struct platform_state s = look(&p, t_s);
        struct vehicle_state v;
        vehicle_at(&p.vehicle, ns(t_s), &v);
        double C_lp[3][3];
        attitude(&s, C_lp);
        for (unsigned k = 0; k < 3; k++) {
            for (unsigned j = 0; j < 3; j++) near(s.C_lp[k][j], C_lp[k][j], 2e-15);
            near(s.C_lp[k][0], cos(s.q_rad) * v.C_lc[k][0] + sin(s.q_rad) * v.C_lc[k][1], 2e-15);
        }
        const double h_s = 1e-4;
        const double by_difference = (look(&p, t_s + h_s).gamma_rad - look(&p, t_s - h_s).gamma_rad) / (2.0 * h_s);
        near(s.gamma_radps, by_difference, 1e-8);
    }
}

static void a_level_vehicle_has_the_heading_in_the_gimbal_angle(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.alpha0_deg = 30.0;
    const struct vehicle_cfg v = parked(25.0, 0.0, 0.0);
    struct platform p = up(&c, &v);
    near(look(&p, 0.0).q_rad, 55.0 * RAD_PER_DEG, 1e-15);
    near(look(&p, 0.0).gamma_rad, 0.0, 1e-16);
    near(atan2(look(&p, 0.0).C_lp[0][1], look(&p, 0.0).C_lp[1][1]), -30.0 * RAD_PER_DEG, 1e-15); /* azimuth of y_p */
}

/* A platform that is level at azimuth angle alpha on a tilted vehicle. */
static struct platform_state levelled(double alpha_deg, const struct vehicle_cfg *v)
{
    struct platform_cfg c = ideal();
    c.alpha0_deg = alpha_deg;
    struct platform p = up(&c, v);
    return look(&p, 0.0);
}

/* Block 1: gamma ~ cos q roll - sin q pitch, to second order in the tilts. */
static void block_1_gives_roll_and_pitch_by_the_gimbal_angle(void **state)
{
    (void)state;
    const struct vehicle_cfg v = parked(40.0, 0.5, -0.4);
    for (double alpha_deg = -180.0; alpha_deg < 180.0; alpha_deg += 17.0) {
        const struct platform_state s = levelled(alpha_deg, &v);
        const double by_angle = cos(s.q_rad) * v.roll_deg - sin(s.q_rad) * v.pitch_deg;
        near(s.gamma_rad / RAD_PER_DEG, by_angle, 2e-5);
        near(s.alpha_rad, alpha_deg * RAD_PER_DEG, 1e-15);
    }
}

/* Increment of alpha for a step of the encoder, from the first angle; levelled at both. */
static double increment_deg(double from_deg, double step_deg, const struct vehicle_cfg *v)
{
    const double q_rad = levelled(from_deg, v).q_rad + step_deg * RAD_PER_DEG;
    double to_deg = from_deg + step_deg;
    for (unsigned i = 0; i < 6; i++) {
        const double miss_rad = remainder(q_rad - levelled(to_deg, v).q_rad, 6.283185307179586);
        to_deg += miss_rad / RAD_PER_DEG;
    }
    return to_deg - from_deg;
}

/* The largest hidden trap (sources instruments 1.3): the encoder turns about a tilted axis. */
static void cardan_error_is_that_of_the_sources(void **state)
{
    (void)state;
    static const struct {
        double tilt_deg, step_deg, worst_arcmin, tol_arcmin;
    } rows[] = {{5.0, 90.0, 26.2, 0.05}, {2.0, 90.0, 4.2, 0.05}, {1.0, 90.0, 1.05, 0.005}, {5.0, 180.0, 0.0, 1e-9}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct vehicle_cfg v = parked(40.0, rows[i].tilt_deg, rows[i].tilt_deg);
        double worst_arcmin = 0.0;
        for (double from_deg = 0.0; from_deg < 360.0; from_deg += 1.0) {
            const double off = 60.0 * fabs(increment_deg(from_deg, rows[i].step_deg, &v) - rows[i].step_deg);
            worst_arcmin = fmax(worst_arcmin, off);
        }
        near(worst_arcmin, rows[i].worst_arcmin, rows[i].tol_arcmin);
    }
}

/* ---- what a unit on it feels */

static void force_is_gravity_in_the_axes_of_the_platform(void **state)
{
    (void)state;
    struct lab l;
    struct lab_cfg c = lab_default();
    c.site = at_latitude(50.0);
    c.platform = ideal();
    c.platform.alpha0_deg = 70.0;
    c.platform.beta0_deg = 2.0;
    c.platform.level_tilt_arcmin[0] = 10.0;
    c.platform.level_tilt_arcmin[1] = -7.0;
    c.vehicle = parked(40.0, 5.0, -4.0);
    lab_init(&l, &c, 1);
    const struct lab_mounting mounting = {.on = LAB_PLATFORM};
    const double origin[3] = {0.0, 0.0, 0.0};
    const struct platform_state s = look(&l.platform, 0.0);
    const double g = l.site.g_mps2;
    double f[3];
    double a[3];
    struct kinematics kin;
    platform_force_mps2(&l.platform, 0, f);
    near(f[0], -g * sin(s.gamma_rad) * cos(s.beta_rad), 1e-14);
    near(f[1], g * sin(s.beta_rad), 1e-14);
    near(f[2], g * cos(s.gamma_rad) * cos(s.beta_rad), 1e-14);
    lab_kinematics(&l, &mounting, origin, 0, &kin);
    lab_sensor_mps2(&l, &mounting, origin, 1.0, 0.0, 0, a);
    for (unsigned k = 0; k < 3; k++) near(kin.f_mps2[k], -a[k], 1e-14);
    const double tb = 10.0 * RAD_PER_ARCMIN, tg = -7.0 * RAD_PER_ARCMIN;
    near(kin.f_mps2[1], f[1] * cos(tb) + f[2] * sin(tb), 1e-14);
    near(kin.f_mps2[0], f[0] * cos(tg) - (f[2] * cos(tb) - f[1] * sin(tb)) * sin(tg), 1e-14);
    near(asin(kin.f_mps2[1] / g), 2.0 * RAD_PER_DEG + tb, 1e-5); /* a level sensor shows so much more beta, */
    near(asin(-kin.f_mps2[0] / g / cos(s.beta_rad)), s.gamma_rad + tg,
         1e-5); /* and gamma; gamma's own turn is second order */
    near(kin.w_radps[2], s.w_ip_p_radps[2], 1e-6);
    const struct lab_mounting askew = {.on = LAB_PLATFORM, .misalignment_rad = {1e-3, -2e-3, 3e-3}};
    lab_kinematics(&l, &askew, origin, 0, &kin);
    lab_sensor_mps2(&l, &askew, origin, 1.0, 0.0, 0, a);
    for (unsigned k = 0; k < 3; k++) near(kin.f_mps2[k], -a[k], 1e-14);
    lab_sensor_mps2(&l, &mounting, origin, cos(3e-3), sin(3e-3), 0,
                    a); /* a sensor's alpha0 is a turn about z of the block */
    lab_kinematics(&l, &(struct lab_mounting){.on = LAB_PLATFORM, .misalignment_rad = {0.0, 0.0, 3e-3}}, origin, 0,
                   &kin);
    for (unsigned k = 0; k < 3; k++) near(kin.f_mps2[k], -a[k], 1e-14);
}

static void a_lever_arm_feels_the_rate(void **state)
{
    (void)state;
    struct lab l;
    struct lab_cfg c = lab_default();
    c.platform = ideal();
    c.vehicle = parked(0.0, 0.0, 0.0);
    lab_init(&l, &c, 1);
    platform_torque(&l.platform, 0.0, 0.3, 0);
    struct kinematics kin;
    double a[3];
    const struct lab_mounting mounting = {.on = LAB_PLATFORM, .lever_m = {0.1, 0.0, 0.0}};
    lab_kinematics(&l, &mounting, (const double[3]){0.1, 0.0, 0.0}, ns(1.0), &kin);
    near(kin.f_mps2[0], -0.2 * 0.3 * 0.3, 1e-12);
    lab_sensor_mps2(&l, &mounting, (const double[3]){0.1, 0.0, 0.0}, 1.0, 0.0, ns(1.0), a);
    for (unsigned k = 0; k < 3; k++) near(kin.f_mps2[k], -a[k], 1e-14);
    near(kin.w_radps[2], 0.3, 1e-15);
}

static void a_flight_is_felt_on_the_platform(void **state)
{
    (void)state;
    const struct platform_cfg c = ideal();
    const struct vehicle_cfg v = parked(0.0, 0.0, 0.0);
    struct platform p = up(&c, &v);
    vehicle_fly(platform_vehicle(&p, 0), 100.0, 0.0, 0);
    double f[3];
    platform_force_mps2(&p, ns(10.0), f); /* 2 m/s^2 to the north, along y_p */
    near(f[1], 2.0, 0.01);
    platform_force_mps2(&p, ns(100.0),
                        f); /* Coriolis: to the right of the track the world pulls, to the left it pushes */
    near(f[0], -2.0 * EARTH_RATE_RADPS * sin(50.0 * RAD_PER_DEG) * 100.0, 2e-3);
}

/* What it shows is a tilt of the vertical: 0.3 mg are 1.03 arcmin, along y of the platform as beta, along x as -gamma. 5e-6:
 * the Earth has turned under the platform. */
static void a_push_is_felt_on_the_platform(void **state)
{
    (void)state;
    struct platform_cfg c = ideal();
    c.alpha0_deg = 30.0;
    const struct vehicle_cfg v = parked(0.0, 0.0, 0.0);
    struct platform calm = up(&c, &v), p = up(&c, &v);
    vehicle_sway(platform_vehicle(&p, 0), &(struct vehicle_sway){.north_mg = 0.3, .north_s = 20.0}, 0);
    for (int sign = 1; sign >= -1; sign -= 2) {
        const int64_t t_ns = ns(10.0 - 5.0 * sign);
        double still[3], f[3];
        platform_force_mps2(&calm, t_ns, still);
        platform_force_mps2(&p, t_ns, f);
        near(f[0] - still[0], sign * 0.3 * 9.80665e-3 * 0.5, 5e-6);
        near(f[1] - still[1], sign * 0.3 * 9.80665e-3 * sqrt(0.75), 5e-6);
        near((f[1] - still[1]) / f[2] / RAD_PER_ARCMIN, sign * 1.03 * sqrt(0.75), 0.01);
    }
}

/* To the bit, with everything moving: the angle sensor without errors tells q, on and between grid points. */
static void the_angle_sensor_tells_q(void **state)
{
    (void)state;
    struct platform p = lively(3.0);
    for (double t_s = 0.0; t_s < 20.0; t_s += 0.317) {
        platform_torque(&p, 0.05 * sin(t_s), 0.2 * cos(t_s), ns(t_s));
        const double q_rad = look(&p, t_s).q_rad;
        near(platform_servo_rad(&p, ns(t_s)), q_rad, 0.0);
        near(platform_encoder_rad(&p, ns(t_s)), q_rad, 0.0);
    }
}

/* ---- grid */

/* Fourth order: a slew at 9 deg/s on steps of 10 ms and on steps of 1 ms ends at the same angles. */
static void the_step_does_not_matter(void **state)
{
    (void)state;
    struct platform p[2];
    for (unsigned i = 0; i < 2; i++) {
        struct platform_cfg c = ideal();
        c.step_ns = (uint32_t)(i ? STEP_NS / 10 : STEP_NS);
        c.beta0_deg = 1.0;
        struct vehicle_cfg v = parked(40.0, 5.0, -4.0);
        v.sway = (struct vehicle_sway){.pitch_arcmin = 10.0, .pitch_s = 2.0, .roll_arcmin = 10.0, .roll_s = 3.0};
        p[i] = up(&c, &v);
        platform_torque(&p[i], 1e-3, 9.0 * RAD_PER_DEG, 0);
    }
    for (double t_s = 0.0; t_s < 15.0; t_s += 0.123) {
        if (t_s > 10.0) {
            for (unsigned i = 0; i < 2; i++) platform_torque(&p[i], -1e-3, 0.0, ns(t_s) / STEP_NS * STEP_NS);
        }
        near(look(&p[0], t_s).alpha_rad, look(&p[1], t_s).alpha_rad, 1e-12);
        near(look(&p[0], t_s).beta_rad, look(&p[1], t_s).beta_rad, 1e-12);
    }
}

/* To the bit: with somebody who looks all the time, ahead and back, and with no one. */
static void nothing_depends_on_who_looks(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(7), 0, "platform");
    struct platform_cfg c = platform_default();
    const struct vehicle_cfg v = parked(40.0, 5.0, -4.0);
    struct platform seen = up(&c, &v);
    struct platform alone = up(&c, &v);
    double f[3];
    for (unsigned i = 1; i < 1500; i++) {
        const int64_t t_ns = (int64_t)i * (STEP_NS + 1234567);
        if (i % 3 == 0) {
            platform_torque(&seen, 0.01 * sin(i), 0.1 * cos(i), t_ns);
            platform_torque(&alone, 0.01 * sin(i), 0.1 * cos(i), t_ns);
        }
        if (i % 50 == 1) {
            vehicle_attitude(platform_vehicle(&seen, t_ns), i, 5.0, -3.0, t_ns);
            vehicle_attitude(platform_vehicle(&alone, t_ns), i, 5.0, -3.0, t_ns);
        }
        if (i % 70 == 1) {
            platform_step_drift(&seen, PLATFORM_AZIMUTH, i, t_ns);
            platform_step_drift(&alone, PLATFORM_AZIMUTH, i, t_ns);
        }
        const double off_s = 1.0 * rng_uniform(&r) - 0.5;
        look(&seen, (double)t_ns * 1e-9 + off_s);
        platform_force_mps2(&seen, t_ns - 1, f);
        platform_force_mps2(&seen, t_ns + ns(0.3), f);
        const struct platform_state a = look(&seen, (double)t_ns * 1e-9);
        const struct platform_state b = look(&alone, (double)t_ns * 1e-9);
        assert_true(a.alpha_rad == b.alpha_rad && a.beta_rad == b.beta_rad);
        assert_true(a.q_rad == b.q_rad && a.drift_radps[0] == b.drift_radps[0]);
    }
}

static void half_a_second_back_is_what_it_was(void **state)
{
    (void)state;
    struct platform_cfg c = platform_default();
    const struct vehicle_cfg v = parked(40.0, 5.0, -4.0);
    struct platform p = up(&c, &v);
    double was[51];
    platform_torque(&p, 0.01, 0.1, 0);
    for (int i = 0; i <= 50; i++) was[i] = look(&p, 1.0 + 0.0101 * i).beta_rad;
    platform_torque(&p, -0.01, 0.0, ns(1.51));
    platform_reposition(&p, ns(1.51));
    for (int i = 0; i <= 50; i++) near(look(&p, 1.0 + 0.0101 * i).beta_rad, was[i], 0.0);
    near(look(&p, 0.0).beta_rad, look(&p, 1.51 - 1.27).beta_rad, 0.01); /* further back: the oldest that it knows */
}

/* A torque acts from the first grid point not before it on. */
static void a_torque_acts_from_the_next_grid_point(void **state)
{
    (void)state;
    const struct platform_cfg c = ideal();
    const struct vehicle_cfg v = parked(0.0, 0.0, 0.0);
    struct platform p;
    platform_init(&p, &c, &v, &(struct site){.g_mps2 = 9.81}, 1);
    platform_torque(&p, 0.0, 0.1, ns(0.020));
    platform_torque(&p, 0.0, 0.2, ns(0.0301));
    near(look(&p, 0.020).alpha_rad, 0.0, 0.0);
    near(look(&p, 0.040).alpha_rad, 0.1 * 0.02, 1e-17);
    near(look(&p, 0.045).alpha_rad, 0.1 * 0.02 + 0.2 * 0.005, 1e-17);
    near(look(&p, -1.0).alpha_rad, 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rates_are_those_of_the_rotation_matrices),
        cmocka_unit_test(equation_3_holds_as_corrected),
        cmocka_unit_test(the_suspension_axis_is_in_the_outer_frame),
        cmocka_unit_test(a_level_vehicle_has_the_heading_in_the_gimbal_angle),
        cmocka_unit_test(block_1_gives_roll_and_pitch_by_the_gimbal_angle),
        cmocka_unit_test(cardan_error_is_that_of_the_sources),
        cmocka_unit_test(force_is_gravity_in_the_axes_of_the_platform),
        cmocka_unit_test(a_lever_arm_feels_the_rate),
        cmocka_unit_test(a_flight_is_felt_on_the_platform),
        cmocka_unit_test(a_push_is_felt_on_the_platform),
        cmocka_unit_test(the_angle_sensor_tells_q),
        cmocka_unit_test(the_step_does_not_matter),
        cmocka_unit_test(nothing_depends_on_who_looks),
        cmocka_unit_test(half_a_second_back_is_what_it_was),
        cmocka_unit_test(a_torque_acts_from_the_next_grid_point),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
