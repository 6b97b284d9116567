/* Signal path of the ADS1256 against the printed tables (sources 2.2, 2.7, 2.8) and the analytic response. */
#include "rig.h"

#include "chip/ads1256/filter.h"

#include <math.h>

#define CLKIN_HZ 7.68e6
#define PI       3.14159265358979323846

static void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

/* DRATE, SPS, t18 in ms, -3 dB in Hz. */
static const struct {
    uint8_t code;
    double sps, t18_ms, f3db_hz;
} printed[] = {
    {0xF0, 30000, 0.21, 6116}, {0xE0, 15000, 0.25, 4815}, {0xD0, 7500, 0.31, 3008}, {0xC0, 3750, 0.44, 1618},
    {0xB0, 2000, 0.68, 879},   {0xA1, 1000, 1.18, 442},   {0x92, 500, 2.18, 221},   {0x82, 100, 10.18, 44.3},
    {0x72, 60, 16.84, 26.6},   {0x63, 50, 20.18, 22.1},   {0x53, 30, 33.51, 13.3},  {0x43, 25, 40.18, 11.1},
    {0x33, 15, 66.84, 6.64},   {0x23, 10, 100.18, 4.43},  {0x13, 5, 200.18, 2.22},  {0x03, 2.5, 400.18, 1.11},
};

static void rates_and_settling_follow_the_printed_table(void **state)
{
    (void)state;
    assert_int_equal(COUNT(printed), ADS1256_RATES);
    for (unsigned i = 0; i < COUNT(printed); i++) {
        const struct ads1256_rate *r = ads1256_rate_of(printed[i].code);
        assert_non_null(r);
        assert_ptr_equal(r, &ads1256_rates[i]);
        near(CLKIN_HZ / (double)ads1256_period_tau(r), printed[i].sps, 1e-6);
        /* The column mixes rounding (15000 SPS) and truncation (3750 SPS): one unit of its last digit. */
        near((double)ads1256_settle_tau(r) / 7680.0, printed[i].t18_ms, 0.01);
        assert_int_equal(r->navg % r->cell_words, 0);
    }
}

static void only_sixteen_rate_codes_exist(void **state)
{
    (void)state;
    unsigned found = 0;
    for (unsigned code = 0; code < 256; code++) found += ads1256_rate_of((uint8_t)code) != NULL;
    assert_int_equal(found, 16);
    assert_null(ads1256_rate_of(0x20)); /* one Linux driver's 10 SPS */
    assert_null(ads1256_rate_of(0x0F)); /* the vendor's sample header */
}

/* Printed durations: SELFOCAL, SELFCAL at PGA 64, in us, and the unit of their last digit. */
static const struct {
    uint8_t code;
    double selfocal_us, selfcal_us, digit_us;
} durations[] = {
    {0xF0, 387, 892, 1},         {0xE0, 453, 896, 1},         {0xD0, 587, 1029, 1},        {0xC0, 853, 1300, 1},
    {0xB0, 1300, 2000, 100},     {0xA1, 2300, 3600, 100},     {0x92, 4300, 6600, 100},     {0x82, 20300, 31200, 100},
    {0x72, 33700, 50900, 100},   {0x63, 40300, 61800, 100},   {0x53, 67000, 101300, 100},  {0x43, 80300, 123200, 100},
    {0x33, 133700, 202100, 100}, {0x23, 200300, 307200, 100}, {0x13, 400300, 613800, 100}, {0x03, 800300, 1227200, 100},
};

static void calibration_durations_follow_the_printed_table(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(durations); i++) {
        const struct ads1256_rate *r = ads1256_rate_of(durations[i].code);
        const double ocal_us = (double)ads1256_cal_tau(r, ADS1256_SELFOCAL, 6) / 7.68;
        const double cal_us = (double)ads1256_cal_tau(r, ADS1256_SELFCAL, 6) / 7.68;
        near(ocal_us, durations[i].selfocal_us, 0.5 * durations[i].digit_us);
        near(cal_us, durations[i].selfcal_us, 0.1);
        for (unsigned g = 0; g < ADS1256_GAINS; g++) { /* the last t18 of each is the settling of a normal run */
            assert_true(ads1256_cal_tau(r, ADS1256_SELFCAL, g) > ads1256_cal_tau(r, ADS1256_SELFGCAL, g));
            assert_true(ads1256_cal_tau(r, ADS1256_SELFGCAL, g) > ads1256_settle_tau(r));
        }
    }
    const struct ads1256_rate *fast = ads1256_rate_of(0xF0);
    static const int gcal_us[] = {417, 417, 451, 517, 651, 651, 651};
    static const int cal_us[] = {596, 596, 692, 696, 892, 892, 892};
    for (unsigned g = 0; g < ADS1256_GAINS; g++) {
        near((double)ads1256_cal_tau(fast, ADS1256_SELFGCAL, g) / 7.68, gcal_us[g], 0.1);
        near((double)ads1256_cal_tau(fast, ADS1256_SELFCAL, g) / 7.68, cal_us[g], 0.1);
    }
}

