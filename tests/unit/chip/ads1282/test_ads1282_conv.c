/* ADS1281/ADS1282: settling, data rate, codes and noise (sources 1.6, 1.7, 1.9). */
#include "ads1282_rig.h"

/* ---- Settling and data rate ---- */

static const struct {
    uint8_t dr;
    int64_t t_dr_tclk, period_tclk; /* sources 1.6 and 1.8 */
    uint32_t data_hz;
} rates[] = {
    {0, 1032340, 16384, 250}, {1, 516404, 8192, 500}, {2, 258436, 4096, 1000},
    {3, 129452, 2048, 2000},  {4, 64960, 1024, 4000},
};

static uint8_t config0_of(uint8_t dr, unsigned phase)
{
    return (uint8_t)(0x42u | (unsigned)dr << 3 | phase << 2);
}

static void first_fall_comes_t_dr_after_sync_then_every_period(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(rates); k++) {
        for (unsigned phase = 0; phase < 2; phase++) {
            struct rig r;
            powered(&r, &quiet);
            to_fall(&r);
            wreg(&r, 1, config0_of(rates[k].dr, phase));
            const bool same = config0_of(rates[k].dr, phase) == 0x52;
            const int64_t from = same ? 0 : r.tclk;
            for (int m = same; m < 3; m++)
                assert_int_equal(to_fall(&r),
                                 clk_edge_ns(&r.clk, from + rates[k].t_dr_tclk + m * rates[k].period_tclk));
            assert_int_equal(ads1282_settle_ns(&r.a), clk_edge_ns(&r.clk, rates[k].t_dr_tclk));
            assert_int_equal(ads1282_period_ns(&r.a), NS_PER_S / rates[k].data_hz);
        }
    }
}

enum cause { POWER, RESET_PIN, RESET_OPCODE, SYNC_PIN, SYNC_OPCODE };

static void cause_restart(struct rig *r, enum cause cause, int64_t t_ns)
{
    if (cause == POWER) ads1282_power_up(&r->a, t_ns);
    if (cause == RESET_PIN) {
        ads1282_reset_pin(&r->a, false, t_ns - 1000);
        ads1282_reset_pin(&r->a, true, t_ns);
    }
    if (cause == RESET_OPCODE) spi_byte(&r->a.spi, 0x06, t_ns);
    if (cause == SYNC_OPCODE) spi_byte(&r->a.spi, 0x04, t_ns);
    if (cause == SYNC_PIN) {
        ads1282_sync_pin(&r->a, true, t_ns);
        ads1282_sync_pin(&r->a, false, t_ns + 1000);
    }
}

/* A cause between two CLK edges acts at the later one. */
static void every_cause_of_a_restart_settles_in_t_dr(void **state)
{
    (void)state;
    for (int cause = POWER; cause <= SYNC_OPCODE; cause++) {
        for (int64_t t_ns = 70000000; t_ns < 70000500; t_ns += 61) {
            struct rig r;
            powered(&r, &quiet);
            sched_run_until(&r.s, t_ns);
            assert_int_equal(r.falls, 7);
            cause_restart(&r, (enum cause)cause, t_ns);
            assert_true(ads1282_drdy(&r.a));
            const int64_t edge = clk_count_at(&r.clk, t_ns);
            assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
        }
    }
}

static void conversions_stay_on_the_clock_for_an_hour(void **state)
{
    (void)state;
    static const uint32_t hz[] = {4096000, 4095999, 1000000, 3333333};
    for (unsigned k = 0; k < COUNT(hz); k++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.clk_hz = hz[k];
        unpowered(&r, &cfg, 1);
        const int64_t start_ns = INT64_C(3600) * NS_PER_S + 17;
        sched_run_until(&r.s, start_ns);
        ads1282_power_up(&r.a, start_ns);
        const int64_t edge = clk_count_at(&r.clk, start_ns);
        for (int64_t m = 0; m < 500; m++)
            assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000 + 4096 * m));
        assert_int_equal(r.a.count.conversions, 500);
        assert_int_equal(ads1282_period_ns(&r.a), 4096 * NS_PER_S / hz[k]);
    }
}

