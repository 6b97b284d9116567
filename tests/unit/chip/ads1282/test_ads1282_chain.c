/* ADS1281/ADS1282: the bit-true chain, the chain of blocks and the direct one beside each other (sources 1.7 to 1.9). */
#include "ads1282_rig.h"

static const double snr_db[5] = {130, 127, 124, 121, 118};

static double published(unsigned dr)
{
    return sqrt(0.5) * pow(10.0, -snr_db[dr] / 20.0);
}

static void chain_up(struct rig *r, enum ads1282_chain chain, double noise_scale, uint8_t config0, uint64_t seed)
{
    struct ads1282_cfg cfg = quiet;
    cfg.chain = chain;
    cfg.noise_scale = noise_scale;
    unpowered(r, &cfg, seed);
    ads1282_power_up(&r->a, 0);
    wreg(r, 1, config0);
}

static uint8_t fir_mode(unsigned dr, unsigned phase)
{
    return (uint8_t)(0x42 | dr << 3 | phase << 2);
}

/* Noiseless: what is left is the error of the bits, a tenth of the published noise at most, at full scale and at a slow
 * sine alike. (The ideal chain holds its input over a block: nothing at 1/2000 of the data rate.) */
static void the_bit_true_chain_gives_the_ideal_words_within_a_tenth_of_the_noise(void **state)
{
    (void)state;
    static const double volts[][2] = {{0.0, 0.0}, {0.7, 0.0}, {-2.49, 0.0}, {0.1, 2.2}};
    for (unsigned k = 0; k < COUNT(volts) * 10; k++) {
        const unsigned dr = k % 5;
        static struct rig r[2];
        double power = 0.0;
        for (int c = 0; c < 2; c++) {
            chain_up(&r[c], c ? ADS1282_CHAIN_MODULATOR : ADS1282_CHAIN_EXACT, 0.0, fir_mode(dr, k / 5 % 2), 1);
            r[c].v = volts[k / 10][0];
            r[c].sine_v = volts[k / 10][1];
            r[c].sine_hz = (250 << dr) / 2000.0;
        }
        for (int m = 0; m < 60; m++) {
            assert_int_equal(to_fall(&r[0]), to_fall(&r[1]));
            power += pow(fraction(read_bytes(&r[0], 4)) - fraction(read_bytes(&r[1], 4)), 2) / 60.0;
        }
        if (!(sqrt(power) < 0.1 * published(dr))) fail_msg("row %u, rate %u: %g", k / 10, dr, sqrt(power));
    }
}

static void the_bit_true_chain_saturates_at_106_percent_and_comes_back(void **state)
{
    (void)state;
    static const double volts[] = {2.6, 2.7, 100.0, -2.6, -2.7, -100.0};
    for (unsigned k = 0; k < COUNT(volts); k++) {
        struct rig r;
        chain_up(&r, ADS1282_CHAIN_MODULATOR, 0.0, 0x52, 1);
        wreg(&r, ADS1282_FSC2, 0x20); /* gain 1/2 shows what lies beyond full scale */
        r.v = volts[k];
        const double clipped = fmin(fmax(volts[k] / 2.5, -1.06), 1.06);
        near(fraction(settled_word(&r)), 0.5 * 1.00002874 * clipped, 2e-8);
        assert_int_equal(r.a.count.clipped, 0);
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = 0.25;
        near(fraction(settled_word(&r)), 0.05 * 1.00002874, 2e-8);
    }
}

enum { WORDS = 200 };

static double noise_power(enum ads1282_chain chain, uint64_t seed, uint8_t config0, uint8_t config1)
{
    struct rig r;
    chain_up(&r, chain, 1.0, 0x52, seed);
    wreg(&r, 2, config1);
    wreg(&r, 1, config0);
    double power = 0.0;
    for (int i = 0; i < WORDS; i++) {
        to_fall(&r);
        power += pow(fraction(read_bytes(&r, 4)), 2) / WORDS;
    }
    return power;
}

/* Thermal noise at its input: the figure of the ideal chain (test_ads1282_conv.c), 160 degrees of freedom a seed. */
static void the_bit_true_chain_has_the_published_noise(void **state)
{
    (void)state;
    static const struct {
        unsigned dr, pga;
        double snr_db;
    } rows[] = {{4, 0, 118}, {4, 6, 101}, {3, 0, 121}, {2, 0, 124}};
    const uint64_t first = rig_seed(400);
    enum { SEEDS = 30 };
    for (unsigned k = 0; k < COUNT(rows); k++) {
        double sum = 0.0;
        const double want = 0.5 * pow(10.0, -rows[k].snr_db / 10.0);
        for (unsigned seed = 0; seed < SEEDS; seed++)
            sum += noise_power(ADS1282_CHAIN_MODULATOR, first + seed, fir_mode(rows[k].dr, seed & 1),
                               (uint8_t)(8 | rows[k].pga)) /
                   SEEDS;
        near(sum / want, 1.0, 4.0 * sqrt(2.0 / 4800));
    }
}

