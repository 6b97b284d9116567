/* Conversions of the AD7712 in time: rates, settling, DRDY, what restarts the filter (sources 3.2), noise (3.5), inputs (3.6). */
#include "ad7712_rig.h"

#define CODE(md, code) AD7712_CONTROL(md, 0, 0, 1, 0, code)

/* Writes a control word and returns the instant from which on its run counts: the first modulator edge at or after the
 * load, 4 tau after the last fall of SCLK. Modulator edges lie at origin_ns + k 51.2 us. */
static int64_t write_at(struct rig *r, uint32_t word, int64_t origin_ns)
{
    write_control(r, word);
    const int64_t load_ns = r->a.port.fall_ns + 4 * TAU_NS;
    const int64_t edges = (load_ns - origin_ns + MOD_NS - 1) / MOD_NS;
    return origin_ns + edges * MOD_NS;
}

/* Rate = fCLKIN / 512 / code, exactly, for codes of all sizes and clocks; the first word after three periods. */
static void output_rate_by_code_and_clock(void **state)
{
    (void)state;
    static const unsigned codes[] = {19, 20, 33, 50, 326, 1000, 1999, 2000};
    static const uint32_t clocks[] = {10000000, 9830400, 400000, 5000000};
    for (unsigned k = 0; k < COUNT(clocks); k++) {
        for (unsigned i = 0; i < COUNT(codes); i++) {
            struct rig r;
            struct ad7712_cfg cfg = quiet;
            cfg.clkin_hz = clocks[k];
            power_up(&r, &cfg);
            /* At power-up already, so that the grid begins at 0. */
            ad7712_sync_pin(&r.a, false, 0);
            r.a.control = codes[i];
            ad7712_sync_pin(&r.a, true, 0);
            const double period_ns = codes[i] * 512.0 / clocks[k] * 1e9;
            for (unsigned n = 3; n < 8; n++) assert_int_equal(await_fall(&r), (int64_t)floor(n * period_ns + 1e-6));
        }
    }
    near(1e7 / 512 / 19, 1028.0, 0.1);
    near(1e7 / 512 / 2000, 9.77, 0.01);
}

/* A word that is not read: DRDY rises 500 tau before the next, which replaces it. */
static void an_unread_word_pulses_drdy_and_is_an_overrun(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    const int64_t start_ns = write_at(&r, CODE(0, 50), 0);
    for (unsigned i = 0; i < 5; i++) await_fall(&r);
    assert_int_equal(r.drdy.n, 9);
    for (unsigned i = 0; i < 9; i++) {
        const int64_t fall_ns = start_ns + (3 + i / 2) * 50 * MOD_NS;
        assert_int_equal(r.drdy.e[i].level, i % 2);
        assert_int_equal(r.drdy.e[i].t_ns, i % 2 ? fall_ns + 50 * MOD_NS - 50000 : fall_ns);
    }
    assert_int_equal(r.a.n.overruns, 4);
    assert_int_equal(r.a.n.conversions, 5);
}

/* RFS low holds the register: no update comes, and DRDY announces none, if the word is being read 500 tau before. It rises
 * with the last bit, and the next word falls in as ever. RFS at that very instant comes behind it (E0). */
static void drdy_announces_no_update_while_rfs_is_low(void **state)
{
    (void)state;
    for (int64_t late_ns = -1; late_ns <= 1; late_ns++) {
        struct rig r;
        power_up(&r, &quiet);
        write_control(&r, CODE(0, 50));
        const int64_t next_ns = await_fall(&r) + 50 * MOD_NS, announced_ns = next_ns - 500 * TAU_NS;
        wait_until(&r, announced_ns - 1000);
        a0(&r, true);
        wait_until(&r, announced_ns + late_ns);
        const unsigned n = r.drdy.n;
        assert_int_equal(ad7712_drdy(&r.a), late_ns >= 0);
        rfs(&r, false);
        wait_ns(&r, FIRST_NS);
        assert_int_equal(r.drdy.n, n);
        pulses(&r, 24);
        const int64_t last_ns = r.s.now_ns;
        wait_ns(&r, LAST_NS);
        rfs(&r, true);
        assert_int_equal(await_fall(&r), next_ns);
        assert_int_equal(r.drdy.e[r.drdy.n - 2].t_ns, late_ns < 0 ? last_ns + TAU_NS : announced_ns);
        assert_int_equal(r.a.n.lost_words, 0);
        assert_int_equal(r.a.n.stale_reads, late_ns >= 0);
    }
}

