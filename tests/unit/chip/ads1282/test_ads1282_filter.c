/* Signal path of the ADS1281/ADS1282 against a sinc at the modulator rate and the published properties (sources 1.7, 1.8). */
#include "rig.h"

#include "base/bits.h"
#include "base/rng.h"
#include "chip/ads1282/decimate.h"
#include "chip/ads1282/filter.h"

#include <complex.h>
#include <math.h>
#include <string.h>

#define PI          3.14159265358979323846
#define G_MAX       2048
#define BLOCK_FS    (INT64_C(1) << ADS1282_BLOCK_LOG2)
#define PERIODS_MAX 64

static void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

static const unsigned ratios[] = {8, 16, 32, 64, 128};

/* ---- sinc5 ---- */

/* Five integrators at the modulator rate and five combs at the block rate, modulo 2^64 as such filters are built. */
struct cic {
    uint64_t integrator[5], comb[5];
};

static int64_t cic_block(struct cic *c, unsigned n, int64_t held)
{
    for (unsigned i = 0; i < n; i++) {
        uint64_t x = (uint64_t)held;
        for (int s = 0; s < 5; s++) x = c->integrator[s] += x;
    }
    uint64_t y = c->integrator[4];
    for (int s = 0; s < 5; s++) {
        const uint64_t was = c->comb[s];
        c->comb[s] = y;
        y -= was;
    }
    return (int64_t)y;
}

static void sinc_taps(unsigned ratio, int32_t tap[ADS1282_SINC_TAPS])
{
    static struct ads1282_filter f;
    ads1282_filter_init(&f, ratio, ADS1282_LINEAR);
    memcpy(tap, f.sinc_tap, sizeof f.sinc_tap);
}

static void five_weights_are_the_sinc_at_the_modulator_rate(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "sinc");
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        int32_t tap[ADS1282_SINC_TAPS];
        sinc_taps(ratios[k], tap);
        struct cic cic = {{0}, {0}};
        int64_t held[ADS1282_SINC_TAPS] = {0};
        for (int block = 0; block < 200; block++) {
            memmove(held + 1, held, 4 * sizeof *held);
            held[0] = (int64_t)(rng_u64(&r) % 0x2000000u) - 0x1000000;
            int64_t want = 0;
            for (int j = 0; j < ADS1282_SINC_TAPS; j++) want += tap[j] * held[j];
            assert_int_equal(cic_block(&cic, ratios[k], held[0]), want * ratios[k]);
        }
    }
}

static void sinc_weights_sum_to_the_fourth_power(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        int32_t tap[ADS1282_SINC_TAPS];
        sinc_taps(ratios[k], tap);
        int64_t sum = 0;
        for (int j = 0; j < ADS1282_SINC_TAPS; j++) sum += tap[j];
        const int64_t n2 = (int64_t)ratios[k] * ratios[k];
        assert_int_equal(sum, n2 * n2);
    }
}

/* ---- Published coefficients ---- */

/* Sources 1.8; first moments are sums of i * tap[i]: a tap that changed places shows. */
static const struct {
    enum ads1282_phase phase;
    unsigned stage, taps, decim, scale_log2;
    int64_t sum, moment;
    bool symmetric;
} published[] = {
    {ADS1282_LINEAR, 0, 11, 2, 9, 512, 512 * 5, true},
    {ADS1282_LINEAR, 1, 15, 2, 23, 8388608, INT64_C(8388608) * 7, true},
    {ADS1282_LINEAR, 2, 51, 4, 27, 134201050, INT64_C(134201050) * 25, true},
    {ADS1282_LINEAR, 3, 109, 2, 27, 134238266, INT64_C(134238266) * 54, true},
    {ADS1282_MINIMUM, 0, 11, 2, 9, 512, 512 * 5, true},
    {ADS1282_MINIMUM, 1, 15, 2, 23, 8388608, INT64_C(8388608) * 7, true},
    {ADS1282_MINIMUM, 2, 53, 4, 27, 134259543, INT64_C(1364107623), false},
    {ADS1282_MINIMUM, 3, 108, 2, 27, 134198608, INT64_C(820942409), false},
};

