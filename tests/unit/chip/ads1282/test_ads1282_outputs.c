/* ADS1281/ADS1282 beside plain FIR words: sinc only, modulator output, high-pass (sources 1.1, 1.6, 1.8). */
#include "ads1282_rig.h"

#include "base/bits.h"

/* ---- Sinc only ---- */

/* Sources 1.6 (M60) and 1.8; the data period is 4 N tCLK. */
static const struct {
    uint8_t dr;
    unsigned n;
    int64_t settle_tclk;
    int hz;
} sinc_rates[] = {
    {0, 128, 2824, 8000}, {1, 64, 1672, 16000}, {2, 32, 968, 32000}, {3, 16, 616, 64000}, {4, 8, 440, 128000}};

static void sinc_words_come_after_their_settling_time_then_every_4n_tclk(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_rates); k++) {
        for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.chain = (enum ads1282_chain)chain;
            powered(&r, &cfg);
            wreg(&r, 1, (uint8_t)(0x41 | sinc_rates[k].dr << 3));
            int64_t from = r.tclk;
            for (int sync = 0; sync < 2; sync++) {
                for (int m = 0; m < 40; m++)
                    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + sinc_rates[k].settle_tclk +
                                                                          m * 4 * (int64_t)sinc_rates[k].n));
                from = r.tclk + 5;
                ads1282_sync_pin(&r.a, false, r.s.now_ns);
                ads1282_sync_pin(&r.a, true, at_tclk(&r, from));
                assert_true(ads1282_drdy(&r.a));
            }
            assert_int_equal(ads1282_settle_ns(&r.a), clk_edge_ns(&r.clk, sinc_rates[k].settle_tclk));
            assert_int_equal(ads1282_period_ns(&r.a), NS_PER_S / sinc_rates[k].hz);
        }
    }
}

/* Sources 1.7: right-justified, half scale, not clipped; up to where the modulator saturates. */
static const struct {
    double fs;
    uint32_t word;
} sinc_words[] = {
    {0.0, 0x00000000},   {0x1p-30, 0x00000001},       {-0x1p-30, 0xFFFFFFFF}, {1.0 - 0x1p-30, 0x3FFFFFFF},
    {-1.0, 0xC0000000},  {1.0 + 0x1p-30, 0x40000001}, {0.5, 0x20000000},      {1.05, 0x43333333},
    {-1.05, 0xBCCCCCCD}, {2.0, 0x43D70A3D},           {-2.0, 0xBC28F5C3},
};

static void sinc_words_are_right_justified_and_not_clipped(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_words); k++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = 2.5 * sinc_words[k].fs;
        wreg(&r, ADS1282_OFC1, 0x12); /* OFC and FSC stand behind the FIR */
        wreg(&r, ADS1282_FSC2, 0x20);
        wreg(&r, 1, 0x41);
        to_fall(&r);
        r.gap_tclk = 4;
        hex_is(read_bytes(&r, 4), sinc_words[k].word);
        assert_int_equal(r.a.count.clipped, 0);
    }
}

/* A step between two blocks runs through the sinc: with everything before it 0, word m is its step response after m + 1
 * blocks, whole after five. */
static void a_step_passes_the_sinc_in_five_words(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(sinc_rates); k++) {
        struct rig r;
        powered(&r, &quiet);
        wreg(&r, 1, (uint8_t)(0x41 | sinc_rates[k].dr << 3));
        for (int i = 0; i < 10; i++) to_fall(&r);
        const int64_t step = 4 * (int64_t)sinc_rates[k].n;
        const int64_t latency = 264 % step; /* words come 264 tCLK behind their last block */
        at_tclk(&r, r.tclk + step - latency);
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = 1.25;
        const int32_t *const tap = r.a.filter.sinc_tap;
        int64_t sum = 0;
        const double n4 = pow(sinc_rates[k].n, 4);
        for (int m = -1 - (int)(264 / step); m < 8; m++) {
            to_fall(&r);
            if (m >= 0 && m < ADS1282_SINC_TAPS) sum += tap[m];
            hex_is((uint32_t)(r.a.out >> 32), (uint32_t)llround(0x1p29 * (double)sum / n4));
        }
        near((double)sum, n4, 0.0);
    }
}