static void a_word_that_is_read_pulses_nothing(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    write_control(&r, CODE(0, 50));
    for (unsigned i = 0; i < 5; i++) {
        const int64_t fall_ns = await_fall(&r);
        read_frame(&r, true, 24);
        assert_int_equal(r.drdy.n, 2 * (i + 1));
        /* A0 400, RFS to SCLK 700, 23 periods, high 400, and the rise of DRDY tau after the last fall */
        assert_int_equal(r.drdy.e[2 * i + 1].t_ns, fall_ns + 400 + 700 + 23 * 800 + 400 + TAU_NS);
    }
    assert_int_equal(r.a.n.overruns, 0);
}

/* Three periods after a write of FS, gain or channel; none of WL, B/U, BO, b14, nor the same word again. */
static void what_restarts_the_filter(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t flips;
        bool restarts;
    } rows[] = {
        {"same", 0, false},
        {"WL", AD7712_CTL_WL, false},
        {"B/U", AD7712_CTL_BU, false},
        {"BO", AD7712_CTL_BO, false},
        {"b14", AD7712_CTL_B14, false},
        {"MD 6", 0xC00000, false},
        {"MD 7", 0xE00000, false},
        {"G0", 0x040000, true},
        {"G2", 0x100000, true},
        {"CH", AD7712_CTL_CH, true},
        {"FS", 1, true},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        power_up(&r, &quiet);
        const int64_t origin_ns = write_at(&r, CODE(0, 100), 0);
        await_fall(&r);
        const int64_t next_ns = await_fall(&r) + 100 * MOD_NS;
        const int64_t start_ns = write_at(&r, CODE(0, 100) ^ rows[i].flips, origin_ns);
        const int64_t period_ns = (rows[i].flips & 1 ? 101 : 100) * MOD_NS;
        const int64_t want_ns = rows[i].restarts ? start_ns + 3 * period_ns : next_ns;
        const int64_t got_ns = await_fall(&r);
        if (got_ns != want_ns) fail_msg("%s: %lld, not %lld", rows[i].name, (long long)got_ns, (long long)want_ns);
        assert_int_equal(r.a.n.restarts, rows[i].restarts ? 3 : 2);
    }
}

/* After a write that restarts DRDY goes high at the next modulator edge: at most 512 tau after the load. */
static void drdy_rises_within_a_modulator_period_of_the_write(void **state)
{
    (void)state;
    for (int64_t late_ns = 0; late_ns < 60000; late_ns += 3700) {
        struct rig r;
        power_up(&r, &quiet);
        const int64_t origin_ns = write_at(&r, CODE(0, 200), 0);
        await_fall(&r);
        wait_ns(&r, late_ns);
        const int64_t start_ns = write_at(&r, CODE(1, 200), origin_ns);
        const int64_t load_ns = r.a.port.fall_ns + 400;
        wait_until(&r, load_ns);
        wait_until(&r, start_ns);
        assert_int_equal(r.drdy.n, 2);
        assert_true(r.drdy.e[1].level);
        assert_int_equal(r.drdy.e[1].t_ns, start_ns);
        assert_true(start_ns >= load_ns && start_ns - load_ns < MOD_NS);
    }
}

/* A load at the very edge of the modulator's clock acts there and then. */
static void a_write_that_loads_at_an_edge_acts_there(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    const int64_t origin_ns = write_at(&r, CODE(0, 50), 0);
    await_fall(&r);
    const int64_t frame_ns = A0_NS + 24 * SCLK_NS + 4 * TAU_NS; /* until the load */
    const int64_t edge_ns = origin_ns + 500 * MOD_NS;
    wait_until(&r, edge_ns - frame_ns);
    write_control(&r, CODE(0, 51));
    assert_int_equal(r.a.port.fall_ns + 4 * TAU_NS, edge_ns);
    assert_int_equal(await_fall(&r), edge_ns + 3 * 51 * MOD_NS);
}

