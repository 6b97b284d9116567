/* The signal path of the AD7712 alone: sources 3.2 (rates, sinc3), 3.3 (codes, coefficients), 3.5 (noise). */
#include "rig.h"

#include "base/rng.h"
#include "chip/ad7712/filter.h"

#include <math.h>

static void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

#define PI 3.14159265358979323846

/* |H| of the weights at so many times the output rate, by its definition. */
static double gain_of(const struct ad7712_sinc3 *f, double freq)
{
    double re = 0.0, im = 0.0;
    for (unsigned k = 0; k < 3 * f->cells; k++) {
        const double phase = 2.0 * PI * freq * k / f->cells, w = f->weight[2 - k / f->cells][k % f->cells];
        re += w * cos(phase);
        im += w * sin(phase);
    }
    return sqrt(re * re + im * im);
}

/* The silicon's: |sin(N x) / (N sin x)|^3 with N = code. */
static double ideal_gain(unsigned code, double freq)
{
    const double below = code * sin(PI * freq / code);
    return fabs(below) < 1e-9 ? 1.0 : pow(fabs(sin(PI * freq) / below), 3.0);
}

static const unsigned codes[] = {19, 20, 39, 78, 195, 325, 326, 651, 781, 1953, 2000};

static void weights_add_up_to_one(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(codes); i++) {
        for (unsigned cells = 1; cells <= AD7712_CELLS_MAX; cells *= 2) {
            static struct ad7712_sinc3 f;
            ad7712_sinc3_start(&f, codes[i], cells);
            near(gain_of(&f, 0.0), 1.0, 1e-14);
        }
    }
}

/* A constant is there exactly after three periods and not before; a step at an output needs three, inside a period four. */
static void a_step_needs_three_periods_and_four_from_within_one(void **state)
{
    (void)state;
    for (unsigned cells = 4; cells <= AD7712_CELLS_MAX; cells *= 2) {
        for (unsigned late = 0; late < cells; late += cells / 4) {
            struct ad7712_sinc3 f = {0};
            ad7712_sinc3_start(&f, 325, cells);
            unsigned outputs = 0;
            double out[4] = {0};
            for (unsigned k = 0; outputs < 4; k++) {
                if (ad7712_sinc3_push(&f, k < late ? 0.0 : 1.0)) out[outputs++] = f.out;
            }
            near(out[3], 1.0, 1e-14);
            if (late) assert_true(out[2] < 0.9999);
            else near(out[2], 1.0, 1e-14);
            assert_true(out[0] < out[1] && out[1] < out[2] && out[1] < 0.999);
        }
    }
}

/* Against |sin(N x) / (N sin x)|^3, by looks per period: worst error below the -3 dB point and up to half the output rate. */
static void response_is_that_of_the_sinc3(void **state)
{
    (void)state;
    static const struct {
        unsigned cells;
        double in_band, to_half;
    } rows[] = {
        {1, 0.024, 0.23},     {2, 1.25e-3, 7.1e-3}, {4, 7.8e-5, 4.0e-4},  {8, 5.4e-6, 2.7e-5},
        {16, 3.4e-7, 1.7e-6}, {32, 2.1e-8, 1.1e-7}, {64, 1.3e-9, 6.2e-9},
    };
    for (unsigned i = 0; i < COUNT(codes); i++) {
        for (unsigned k = 0; k < COUNT(rows); k++) {
            static struct ad7712_sinc3 f;
            ad7712_sinc3_start(&f, codes[i], rows[k].cells);
            double in_band = 0.0, to_half = 0.0;
            for (double freq = 0.0; freq <= 0.5; freq += 0.01) {
                const double error = fabs(gain_of(&f, freq) - ideal_gain(codes[i], freq));
                if (freq <= 0.262) in_band = fmax(in_band, error);
                to_half = fmax(to_half, error);
            }
            if (rows[k].cells > codes[i]) continue;
            if (in_band > rows[k].in_band || to_half > rows[k].to_half)
                fail_msg("code %u, %u looks: %g, %g", codes[i], rows[k].cells, in_band, to_half);
        }
    }
}

static void notches_lie_at_multiples_of_the_output_rate(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(codes); i++) {
        for (unsigned cells = 2; cells <= AD7712_CELLS_MAX; cells *= 2) {
            static struct ad7712_sinc3 f;
            ad7712_sinc3_start(&f, codes[i], cells);
            for (unsigned m = 1; m < cells; m++) {
                near(gain_of(&f, m), 0.0, 1e-13);
                if (m < codes[i]) near(ideal_gain(codes[i], m), 0.0, 1e-13);
            }
            assert_true(gain_of(&f, cells) > 0.4); /* the price of few looks */
        }
    }
}

