/* Calibrations of the AD7712: what they measure, how long they take, what they leave (sources 3.2, 3.3). */
#include "ad7712_rig.h"

/* A path with errors that calibration takes away. */
static const struct ad7712_cfg crooked = {
    .clkin_hz = 10000000, .vref_v = 2.5, .offset_v = {0.02, -0.1}, .gain_error = {-0.03, 0.02}};

#define CAL(md, code) AD7712_CONTROL(md, 0, 0, 1, 0, code)

/* Output periods from the modulator edge that follows the load to the fall of DRDY, at codes of all sizes. */
static void durations(void **state)
{
    (void)state;
    static const struct {
        unsigned md, periods, calibrations;
    } rows[] = {{1, 9, 1}, {2, 4, 1}, {3, 4, 1}, {4, 9, 1}, {5, 6, 1}};
    static const unsigned codes[] = {19, 20, 50, 325, 2000};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned k = 0; k < COUNT(codes); k++) {
            struct rig r;
            power_up(&r, &crooked);
            write_control(&r, CAL(rows[i].md, codes[k]));
            const int64_t load_ns = r.a.port.fall_ns + 4 * TAU_NS;
            const int64_t start_ns = (load_ns + MOD_NS - 1) / MOD_NS * MOD_NS;
            assert_int_equal(await_fall(&r), start_ns + (int64_t)rows[i].periods * codes[k] * MOD_NS);
            assert_int_equal(r.a.n.calibrations, rows[i].calibrations);
            assert_int_equal(r.drdy.n, 1);
            /* Back to normal by itself; background goes on. */
            assert_int_equal(r.a.control, CAL(rows[i].md == 5 ? 5 : 0, codes[k]));
            const int64_t fall_ns = r.s.now_ns;
            assert_int_equal(await_fall(&r), fall_ns + (int64_t)(rows[i].md == 5 ? 6 : 1) * codes[k] * MOD_NS);
        }
    }
}

static void durations_scale_with_the_clock(void **state)
{
    (void)state;
    static const uint32_t clocks[] = {400000, 1000000, 9830400};
    for (unsigned i = 0; i < COUNT(clocks); i++) {
        struct rig r;
        struct ad7712_cfg cfg = crooked;
        cfg.clkin_hz = clocks[i];
        power_up(&r, &cfg);
        ad7712_sync_pin(&r.a, false, 0);
        r.a.control = CAL(1, 20);
        ad7712_sync_pin(&r.a, true, 0);
        assert_int_equal(await_fall(&r), clk_span_ns(clocks[i], 9 * 20 * 512));
    }
}

static double volts(const struct rig *r)
{
    return (r->a.word / 8388608.0 - 1.0) * 2.5;
}

static void settle(struct rig *r, double v)
{
    r->v[0] = r->v[1] = v;
    for (unsigned i = 0; i < 4; i++) await_fall(r);
}

/* Without calibration the path's errors are in the words; shorted inputs and VREF take them away, at any input. */
static void self_calibration_takes_the_path_away(void **state)
{
    (void)state;
    for (unsigned g = 0; g < 8; g++) {
        struct rig r;
        struct ad7712_cfg cfg = crooked;
        cfg.offset_v[0] /= 1 << g;
        power_up(&r, &cfg);
        write_control(&r, AD7712_CONTROL(0, g, 0, 1, 0, 19));
        await_fall(&r);
        settle(&r, 1.0 / (1 << g));
        near(volts(&r), (1.0 + 0.02) * 0.97, 1e-6);
        write_control(&r, AD7712_CONTROL(1, g, 0, 1, 0, 19));
        await_fall(&r);
        near(volts(&r), 1.0, 2e-6); /* the word that comes with DRDY is settled and corrected */
        settle(&r, -2.0 / (1 << g));
        near(volts(&r), -2.0, 2e-6);
        assert_int_equal(r.a.zero[0], 0x800000 + (uint32_t)lround(0.02 * 0.97 / 2.5 * 4194304));
        near(r.a.full[0], 4194304 / 0.97, 1);
        assert_int_equal(r.a.zero[1], AD7712_ZERO_IDEAL); /* the other channel keeps its own */
        assert_int_equal(r.a.full[1], AD7712_FULL_IDEAL);
    }
}