/* A conversion that would end at the very edge at which the filter is reset never is. */
static void a_conversion_that_ends_with_the_reset_is_none(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    const int64_t start_ns = write_at(&r, CODE(0, 19), 0);
    const int64_t ready_ns = start_ns + 3 * 19 * MOD_NS;
    wait_until(&r, ready_ns - 40000);
    assert_int_equal(write_at(&r, CODE(0, 20), start_ns), ready_ns);
    wait_until(&r, ready_ns);
    assert_int_equal(r.drdy.n, 0);
    assert_int_equal(await_fall(&r), ready_ns + 3 * 20 * MOD_NS);
    assert_int_equal(r.a.n.conversions, 1);
}

/* A step between two outputs is whole in the fourth, one at an output in the third. */
static void a_step_settles_in_three_or_four_outputs(void **state)
{
    (void)state;
    for (unsigned inside = 0; inside < 2; inside++) {
        struct rig r;
        power_up(&r, &quiet);
        write_control(&r, CODE(0, 39));
        for (unsigned i = 0; i < 3; i++) await_fall(&r);
        if (inside) wait_ns(&r, 1000000);
        ad7712_sample_until(&r.a, r.s.now_ns);
        r.v[0] = 1.25;
        for (unsigned i = 1; i < 6; i++) {
            await_fall(&r);
            const bool settled = i >= 3 + inside;
            if ((r.a.word == 0xC00000) != settled) fail_msg("output %u: %06X", i, r.a.word);
        }
    }
}

/* A channel that changes without restart, as cfg.free_settling has it: three mixtures or four, DRDY goes on. */
static void free_settling_mixes_the_channels(void **state)
{
    (void)state;
    struct rig r;
    struct ad7712_cfg cfg = quiet;
    cfg.free_settling = true;
    power_up(&r, &cfg);
    r.v[1] = 5.0;
    write_control(&r, CODE(0, 39));
    await_fall(&r);
    const int64_t fall_ns = await_fall(&r);
    wait_ns(&r, 500000);
    write_control(&r, CODE(0, 39) | AD7712_CTL_CH);
    uint32_t was = 0x800000;
    for (unsigned i = 1; i <= 4; i++) {
        assert_int_equal(await_fall(&r), fall_ns + (int64_t)i * 39 * MOD_NS);
        assert_true(r.a.word > was && (r.a.word == 0xC00000) == (i == 4));
        was = r.a.word;
    }
    assert_int_equal(r.a.n.restarts, 2);
    write_control(&r, CODE(0, 39) | AD7712_CTL_CH | 0x040000); /* gain 2 */
    for (unsigned i = 0; i < 4; i++) await_fall(&r);
    assert_int_equal(r.a.word, 0xFFFFFF);
}

/* One cell after another, each looked at in its middle, on the modulator's grid, late and in order. */
static void the_input_is_looked_at_in_the_middle_of_cells(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    const int64_t start_ns = write_at(&r, CODE(0, 19), 0);
    wait_until(&r, start_ns);
    r.looks = 0;
    await_fall(&r);
    assert_int_equal(r.looks, 12);
    for (unsigned i = 0; i < 12; i++) assert_int_equal(r.look_ns[i], start_ns + 121600 + i * 243200);
    wait_ns(&r, 500000);
    assert_int_equal(r.looks, 12); /* no one asked */
    ad7712_sample_until(&r.a, r.s.now_ns);
    assert_int_equal(r.looks, 14);
    ad7712_sample_until(&r.a, r.s.now_ns);
    assert_int_equal(r.looks, 14);
}

static double tone_hz, tone_ns;

static double tone(int64_t t_ns)
{
    return 1.0 * sin(6.283185307179586 * tone_hz * (double)(t_ns - (int64_t)tone_ns) * 1e-9);
}

/* rms of the words of a tone, against the sinc3's |H|; at the notches nothing. */
static void a_tone_comes_out_as_the_sinc3_says(void **state)
{
    (void)state;
    static const double relative[] = {0.013, 0.1, 0.2619, 0.45, 1.0, 2.0, 3.0, 1.3};
    for (unsigned i = 0; i < COUNT(relative); i++) {
        struct rig r;
        power_up(&r, &quiet);
        write_control(&r, CODE(0, 50));
        r.signal = tone;
        const double rate_hz = 1e7 / 512 / 50;
        tone_hz = relative[i] * rate_hz;
        for (unsigned k = 0; k < 4; k++) await_fall(&r);
        double sum2 = 0.0;
        const unsigned n = 2000;
        for (unsigned k = 0; k < n; k++) {
            await_fall(&r);
            const double v = (r.a.word / 8388608.0 - 1.0) * 2.5;
            sum2 += v * v;
            r.drdy.n = 0;
        }
        const double x = 3.14159265358979323846 * relative[i], below = 50.0 * sin(x / 50.0);
        const double h = pow(fabs(sin(x) / below), 3.0);
        near(sqrt(2.0 * sum2 / n), h, 0.004 * h + 2e-6);
    }
}

