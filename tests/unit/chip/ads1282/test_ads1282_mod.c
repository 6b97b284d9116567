/* ADS1281/ADS1282: the bit-true modulator, the sinc at its rate, and the three chains beside each other (sources 1.7 to 1.9). */
#include "ads1282_rig.h"

#include "base/rng.h"
#include "chip/ads1282/filter.h"
#include "chip/ads1282/mod.h"

#define FS (INT64_C(1) << 34)

/* ---- Modulator ---- */

enum shape { DC, SINE, SLAM, NOISE, FAST_SLAM, SHAPES };

static int64_t shaped(enum shape shape, double amplitude, int n, struct rng *g)
{
    const double u = shape == DC      ? 1.0
                     : shape == SINE  ? sin(n * 1e-3)
                     : shape == SLAM  ? (n / 1000 % 2 ? 1.0 : -1.0)
                     : shape == NOISE ? 2.0 * rng_uniform(g) - 1.0
                                      : (n / 7 % 2 ? 1.0 : -1.0);
    return (int64_t)(amplitude * u * (double)FS);
}

/* y[n] = x[n-4] + 9 (e[n] - 4 e[n-1] + 6 e[n-2] - 4 e[n-3] + e[n-4]), to the last bit: e is the error of the second
 * quantiser, which 9 times larger than life is what its loop holds. */
static void decoded_bits_are_the_input_and_fourth_order_shaped_error(void **state)
{
    (void)state;
    static const double amplitudes[] = {0.0, 0.3, 1.0, 1.06};
    struct rng g = rng_stream(rig_seed(8), 0, "mod");
    for (unsigned k = 0; k < COUNT(amplitudes) * SHAPES; k++) {
        struct ads1282_mod m;
        ads1282_mod_clear(&m);
        int64_t x[5] = {0};
        int64_t e9[5] = {0};
        for (int n = 0; n < 20000; n++) {
            memmove(x + 1, x, 4 * sizeof *x);
            memmove(e9 + 1, e9, 4 * sizeof *e9);
            x[0] = shaped((enum shape)(k % SHAPES), amplitudes[k / SHAPES], n, &g);
            const int64_t v9 = m.second[1];
            ads1282_mod_step(&m, x[0]);
            e9[0] = ((m.m1 & 1) ? 9 : -9) * ADS1282_MOD_ONE - v9;
            if (n < 4) continue;
            const int64_t want = x[4] + e9[0] - 4 * e9[1] + 6 * e9[2] - 4 * e9[3] + e9[4];
            assert_int_equal(ads1282_mod_decode(&m) * ADS1282_MOD_ONE, want);
            assert_in_range(labs(ads1282_mod_decode(&m)), 0, ADS1282_MOD_Y_MAX);
        }
    }
}

static void states_stay_bounded_up_to_106_percent(void **state)
{
    (void)state;
    struct rng g = rng_stream(rig_seed(9), 0, "mod");
    for (int shape = DC; shape < SHAPES; shape++) {
        for (int percent = -106; percent <= 106; percent += 4) {
            struct ads1282_mod m;
            ads1282_mod_clear(&m);
            for (int n = 0; n < 100000; n++) {
                ads1282_mod_step(&m, shaped((enum shape)shape, percent * 0.01, n, &g));
                if (llabs(m.first[1]) > 13 * ADS1282_MOD_ONE || llabs(m.second[1]) > 9 * 100 * ADS1282_MOD_ONE)
                    fail_msg("shape %d, %d %%: unstable at %d", shape, percent, n);
            }
        }
    }
}

/* ---- Sinc at the modulator's rate ---- */

static const unsigned ratios[] = {8, 16, 32, 64, 128};

/* Five running sums of N, written out as a convolution. */
static unsigned sinc5(unsigned n, double h[5 * 128])
{
    unsigned len = 1;
    h[0] = 1.0;
    for (int s = 0; s < 5; s++) {
        double next[5 * 128] = {0};
        for (unsigned i = 0; i < len; i++)
            for (unsigned j = 0; j < n; j++) next[i + j] += h[i];
        len += n - 1;
        memcpy(h, next, len * sizeof *h);
    }
    return len;
}