static void blocks_are_sampled_at_their_middles(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    to_fall(&r);
    assert_int_equal(r.first_sample_ns,
                     clk_edge_ns(&r.clk, 48 + 64)); /* the first block begins 1.5 N after the restart */
    const unsigned taken = r.samples;
    const int64_t last_ns = r.last_sample_ns;
    to_fall(&r);
    assert_int_equal(r.samples - taken, 32);
    assert_int_equal(r.last_sample_ns - last_ns, 1000000);
    /* The newest block of a word has its middle 468 + 64 tCLK before DRDY falls; four of the next follow it. */
    assert_int_equal(r.last_sample_ns, clk_edge_ns(&r.clk, T_DR_1000 + 4096 - (468 + 64 - 4 * 128)));
}

static void an_abrupt_change_of_input_can_be_placed_exactly(void **state)
{
    (void)state;
    uint32_t word[2][8];
    for (int early = 0; early < 2; early++) {
        struct rig r;
        powered(&r, &quiet);
        for (int i = 0; i < 3; i++) to_fall(&r);
        sched_run_until(&r.s, r.s.now_ns + 400000);
        if (early) ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = 1.0;
        for (int i = 0; i < 8; i++) {
            to_fall(&r);
            word[early][i] = read_bytes(&r, 4);
        }
    }
    assert_int_not_equal(word[0][2], word[1][2]);
    struct rig r; /* the same step as a function of time */
    powered(&r, &quiet);
    for (int i = 0; i < 3; i++) to_fall(&r);
    const unsigned before = r.samples;
    for (int i = 0; i < 40; i++) { /* walk in steps far below a block, so that nothing is sampled late */
        sched_run_until(&r.s, r.s.now_ns + 10000);
        ads1282_sample_until(&r.a, r.s.now_ns);
    }
    assert_in_range(r.samples - before, 12, 13);
    r.v = 1.0;
    for (int i = 0; i < 8; i++) {
        to_fall(&r);
        hex_is(read_bytes(&r, 4), word[1][i]);
    }
}

/* ---- Codes ---- */

#define DC_LINEAR 1.0000287402267158 /* DC gain of the integer taps, sources 1.8 */

static const struct {
    enum ads1282_part part;
    double vref_v;
    uint8_t config1;
    double v, want; /* fraction of full scale; +-2: clipped */
    const char *what;
} codes[] = {
    {ADS1282_PART_1282, 5.0, 0x08, 0.0, 0.0, "zero"},
    {ADS1282_PART_1282, 5.0, 0x08, 1.25, 0.5, "half of full scale"},
    {ADS1282_PART_1282, 5.0, 0x08, -1.25, -0.5, "minus half"},
    {ADS1282_PART_1282, 5.0, 0x08, 2.4999, 2.4999 / 2.5, "just inside"},
    {ADS1282_PART_1282, 5.0, 0x08, 2.5, 2, "full scale: the taps' DC gain is 29 ppm above 1"},
    {ADS1282_PART_1282, 5.0, 0x08, -2.5, -2, "minus full scale"},
    {ADS1282_PART_1282, 5.0, 0x08, 100.0, 2, "far above"},
    {ADS1282_PART_1282, 5.0, 0x08, NAN, 2, "a fault of the analog model saturates"},
    {ADS1282_PART_1282, 5.0, 0x09, 1.0, 0.8, "gain 2: 1.25 V of full scale"},
    {ADS1282_PART_1282, 5.0, 0x0A, 0.1, 0.16, "gain 4"},
    {ADS1282_PART_1282, 5.0, 0x0B, 0.1, 0.32, "gain 8"},
    {ADS1282_PART_1282, 5.0, 0x0C, 0.1, 0.64, "gain 16"},
    {ADS1282_PART_1282, 5.0, 0x0D, 0.05, 0.64, "gain 32"},
    {ADS1282_PART_1282, 5.0, 0x0E, -0.02, -0.512, "gain 64"},
    {ADS1282_PART_1282, 5.0, 0x0F, -0.02, -0.512, "reserved gain 111 acts as 64"},
    {ADS1282_PART_1282, 2.5, 0x08, 0.5, 0.4, "reference 2.5 V"},
    {ADS1282_PART_1282, 5.0, 0x28, 1.0, 0.0, "inputs shorted inside"},
    {ADS1282_PART_1282, 5.0, 0x58, 1.0, 0.0, "reserved input 101 reads 0 V"},
    {ADS1282_PART_1282, 5.0, 0x78, 1.0, 0.0, "reserved input 111 too"},
    {ADS1282_PART_1282, 5.0, 0x18, 1.0, 0.4, "AIN2"},
    {ADS1282_PART_1281, 2.5, 0x08, 0.5, 0.4, "ADS1281"},
    {ADS1282_PART_1281, 2.5, 0xAF, 0.5, 0.4, "ADS1281: CONFIG1 is a plain byte"},
};

