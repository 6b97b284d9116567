/* PMKA: what flows in comes out, through resets and rotations. */
#include "pmka_rig.h"

#include "base/rng.h"

#define LSB_VS 2.8686e-6 /* Sr / Nr of the printed parameters */

static struct rig rig, quiet;

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static void random_inputs(struct rig *r, uint64_t seed, double hz_max)
{
    struct rng rng = rng_stream(seed, 0, "inputs");
    for (unsigned a = 0; a < 3; a++) {
        r->input[a].mean_v = 4.0 * rng_uniform(&rng) - 2.0;
        for (unsigned k = 0; k < RIG_SINES; k++) {
            r->input[a].amp_v[k] = 1.2 * rng_uniform(&rng);
            r->input[a].hz[k] = hz_max * rng_uniform(&rng);
            r->input[a].phase[k] = rig_two_pi * rng_uniform(&rng);
        }
    }
}

/* Integral of a random input, band-limited to 40 Hz, from reading to reading beside the exact one. Each of the `ends` codes
 * at which an integrator begins or ends with an axis may be half a code off, and there is nothing else. */
static void compare(struct rig *r, unsigned from, unsigned to, double codes)
{
    for (unsigned axis = 0; axis < 3; axis++) {
        const double got = rig_axis_vs(r, axis, from, to);
        const double want = rig_integral_vs(&r->input[axis], rig_until_s(r, axis, from), rig_until_s(r, axis, to));
        near(got, want, codes * LSB_VS);
    }
}

static void a_random_input_is_integrated_through_many_rotations(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.beat_periods = 20;
    p.zero_periods = 8;
    for (uint64_t seed = 1; seed <= 3; seed++) {
        rig_init(&rig, &p);
        random_inputs(&rig, seed, 40.0);
        pmka_board.power_up(&rig.b.base, 0);
        rig_readings(&rig, 6002); /* 60 turns of five beats: 120 hand-overs an axis, two codes each */
        assert_in_range(rig.b.counters.handovers, 355, 365);
        compare(&rig, 0, 6000, 25.0); /* random: sqrt(2 x 240 / 12) = 6 codes rms */
        compare(&rig, 0, 18, 1.0);    /* none: half a code at either end */
    }
}

/* One hand-over after the other, each increment: nothing is lost at the keys, to a code. */
static void no_hand_over_costs_more_than_its_codes(void **state)
{
    (void)state;
    struct pmka_profile p = rig_ideal();
    p.beat_periods = 10;
    p.zero_periods = 2;
    rig_init(&rig, &p);
    random_inputs(&rig, 9, 30.0);
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 402);
    for (unsigned k = 3; k + 3 < 400; k++) compare(&rig, k, k + 3, 3.0);
}

/* As a real unit: tolerances, zero, asymmetry, a capacitor that loses 20 % an hour, temperature that rises. */
static void constants_of_the_specimen_are_all_there_is(void **state)
{
    (void)state;
    struct pmka_profile p = rig_profile();
    p.adc_noise_lsb = 0.0;
    p.cap_ageing_per_h = -0.2;
    p.beat_periods = 40;
    p.zero_periods = 20;
    rig_init(&rig, &p);
    random_inputs(&rig, 4, 10.0);
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 2002);
    compare(&rig, 0, 2000, 20.0);
}

/* Of the converter and of the thermometer, from reading to reading: what a board without it does not have. */
static void noise_of_the_converters_is_white(void **state)
{
    (void)state;
    enum { N = 3000 };
    struct pmka_profile p = rig_ideal();
    double square[2] = {0.0}, lag[2] = {0.0}, last[2] = {0.0};
    rig_up(&quiet, &p);
    p.adc_noise_lsb = 10.0;
    p.temp_noise_k = 10.0 / 128.0;
    rig_up(&rig, &p);
    rig_readings(&quiet, N);
    rig_readings(&rig, N);
    for (unsigned k = 0; k < N; k++) {
        const struct pmka_reading *noisy = &rig.reading[k], *still = &quiet.reading[k];
        const double z[2] = {noisy->code[1] - still->code[1], noisy->temp_code - still->temp_code};
        for (unsigned i = 0; i < 2; i++) {
            square[i] += z[i] * z[i] / (100.0 * N);
            lag[i] += z[i] * last[i] / (100.0 * N);
            last[i] = z[i];
        }
    }
    for (unsigned i = 0; i < 2; i++) {
        near(square[i], 1.0, 4.0 * sqrt(2.0 / N));
        near(lag[i], 0.0, 5.0 / sqrt(N));
    }
}