static void integrators_and_combs_are_five_running_sums(void **state)
{
    (void)state;
    struct rng g = rng_stream(rig_seed(10), 0, "cic");
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        double h[5 * 128];
        const unsigned len = sinc5(ratios[k], h);
        struct ads1282_cic c;
        ads1282_cic_init(&c, ratios[k]);
        static int32_t x[40 * 128];
        unsigned outputs = 0;
        for (unsigned n = 0; n < 40 * ratios[k]; n++) {
            x[n] = (int32_t)(rng_u64(&g) % (2 * ADS1282_MOD_Y_MAX + 1)) - ADS1282_MOD_Y_MAX;
            int64_t y;
            if (!ads1282_cic_take(&c, x[n], &y)) continue;
            double want = 0.0; /* whole numbers below 2^53: exact */
            for (unsigned i = 0; i < len && i <= n; i++) want += h[i] * x[n - i];
            assert_true((double)y == want);
            assert_int_equal(n % ratios[k], ratios[k] - 1);
            outputs++;
        }
        assert_int_equal(outputs, 40);
    }
}

/* ---- Runs of clocks ---- */

/* What the chain would be given clock by clock: n outputs of the sinc, then the modulator's state. */
static unsigned clock_by_clock(struct ads1282_mod *m, unsigned ratio, const int64_t *x, unsigned clocks, int64_t *y)
{
    struct ads1282_cic c;
    unsigned outputs = 0;
    ads1282_cic_init(&c, ratio);
    ads1282_mod_clear(m);
    for (unsigned n = 0; n < clocks; n++) {
        ads1282_mod_step(m, x[n]);
        if (n >= ADS1282_MOD_DELAY && ads1282_cic_take(&c, ads1282_mod_decode(m), &y[outputs])) outputs++;
    }
    return outputs;
}

/* Runs of any length that ends with its block, or of a whole one. */
static unsigned run_by_run(struct ads1282_mod *m, unsigned ratio, const int64_t *x, unsigned clocks, struct rng *g,
                           int64_t *y)
{
    struct ads1282_cic c;
    unsigned outputs = 0;
    ads1282_cic_init(&c, ratio);
    ads1282_mod_clear(m);
    for (unsigned n = 0; n < ADS1282_MOD_DELAY; n++) ads1282_mod_step(m, x[n]);
    ads1282_mod_start(m, &c);
    for (unsigned n = ADS1282_MOD_DELAY; n < clocks;) {
        const unsigned most = g ? 1 + (unsigned)(rng_u64(g) % ADS1282_MOD_RUN) : ADS1282_MOD_RUN;
        const unsigned left = ratio - c.n < clocks - n ? ratio - c.n : clocks - n;
        const unsigned run = most < left ? most : left;
        ads1282_mod_run(m, &c, x + n, run);
        n += run;
        if (ads1282_cic_output(&c, &y[outputs])) outputs++;
    }
    return outputs;
}

static void a_run_is_its_clocks_one_by_one(void **state)
{
    (void)state;
    enum { CLOCKS = 5001 };
    static int64_t x[CLOCKS], want[CLOCKS], got[CLOCKS];
    struct rng g = rng_stream(rig_seed(11), 0, "run");
    for (unsigned k = 0; k < COUNT(ratios) * SHAPES * 2; k++) {
        const unsigned ratio = ratios[k / 2 % COUNT(ratios)];
        const double amplitude = k & 1 ? 1.06 : -0.4;
        struct ads1282_mod m, run;
        for (int n = 0; n < CLOCKS; n++) x[n] = shaped((enum shape)(k / 2 / COUNT(ratios)), amplitude, n, &g);
        const unsigned outputs = clock_by_clock(&m, ratio, x, CLOCKS, want);
        assert_int_equal(outputs, (CLOCKS - ADS1282_MOD_DELAY) / ratio);
        for (int whole = 0; whole < 2; whole++) {
            assert_int_equal(run_by_run(&run, ratio, x, CLOCKS, whole ? NULL : &g, got), outputs);
            assert_memory_equal(got, want, outputs * sizeof *got);
            assert_memory_equal(&run, &m, sizeof m);
        }
    }
}