static void alpha_beta_and_fsc_agree_with_each_other(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        const struct ads1256_rate *r = &ads1256_rates[i];
        near(r->fsc_ideal * r->beta / 8388608.0, 1.0, 3e-5);
        near(r->alpha * (double)r->fsc_ideal / 8388608.0, ADS1256_CODE_K, 1.0);
        bool clipped = false;
        near(ads1256_code(0.5 * r->alpha, 0, r->fsc_ideal, &clipped), 4194304, 2); /* K is one rounded constant */
        assert_false(clipped);
    }
}

static const struct {
    double raw;
    int32_t ofc;
    uint32_t fsc;
    int32_t code;
    bool clipped;
} codes[] = {
    {0.0, 0, 0x44AC08, 0, false},
    {4194304.0, 0, 0x44AC08, 8388607, true}, /* + full scale itself is one code too many */
    {4194303.5, 0, 0x44AC08, 8388607, false},
    {-4194304.0, 0, 0x44AC08, -8388608, false},
    {-4194305.0, 0, 0x44AC08, -8388608, true},
    {1e12, 0, 0x44AC08, 8388607, true},
    {-1e12, 0, 0x44AC08, -8388608, true},
    {2097152.0, 0, 0x44AC08, 4194304, false},
    {1000.0, 1000, 0x44AC08, 0, false},
    {0.0, 1000, 0x44AC08, -2000, false},
    {0.0, -0x800000, 0x44AC08, 8388607, true},
    {1000.0, 0, 0, 0, false},
    {2250244.0, 0, 1, 1, false}, /* FSC counts in units of K */
};

static void code_arithmetic(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(codes); i++) {
        bool clipped = false;
        assert_int_equal(ads1256_code(codes[i].raw, codes[i].ofc, codes[i].fsc, &clipped), codes[i].code);
        assert_int_equal(clipped, codes[i].clipped);
    }
}

static void calibration_arithmetic(void **state)
{
    (void)state;
    bool clamped = false;
    for (unsigned i = 0; i < ADS1256_RATES; i++)
        assert_int_equal(ads1256_cal_fsc(&ads1256_rates[i], ads1256_rates[i].alpha, &clamped),
                         ads1256_rates[i].fsc_ideal);
    assert_int_equal(ads1256_cal_fsc(&ads1256_rates[0], 1.01 * 0x400000, &clamped), 4455929); /* 4500488 / 1.01 */
    assert_int_equal(ads1256_cal_ofc(-12.4, &clamped), -12);
    assert_int_equal(ads1256_cal_ofc(8388607.0, &clamped), 0x7FFFFF);
    assert_int_equal(ads1256_cal_ofc(-8388608.0, &clamped), -0x800000);
    assert_false(clamped);
    static const struct {
        double span;
        uint32_t fsc;
    } ends[] = {{0.1 * 0x400000, 0xFFFFFF}, {0.0, 0xFFFFFF}, {-1.0, 0}, {-1e9, 0}};
    for (unsigned i = 0; i < COUNT(ends); i++) {
        clamped = false;
        assert_int_equal(ads1256_cal_fsc(&ads1256_rates[0], ends[i].span, &clamped), ends[i].fsc);
        assert_true(clamped);
    }
    for (int sign = -1; sign <= 1; sign += 2) {
        clamped = false;
        assert_int_equal(ads1256_cal_ofc(sign * 1e9, &clamped), sign > 0 ? 0x7FFFFF : -0x800000);
        assert_true(clamped);
    }
}

/* Sources 2.3, sinc5 and mean: |H| in clock terms. */
static double printed_response(double f_hz, unsigned navg)
{
    const double w = PI * f_hz / CLKIN_HZ;
    const double sinc = sin(256 * w) / (64 * sin(4 * w));
    const double mean = sin(256 * navg * w) / (navg * sin(256 * w));
    return fabs(pow(sinc, 5) * mean);
}