/* -3 dB at 0.262 of the rate: 2.62 Hz at 10 Hz is printed. */
static void minus_3_db_where_printed(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(codes); i++) {
        static struct ad7712_sinc3 f;
        ad7712_sinc3_start(&f, codes[i], ad7712_cells(codes[i], 0));
        near(gain_of(&f, 0.2619), sqrt(0.5), 0.002);
        near(ideal_gain(codes[i], 0.2619), sqrt(0.5), 0.002);
    }
}

static void codes_outside_19_to_2000_act_as_the_nearest(void **state)
{
    (void)state;
    static const unsigned rows[][2] = {{0, 19},      {18, 19},     {19, 19},     {20, 20},
                                       {1999, 1999}, {2000, 2000}, {2001, 2000}, {4095, 2000}};
    for (unsigned i = 0; i < COUNT(rows); i++) assert_int_equal(ad7712_code_of(rows[i][0]), rows[i][1]);
    assert_int_equal(ad7712_period_tau(19), 9728);
    assert_int_equal(ad7712_period_tau(2000), 1024000);
}

/* 4 kHz of looks, at least four a period, at most 64, or what the owner allows. */
static void looks_per_period(void **state)
{
    (void)state;
    static const unsigned rows[][3] = {{19, 0, 4},     {20, 0, 8}, {39, 0, 8}, {195, 0, 64}, {2000, 0, 64},
                                       {2000, 16, 16}, {19, 2, 2}, {19, 1, 1}, {19, 64, 4}};
    for (unsigned i = 0; i < COUNT(rows); i++) assert_int_equal(ad7712_cells(rows[i][0], rows[i][1]), rows[i][2]);
}

/* Sources 3.5, every printed cell, and the filled ones as their left neighbours. */
// clang-format off
static const struct {
    double notch_hz, uv[8];
} printed[] = {
    {10,   {1.0,  .78,  .48,  .33, .25, .25, .25, .25}},
    {25,   {1.8,  1.1,  .63,  .5,  .44, .41, .38, .38}},
    {30,   {2.5,  1.31, .84,  .57, .46, .43, .4,  .4}},
    {50,   {4.33, 2.06, 1.2,  .64, .54, .46, .46, .46}},
    {60,   {5.28, 2.36, 1.33, .87, .63, .62, .6,  .56}},
    {100,  {13,   6.4,  3.7,  1.8, 1.1, .9,  .65, .65}},
    {250,  {130,  75,   25,   12,  7.5, 4,   2.7, 1.7}},
    {500,  {600,  260,  140,  70,  35,  25,  15,  8}},
    {1000, {3100, 1600, 700,  290, 180, 120, 70,  40}},
};
// clang-format on

static void noise_is_the_printed_table(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(printed); i++) {
        for (unsigned g = 0; g < 8; g++) {
            /* The code nearest to the notch is off by part of a code; the steepest row goes with the rate to the 2.6. */
            const unsigned code = (unsigned)(1e7 / 512 / printed[i].notch_hz + 0.5);
            const double off = fabs(1e7 / 512 / code / printed[i].notch_hz - 1.0);
            near(ad7712_noise_v(code, g) * 1e6 / printed[i].uv[g], 1.0, 3.0 * off + 1e-12);
        }
    }
    for (unsigned g = 0; g < 8; g++) { /* beyond the ends: the last row's */
        near(ad7712_noise_v(19, g), printed[8].uv[g] * 1e-6, 1e-20);
        near(ad7712_noise_v(2000, g), printed[0].uv[g] * 1e-6, 1e-20);
    }
}

static void noise_falls_with_the_code(void **state)
{
    (void)state;
    for (unsigned g = 0; g < 8; g++) {
        for (unsigned code = 20; code <= 2000; code++)
            assert_true(ad7712_noise_v(code, g) <= ad7712_noise_v(code - 1, g) * (1 + 1e-12));
    }
    /* Half-way in the logarithm between 500 and 250 Hz: the geometric mean. */
    near(ad7712_noise_v(55, 0), 130e-6 * pow(600.0 / 130, log(19531.25 / 55 / 250) / log(2)), 1e-12);
}