/* ---- Bits from elsewhere ---- */

/* Outputs of the sinc for played bits, runs of any length. */
static unsigned play_by_run(struct ads1282_mod *m, unsigned ratio, const uint8_t *bits, unsigned clocks, bool one_bit,
                            struct rng *g, int64_t *y)
{
    struct ads1282_cic c;
    unsigned outputs = 0;
    ads1282_cic_init(&c, ratio);
    ads1282_mod_clear(m);
    for (unsigned n = 0; n < ADS1282_MOD_DELAY; n++) ads1282_mod_take(m, bits[n]);
    if (!one_bit) ads1282_mod_start(m, &c);
    for (unsigned n = ADS1282_MOD_DELAY; n < clocks;) {
        const unsigned most = 1 + (unsigned)(rng_u64(g) % ADS1282_MOD_RUN);
        const unsigned left = ratio - c.n < clocks - n ? ratio - c.n : clocks - n;
        const unsigned run = most < left ? most : left;
        ads1282_mod_play(m, &c, bits + n, run, one_bit);
        n += run;
        if (ads1282_cic_output(&c, &y[outputs])) outputs++;
    }
    return outputs;
}

static void bits_give_the_words_of_the_loops_that_made_them(void **state)
{
    (void)state;
    enum { CLOCKS = 5001 };
    static int64_t x[CLOCKS], want[CLOCKS], got[CLOCKS];
    static uint8_t bits[CLOCKS];
    struct rng g = rng_stream(rig_seed(12), 0, "play");
    for (unsigned k = 0; k < COUNT(ratios) * SHAPES; k++) {
        struct ads1282_mod made, m;
        for (int n = 0; n < CLOCKS; n++) x[n] = shaped((enum shape)(k / COUNT(ratios)), 0.9, n, &g);
        ads1282_mod_clear(&made);
        for (int n = 0; n < CLOCKS; n++) {
            ads1282_mod_step(&made, x[n]);
            bits[n] = (uint8_t)((made.m0 & 1) | (made.m1 & 1) << 1);
        }
        const unsigned outputs = clock_by_clock(&made, ratios[k % COUNT(ratios)], x, CLOCKS, want);
        assert_int_equal(play_by_run(&m, ratios[k % COUNT(ratios)], bits, CLOCKS, false, &g, got), outputs);
        assert_memory_equal(got, want, outputs * sizeof *got);
        assert_int_equal(m.m0, made.m0);
        assert_int_equal(m.m1, made.m1);
    }
}

/* M1's bit of the byte does not count. */
static void one_bit_is_the_input_four_clocks_late(void **state)
{
    (void)state;
    enum { CLOCKS = 3001 };
    static int64_t got[CLOCKS];
    static uint8_t bits[CLOCKS];
    struct rng g = rng_stream(rig_seed(13), 0, "one");
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        struct ads1282_mod m;
        struct ads1282_cic c;
        unsigned outputs = 0;
        for (int n = 0; n < CLOCKS; n++) bits[n] = (uint8_t)(rng_u64(&g) & 3);
        const unsigned played = play_by_run(&m, ratios[k], bits, CLOCKS, true, &g, got);
        ads1282_cic_init(&c, ratios[k]);
        for (unsigned n = 0; n < CLOCKS - ADS1282_MOD_DELAY; n++) {
            int64_t y;
            if (ads1282_cic_take(&c, bits[n] & 1 ? 1 : -1, &y)) assert_int_equal(got[outputs++], y);
        }
        assert_int_equal(outputs, played);
    }
}

/* ---- Chains beside each other ---- */

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
        cmocka_unit_test(decoded_bits_are_the_input_and_fourth_order_shaped_error),
        cmocka_unit_test(states_stay_bounded_up_to_106_percent),
        cmocka_unit_test(integrators_and_combs_are_five_running_sums),
        cmocka_unit_test(a_run_is_its_clocks_one_by_one),
        cmocka_unit_test(bits_give_the_words_of_the_loops_that_made_them),
        cmocka_unit_test(one_bit_is_the_input_four_clocks_late),
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
