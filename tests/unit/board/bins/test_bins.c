/* The inertial unit: increments against closed forms of the motion, its error model, its noise, what is missing in a reading. */
#include "bins_rig.h"

static struct rig r;

#define COUNT_RAD (0.01 * RAD_PER_ARCSEC)
#define EARTH     EARTH_RATE_RADPS

static void near(double got, double want, double tolerance, const char *what)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%s: %.12g, expected %.12g +- %.3g", what, got, want, tolerance);
}

static void ideal(bool placed)
{
    const struct bins_profile p = rig_ideal();
    rig_up(&r, &p, placed, 1);
    rig_run(&r, 0.5);
    rig_forget(&r);
}

/* ---- increments of an ideal unit */

static void at_rest_it_shows_the_earth_s_rate_and_gravity(void **state)
{
    (void)state;
    ideal(true);
    rig_run(&r, 100.0);
    const double t_s = rig_span_s(&r);
    near(rig_angle_rad(&r, 0), EARTH * cos(RIG_LATITUDE) * t_s, 1.01 * COUNT_RAD, "x, north");
    near(rig_angle_rad(&r, 1), 0.0, 1.01 * COUNT_RAD, "y, east");
    near(rig_angle_rad(&r, 2), -EARTH * sin(RIG_LATITUDE) * t_s, 1.01 * COUNT_RAD, "z, down");
    near(rig_velocity_mps(&r, 0), 0.0, 6e-6 * t_s, "x");
    near(rig_velocity_mps(&r, 2), -RIG_G_MPS2 * t_s, 6e-6 * t_s, "z"); /* half a code of 9.7 um/s^2 */
    assert_int_equal(r.flags, 0);
    assert_int_equal(r.readings, 10000);
}

/* On a bench that does not turn with the Earth the sum of the increments is the table's angle, through ramps and reversals. */
static void increments_sum_up_to_the_table_s_angle(void **state)
{
    static const double rates_dps[] = {10.0, -10.0, 123.456, -0.001, 400.0, 0.0};
    (void)state;
    ideal(false);
    for (unsigned i = 0; i < COUNT(rates_dps); i++) {
        rig_rate(&r, 0, rates_dps[i]);
        rig_run(&r, 7.3217);
    }
    rig_run(&r, 3.0);
    const double angle_rad = table_axis(&r.lab.table, 0, r.last.t_ns).angle_rad;
    assert_true(fabs(angle_rad) > 50.0);
    near(rig_angle_rad(&r, 0), angle_rad, 1.01 * COUNT_RAD, "the angle");
    near(rig_angle_rad(&r, 1), 0.0, 1.01 * COUNT_RAD, "across");
}

/* Each increment, not only their sum: both are of the interval that TSTAMP ends. */
struct worst {
    double gyro_rad, accel_mps;
    int64_t from_ns;
};

static void compare_reading(struct rig *rig, const struct bins_reading *g)
{
    struct worst *w = rig->own;
    const struct motion_state a = table_axis(&rig->lab.table, 0, w->from_ns),
                              b = table_axis(&rig->lab.table, 0, g->t_ns);
    const double rate = (b.angle_rad - a.angle_rad) / (1e-9 * (double)(g->t_ns - w->from_ns));
    /* about x: f = -g (0, sin, cos); its integral over the interval */
    const double y = RIG_G_MPS2 / rate * (cos(b.angle_rad) - cos(a.angle_rad));
    const double z = -RIG_G_MPS2 / rate * (sin(b.angle_rad) - sin(a.angle_rad));
    const double code = bins_accel_mps_per_code(rig_bins(rig)), half = 0.5 * g->words;
    const double off[] = {fabs(g->gyro[0] * COUNT_RAD - (b.angle_rad - a.angle_rad)),
                          fabs((g->accel[1] + half) * code - y), fabs((g->accel[2] + half) * code - z)};
    if (off[0] > w->gyro_rad) w->gyro_rad = off[0];
    for (unsigned i = 1; i < 3; i++)
        if (off[i] > w->accel_mps) w->accel_mps = off[i];
    w->from_ns = g->t_ns;
}