static void each_channel_has_its_coefficients(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &crooked);
    for (unsigned c = 0; c < 2; c++) {
        write_control(&r, AD7712_CONTROL(1, 0, c, 1, 0, 19));
        await_fall(&r);
    }
    near(r.a.zero[0], 8388608 + 0.02 * 0.97 / 2.5 * 4194304, 1);
    near(r.a.zero[1], 8388608 - 0.1 * 1.02 / 10.0 * 4194304, 1);
    near(r.a.full[0], 4194304 / 0.97, 1);
    near(r.a.full[1], 4194304 / 1.02, 1);
    settle(&r, 2.0);
    near(volts(&r) * 4.0, 2.0, 1e-5);
    write_control(&r, CAL(0, 19));
    await_fall(&r);
    near(volts(&r), 2.0, 2e-6);
}

/* System calibration: what is at the pins in step 1 reads zero, what is there in step 2 full scale. */
static void system_calibration_takes_the_pins(void **state)
{
    (void)state;
    static const struct {
        bool unipolar;
        double seen; /* of half the span */
    } rows[] = {{false, 0.5}, {true, 0.5}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        power_up(&r, &crooked);
        const uint32_t bu = rows[i].unipolar ? AD7712_CTL_BU : 0;
        r.v[0] = 0.3;
        write_control(&r, CAL(2, 19) | bu);
        await_fall(&r);
        assert_int_equal(r.a.word, rows[i].unipolar ? 0x000000 : 0x800000);
        r.v[0] = 2.4;
        write_control(&r, CAL(3, 19) | bu);
        await_fall(&r);
        near(r.a.word, 0xFFFFFF, 8);
        settle(&r, 0.5 * (0.3 + 2.4));
        near(r.a.word, rows[i].unipolar ? 8388608 : 8388608 * 1.5, 8);
        assert_int_equal(r.a.n.calibrations, 2);
    }
}

/* 100: zero from the pins, span to the internal reference. */
static void system_offset_takes_the_zero_from_the_pins(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &crooked);
    r.v[0] = -0.4;
    write_control(&r, CAL(4, 19));
    await_fall(&r);
    assert_int_equal(r.a.word, 0x800000);
    near(r.a.zero[0], 8388608 + (-0.4 + 0.02) * 0.97 / 2.5 * 4194304, 1);
    near(r.a.full[0], 4194304 / ((2.5 + 0.4) * 0.97 / 2.5), 1);
}

/* 101: the zero is taken again before each word, so that it follows; the span stays. */
static void background_calibration_follows_the_zero(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &crooked);
    r.v[0] = 1.0;
    write_control(&r, CAL(5, 19));
    await_fall(&r);
    near(volts(&r), 0.97, 1e-6);
    r.a.cfg.offset_v[0] = -0.05; /* drifts while the zero is taken: this word sees it, the next is corrected */
    await_fall(&r);
    near(volts(&r), (1.0 - 0.05 - 0.02) * 0.97, 1e-6);
    await_fall(&r);
    near(volts(&r), 0.97, 1e-6);
    assert_int_equal(r.a.n.calibrations, 3);
    assert_int_equal(r.a.full[0], AD7712_FULL_IDEAL);
    near(r.a.zero[0], 8388608 - 0.05 * 0.97 / 2.5 * 4194304, 1);
    assert_int_equal(r.a.n.restarts, 2);
    write_control(&r, CAL(0, 19)); /* normal again, by a new run */
    assert_int_equal(r.a.n.overruns, 2);
    const int64_t fall_ns = await_fall(&r);
    assert_int_equal(await_fall(&r) - fall_ns, 19 * MOD_NS);
    r.a.cfg.offset_v[0] = 0.0;
    write_control(&r, CAL(0, 20));
    await_fall(&r);
    near(volts(&r), 1.05 * 0.97, 1e-5); /* no one corrects it now */
}

/* An unread background word pulses DRDY before the next one, six periods later. */
static void background_words_keep_the_rules_of_drdy(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &crooked);
    write_control(&r, CAL(5, 19));
    const int64_t first_ns = await_fall(&r);
    await_fall(&r);
    assert_int_equal(r.drdy.n, 3);
    assert_int_equal(r.drdy.e[1].t_ns, first_ns + 6 * 19 * MOD_NS - 50000);
    read_frame(&r, true, 24);
    await_fall(&r);
    assert_int_equal(r.drdy.n, 5);
}

/* A write of the control word ends a calibration under way; its coefficients stay as far as they had come. */
static void a_write_ends_a_calibration(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &crooked);
    write_control(&r, CAL(1, 100));
    wait_ns(&r, 4 * 100 * MOD_NS); /* the zero is done, the span is not */
    write_control(&r, CAL(0, 100));
    const int64_t load_ns = r.a.port.fall_ns + 400;
    const int64_t fall_ns = await_fall(&r);
    assert_true(fall_ns - load_ns >= 300 * MOD_NS && fall_ns - load_ns < 301 * MOD_NS);
    assert_int_equal(r.a.n.calibrations, 0);
    assert_true(r.a.zero[0] != AD7712_ZERO_IDEAL);
    assert_int_equal(r.a.full[0], AD7712_FULL_IDEAL);
}