/* Of a density d over an interval T: rms d sqrt(T / 2), as if the chain were integrated without nodes. */
static void white_noise_has_its_integral(void **state)
{
    (void)state;
    enum { N = 7000 };
    const double density_v_rthz = 1e-4;
    const struct pmka_profile p = rig_ideal();
    double last_vs[3] = {0.0}, squares = 0.0;
    int64_t last_ns[3] = {0};
    rig_init(&rig, &p);
    for (unsigned a = 0; a < 3; a++) rig.b.base.afe[a].cfg.noise_v_rthz = density_v_rthz;
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 100);
    for (unsigned k = 0; k <= N; k++) {
        for (unsigned a = 0; a < 3; a++) {
            const struct pmka_axis *axis = &rig.b.axis[a];
            const double span_s = 1e-9 * (double)(axis->at_ns - last_ns[a]);
            const double z = (axis->integral_vs - last_vs[a]) / (density_v_rthz * sqrt(span_s / 2.0));
            if (k > 0) squares += z * z;
            last_vs[a] = axis->integral_vs;
            last_ns[a] = axis->at_ns;
        }
        rig_readings(&rig, 101 + k);
    }
    near(squares / (3.0 * N), 1.0, 4.0 * sqrt(2.0 / (3.0 * N)));
}

/* 10 V of either sign is a reset a period; the codes never come near the converter's end. */
static void full_scale_is_a_reset_a_period(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    for (int sign = -1; sign <= 1; sign += 2) {
        rig_init(&rig, &p);
        for (unsigned a = 0; a < 3; a++) rig.input[a].mean_v = 10.0 * sign;
        pmka_board.power_up(&rig.b.base, 0);
        rig_readings(&rig, 300);
        unsigned resets = 0;
        for (unsigned k = 100; k < 200; k++) {
            assert_true(rig.reading[k].reset[0] * sign >= 0);
            resets += rig.reading[k].reset[0] != 0;
            assert_true(abs(rig.reading[k].code[0]) < 30000);
        }
        assert_int_equal(resets, 100);
        compare(&rig, 0, 298, 3.0);
        assert_int_equal(rig.b.counters.saturations, 0);
        assert_int_equal(rig.b.counters.clips, 0);
    }
}

/* Sources, instruments 4.2: Ur 5.106 V, Nr 16733, 2.87e-6 V s a code. */
static void figures_of_the_article(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    rig_up(&rig, &p);
    near(rig_nr(&rig, 0, PMKA_PLUS, 0.0), 16732.6, 0.1);
    near(10.0 * 4.8e-3 / rig_nr(&rig, 0, PMKA_PLUS, 0.0), LSB_VS, 1e-10);
    near(9.8 / 1.2 * 10.0 * 4.8e-3 / rig_nr(&rig, 0, PMKA_PLUS, 0.0), 2.34e-5, 0.005e-5);
    rig.input[1].mean_v = 1.2; /* 1 g */
    rig_readings(&rig, 120);
    assert_int_equal(rig.reading[100].code[1] - rig.reading[99].code[1], 2008);
}

/* X at t0 + k Ts, the others 100 us after one another. */
static void sampling_instants(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    rig_up(&rig, &p);
    assert_false(pmka_board.ready(&rig.b.base));
    rig_run(&rig, p.start_ns - 1);
    assert_false(pmka_board.ready(&rig.b.base));
    rig_run(&rig, 1);
    assert_true(pmka_board.ready(&rig.b.base));
    assert_int_equal(rig.event_ns[PMKA_EV_START], 10000000);
    rig_readings(&rig, 50);
    for (unsigned k = 0; k < 50; k++) {
        assert_int_equal(rig.reading[k].seq, k);
        assert_int_equal(rig.reading[k].t_ns, 10000000 + 4800000 * (int64_t)k);
    }
    assert_int_equal(rig.events[PMKA_EV_READING], rig.b.counters.readings);
}