static void both_increments_are_of_the_interval_that_the_time_stamp_ends(void **state)
{
    static const uint32_t sps[] = {500, 1000, 2000};
    (void)state;
    for (unsigned i = 0; i < COUNT(sps); i++) {
        struct bins_profile p = rig_ideal();
        p.accel_sps = sps[i];
        p.words_per_reading = sps[i] / 100;
        rig_up(&r, &p, false, 1);
        rig_rate(&r, 0, 10.0);
        rig_run(&r, 2.0);
        struct worst w = {.from_ns = r.last.t_ns};
        r.own = &w;
        r.on_reading = compare_reading;
        rig_run(&r, 40.0);
        near(w.gyro_rad, 0.0, 1.01 * COUNT_RAD, "an increment of angle");
        /* half a code in each word, and 1 us of time is 1.7e-8 m/s: the alignment is good to 0.1 us */
        near(w.accel_mps, 0.0, 0.5 * p.words_per_reading * bins_accel_mps_per_code(rig_bins(&r)) + 2e-9,
             "an increment of velocity");
        assert_int_equal(bins_accel_age_ns(rig_bins(&r)), 0);
    }
}

static void without_alignment_the_accelerometers_are_older_by_their_delay(void **state)
{
    (void)state;
    struct bins_profile p = rig_ideal();
    p.aligned = false;
    rig_up(&r, &p, false, 1);
    rig_rate(&r, 0, 10.0);
    rig_run(&r, 2.0);
    rig_forget(&r);
    rig_run(&r, 0.01);
    assert_int_equal(r.readings, 1);
    const double age_s = 1e-9 * (double)bins_accel_age_ns(rig_bins(&r));
    const double middle_rad = table_axis(&r.lab.table, 0, r.last.t_ns).angle_rad - 10.0 * RAD_PER_DEG * (0.005 + age_s);
    const double shown_rad = atan2(-(double)r.accel[1], -(double)r.accel[2]);
    near(age_s, 5.0 / 500 + 468.0 / 4.096e6 - 0.001, 2e-5,
         "5 words and the latency, less half a word"); /* ads1282.md */
    near(det_wrap_rad(shown_rad - middle_rad), 0.0, 3e-6, "the angle of gravity");
}

/* ---- errors */

static struct bins_profile erring(void)
{
    struct bins_profile p = rig_ideal();
    for (unsigned i = 0; i < 3; i++) {
        p.gyro_bias_degph[i] = 10.0 - 7.0 * i;
        p.accel_bias_mps2[i] = -0.02 + 0.03 * i;
    }
    for (unsigned i = 0; i < 9; i++) {
        p.gyro_theta[i] = 1e-3 * (4.0 - i);
        p.accel_gamma[i] = 5e-4 * (i - 3.5);
        p.gyro_g_degph_per_g[i] = 0.5 * i - 1.0;
    }
    return p;
}

/* About x with the Earth: w = (a', 0, 0) + C^T u, f = -g (0, sin a, cos a); their integrals in closed form. */
static void integrals(double from_rad, double to_rad, double rate, double t_s, double w[3], double f[3])
{
    const double uh = EARTH * cos(RIG_LATITUDE), uz = -EARTH * sin(RIG_LATITUDE);
    const double sines = (cos(from_rad) - cos(to_rad)) / rate, cosines = (sin(to_rad) - sin(from_rad)) / rate;
    w[0] = to_rad - from_rad + uh * t_s;
    w[1] = uz * sines;
    w[2] = uz * cosines;
    f[0] = 0.0;
    f[1] = -RIG_G_MPS2 * sines;
    f[2] = -RIG_G_MPS2 * cosines;
}