static void coefficients_are_the_published_ones(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(published); k++) {
        const struct ads1282_fir *f = &ads1282_fir[published[k].phase][published[k].stage];
        assert_int_equal(f->taps, published[k].taps);
        assert_int_equal(f->decim, published[k].decim);
        assert_int_equal(f->scale_log2, published[k].scale_log2);
        int64_t sum = 0;
        int64_t moment = 0;
        for (unsigned i = 0; i < f->taps; i++) {
            sum += f->tap[i];
            moment += (int64_t)i * f->tap[i];
            if (published[k].symmetric) assert_int_equal(f->tap[i], f->tap[f->taps - 1 - i]);
        }
        assert_int_equal(sum, published[k].sum);
        assert_int_equal(moment, published[k].moment);
    }
}

/* ---- Composite ---- */

/* Composite impulse response in blocks, by plain convolution of the tables; returns its length. */
static unsigned composite(unsigned ratio, enum ads1282_phase phase, double g[G_MAX])
{
    int32_t sinc[ADS1282_SINC_TAPS];
    sinc_taps(ratio, sinc);
    memset(g, 0, G_MAX * sizeof *g);
    for (int j = 0; j < ADS1282_SINC_TAPS; j++) g[j] = sinc[j] / pow(ratio, 4);
    unsigned len = ADS1282_SINC_TAPS;
    unsigned step = 1;
    for (int s = 0; s < ADS1282_FIR_STAGES; s++) {
        const struct ads1282_fir *f = &ads1282_fir[phase][s];
        double h[G_MAX] = {0};
        for (unsigned n = 0; n < len; n++)
            for (unsigned i = 0; i < f->taps; i++) h[n + i * step] += g[n] * ldexp(f->tap[i], -(int)f->scale_log2);
        len += (f->taps - 1) * step;
        step *= f->decim;
        memcpy(g, h, sizeof h);
    }
    return len;
}

static void decimation_chain_is_the_composite(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        for (int phase = 0; phase < 2; phase++) {
            double g[G_MAX];
            composite(ratios[k], (enum ads1282_phase)phase, g);
            static struct ads1282_filter f;
            ads1282_filter_init(&f, ratios[k], (enum ads1282_phase)phase);
            for (unsigned at = 0; at < ADS1282_BLOCKS; at++) {
                int64_t block[ADS1282_BLOCKS] = {0};
                block[at] = BLOCK_FS;
                ads1282_filter_clear(&f);
                for (unsigned p = 0; p < PERIODS_MAX - 1; p++) {
                    const double got = (double)ads1282_filter_period(&f, block);
                    block[at] = 0;
                    near(got, g[32 * p + 31 - at] * 0x1p30, 1.0);
                }
            }
        }
    }
}

/* ---- Plain convolution ---- */

/* All of a run at once, each output by the definition: taps one by one, rounded to nearest. Returns how many. */
static unsigned convolve_all(const int32_t *tap, unsigned taps, unsigned decim, unsigned shift, const int64_t *in,
                             unsigned n, int64_t *out)
{
    for (unsigned k = 0; k < n / decim; k++) {
        int64_t sum = 0;
        for (unsigned i = 0; i < taps && i <= (k + 1) * decim - 1; i++) sum += tap[i] * in[(k + 1) * decim - 1 - i];
        out[k] = bits_round_shift(sum, shift);
    }
    return n / decim;
}

enum { ANYTHING, SLAMS, HIGH, LOW, ALTERNATING, NEXT_TO_NOTHING, KINDS };

static int64_t random_block(struct rng *r, unsigned kind, unsigned n)
{
    static const int64_t max = (int64_t)(ADS1282_SATURATION * (double)BLOCK_FS);
    const uint64_t u = rng_u64(r);
    switch (kind) {
    case ANYTHING:
        return (int64_t)(u % (uint64_t)(2 * max + 1)) - max;
    case SLAMS:
        return u & 1 ? max : -max; /* between the ends */
    case HIGH:
        return max;
    case LOW:
        return -max;
    case ALTERNATING:
        return n & 1 ? max : -max;
    default:
        return (int64_t)(u % 5) - 2;
    }
}

enum { PERIODS = 100, RUN = PERIODS * 32 };

struct run {
    int64_t block[RUN], sinc[RUN], word[PERIODS];
};