static void words_by_coding(void **state)
{
    (void)state;
    static const struct {
        double x;
        bool unipolar;
        uint32_t word;
        bool clipped;
    } rows[] = {
        {0.0, false, 0x800000, false},
        {-1.0, false, 0x000000, false},
        {1.0, false, 0xFFFFFF, true},
        {0.5, false, 0xC00000, false},
        {-0.5, false, 0x400000, false},
        {-1.0000002, false, 0x000000, true},
        {1.05, false, 0xFFFFFF, true},
        {1.0 / 8388608, false, 0x800001, false},
        {-1.0 / 8388608, false, 0x7FFFFF, false},
        {0.0, true, 0x000000, false},
        {1.0, true, 0xFFFFFF, true},
        {0.5, true, 0x800000, false},
        {-0.01, true, 0x000000, true},
        {1.0 / 16777216, true, 0x000001, false},
        {16777215.0 / 16777216, true, 0xFFFFFF, false},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        bool clipped = false;
        const uint32_t word = ad7712_code(rows[i].x, AD7712_ZERO_IDEAL, AD7712_FULL_IDEAL, rows[i].unipolar, &clipped);
        if (word != rows[i].word || clipped != rows[i].clipped) fail_msg("row %u: %06X %d", i, word, clipped);
    }
}

/* Subtraction of the zero first, then the factor: doubling the factor doubles what is left of the zero. */
static void the_zero_is_taken_off_before_the_factor(void **state)
{
    (void)state;
    bool clipped = false;
    const uint32_t zero = AD7712_ZERO_IDEAL + 0x100000; /* a quarter of full scale */
    assert_int_equal(ad7712_code(0.25, zero, 2 * AD7712_FULL_IDEAL, false, &clipped), 0x800000);
    assert_int_equal(ad7712_code(0.5, zero, 2 * AD7712_FULL_IDEAL, false, &clipped), 0xC00000);
    assert_int_equal(ad7712_code(0.5, zero, AD7712_FULL_IDEAL / 2, true, &clipped), 0x200000);
    assert_false(clipped);
}

static void calibration_makes_zero_zero_and_full_full(void **state)
{
    (void)state;
    struct rng rng = rng_stream(rig_seed(7), 1, "cal");
    for (unsigned i = 0; i < 2000; i++) {
        const double zero_x = 0.4 * rng_uniform(&rng) - 0.2;
        const double full_x = zero_x + 0.7 + 0.6 * rng_uniform(&rng);
        bool clamped = false;
        const uint32_t zero = ad7712_cal_zero(zero_x, &clamped);
        const uint32_t full = ad7712_cal_full(full_x, zero, &clamped);
        assert_false(clamped);
        bool clipped = false;
        near(ad7712_code(zero_x, zero, full, false, &clipped), 0x800000, 2);
        near(ad7712_code(zero_x + 0.99 * (full_x - zero_x), zero, full, false, &clipped), 8388608 * 1.99, 4);
        near(ad7712_code(zero_x + 0.5 * (full_x - zero_x), zero, full, true, &clipped), 8388608, 8);
    }
}

static void coefficients_stop_at_their_ends(void **state)
{
    (void)state;
    bool clamped = false;
    assert_int_equal(ad7712_cal_zero(0.0, &clamped), AD7712_ZERO_IDEAL);
    assert_int_equal(ad7712_cal_full(1.0, AD7712_ZERO_IDEAL, &clamped), AD7712_FULL_IDEAL);
    assert_int_equal(ad7712_cal_zero(1.05, &clamped), AD7712_ZERO_IDEAL + 4404019);
    assert_false(clamped);
    static const double spans[] = {0.2, 0.0, -0.5}; /* factors of 4 and more */
    for (unsigned i = 0; i < COUNT(spans); i++) {
        clamped = false;
        assert_int_equal(ad7712_cal_full(spans[i], AD7712_ZERO_IDEAL, &clamped), 0xFFFFFF);
        assert_true(clamped);
    }
    clamped = false;
    assert_int_equal(ad7712_cal_zero(2.5, &clamped), 0xFFFFFF);
    assert_true(clamped);
    clamped = false;
    assert_int_equal(ad7712_cal_zero(-2.5, &clamped), 0x000000);
    assert_true(clamped);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_add_up_to_one),
        cmocka_unit_test(a_step_needs_three_periods_and_four_from_within_one),
        cmocka_unit_test(response_is_that_of_the_sinc3),
        cmocka_unit_test(notches_lie_at_multiples_of_the_output_rate),
        cmocka_unit_test(minus_3_db_where_printed),
        cmocka_unit_test(codes_outside_19_to_2000_act_as_the_nearest),
        cmocka_unit_test(looks_per_period),
        cmocka_unit_test(noise_is_the_printed_table),
        cmocka_unit_test(noise_falls_with_the_code),
        cmocka_unit_test(words_by_coding),
        cmocka_unit_test(the_zero_is_taken_off_before_the_factor),
        cmocka_unit_test(calibration_makes_zero_zero_and_full_full),
        cmocka_unit_test(coefficients_stop_at_their_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