static void increments_follow_the_linear_model_on_a_turning_table(void **state)
{
    const double rate = -17.0 * RAD_PER_DEG;
    (void)state;
    const struct bins_profile p = erring();
    rig_up(&r, &p, true, 1);
    rig_rate(&r, 0, -17.0);
    rig_run(&r, 1.0);
    rig_forget(&r);
    rig_run(&r, 77.7);
    double w[3], f[3];
    const double from_rad = table_axis(&r.lab.table, 0, r.from_ns).angle_rad;
    integrals(from_rad, table_axis(&r.lab.table, 0, r.last.t_ns).angle_rad, rate, rig_span_s(&r), w, f);
    for (unsigned i = 0; i < 3; i++) {
        double angle_rad = w[i] + p.gyro_bias_degph[i] * DEGPH * rig_span_s(&r);
        double v_mps = f[i] + p.accel_bias_mps2[i] * rig_span_s(&r);
        for (unsigned j = 0; j < 3; j++) {
            angle_rad += p.gyro_theta[3 * i + j] * w[j] + p.gyro_g_degph_per_g[3 * i + j] * DEGPH * f[j] / 9.80665;
            v_mps += p.accel_gamma[3 * i + j] * f[j];
        }
        near(rig_angle_rad(&r, i), angle_rad, 1.01 * COUNT_RAD, "angle");
        near(rig_velocity_mps(&r, i), v_mps, 6e-6 * rig_span_s(&r), "velocity");
    }
}

/* Sensor at r_i: [w x (w x r) + w' x r] along its axis; the table spins up about x with 400 deg/s^2. */
static void an_accelerometer_off_the_centre_feels_the_size_effect(void **state)
{
    static const double at_m[3] = {0.3, 0.2, -0.1};
    const double accel = 400.0 * RAD_PER_DEG, w = 100.0 * RAD_PER_DEG;
    (void)state;
    ideal(false);
    for (unsigned i = 0; i < 3; i++) memcpy(r.u.cfg.axis[i].at_m, at_m, sizeof at_m);
    rig_rate(&r, 0, 100.0); /* 0.25 s long */
    rig_run(&r, 0.1);
    const struct motion_state now = table_axis(&r.lab.table, 0, r.last.t_ns - 5000000);
    near(now.accel_radps2, accel, 1e-9, "the ramp");
    const double code = bins_accel_mps_per_code(rig_bins(&r)) / RIG_PERIOD_S, q = now.rate_radps * now.rate_radps;
    near(r.last.accel[1] * code + RIG_G_MPS2 * sin(now.angle_rad), -q * at_m[1] - accel * at_m[2], 2e-3, "y, ramp");
    near(r.last.accel[2] * code + RIG_G_MPS2 * cos(now.angle_rad), -q * at_m[2] + accel * at_m[1], 2e-3, "z, ramp");
    rig_run(&r, 1.0);
    const double angle_rad = table_axis(&r.lab.table, 0, r.last.t_ns - 5000000).angle_rad;
    near(r.last.accel[1] * code + RIG_G_MPS2 * sin(angle_rad), -w * w * at_m[1], 2e-3, "y");
    near(r.last.accel[0] * code, 0.0, 1e-5, "x, along the axis");
}