/* Independent words here: 200 degrees of freedom each. */
static void the_direct_chain_has_the_published_noise(void **state)
{
    (void)state;
    static const double db[5][7] = {
        {130, 130, 129, 128, 125, 119, 114}, {127, 127, 126, 125, 122, 116, 111}, {124, 124, 123, 122, 119, 113, 108},
        {121, 121, 120, 119, 116, 110, 105}, {118, 118, 117, 115, 112, 107, 101},
    };
    const uint64_t first = rig_seed(500);
    enum { SEEDS = 30 };
    for (unsigned k = 0; k < 35; k++) {
        double sum = 0.0;
        const double want = 0.5 * pow(10.0, -db[k / 7][k % 7] / 10.0);
        for (unsigned seed = 0; seed < SEEDS; seed++) {
            const double one =
                noise_power(ADS1282_CHAIN_DIRECT, first + seed, fir_mode(k / 7, seed & 1), (uint8_t)(8 | k % 7));
            near(one / want, 1.0, 5.0 * sqrt(2.0 / WORDS));
            sum += one / SEEDS;
        }
        near(sum / want, 1.0, 4.0 * sqrt(2.0 / (WORDS * SEEDS)));
    }
}

/* A sample's number is its instant in steps of its rate; the same number at another rate is other noise. */
static void no_rate_repeats_the_noise_of_another(void **state)
{
    (void)state;
    enum { N = 700, LAGS = 100 };
    double word[2][N], power = 0.0, most = 0.0;
    for (unsigned dr = 0; dr < 2; dr++) {
        struct rig r;
        chain_up(&r, ADS1282_CHAIN_DIRECT, 1.0, fir_mode(dr, 0), 1);
        for (unsigned i = 0; i < N; i++) {
            to_fall(&r);
            word[dr][i] = fraction(read_bytes(&r, 4));
            power += dr ? 0.0 : word[0][i] * word[0][i];
        }
    }
    for (unsigned lag = 0; lag < 2 * LAGS; lag++) {
        double sum = 0.0;
        for (unsigned i = LAGS; i < N - LAGS; i++) sum += word[0][i] * word[1][i + lag - LAGS];
        most = fmax(most, fabs(sum));
    }
    assert_true(most < 0.4 * power); /* 6 sigma; it would be 0.7 */
}

/* The sinc alone passes more of the white noise: the ideal and the direct chain agree on how much. */
static void the_sinc_alone_is_equally_noisy_in_both_fast_chains(void **state)
{
    (void)state;
    for (unsigned dr = 0; dr < 5; dr++) {
        double power[2] = {0.0, 0.0};
        for (int c = 0; c < 2; c++) {
            struct rig r;
            chain_up(&r, c ? ADS1282_CHAIN_DIRECT : ADS1282_CHAIN_EXACT, 1.0, (uint8_t)(0x41 | dr << 3), 77);
            for (int i = 0; i < 20000; i++) {
                to_fall(&r);
                power[c] += pow((double)(int32_t)(uint32_t)(r.a.out >> 32) * 0x1p-30, 2) / 20000;
            }
        }
        near(power[0] / power[1], 1.0, 0.06);
        assert_true(sqrt(power[0]) > 2.0 * published(dr));
    }
}

/* Same words for a resting input, the chain's DC gain included. */
static void the_direct_chain_gives_the_exact_words_of_a_resting_input(void **state)
{
    (void)state;
    static const double volts[] = {0.0, 1e-7, 0.123456789, -1.0, 2.49, 2.5, -2.6, 3.0, -3.0};
    for (unsigned k = 0; k < COUNT(volts) * 10; k++) {
        uint32_t word[2];
        uint32_t clipped[2];
        for (int c = 0; c < 2; c++) {
            struct rig r;
            chain_up(&r, c ? ADS1282_CHAIN_DIRECT : ADS1282_CHAIN_EXACT, 0.0, fir_mode(k % 5, k / 5 % 2), 1);
            r.v = volts[k / 10];
            word[c] = settled_word(&r);
            clipped[c] = r.a.count.clipped;
        }
        assert_in_range(labs((long)(int32_t)word[0] - (long)(int32_t)word[1]), 0, 2); /* LSB of 2^-30 is 2 */
        assert_int_equal(clipped[0], clipped[1]);
    }
}