/* ---- Modulator output ---- */

struct bits {
    struct rig r;
    uint8_t m0[4096], m1[4096];
    int64_t first_ns, last_ns;
    unsigned n;
};

static void on_bits(void *ctx, bool m0, bool m1, int64_t t_ns)
{
    struct bits *b = ctx; /* r is its first member */
    assert_int_equal(t_ns, b->r.s.now_ns);
    if (b->n == 0) b->first_ns = t_ns;
    b->last_ns = t_ns;
    if (b->n < sizeof b->m0) {
        b->m0[b->n] = m0;
        b->m1[b->n] = m1;
    }
    b->n++;
}

static void modulator_bits_come_each_4_tclk_and_without_drdy(void **state)
{
    (void)state;
    for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        struct ads1282_cfg cfg = quiet;
        cfg.chain = (enum ads1282_chain)chain;
        wired(&b.r, &cfg, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        b.r.v = 0.5;
        to_fall(&b.r);
        assert_int_equal(b.n, 0); /* M0, M1 rest in the other modes */
        wreg(&b.r, 1, 0x50);
        const int64_t from = b.r.tclk;
        b.r.falls = 0;
        at_tclk(&b.r, from + 4 * 4000);
        assert_int_equal(b.n, 4000);
        assert_int_equal(b.first_ns, clk_edge_ns(&b.r.clk, from + 4));
        assert_int_equal(b.last_ns, clk_edge_ns(&b.r.clk, from + 4 * 4000));
        assert_int_equal(b.r.falls, 0);
        assert_true(ads1282_drdy(&b.r.a));
        assert_true(b.r.a.running);
        assert_int_equal(ads1282_period_ns(&b.r.a), 0);
    }
}

/* The published formula, here in its own words: y[n] = 3 M0[n-2] - 6 M0[n-3] + 4 M0[n-4] + 9 (M1[n] - 2 M1[n-1] + M1[n-2]). */
static double decoded(const struct bits *b, unsigned n)
{
    double m0[5];
    double m1[5];
    for (unsigned i = 0; i < 5; i++) {
        m0[i] = b->m0[n - i] ? 1.0 : -1.0;
        m1[i] = b->m1[n - i] ? 1.0 : -1.0;
    }
    return 3 * m0[2] - 6 * m0[3] + 4 * m0[4] + 9 * (m1[0] - 2 * m1[1] + m1[2]);
}

/* Four running means of 64 leave only the input: full scale represents 4/5 of the bits' range. */
static void the_published_formula_recovers_the_input_from_the_bits(void **state)
{
    (void)state;
    static const double volts[] = {0.0, 1.0, -1.0, 2.4, -2.5, 2.6};
    for (unsigned k = 0; k < COUNT(volts); k++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        b.r.v = volts[k];
        wreg(&b.r, 1, 0x50);
        at_tclk(&b.r, b.r.tclk + 4 * 4096);
        static double y[4096];
        for (unsigned n = 0; n < 4096; n++) y[n] = n < 5 ? 0.0 : decoded(&b, n);
        for (int stage = 0; stage < 5; stage++)
            for (unsigned n = 4095; n >= 63; n--) {
                double sum = 0.0;
                for (unsigned i = 0; i < 64; i++) sum += y[n - i];
                y[n] = sum / 64.0;
            }
        near(1.25 * 2.5 * y[4095], volts[k], 2e-5);
    }
}

/* The rate is the filter's: reserved codes of it do not stop the modulator. */
static void modulator_output_needs_no_rate(void **state)
{
    (void)state;
    for (unsigned dr = 0; dr < 8; dr++) {
        static struct bits b;
        memset(&b, 0, sizeof b);
        wired(&b.r, &quiet, 1, (struct ads1282_io){.modulator = on_bits});
        ads1282_power_up(&b.r.a, 0);
        wreg(&b.r, 1, (uint8_t)(0x40 | dr << 3));
        at_tclk(&b.r, b.r.tclk + 400);
        assert_int_equal(b.n, 100);
        assert_int_equal(b.r.a.count.refused, 0);
    }
}