static void codes_follow_reference_gain_and_multiplexer(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(codes); k++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.part = codes[k].part;
        cfg.vref_v = codes[k].vref_v;
        powered(&r, &cfg);
        r.v = codes[k].v;
        wreg(&r, 2, codes[k].config1);
        const uint32_t word = settled_word(&r);
        const uint32_t clip = codes[k].want > 1.0 ? 0x7FFFFFFF : 0x80000000;
        const bool ok = fabs(codes[k].want) > 1.0 ? word == clip && r.a.count.clipped > 0
                                                  : fabs(fraction(word) - DC_LINEAR * codes[k].want) < 4e-9;
        if (!ok) fail_msg("%s: word %08X", codes[k].what, (unsigned)word);
        const unsigned mux = codes[k].config1 >> 4;
        const bool asked = codes[k].part == ADS1282_PART_1282 && mux != 2 && mux < 5;
        assert_int_equal(r.asked_mux, asked ? mux : 0);
    }
}

static void the_modulator_saturates_at_106_percent(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, ADS1282_FSC2, 0x20); /* gain 1/2 shows what lies beyond full scale */
    r.v = 2.6;
    near(fraction(settled_word(&r)), DC_LINEAR * 0.52, 4e-9);
    r.v = 2.7;
    near(fraction(settled_word(&r)), DC_LINEAR * 0.53, 4e-9);
    r.v = -3.0;
    near(fraction(settled_word(&r)), DC_LINEAR * -0.53, 4e-9);
    assert_int_equal(r.a.count.clipped, 0);
}

static void ofc_and_fsc_act_at_once(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    to_fall(&r);
    wreg(&r, ADS1282_OFC0, 0x01);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), 0xFFFFFF01);
    SEND(&r, 0x45, 0x02, 0xFF, 0xFF, 0xFF);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), 0x00000100);
    SEND(&r, 0x4A, 0x00, 0x80);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), 0x00000200);
    SEND(&r, 0x47, 0x00, 0x7F);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), 0x80000000);
    assert_int_equal(r.a.count.restarts, 0);
    assert_int_equal(r.a.count.clipped, 1);
}

static void gain_changes_without_a_restart_and_settles_in_63_words(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 0.5;
    const uint32_t before = settled_word(&r);
    const int64_t from_ns = r.fall_ns;
    wreg(&r, 2, 0x09);
    for (int i = 1; i <= 63; i++) assert_int_equal(to_fall(&r), from_ns + i * 1000000);
    const uint32_t last = read_bytes(&r, 4);
    near(fraction(last), 2.0 * fraction(before), 4e-9);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), last);
    assert_int_equal(r.a.count.restarts, 0);
}