/* Priors of the article; a spread of one kind shifts no other. */
static void errors_are_drawn_with_their_spread(void **state)
{
    enum { UNITS = 4000 };
    double sum2[5] = {0.0};
    struct bins_profile p;
    (void)state;
    fields_default(&bins_fields, &p);
    for (unsigned k = 0; k < UNITS; k++) {
        const struct inertial_errors e = bins_profile_errors(&p, 7, k + 1);
        const double of[] = {e.nu0_radps[1] / (0.5 * DEGPH), e.theta[2][2] / 1e-3,
                             e.theta[0][2] / (3.0 * RAD_PER_ARCMIN), e.df0_mps2[0] / 0.02,
                             e.gamma[1][0] / (3.0 * RAD_PER_ARCMIN)};
        for (unsigned i = 0; i < COUNT(of); i++) sum2[i] += of[i] * of[i] / UNITS;
    }
    for (unsigned i = 0; i < COUNT(sum2); i++) near(sum2[i], 1.0, 0.1, "variance");
    const struct inertial_errors with = bins_profile_errors(&p, 7, 1);
    p.gyro_scale_sd = p.gyro_bias_sd_degph = 0.0;
    p.gyro_bias_degph[2] = 3.0;
    const struct inertial_errors without = bins_profile_errors(&p, 7, 1);
    near(without.nu0_radps[2], 3.0 * DEGPH, 0.0, "given");
    near(without.theta[0][0], 0.0, 0.0, "no spread");
    near(without.theta[0][1], with.theta[0][1], 0.0, "its own draw");
    near(without.gamma[2][1], with.gamma[2][1], 0.0, "its own draw");
}

/* Adler: sqrt(w^2 - lock-in^2), nothing within. */
static void a_locked_gyro_counts_nothing(void **state)
{
    (void)state;
    struct bins_profile p = rig_ideal();
    p.gyro_lock_in_degph = 36.0; /* 0.01 deg/s */
    rig_up(&r, &p, false, 1);
    rig_rate(&r, 0, 0.009);
    rig_run(&r, 1.0);
    rig_forget(&r);
    rig_run(&r, 10.0);
    near(rig_angle_rad(&r, 0), 0.0, 0.0, "within");
    rig_rate(&r, 0, -0.02);
    rig_run(&r, 1.0);
    rig_forget(&r);
    rig_run(&r, 10.0);
    near(rig_angle_rad(&r, 0), -sqrt(0.02 * 0.02 - 0.01 * 0.01) * RAD_PER_DEG * rig_span_s(&r), 1.01 * COUNT_RAD,
         "beyond");
}

/* ---- noise */

struct means {
    unsigned n, in;
    double sum[6], sum2[6], mean[6];
};

static void add_mean(struct rig *rig, const struct bins_reading *g)
{
    struct means *m = rig->own;
    for (unsigned i = 0; i < 6; i++) m->sum[i] += i < 3 ? g->gyro[i] : g->accel[i - 3];
    if (++m->in < 100) return;
    for (unsigned i = 0; i < 6; i++) {
        m->mean[i] += m->sum[i];
        m->sum2[i] += m->sum[i] * m->sum[i];
        m->sum[i] = 0.0;
    }
    m->in = 0;
    m->n++;
}

/* Means of a second: 0.1 deg/h and 0.001 m/s^2. 500 of them: the deviation is known to 3 %. */
static void noise_has_the_density_of_the_article(void **state)
{
    (void)state;
    struct bins_profile p = rig_ideal();
    p.gyro_noise_degph = 0.1;
    p.accel_noise_mps2 = 1e-3;
    rig_up(&r, &p, false, 1);
    rig_run(&r, 0.5);
    struct means m = {0};
    r.own = &m;
    r.on_reading = add_mean;
    rig_run(&r, 500.0);
    const double of[2] = {COUNT_RAD / DEGPH, bins_accel_mps_per_code(rig_bins(&r))};
    static const double want[2] = {0.1, 1e-3};
    for (unsigned i = 0; i < 6; i++) {
        const double mean = m.mean[i] / m.n;
        near(sqrt(m.sum2[i] / m.n - mean * mean) * of[i / 3] / want[i / 3], 1.0, 0.12, "deviation of a mean");
    }
}

/* ---- who looks, and what is missing */