/* With MD 6 and 7 and A0 high the port reads and writes 24 bits of a coefficient of the selected channel, whatever WL says. */
static void coefficients_over_the_port(void **state)
{
    (void)state;
    for (unsigned md = 6; md <= 7; md++) {
        for (unsigned c = 0; c < 2; c++) {
            for (unsigned wl = 0; wl < 2; wl++) {
                struct rig r;
                power_up(&r, &quiet);
                write_control(&r, AD7712_CONTROL(md, 0, c, wl, 0, 19));
                uint32_t *const coef = md == 6 ? r.a.zero : r.a.full;
                assert_int_equal(read_frame(&r, true, 24), coef[c]);
                write_frame(&r, true, 0x345678, 24);
                assert_int_equal(coef[c], 0x345678);
                assert_int_equal(coef[1 - c], md == 6 ? AD7712_ZERO_IDEAL : AD7712_FULL_IDEAL);
                assert_int_equal(read_frame(&r, true, 24), 0x345678);
                assert_int_equal(read_control(&r), AD7712_CONTROL(md, 0, c, wl, 0, 19));
                assert_int_equal(r.a.n.stale_reads + r.a.n.refused + r.a.n.over_reads + breaches(&r), 0);
            }
        }
    }
}

/* Conversions go on in the coefficient modes; a coefficient counts from the next word on; the word is reached in mode 0. */
static void coefficients_count_from_the_next_word_on(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    r.v[0] = 1.0;
    write_control(&r, CAL(7, 19));
    await_fall(&r);
    assert_int_equal(read_frame(&r, true, 24), AD7712_FULL_IDEAL);
    assert_true(r.a.unread && !ad7712_drdy(&r.a)); /* the word still waits */
    write_frame(&r, true, AD7712_FULL_IDEAL / 2, 24);
    near(volts(&r), 1.0, 1e-6);
    await_fall(&r);
    near(volts(&r), 0.5, 1e-6);
    write_control(&r, CAL(0, 19));
    assert_int_equal(read_frame(&r, true, 24), r.a.word);
    assert_true(ad7712_drdy(&r.a));
}

static void a_span_that_does_not_fit_is_counted(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    write_control(&r, CAL(3, 19)); /* full scale with nothing at the pins */
    await_fall(&r);
    assert_int_equal(r.a.full[0], 0xFFFFFF);
    assert_int_equal(r.a.n.cal_clamped, 1);
}

/* 30 seeds: coefficients scatter by the published noise of one word each (5-sigma band of chi2). */
static void calibrations_have_the_noise_of_a_word(void **state)
{
    (void)state;
    enum { SEEDS = 30, RUNS = 10 };
    struct ad7712_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    cfg.cells_max = 1;
    double chi2[2] = {0};
    const double sd = ad7712_noise_v(19, 0) / 2.5 * 4194304;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        struct rig r;
        power_up_seeded(&r, &cfg, seed);
        for (unsigned i = 0; i < RUNS; i++) {
            write_control(&r, CAL(1, 19));
            await_fall(&r);
            const double zero = ((double)r.a.zero[0] - AD7712_ZERO_IDEAL) / sd;
            const double span = (4194304.0 * 4194304.0 / r.a.full[0] - 4194304.0) / sd;
            chi2[0] += zero * zero;
            chi2[1] += (span + zero) * (span + zero); /* span = full - zero */
        }
    }
    for (unsigned i = 0; i < 2; i++) near(chi2[i], SEEDS * RUNS, 5.0 * sqrt(2.0 * SEEDS * RUNS));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(durations),
        cmocka_unit_test(durations_scale_with_the_clock),
        cmocka_unit_test(self_calibration_takes_the_path_away),
        cmocka_unit_test(each_channel_has_its_coefficients),
        cmocka_unit_test(system_calibration_takes_the_pins),
        cmocka_unit_test(system_offset_takes_the_zero_from_the_pins),
        cmocka_unit_test(background_calibration_follows_the_zero),
        cmocka_unit_test(background_words_keep_the_rules_of_drdy),
        cmocka_unit_test(a_write_ends_a_calibration),
        cmocka_unit_test(coefficients_over_the_port),
        cmocka_unit_test(coefficients_count_from_the_next_word_on),
        cmocka_unit_test(a_span_that_does_not_fit_is_counted),
        cmocka_unit_test(calibrations_have_the_noise_of_a_word),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