static void a_new_gain_holds_from_the_block_after_its_write(void **state)
{
    (void)state;
    struct rig r;
    struct rig ref; /* gain 1, and an input that doubles when the other's gain does */
    powered(&r, &quiet);
    powered(&ref, &quiet);
    r.v = ref.v = 0.5;
    for (int i = 0; i < 3; i++) {
        to_fall(&r);
        to_fall(&ref);
    }
    at_tclk(&r, r.tclk + 1700);
    wreg(&r, 2, 0x09);
    at_tclk(&ref, r.tclk);
    ads1282_sample_until(&ref.a, ref.s.now_ns);
    ref.v = 1.0;
    for (int i = 0; i < 64; i++) {
        to_fall(&r);
        to_fall(&ref);
        hex_is(read_bytes(&r, 4), read_bytes(&ref, 4));
    }
}

/* Sources 1.8: 57.4 and 51.8 data periods. CONFIG0 PHASE reaches the filter. */
static void a_step_settles_to_a_millionth_in_52_or_58_words(void **state)
{
    (void)state;
    const int want[2] = {58, 52};
    for (unsigned phase = 0; phase < 2; phase++) {
        struct rig r;
        powered(&r, &quiet);
        wreg(&r, 1, config0_of(2, phase));
        settled_word(&r);
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = 1.0;
        double word[70];
        for (unsigned i = 0; i < COUNT(word); i++) to_fall(&r), word[i] = fraction(read_bytes(&r, 4));
        int last = 0;
        for (int i = 0; i < 69; i++)
            if (fabs(word[i] / word[69] - 1.0) > 1e-6) last = i + 1;
        assert_in_range(last + 1, want[phase] - 1, want[phase] + 1);
    }
}

/* ---- Noise ---- */

/* Sources 1.9: SNR in dB, referred to a full-scale sine. */
static const double snr_db[5][7] = {
    {130, 130, 129, 128, 125, 119, 114}, {127, 127, 126, 125, 122, 116, 111}, {124, 124, 123, 122, 119, 113, 108},
    {121, 121, 120, 119, 116, 110, 105}, {118, 118, 117, 115, 112, 107, 101},
};

enum { SEEDS = 30, WORDS = 200 };

/* Second and fourth moments of settled words, in LSB of the word. */
static void moments(uint64_t seed, uint8_t config0, uint8_t config1, double scale, double *m2, double *m4)
{
    struct rig r;
    struct ads1282_cfg cfg = quiet;
    cfg.noise_scale = scale;
    unpowered(&r, &cfg, seed);
    ads1282_power_up(&r.a, 0);
    wreg(&r, 2, config1);
    wreg(&r, 1, config0);
    *m2 = *m4 = 0.0;
    for (int i = 0; i < WORDS; i++) {
        to_fall(&r);
        const double x2 = pow(fraction(read_bytes(&r, 4)), 2);
        *m2 += x2 / WORDS;
        *m4 += x2 * x2 / WORDS;
    }
}

/* The words of a filter whose noise band is 0.826 of Nyquist's are worth about 0.8 independent ones each: 160 degrees of
 * freedom a seed (band: 5 sigma of chi-square either side), 4800 in all (4 sigma: 8 %). */
static void output_noise_is_the_published_one(void **state)
{
    (void)state;
    const uint64_t first = rig_seed(100);
    for (unsigned dr = 0; dr < 5; dr++) {
        for (unsigned pga = 0; pga < 7; pga++) {
            const double sigma = sqrt(0.5) * pow(10.0, -snr_db[dr][pga] / 20.0);
            double sum2 = 0.0;
            double sum4 = 0.0;
            for (unsigned seed = 0; seed < SEEDS; seed++) {
                double m2, m4;
                moments(first + seed, config0_of((uint8_t)dr, pga & 1), (uint8_t)(8 | pga), 1.0, &m2, &m4);
                near(m2 / (sigma * sigma), 1.0, 5.0 * sqrt(2.0 / 160));
                sum2 += m2 / SEEDS;
                sum4 += m4 / SEEDS;
            }
            near(sum2 / (sigma * sigma), 1.0, 4.0 * sqrt(2.0 / 4800));
            near(sum4 / (sum2 * sum2), 3.0, 0.35); /* Gaussian: 5 sigma of the kurtosis of 4800 */
        }
    }
}