static void fill_run(struct run *run, unsigned ratio, enum ads1282_phase phase, unsigned kind, struct rng *r)
{
    static const unsigned shift[ADS1282_FIR_STAGES] = {9, 23, 28, 30};
    static int64_t line[2][RUN];
    int32_t tap[ADS1282_SINC_TAPS];
    sinc_taps(ratio, tap);
    for (unsigned i = 0; i < RUN; i++) run->block[i] = random_block(r, kind, i);
    unsigned n = convolve_all(tap, ADS1282_SINC_TAPS, 1, 4 * bits_log2(ratio), run->block, RUN, run->sinc);
    memcpy(line[0], run->sinc, sizeof line[0]);
    for (unsigned s = 0; s < ADS1282_FIR_STAGES; s++) {
        const struct ads1282_fir *fir = &ads1282_fir[phase][s];
        n = convolve_all(fir->tap, fir->taps, fir->decim, shift[s], line[s & 1], n, line[!(s & 1)]);
    }
    assert_int_equal(n, PERIODS);
    memcpy(run->word, line[0], sizeof run->word);
}

/* Plain and with vectors where this machine has them: the same to the last bit, from blocks and from outputs of a sinc,
 * after a synchronisation as after power-up. */
static void each_word_is_the_plain_convolution(void **state)
{
    (void)state;
    static struct run run;
    static struct ads1282_filter f;
    const struct ads1282_decimator *const quickest = ads1282_decimator();
    struct rng r = rng_stream(rig_seed(1), 0, "plain");
    for (unsigned row = 0; row < COUNT(ratios) * 2 * KINDS; row++) {
        const unsigned ratio = ratios[row / (2 * KINDS)];
        const enum ads1282_phase phase = row & 1 ? ADS1282_MINIMUM : ADS1282_LINEAR;
        fill_run(&run, ratio, phase, row / 2 % KINDS, &r);
        ads1282_filter_init(&f, ratio, phase);
        assert_ptr_equal(f.decimator, quickest);
        for (unsigned by = 0; by < 4; by++) {
            f.decimator = by < 2 ? &ads1282_plain : quickest;
            ads1282_filter_clear(&f);
            for (unsigned p = 0; p < PERIODS; p++) {
                const int64_t y = by & 1 ? ads1282_filter_fir(&f, run.sinc + (size_t)32 * p)
                                         : ads1282_filter_period(&f, run.block + (size_t)32 * p);
                assert_int_equal(y, run.word[p]);
            }
        }
    }
}

/* Response at f (in units of the data rate), sinc as the formula of SBAS378 p. 15 and not as our weights. */
static double complex response(enum ads1282_phase phase, double f)
{
    const double n = 32.0;
    const double x = PI * f / (32.0 * n);
    double complex h = f > 0.0 ? pow(sin(n * x) / (n * sin(x)), 5) : 1.0;
    double step = 1.0;
    for (int s = 0; s < ADS1282_FIR_STAGES; s++) {
        const struct ads1282_fir *fir = &ads1282_fir[phase][s];
        double complex sum = 0.0;
        for (unsigned i = 0; i < fir->taps; i++)
            sum += ldexp(fir->tap[i], -(int)fir->scale_log2) * cexp(-2.0 * PI * I * f * step * i / 32.0);
        h *= sum;
        step *= fir->decim;
    }
    return h;
}

static double response_db(enum ads1282_phase phase, double f)
{
    return 20.0 * log10(cabs(response(phase, f)) / cabs(response(phase, 0.0)));
}

static double worst_db(enum ads1282_phase phase, double from, double to, double sign)
{
    double worst = -1e9;
    for (double f = from; f <= to; f += 0.0005) worst = fmax(worst, sign * response_db(phase, f));
    return sign * worst;
}

static double corner(enum ads1282_phase phase)
{
    double lo = 0.4;
    double hi = 0.43;
    for (int i = 0; i < 40; i++) {
        const double f = 0.5 * (lo + hi);
        *(response_db(phase, f) > -3.0 ? &lo : &hi) = f;
    }
    return lo;
}

/* Sources 1.8, "composite properties", in units of the data rate. */
static const struct {
    enum ads1282_phase phase;
    double dc_gain, ripple_low_db, ripple_high_db, corner, half_db, stop_from, stop_db;
} properties[] = {
    {ADS1282_LINEAR, 1.0000287, -0.0028, 0.0021, 0.4129, -144.7, 0.5, -141.8},
    {ADS1282_MINIMUM, 1.0001690, -0.0031, 0.0004, 0.4136, -121.3, 0.502, -130.0},
};