static void who_looks_when_changes_nothing(void **state)
{
    int64_t gyro[2][3], accel[2][3];
    (void)state;
    struct bins_profile p = erring();
    p.gyro_noise_degph = 0.1;
    p.accel_noise_mps2 = 1e-3;
    for (unsigned k = 0; k < 2; k++) {
        rig_up(&r, &p, true, 1);
        rig_rate(&r, 1, 33.0);
        for (unsigned i = 0; i < 500; i++) {
            rig_run(&r, 0.0137);
            if (k == 1) unit_sample_until(&r.u, r.s.now_ns);
        }
        memcpy(gyro[k], r.gyro, sizeof gyro[k]);
        memcpy(accel[k], r.accel, sizeof accel[k]);
    }
    for (unsigned i = 0; i < 3; i++) {
        assert_true(llabs(gyro[0][i] - gyro[1][i]) <= 1); /* panels are cut elsewhere: 1e-13 rad */
        assert_true(accel[0][i] == accel[1][i]);
    }
}

/* The pin shows the last word when it is free again, late by any part of a word. */
static void dead_drd_a(double for_s)
{
    const struct chip_fault dead = {.drdy = CHIP_STUCK_HIGH}, none = {0};
    ideal(false);
    rig_rate(&r, 0, 10.0);
    rig_run(&r, 1.0);
    rig_forget(&r);
    bins_board.parts[2].fault(r.u.board, 2, &dead, r.s.now_ns); /* adc.x */
    rig_run(&r, for_s);
    bins_board.parts[2].fault(r.u.board, 2, &none, r.s.now_ns);
    rig_run(&r, 1.0);
    near(rig_angle_rad(&r, 0), 10.0 * RAD_PER_DEG * rig_span_s(&r), 1.01 * COUNT_RAD, "the angle");
    near((double)r.words, rig_span_s(&r) * 500.0 - rig_bins(&r)->counters.missed_words, 0.01, "words");
}

static void missing_words_are_reported_and_the_increments_stay_integrals(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        dead_drd_a(0.0045 + 0.0002 * i);
        assert_in_range(rig_bins(&r)->counters.missed_words, 1, 2);
        assert_int_equal(r.flags, BINS_INCOMPLETE);
    }
    dead_drd_a(0.052); /* latches are missed too */
    assert_in_range(rig_bins(&r)->counters.missed_words, 25, 26);
    assert_int_equal(r.flags, BINS_INCOMPLETE | BINS_STRETCHED);
}

static void reset_and_power_begin_again(void **state)
{
    (void)state;
    ideal(true);
    rig_run(&r, 1.0);
    r.u.type->reset(r.u.board, r.s.now_ns);
    rig_forget(&r);
    assert_false(r.u.type->ready(r.u.board));
    rig_run(&r, 0.5);
    assert_true(r.u.type->ready(r.u.board));
    assert_int_equal(r.last.seq, r.readings);
    unit_power_down(&r.u, r.s.now_ns);
    rig_forget(&r);
    rig_run(&r, 1.0);
    assert_int_equal(r.readings, 0);
    unit_power_up(&r.u, r.s.now_ns);
    rig_run(&r, 0.5);
    assert_int_equal(r.last.seq, r.readings);
    assert_int_equal(r.flags, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(at_rest_it_shows_the_earth_s_rate_and_gravity),
        cmocka_unit_test(increments_sum_up_to_the_table_s_angle),
        cmocka_unit_test(both_increments_are_of_the_interval_that_the_time_stamp_ends),
        cmocka_unit_test(without_alignment_the_accelerometers_are_older_by_their_delay),
        cmocka_unit_test(increments_follow_the_linear_model_on_a_turning_table),
        cmocka_unit_test(an_accelerometer_off_the_centre_feels_the_size_effect),
        cmocka_unit_test(errors_are_drawn_with_their_spread),
        cmocka_unit_test(a_locked_gyro_counts_nothing),
        cmocka_unit_test(noise_has_the_density_of_the_article),
        cmocka_unit_test(who_looks_when_changes_nothing),
        cmocka_unit_test(missing_words_are_reported_and_the_increments_stay_integrals),
        cmocka_unit_test(reset_and_power_begin_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