/* The published SNR of every rate and gain, as the scale of the draws: what statistics see to 4 %, to the last digits. */
static void noise_scale_is_the_published_one_exactly(void **state)
{
    (void)state;
    for (unsigned dr = 0; dr < 5; dr++) {
        for (unsigned pga = 0; pga < 7; pga++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.noise_scale = 1.0;
            cfg.chain = ADS1282_CHAIN_DIRECT; /* whose draws are those of the output */
            unpowered(&r, &cfg, 1);
            ads1282_power_up(&r.a, 0);
            wreg(&r, 2, (uint8_t)(8 | pga));
            wreg(&r, 1, config0_of((uint8_t)dr, 0));
            to_fall(&r);
            const double sigma = sqrt(0.5) * pow(10.0, -snr_db[dr][pga] / 20.0);
            near(r.a.noise_lsb / (ldexp(sigma, ADS1282_BLOCK_LOG2) / 16.0), 1.0, 1e-9);
        }
    }
}

static void noise_scales_and_can_be_switched_off(void **state)
{
    (void)state;
    double one, three, m4;
    moments(7, 0x52, 8, 1.0, &one, &m4);
    moments(7, 0x52, 8, 3.0, &three, &m4);
    near(three / one, 9.0, 0.01);
    struct rig r;
    powered(&r, &quiet);
    hex_is(settled_word(&r), 0);
}

static void same_seed_same_words_with_any_compiler(void **state)
{
    (void)state;
    uint64_t hash = UINT64_C(0xCBF29CE484222325); /* FNV-1a */
    for (unsigned dr = 0; dr < 5; dr++) {
        for (unsigned phase = 0; phase < 2; phase++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.noise_scale = 1.0;
            unpowered(&r, &cfg, 2024);
            r.v = 0.123456789;
            r.ramp_v_per_s = 0.7;
            ads1282_power_up(&r.a, 12345);
            wreg(&r, 2, (uint8_t)(8 | dr));
            wreg(&r, 1, config0_of((uint8_t)dr, phase));
            for (int i = 0; i < 100; i++) {
                to_fall(&r);
                hash = (hash ^ read_bytes(&r, 4)) * UINT64_C(0x100000001B3);
            }
        }
    }
    if (hash != UINT64_C(0xB6E445542E11CE05)) fail_msg("hash %016llX", (unsigned long long)hash);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(first_fall_comes_t_dr_after_sync_then_every_period),
        cmocka_unit_test(every_cause_of_a_restart_settles_in_t_dr),
        cmocka_unit_test(conversions_stay_on_the_clock_for_an_hour),
        cmocka_unit_test(blocks_are_sampled_at_their_middles),
        cmocka_unit_test(an_abrupt_change_of_input_can_be_placed_exactly),
        cmocka_unit_test(codes_follow_reference_gain_and_multiplexer),
        cmocka_unit_test(the_modulator_saturates_at_106_percent),
        cmocka_unit_test(ofc_and_fsc_act_at_once),
        cmocka_unit_test(gain_changes_without_a_restart_and_settles_in_63_words),
        cmocka_unit_test(a_new_gain_holds_from_the_block_after_its_write),
        cmocka_unit_test(a_step_settles_to_a_millionth_in_52_or_58_words),
        cmocka_unit_test(output_noise_is_the_published_one),
        cmocka_unit_test(noise_scale_is_the_published_one_exactly),
        cmocka_unit_test(noise_scales_and_can_be_switched_off),
        cmocka_unit_test(same_seed_same_words_with_any_compiler),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