/* Amplitude of the words for a sine of amplitude 1: from the sine and the cosine at one fixed conversion. */
static double response_with(const struct ads1256_rate *r, unsigned cells_max, double f_hz)
{
    double quadrature[2];
    for (unsigned q = 0; q < 2; q++) {
        struct ads1256_mean m;
        ads1256_mean_start(&m, r, cells_max);
        const unsigned cells = m.cells + (m.sinc5 ? 4 : 0);
        for (unsigned i = 0; i < cells; i++) {
            const double t_s = (double)ads1256_cell_tau(&m, r, i) / CLKIN_HZ;
            ads1256_mean_push(&m, sin(2 * PI * f_hz * t_s + q * PI / 2));
        }
        assert_int_equal(m.words, 0); /* just complete */
        quadrature[q] = m.out;
    }
    return hypot(quadrature[0], quadrature[1]);
}

static double modelled_response(const struct ads1256_rate *r, double f_hz)
{
    return response_with(r, 0, f_hz);
}

/* Where the sinc5 is computed, to its aliases; elsewhere the mean of 10 or more points is 0.5 % high at half the rate and
 * 12 % at two and a half, and its notches are exact. */
static void response_is_the_printed_one(void **state)
{
    (void)state;
    static const double at[] = {0.01, 0.1, 0.25, 0.4, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0};
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        const struct ads1256_rate *r = &ads1256_rates[i];
        const double rate_hz = CLKIN_HZ / (double)ads1256_period_tau(r);
        for (unsigned k = 0; k < COUNT(at) && at[k] * rate_hz < 9000.0; k++) {
            const double f_hz = at[k] * rate_hz;
            const double want = printed_response(f_hz, r->navg);
            const double relative = r->cell_words == 1 ? 0.02 : at[k] <= 0.5 ? 0.006 : 0.12;
            near(modelled_response(r, f_hz), want, relative * want + 1e-9);
        }
    }
}

/* The few looks of the slow rates fold what lies at their own rate, 1000 Hz at 100 words/s and 500 Hz at 500; a look a word
 * does not, up to where the words themselves would. */
static void looks_fold_at_their_own_rate(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        const struct ads1256_rate *r = &ads1256_rates[i];
        const double looks_hz = CLKIN_HZ / (256.0 * r->cell_words);
        near(modelled_response(r, looks_hz), 1.0, 0.01);
        for (double f_hz = 37.0; f_hz < 9000.0; f_hz *= 1.7) {
            const double want = printed_response(f_hz, r->navg);
            near(response_with(r, ADS1256_EVERY_WORD, f_hz), want, 0.02 * want + 1e-9);
        }
        if (r->cell_words > 1) near(response_with(r, ADS1256_EVERY_WORD, looks_hz), 0.0, 1e-9);
    }
}

/* B-spline of unit knots by the recursion of Cox and de Boor: what `degree` + 1 boxcars of length 1 make. */
static double b_spline(unsigned degree, double x)
{
    if (degree == 0) return x >= 0.0 && x < 1.0;
    return (x * b_spline(degree - 1, x) + (degree + 1.0 - x) * b_spline(degree - 1, x - 1.0)) / degree;
}

/* One look at 1 among looks at 0: the taps are the sinc5 in time, five boxcars seen at the middle of each word. */
static void sinc5_is_five_boxcars(void **state)
{
    (void)state;
    struct ads1256_mean m;
    ads1256_mean_start(&m, &ads1256_rates[0], 0);
    for (int i = 0; i < 5; i++) ads1256_mean_push(&m, 0.0);
    for (int i = 0; i < 7; i++) {
        ads1256_mean_push(&m, i == 0);
        near(m.out, b_spline(4, i + 0.5), 1e-15);
    }
}

static void minus_3_db_where_printed(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(printed); i++) {
        const struct ads1256_rate *r = &ads1256_rates[i];
        assert_true(modelled_response(r, 0.99 * printed[i].f3db_hz) > sqrt(0.5));
        assert_true(modelled_response(r, 1.01 * printed[i].f3db_hz) < sqrt(0.5));
    }
}

static void mains_hum_vanishes_at_the_rates_meant_for_it(void **state)
{
    (void)state;
    static const struct {
        uint8_t code;
        double f_hz;
    } notch[] = {{0x03, 50}, {0x03, 60}, {0x13, 50}, {0x13, 60},  {0x23, 50},  {0x23, 60}, {0x63, 50},
                 {0x72, 60}, {0x53, 60}, {0x43, 50}, {0x63, 250}, {0x03, 300}, {0x82, 300}};
    for (unsigned i = 0; i < COUNT(notch); i++)
        near(modelled_response(ads1256_rate_of(notch[i].code), notch[i].f_hz), 0.0, 1e-9);
}