/* The comparators: beyond Uc, at the sample; half a period later it is done. */
static void a_reset_begins_beyond_uc_and_lasts_half_a_period(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    rig_up(&rig, &p);
    rig.input[2].mean_v = -3.0;
    rig_readings(&rig, 100);
    const int uc = (int)(3.5 / 10 * 32768);
    unsigned resets = 0;
    for (unsigned k = 1; k < 100; k++) {
        const int was = rig.reading[k - 1].code[2];
        assert_int_equal(rig.reading[k].reset[2], was < -uc ? -1 : 0);
        if (rig.reading[k].reset[2]) resets++;
    }
    assert_in_range(resets, 28, 31); /* 0.3 of full scale */
    assert_int_equal(rig.b.counters.resets_minus, resets + (rig.reading[99].code[2] < -uc));
    const struct pmka_channel *z = &rig.b.channel[2];
    assert_int_equal(z->reset_until_ns - z->reset_from_ns, 2400000);
    assert_int_equal((z->reset_from_ns - 10200000) % 4800000, 0);
}

/* Slowly, so that the threshold shows to 15 mV; both signs. */
static void the_threshold_of_the_comparators(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    for (int sign = -1; sign <= 1; sign += 2) {
        rig_init(&rig, &p);
        rig.input[1].mean_v = 0.03 * sign;
        pmka_board.power_up(&rig.b.base, 0);
        rig_readings(&rig, 280);
        unsigned resets = 0;
        for (unsigned k = 1; k < 280; k++) {
            assert_int_equal(rig.reading[k].reset[1], rig.reading[k - 1].code[1] * sign > 11469 ? sign : 0);
            resets += rig.reading[k].reset[1] != 0;
        }
        assert_int_equal(resets, 1);
    }
}

/* 10 V for a period: 5.10638 V. */
static void a_code_is_a_voltage(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_ideal();
    rig_init(&rig, &p);
    rig.input[0].mean_v = 10.0;
    rig.input[1].mean_v = -9.99;
    pmka_board.power_up(&rig.b.base, 0);
    rig_readings(&rig, 2);
    assert_int_equal(rig.reading[1].code[0], 16733);
    assert_int_equal(rig.reading[1].code[1], -17064); /* 100 us later */
}

/* Nodes and weights: up to the fifth degree nothing is missing; the sixth shows that the nodes are Gauss's. */
static void quadrature(void **state)
{
    (void)state;
    const int64_t from = 1000, to = 2401000;
    int64_t t[PMKA_NODES];
    pmka_nodes(from, to, t);
    for (unsigned power = 0; power <= 6; power++) {
        double v[PMKA_NODES];
        for (unsigned n = 0; n < PMKA_NODES; n++)
            v[n] = pow(2.0 * (double)(t[n] - from) / (double)(to - from) - 1.0, power);
        const double want = power % 2 ? 0.0 : 2.4e-3 / (power + 1);
        const double missing = power == 6 ? 2.4e-3 / 2 * (2.0 / 7 - 2.0 * 5 / 9 * 0.216) : 0.0; /* 0.6^3 = 0.216 */
        near(pmka_integral_vs(v, to - from), want - missing, 1e-11);
    }
}

/* docs/boards/pmka.md: 10 V at 50 Hz to a thousandth of a code in a cell at worst. */
static void quadrature_is_far_below_a_code(void **state)
{
    (void)state;
    struct rig_input in = {.amp_v = {10.0}, .hz = {50.0}};
    double worst = 0.0;
    for (int64_t from = 0; from < 20000000; from += 130000) {
        int64_t t[PMKA_NODES];
        double v[PMKA_NODES];
        pmka_nodes(from, from + 2400000, t);
        for (unsigned n = 0; n < PMKA_NODES; n++) v[n] = rig_volts(&in, 1e-9 * (double)t[n]);
        const double error =
            pmka_integral_vs(v, 2400000) - rig_integral_vs(&in, 1e-9 * (double)from, 1e-9 * (double)(from + 2400000));
        worst = fmax(worst, fabs(error));
    }
    assert_true(worst < 1e-3 * LSB_VS);
    assert_true(worst > 1e-5 * LSB_VS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quadrature),
        cmocka_unit_test(quadrature_is_far_below_a_code),
        cmocka_unit_test(figures_of_the_article),
        cmocka_unit_test(sampling_instants),
        cmocka_unit_test(a_reset_begins_beyond_uc_and_lasts_half_a_period),
        cmocka_unit_test(the_threshold_of_the_comparators),
        cmocka_unit_test(a_code_is_a_voltage),
        cmocka_unit_test(full_scale_is_a_reset_a_period),
        cmocka_unit_test(a_random_input_is_integrated_through_many_rotations),
        cmocka_unit_test(no_hand_over_costs_more_than_its_codes),
        cmocka_unit_test(constants_of_the_specimen_are_all_there_is),
        cmocka_unit_test(noise_of_the_converters_is_white),
        cmocka_unit_test(white_noise_has_its_integral),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