/* Delay at DC: one and a half periods. A ramp shows it. */
static double ramp(int64_t t_ns)
{
    return 2.0 * (double)(t_ns - 50000000) * 1e-9; /* V/s */
}

static void the_delay_is_one_and_a_half_periods(void **state)
{
    (void)state;
    static const uint8_t cells[] = {1, 2, 4, 0};
    for (unsigned i = 0; i < COUNT(cells); i++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.cells_max = cells[i];
        power_up(&r, &cfg);
        r.signal = ramp;
        write_control(&r, CODE(0, 100));
        for (unsigned k = 0; k < 6; k++) {
            const int64_t t_ns = await_fall(&r);
            const double v = (r.a.word / 8388608.0 - 1.0) * 2.5;
            near(v, ramp(t_ns - 150 * MOD_NS), 3e-7);
        }
    }
}

/* Sample variance over 30 seeds of 20 words, each row and gain of sources 3.5: 600 degrees of freedom, 5-sigma band. */
static void noise_has_the_published_rms(void **state)
{
    (void)state;
    enum { SEEDS = 30, WORDS = 20 };
    static const unsigned codes[] = {1953, 781, 651, 391, 326, 195, 78, 39, 20};
    struct ad7712_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    cfg.cells_max = 1;
    for (unsigned row = 0; row < COUNT(codes); row++) {
        for (unsigned g = 0; g < 8; g++) {
            const double rms_v = ad7712_noise_v(codes[row], g);
            const double lsb_v = 2.5 / 8388608.0 / (1 << g);
            double chi2 = 0.0;
            for (uint64_t seed = 1; seed <= SEEDS; seed++) {
                struct rig r;
                power_up_seeded(&r, &cfg, seed * 1000 + row * 8 + g);
                write_control(&r, AD7712_CONTROL(0, g, 0, 1, 0, codes[row]));
                for (unsigned k = 0; k < WORDS; k++) {
                    await_fall(&r);
                    const double v = ((double)r.a.word - 8388608.0) * lsb_v;
                    chi2 += v * v / (rms_v * rms_v + lsb_v * lsb_v / 12.0);
                }
            }
            const double n = SEEDS * WORDS;
            if (fabs(chi2 - n) > 5.0 * sqrt(2.0 * n))
                fail_msg("code %u, gain %u: %g of %g", codes[row], 1u << g, chi2, n);
        }
    }
}

/* On AIN2 of the AD7712 four times as many volts; noise_scale scales, 0 is none. */
static void noise_of_ain2_and_its_scale(void **state)
{
    (void)state;
    static const struct {
        unsigned channel;
        double scale, full_v, rms_v;
    } rows[] = {{0, 1.0, 2.5, 5.28e-6}, {1, 1.0, 10.0, 21.12e-6}, {0, 3.0, 2.5, 15.84e-6}, {1, 0.0, 10.0, 0.0}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.noise_scale = rows[i].scale;
        cfg.cells_max = 1;
        power_up(&r, &cfg);
        write_control(&r, AD7712_CONTROL(0, 0, rows[i].channel, 1, 0, 325));
        double sum2 = 0.0;
        for (unsigned k = 0; k < 2000; k++) {
            await_fall(&r);
            r.drdy.n = 0;
            const double v = (r.a.word / 8388608.0 - 1.0) * rows[i].full_v;
            sum2 += v * v;
        }
        near(sqrt(sum2 / 2000), rows[i].rms_v, 0.08 * rows[i].rms_v + 1e-12);
    }
}

