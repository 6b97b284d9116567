/* ADS1281/ADS1282: the bit-true modulator and the sinc at its rate (sources 1.7, 1.8). */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(decoded_bits_are_the_input_and_fourth_order_shaped_error),
        cmocka_unit_test(states_stay_bounded_up_to_106_percent),
        cmocka_unit_test(integrators_and_combs_are_five_running_sums),
        cmocka_unit_test(a_run_is_its_clocks_one_by_one),
        cmocka_unit_test(bits_give_the_words_of_the_loops_that_made_them),
        cmocka_unit_test(one_bit_is_the_input_four_clocks_late),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