static void frequency_response_has_the_tabulated_properties(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(properties); k++) {
        const enum ads1282_phase phase = properties[k].phase;
        near(cabs(response(phase, 0.0)), properties[k].dc_gain, 1e-7);
        near(worst_db(phase, 0.001, 0.375, -1.0), properties[k].ripple_low_db, 0.0001);
        near(worst_db(phase, 0.001, 0.375, 1.0), properties[k].ripple_high_db, 0.0001);
        near(corner(phase), properties[k].corner, 0.0002);
        near(response_db(phase, 0.5), properties[k].half_db, 0.1);
        const double stop_db = worst_db(phase, properties[k].stop_from, 15.5, 1.0);
        if (stop_db > properties[k].stop_db + 0.05) fail_msg("stop band %.2f dB", stop_db);
    }
}

/* The price of holding the input over a block instead of a modulator clock (docs/chips/ads1282.md). */
static void holding_a_block_droops_by_two_thousandths_of_a_decibel(void **state)
{
    (void)state;
    double g[G_MAX];
    const unsigned len = composite(32, ADS1282_LINEAR, g);
    double complex held = 0.0;
    double dc = 0.0;
    for (unsigned n = 0; n < len; n++) held += g[n] * cexp(-2.0 * PI * I * 0.375 * n / 32.0), dc += g[n];
    near(20.0 * log10(cabs(held) / dc) - response_db(ADS1282_LINEAR, 0.375), -0.0020, 0.0001);
}

static void delay_at_dc_is_31_and_5_data_periods(void **state)
{
    (void)state;
    const double want[2] = {30.80, 5.000};
    for (int phase = 0; phase < 2; phase++) {
        double g[G_MAX];
        const unsigned len = composite(32, (enum ads1282_phase)phase, g);
        double sum = 0.0;
        double moment = 0.0;
        for (unsigned n = 0; n < len; n++) sum += g[n], moment += (n + 0.5) * g[n];
        near(moment / sum / 32.0, want[phase], 0.006); /* a block counts at its middle */
    }
}

/* Sources 1.8, step settled to 1 %, 1e-4, 1e-6, in data periods. */
static void step_response_settles_as_tabulated(void **state)
{
    (void)state;
    const double limit[3] = {1e-2, 1e-4, 1e-6};
    const double want[2][3] = {{38.0, 55.1, 57.4}, {26.3, 42.7, 51.8}};
    for (int phase = 0; phase < 2; phase++) {
        double g[G_MAX];
        const unsigned len = composite(32, (enum ads1282_phase)phase, g);
        double dc = 0.0;
        for (unsigned n = 0; n < len; n++) dc += g[n];
        for (int k = 0; k < 3; k++) {
            unsigned last = 0;
            double step = 0.0;
            for (unsigned n = 0; n < len; n++)
                if (fabs((step += g[n]) / dc - 1.0) > limit[k]) last = n;
            near((last + 1) / 32.0, want[phase][k], 0.15); /* the step response seen once a block */
        }
    }
}

/* A reading depends on 1971 or 1963 blocks; 2015 have been taken when the first word after a synchronisation is due. */
static void first_settled_word_is_already_the_last(void **state)
{
    (void)state;
    for (int phase = 0; phase < 2; phase++) {
        static struct ads1282_filter f;
        ads1282_filter_init(&f, 32, (enum ads1282_phase)phase);
        int64_t block[ADS1282_BLOCKS];
        int64_t y[70];
        for (unsigned i = 0; i < ADS1282_BLOCKS; i++) block[i] = BLOCK_FS / 2;
        block[0] = 0;
        for (unsigned p = 0; p < COUNT(y); p++) {
            y[p] = ads1282_filter_period(&f, block);
            block[0] = BLOCK_FS / 2;
        }
        assert_int_equal(y[62], y[69]);
        assert_int_not_equal(y[55], y[69]);
        near((double)y[69], 0x1p29 * properties[phase].dc_gain, 0x1p29 * 1e-7);
    }
}

/* ---- Word widths ---- */