static void nobody_looking_no_bits_are_computed(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, 1, 0x50);
    const unsigned samples = r.samples;
    at_tclk(&r, r.tclk + 1000000);
    assert_int_equal(r.samples, samples);
    wreg(&r, 1, 0x52); /* and the converter comes back */
    const int64_t edge = r.tclk;
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
}

/* ---- High-pass at the chip ---- */

/* Sources 1.7: a unit at its reset value (E2E 146898) gave 147410, 145582, 143770, 141990 in a row: mean ratio 0.98759. */
static void the_high_pass_at_reset_decays_like_the_measured_unit(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0x53);
    const double first = fraction((to_fall(&r), read_bytes(&r, 4)));
    double before = first;
    for (int i = 0; i < 3; i++) {
        const double word = fraction((to_fall(&r), read_bytes(&r, 4)));
        near(word / before, 0.987596, 1e-6);
        before = word;
    }
    near(pow(before / first, 1.0 / 3.0), pow(141990.0 / 147410.0, 1.0 / 3.0), 1e-4);
    for (int i = 0; i < 2000; i++) to_fall(&r);
    hex_is(read_bytes(&r, 4), 0); /* no DC, no limit cycle */
}

static void a_new_high_pass_coefficient_acts_at_once_and_a_restart_forgets(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0x53);
    to_fall(&r);
    double before = fraction(read_bytes(&r, 4));
    SEND(&r, 0x43, 0x01, 0x00, 0x40); /* a = 1/4: b = (1 + 9/16)/2 */
    for (int i = 0; i < 3; i++) {
        const double word = fraction((to_fall(&r), read_bytes(&r, 4)));
        near(word / before, 25.0 / 32.0, 1e-7);
        before = word;
    }
    assert_int_equal(r.a.count.restarts, 1);
    SEND(&r, 0x43, 0x01, 0x00, 0x00); /* a = 0: what is left stays */
    to_fall(&r);
    near(fraction(read_bytes(&r, 4)), before, 1e-9);
    ads1282_sync_pin(&r.a, true, r.s.now_ns);
    to_fall(&r);
    near(fraction(read_bytes(&r, 4)), 0.4 * 1.0000287, 1e-6); /* all of the step since the restart */
}

/* Through the high-pass the first words after a restart depend on all that came before them. */
static void a_restart_forgets_everything_in_every_chain(void **state)
{
    (void)state;
    for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.chain = (enum ads1282_chain)chain;
        powered(&r, &cfg);
        r.v = 1.7;
        wreg(&r, 1, 0x63);
        uint32_t word[2][20];
        for (int again = 0; again < 2; again++) {
            for (unsigned i = 0; i < COUNT(word[0]); i++) {
                to_fall(&r);
                word[again][i] = read_bytes(&r, 4);
            }
            ads1282_sync_pin(&r.a, true, r.s.now_ns);
        }
        assert_memory_equal(word[0], word[1], sizeof word[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sinc_words_come_after_their_settling_time_then_every_4n_tclk),
        cmocka_unit_test(sinc_words_are_right_justified_and_not_clipped),
        cmocka_unit_test(a_step_passes_the_sinc_in_five_words),
        cmocka_unit_test(modulator_bits_come_each_4_tclk_and_without_drdy),
        cmocka_unit_test(the_published_formula_recovers_the_input_from_the_bits),
        cmocka_unit_test(modulator_output_needs_no_rate),
        cmocka_unit_test(nobody_looking_no_bits_are_computed),
        cmocka_unit_test(the_high_pass_at_reset_decays_like_the_measured_unit),
        cmocka_unit_test(a_new_high_pass_coefficient_acts_at_once_and_a_restart_forgets),
        cmocka_unit_test(a_restart_forgets_everything_in_every_chain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