/* A ramp shows the delay: the same words as the exact chain's to a hundredth of a data period's rise. */
static void the_direct_chain_has_the_group_delay_of_the_exact_one(void **state)
{
    (void)state;
    for (unsigned k = 0; k < 20; k++) {
        const unsigned dr = k % 5;
        const bool sinc = k >= 10;
        const uint8_t config0 = sinc ? (uint8_t)(0x41 | dr << 3) : fir_mode(dr, k / 5);
        double word[3];
        for (int c = 0; c < 3; c++) {
            struct rig r;
            chain_up(&r, (enum ads1282_chain)c, 0.0, config0, 1);
            r.ramp_v_per_s = 10.0;
            for (int i = 0; i < 64; i++) to_fall(&r);
            word[c] = (double)(int32_t)(uint32_t)(r.a.out >> 32) * (sinc ? 0x1p-30 : 0x1p-31);
        }
        const double rise = 10.0 / 2.5 * (sinc ? 1.0 / (8000 << dr) : 1.0 / (250 << dr)); /* of a data period */
        near((word[ADS1282_CHAIN_DIRECT] - word[ADS1282_CHAIN_EXACT]) / rise, 0.0, sinc ? 0.1 : 0.01);
        if (!sinc || dr < 3)
            near((word[ADS1282_CHAIN_MODULATOR] - word[ADS1282_CHAIN_EXACT]) / rise, 0.0, sinc ? 0.1 : 0.01);
    }
}

/* Documented: no filter. A step comes after the delay within one word, and what lies above half the data rate folds. */
static void the_direct_chain_only_delays_a_moving_input(void **state)
{
    (void)state;
    struct rig r;
    chain_up(&r, ADS1282_CHAIN_DIRECT, 0.0, 0x56, 1);
    for (int i = 0; i < 3; i++) to_fall(&r);
    ads1282_sample_until(&r.a, r.s.now_ns);
    r.v = 1.0;
    for (int i = 1; i < 12; i++) {
        to_fall(&r);
        near(fraction(read_bytes(&r, 4)), i <= 5 ? 0.0 : 0.4 * 1.000169, 1e-6);
    }
    chain_up(&r, ADS1282_CHAIN_DIRECT, 0.0, 0x56, 1);
    r.sine_v = 1.0;
    r.sine_hz = 1000.0; /* folds to DC */
    const double first = fraction(settled_word(&r));
    to_fall(&r);
    near(fraction(read_bytes(&r, 4)), first, 1e-6);
    assert_true(fabs(first) > 1e-3);
}

/* One input sample a data period, and DRDY at the same instants as the others: 30 s, cheaply. */
static void the_direct_chain_keeps_all_times(void **state)
{
    (void)state;
    for (unsigned k = 0; k < 10; k++) {
        struct rig r[2];
        for (int c = 0; c < 2; c++)
            chain_up(&r[c], c ? ADS1282_CHAIN_DIRECT : ADS1282_CHAIN_EXACT, 1.0, fir_mode(k % 5, k / 5), 1);
        for (int i = 0; i < 20; i++) assert_int_equal(to_fall(&r[0]), to_fall(&r[1]));
        const unsigned samples = r[1].samples;
        for (int i = 0; i < 500; i++) to_fall(&r[1]);
        assert_int_equal(r[1].samples - samples, 500);
    }
}

/* ---- The same on every machine ---- */

static void same_seed_same_words_in_every_chain_with_any_compiler(void **state)
{
    (void)state;
    static const uint64_t want[3] = {UINT64_C(0xDAB3B1DEFDC63BC1), UINT64_C(0x4152D940D3FB746A),
                                     UINT64_C(0x6FB385D57DD53D5D)};
    for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
        uint64_t hash = UINT64_C(0xCBF29CE484222325); /* FNV-1a */
        static const uint8_t modes[] = {0x52, 0x56, 0x63, 0x41, 0x59, 0x61, 0xE6};
        for (unsigned k = 0; k < COUNT(modes); k++) {
            struct rig r;
            chain_up(&r, (enum ads1282_chain)chain, 1.0, modes[k], 2025);
            r.v = 0.123456789;
            r.ramp_v_per_s = 0.7;
            for (int i = 0; i < 100; i++) {
                to_fall(&r);
                hash = (hash ^ (r.a.out >> 32)) * UINT64_C(0x100000001B3);
            }
        }
        if (hash != want[chain]) fail_msg("chain %d: hash %016llX", chain, (unsigned long long)hash);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bit_true_chain_gives_the_ideal_words_within_a_tenth_of_the_noise),
        cmocka_unit_test(the_bit_true_chain_saturates_at_106_percent_and_comes_back),
        cmocka_unit_test(the_bit_true_chain_has_the_published_noise),
        cmocka_unit_test(the_direct_chain_has_the_published_noise),
        cmocka_unit_test(no_rate_repeats_the_noise_of_another),
        cmocka_unit_test(the_sinc_alone_is_equally_noisy_in_both_fast_chains),
        cmocka_unit_test(the_direct_chain_gives_the_exact_words_of_a_resting_input),
        cmocka_unit_test(the_direct_chain_has_the_group_delay_of_the_exact_one),
        cmocka_unit_test(the_direct_chain_only_delays_a_moving_input),
        cmocka_unit_test(the_direct_chain_keeps_all_times),
        cmocka_unit_test(same_seed_same_words_in_every_chain_with_any_compiler),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