/* A ramp read at DRDY lags by the delay of sinc5 and mean, (Navg + 4) * 128 tau, at every rate and coarseness. */
static void delay_of_a_ramp_is_that_of_the_filter(void **state)
{
    (void)state;
    static const unsigned coarse[] = {0, 1, 7};
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned c = 0; c < COUNT(coarse); c++) {
            const struct ads1256_rate *r = &ads1256_rates[i];
            struct ads1256_mean m;
            ads1256_mean_start(&m, r, coarse[c]);
            const int64_t last = 3 * (int64_t)m.cells + (m.sinc5 ? 4 : 0);
            for (int64_t k = 0; k < last; k++) ads1256_mean_push(&m, (double)ads1256_cell_tau(&m, r, k));
            const int64_t ready_tau = ads1256_settle_tau(r) + 2 * ads1256_period_tau(r);
            assert_true(ads1256_cell_tau(&m, r, last - 1) < ready_tau);
            near((double)ready_tau - m.out, (r->navg + 4) * 128.0, 0.6);
        }
    }
}

static void gain_code_7_acts_as_64(void **state)
{
    (void)state;
    for (uint8_t code = 0; code < 7; code++) assert_int_equal(ads1256_gain_log2(code), code);
    assert_int_equal(ads1256_gain_log2(7), 6);
}

/* Sources 2.8, uV rms at G1, 2, 4 .. 64. */
static const double noise_uv[ADS1256_RATES][ADS1256_GAINS] = {
    {10.73, 6.71, 4.45, 3.28, 2.42, 1.79, 1.74},       {9.07, 5.92, 3.96, 2.98, 2.13, 1.52, 1.52},
    {7.25, 4.59, 3.15, 2.44, 1.69, 1.23, 1.19},        {5.39, 3.46, 2.38, 1.87, 1.22, 0.91, 0.91},
    {4.17, 2.59, 1.83, 1.49, 0.94, 0.69, 0.65},        {2.93, 1.89, 1.33, 1.07, 0.69, 0.51, 0.49},
    {1.95, 1.25, 0.63, 0.65, 0.5, 0.39, 0.37},         {0.875, 0.589, 0.409, 0.305, 0.229, 0.17, 0.169},
    {0.692, 0.438, 0.321, 0.233, 0.184, 0.146, 0.131}, {0.629, 0.393, 0.292, 0.216, 0.168, 0.136, 0.122},
    {0.533, 0.335, 0.245, 0.176, 0.138, 0.104, 0.106}, {0.494, 0.305, 0.224, 0.149, 0.134, 0.102, 0.093},
    {0.401, 0.264, 0.169, 0.126, 0.107, 0.085, 0.073}, {0.339, 0.214, 0.138, 0.106, 0.082, 0.061, 0.061},
    {0.301, 0.175, 0.102, 0.076, 0.061, 0.045, 0.044}, {0.247, 0.156, 0.08, 0.056, 0.043, 0.037, 0.033},
};

/* Effective bits of the 10 V range: 25.3 at 2.5 SPS and 19.8 at 30 kSPS (sources 2.8). */
static void noise_is_the_printed_table_and_gives_the_printed_bits(void **state)
{
    (void)state;
    near(log2(10.0 / ads1256_noise_v(ads1256_rate_of(0x03), 0)), 25.3, 0.05);
    near(log2(10.0 / ads1256_noise_v(ads1256_rate_of(0xF0), 0)), 19.8, 0.05);
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned g = 0; g < ADS1256_GAINS; g++)
            near(ads1256_noise_v(&ads1256_rates[i], g), noise_uv[i][g] * 1e-6, 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rates_and_settling_follow_the_printed_table),
        cmocka_unit_test(only_sixteen_rate_codes_exist),
        cmocka_unit_test(calibration_durations_follow_the_printed_table),
        cmocka_unit_test(alpha_beta_and_fsc_agree_with_each_other),
        cmocka_unit_test(code_arithmetic),
        cmocka_unit_test(calibration_arithmetic),
        cmocka_unit_test(response_is_the_printed_one),
        cmocka_unit_test(sinc5_is_five_boxcars),
        cmocka_unit_test(minus_3_db_where_printed),
        cmocka_unit_test(looks_fold_at_their_own_rate),
        cmocka_unit_test(mains_hum_vanishes_at_the_rates_meant_for_it),
        cmocka_unit_test(delay_of_a_ramp_is_that_of_the_filter),
        cmocka_unit_test(gain_code_7_acts_as_64),
        cmocka_unit_test(noise_is_the_printed_table_and_gives_the_printed_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