static void no_input_overflows_the_accumulators(void **state)
{
    (void)state;
    const double width[5] = {34, 34, 34, 34, 33}; /* log2 of full scale into sinc, stages 1..4 */
    for (int phase = 0; phase < 2; phase++) {
        double gain = ADS1282_SATURATION; /* worst amplitude so far, of full scale */
        for (int s = 0; s < ADS1282_FIR_STAGES; s++) {
            const struct ads1282_fir *f = &ads1282_fir[phase][s];
            double l1 = 0.0;
            for (unsigned i = 0; i < f->taps; i++) l1 += fabs(ldexp(f->tap[i], -(int)f->scale_log2));
            gain *= l1;
            assert_true(log2(gain) + f->scale_log2 + width[s + 1] < 63.0);
        }
    }
    assert_true(log2(ADS1282_SATURATION) + 28 + width[0] < 63.0); /* sinc taps sum to 128^4 at most */
}

static double sum_of_magnitudes(const double *g, unsigned len)
{
    double l1 = 0.0;
    for (unsigned n = 0; n < len; n++) l1 += fabs(g[n]);
    return l1;
}

static void no_output_is_above_the_overshoot(void **state)
{
    (void)state;
    double most = 0.0;
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        for (int phase = 0; phase < 2; phase++) {
            double g[G_MAX];
            const unsigned len = composite(ratios[k], (enum ads1282_phase)phase, g);
            most = fmax(most, sum_of_magnitudes(g, len));
        }
    }
    near(most, ADS1282_OVERSHOOT - 0.05, 0.05);
}

/* The input that drives the output highest: the signs of the impulse response. UBSan looks on. */
static void worst_input_gives_the_sum_of_magnitudes(void **state)
{
    (void)state;
    for (int phase = 0; phase < 2; phase++) {
        double g[G_MAX];
        const unsigned len = composite(128, (enum ads1282_phase)phase, g);
        static struct ads1282_filter f;
        ads1282_filter_init(&f, 128, (enum ads1282_phase)phase);
        const double l1 = sum_of_magnitudes(g, len);
        const int64_t top = (int64_t)(ADS1282_SATURATION * (double)BLOCK_FS);
        int64_t y = 0;
        for (unsigned p = 0; p < PERIODS_MAX; p++) {
            int64_t block[ADS1282_BLOCKS];
            for (unsigned i = 0; i < ADS1282_BLOCKS; i++) block[i] = g[2047 - 32 * p - i] < 0.0 ? -top : top;
            y = ads1282_filter_period(&f, block);
        }
        near((double)y, l1 * ADS1282_SATURATION * 0x1p30, 4.0);
    }
}

static void noise_gain_is_the_root_of_the_sum_of_squares(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(ratios); k++) {
        for (int phase = 0; phase < 2; phase++) {
            static struct ads1282_filter f;
            ads1282_filter_init(&f, ratios[k], (enum ads1282_phase)phase);
            double power = 0.0;
            for (unsigned at = 0; at < ADS1282_BLOCKS; at++) {
                int64_t block[ADS1282_BLOCKS] = {0};
                block[at] = BLOCK_FS;
                ads1282_filter_clear(&f);
                for (unsigned p = 0; p < PERIODS_MAX; p++) {
                    const double y = (double)ads1282_filter_period(&f, block) * 0x1p-30;
                    block[at] = 0;
                    power += y * y;
                }
            }
            near(ads1282_filter_noise_gain(&f), sqrt(power), 1e-8);
            near(sqrt(power), 0.16, 0.002);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(five_weights_are_the_sinc_at_the_modulator_rate),
        cmocka_unit_test(sinc_weights_sum_to_the_fourth_power),
        cmocka_unit_test(coefficients_are_the_published_ones),
        cmocka_unit_test(decimation_chain_is_the_composite),
        cmocka_unit_test(each_word_is_the_plain_convolution),
        cmocka_unit_test(frequency_response_has_the_tabulated_properties),
        cmocka_unit_test(holding_a_block_droops_by_two_thousandths_of_a_decibel),
        cmocka_unit_test(delay_at_dc_is_31_and_5_data_periods),
        cmocka_unit_test(step_response_settles_as_tabulated),
        cmocka_unit_test(first_settled_word_is_already_the_last),
        cmocka_unit_test(no_input_overflows_the_accumulators),
        cmocka_unit_test(no_output_is_above_the_overshoot),
        cmocka_unit_test(worst_input_gives_the_sum_of_magnitudes),
        cmocka_unit_test(noise_gain_is_the_root_of_the_sum_of_squares),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