/* fCLKIN/256 at gain 1, twice at 2, four times at 4, eight times from 8 on. */
static void input_sampling_rate_by_gain(void **state)
{
    (void)state;
    static const unsigned times[] = {1, 2, 4, 8, 8, 8, 8, 8};
    for (unsigned g = 0; g < 8; g++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.clkin_hz = 5120000;
        power_up(&r, &cfg);
        write_control(&r, AD7712_CONTROL(0, g, 0, 1, 0, 100));
        assert_int_equal(ad7712_sampling_hz(&r.a), 20000 * times[g]);
    }
}

/* Printed resistances that cost no more than 16 or 20 bits, without external capacitor, at gain 1, 2, 4 and 8. */
static void source_resistances_cost_what_is_printed(void **state)
{
    (void)state;
    static const struct {
        double ohm[4], bit;
    } rows[] = {{{184e3, 88.6e3, 41.4e3, 17.6e3}, 1.0 / 65536}, {{145e3, 70.5e3, 31.8e3, 13.4e3}, 1.0 / 1048576}};
    for (unsigned k = 0; k < 2; k++) {
        for (unsigned g = 0; g < 4; g++) {
            struct rig r;
            power_up(&r, &quiet);
            r.v[0] = 1.0 / (1 << g);
            r.ohm[0] = rows[k].ohm[g];
            write_control(&r, AD7712_CONTROL(0, g, 0, 1, 0, 19));
            await_fall(&r);
            const double error = 1.0 - (r.a.word / 8388608.0 - 1.0) * 2.5;
            if (error > 3.0 * rows[k].bit || error < 0.6 * rows[k].bit)
                fail_msg("gain %u: %g bits", 1u << g, error / rows[k].bit);
        }
    }
}

static void ain2_loads_its_source_with_44_kohm(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    r.v[1] = 8.0;
    r.ohm[1] = 44e3;
    write_control(&r, AD7712_CONTROL(0, 0, 1, 1, 0, 19));
    await_fall(&r);
    near(r.a.word, 8388608 * 1.4, 1);
    r.ohm[1] = INFINITY;
    for (unsigned i = 0; i < 4; i++) await_fall(&r);
    assert_int_equal(r.a.word, 0x800000);
}

/* 4.5 uA through the source; an open input runs to the end. On AIN2 of the AD7712 there is none. */
static void burn_out_current(void **state)
{
    (void)state;
    static const struct {
        unsigned channel;
        double ohm;
        bool on;
        uint32_t word;
    } rows[] = {
        {0, 10e3, false, 0x800000},    {0, 10e3, true, 0x800000 + 150995}, {0, INFINITY, false, 0x800000},
        {0, INFINITY, true, 0xFFFFFF}, {0, 0.0, true, 0x800000},           {1, 10e3, true, 0x800000},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        power_up(&r, &quiet);
        r.ohm[rows[i].channel] = rows[i].ohm;
        write_control(&r, AD7712_CONTROL(0, 0, rows[i].channel, 1, 0, 19) | (rows[i].on ? AD7712_CTL_BO : 0));
        await_fall(&r);
        near(r.a.word, rows[i].word, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(output_rate_by_code_and_clock),
        cmocka_unit_test(an_unread_word_pulses_drdy_and_is_an_overrun),
        cmocka_unit_test(drdy_announces_no_update_while_rfs_is_low),
        cmocka_unit_test(a_word_that_is_read_pulses_nothing),
        cmocka_unit_test(what_restarts_the_filter),
        cmocka_unit_test(drdy_rises_within_a_modulator_period_of_the_write),
        cmocka_unit_test(a_write_that_loads_at_an_edge_acts_there),
        cmocka_unit_test(a_conversion_that_ends_with_the_reset_is_none),
        cmocka_unit_test(a_step_settles_in_three_or_four_outputs),
        cmocka_unit_test(free_settling_mixes_the_channels),
        cmocka_unit_test(the_input_is_looked_at_in_the_middle_of_cells),
        cmocka_unit_test(a_tone_comes_out_as_the_sinc3_says),
        cmocka_unit_test(the_delay_is_one_and_a_half_periods),
        cmocka_unit_test(noise_has_the_published_rms),
        cmocka_unit_test(noise_of_ain2_and_its_scale),
        cmocka_unit_test(input_sampling_rate_by_gain),
        cmocka_unit_test(source_resistances_cost_what_is_printed),
        cmocka_unit_test(ain2_loads_its_source_with_44_kohm),
        cmocka_unit_test(burn_out_current),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
