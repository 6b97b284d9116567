/* High-pass of the ADS1281/ADS1282 against its formulas and the table of the data sheet (sources 1.7). */
#include "rig.h"

#include "base/rng.h"
#include "chip/ads1282/filter.h"

#include <complex.h>
#include <math.h>

#define PI 3.14159265358979323846

static void near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.17g, want %.17g within %g", got, want, tolerance);
}

/* |H| in dB at f, in units of the data rate, from the impulse response itself. */
static double response_db(uint16_t hpf, double f)
{
    struct ads1282_hpf h;
    ads1282_hpf_clear(&h);
    double complex sum = 0.0;
    for (int n = 0; n < 40000; n++) {
        (void)ads1282_hpf_step(&h, n == 0 ? INT64_C(1) << 31 : 0, hpf);
        sum += ldexp((double)h.y, -20 - 31) * cexp(-2.0 * PI * I * f * n);
    }
    return 20.0 * log10(cabs(sum));
}

/* Register for a corner, data sheet p. 21. */
static double register_for(double corner)
{
    const double w = 2.0 * PI * corner;
    const double c = (cos(w) + sin(w) - 1.0) / cos(w);
    return 65536.0 * (1.0 - sqrt(1.0 - 2.0 * c));
}

static const struct {
    double corner_hz, data_hz;
    uint16_t hpf;
} table[] = {{0.5, 250, 0x0337}, {1.0, 500, 0x0337}, {1.0, 1000, 0x019A}};

static void minus_3_db_lies_at_the_corners_of_the_table(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(table); k++) {
        near(register_for(table[k].corner_hz / table[k].data_hz), table[k].hpf,
             2.0); /* 019Ah: the formula says 411.8 */
        near(response_db(table[k].hpf, table[k].corner_hz / table[k].data_hz), -3.01, 0.03);
        near(response_db(table[k].hpf, 0.5), 0.0, 0.001);
    }
    near(response_db(0x0332, 0.00199), -3.01, 0.03); /* reset value */
    near(response_db(0x0337, 0.5), 20.0 * log10(0.99996), 0.0002);
}

static void the_pole_at_the_reset_value_is_0_987596(void **state)
{
    (void)state;
    struct ads1282_hpf h;
    ads1282_hpf_clear(&h);
    (void)ads1282_hpf_step(&h, 1 << 30, 0x0332);
    (void)ads1282_hpf_step(&h, 1 << 30, 0x0332);
    const double before = (double)h.y;
    (void)ads1282_hpf_step(&h, 1 << 30, 0x0332);
    near((double)h.y / before, 0.987596, 5e-7);
}

/* The recursion in long double, for any register value: the arithmetic drops nothing that shows. */
static void any_coefficient_is_the_recursion_to_the_last_bit(void **state)
{
    (void)state;
    struct rng g = rng_stream(rig_seed(12), 0, "hpf");
    for (int k = 0; k < 300; k++) {
        const uint16_t hpf = k == 0 ? 0 : k == 1 ? 0xFFFF : k == 2 ? 1 : (uint16_t)rng_u64(&g);
        const long double a = hpf / 65536.0L;
        const long double b = (1.0L + (1.0L - a) * (1.0L - a)) / 2.0L;
        struct ads1282_hpf h;
        ads1282_hpf_clear(&h);
        long double y = 0.0L;
        int64_t last = 0;
        for (int n = 0; n < 300; n++) {
            const int64_t x = (int64_t)(rng_u64(&g) >> 30) - (INT64_C(1) << 33); /* anything below 2^33 */
            y = (2.0L - a) / 2.0L * (long double)(x - last) + b * y;
            last = x;
            const int64_t got = ads1282_hpf_step(&h, x, hpf);
            assert_true(fabsl((long double)got - y) < 0.502L);
        }
    }
}

/* The state itself, with 128-bit products: one rounding to nearest a word. */
static void the_state_is_rounded_to_nearest_once_a_word(void **state)
{
    (void)state;
    __extension__ typedef __int128 wide;
    struct rng g = rng_stream(rig_seed(13), 0, "hpf");
    for (int k = 0; k < 300; k++) {
        const uint16_t hpf = k == 0 ? 0xFFFF : (uint16_t)rng_u64(&g);
        const int64_t d = (INT64_C(1) << 32) - (int64_t)(65536 - hpf) * (65536 - hpf);
        struct ads1282_hpf h;
        ads1282_hpf_clear(&h);
        for (int n = 0; n < 100; n++) {
            const struct ads1282_hpf was = h;
            const int64_t x = (int64_t)(rng_u64(&g) >> 30) - (INT64_C(1) << 33);
            (void)ads1282_hpf_step(&h, x, hpf);
            const wide half = (wide)1 << 32;
            const wide product = (wide)was.y * d + half;
            const wide floor = (product - (product % (2 * half) + 2 * half) % (2 * half)) / (2 * half);
            assert_int_equal(h.y, was.y + (x - was.x) * (131072 - hpf) * 8 - (int64_t)floor);
        }
    }
}

static void a_constant_dies_away_to_exactly_zero(void **state)
{
    (void)state;
    static const uint16_t values[] = {0x0337, 0x019A, 0x0332, 0x4000, 0xFFFF, 0x0010};
    for (unsigned k = 0; k < COUNT(values); k++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            struct ads1282_hpf h;
            ads1282_hpf_clear(&h);
            int64_t y = 1;
            for (int n = 0; n < 200000; n++) y = ads1282_hpf_step(&h, sign * (INT64_C(1) << 30), values[k]);
            assert_int_equal(y, 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(minus_3_db_lies_at_the_corners_of_the_table),
        cmocka_unit_test(the_pole_at_the_reset_value_is_0_987596),
        cmocka_unit_test(any_coefficient_is_the_recursion_to_the_last_bit),
        cmocka_unit_test(the_state_is_rounded_to_nearest_once_a_word),
        cmocka_unit_test(a_constant_dies_away_to_exactly_zero),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
