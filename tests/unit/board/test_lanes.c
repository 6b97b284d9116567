/* Rows of samples by vectors: the same numbers, to the bit, with AVX2, without, and one by one. Where a machine has no AVX2 the
 * first two are one. */
#include "rig.h"

#include "base/lanes.h"
#include "base/rng.h"
#include "board/afe.h"
#include "chip/ads1282/input.h"
#include "chip/ads1282/mod.h"

#include <math.h>
#include <string.h>

static bool forbidden; /* as on a machine without vectors */

bool lanes_allowed(void)
{
    return !forbidden;
}

#define MAX 33u

static double any_v(struct rng *r)
{
    static const double odd[] = {0.0, -0.0, 1.325, -1.325, 1.4, -1.4, INFINITY, -INFINITY, NAN, 1e300, -1e300, 5e-324};
    return rng_u64(r) % 4 ? 3.0 * (rng_uniform(r) - 0.5) : odd[rng_u64(r) % COUNT(odd)];
}

static void input_is_that_of_one_sample(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "lanes");
    for (unsigned round = 0; round < 3000; round++) {
        const unsigned n = 1 + round % MAX;
        const struct ads1282_scale scale = {0x1p34 / 1.25 * rng_uniform(&r), round % 3 ? 1e3 * rng_uniform(&r) : 0.0};
        const bool noisy = scale.noise_lsb > 0.0;
        double v[MAX];
        uint64_t u[MAX];
        int64_t wide[MAX], plain[MAX];
        for (unsigned i = 0; i < n; i++) v[i] = any_v(&r), u[i] = rng_u64(&r) | (rng_u64(&r) % 8 ? 0 : UINT64_MAX);
        ads1282_input_row(scale, v, noisy ? u : NULL, n, wide);
        forbidden = true;
        ads1282_input_row(scale, v, noisy ? u : NULL, n, plain);
        forbidden = false;
        assert_memory_equal(wide, plain, n * sizeof *wide);
        for (unsigned i = 0; i < n; i++) {
            const double x = v[i] * scale.lsb_per_v;
            assert_int_equal(wide[i], ads1282_saturate_lsb(noisy ? x + scale.noise_lsb * ads1282_sum_draw(u[i]) : x));
        }
    }
}

static void analog_chain_is_that_of_one_sample(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(2), 0, "lanes");
    struct afe_cfg c = afe_nominal(AFE_VOLTAGE);
    c.noise_v_rthz = 1e-6;
    c.buffer_offset_v = 1e-4;
    struct afe wide, plain, one;
    afe_init(&wide, &c, draws_of(1, 1, "afe"));
    plain = one = wide;
    int64_t t_ns[MAX], last_ns = 0;
    for (unsigned round = 0; round < 3000; round++) {
        const unsigned n = 1 + round % MAX;
        double v[MAX], w[MAX], x[MAX];
        const double degc = 20.0 + (double)(round / 100);
        for (unsigned i = 0; i < n; i++) {
            last_ns += rng_u64(&r) % 100 ? 976 + (int64_t)(rng_u64(&r) % 2) : (int64_t)(rng_u64(&r) % 2000);
            t_ns[i] = last_ns;
            v[i] = w[i] = x[i] = 24.0 * (rng_uniform(&r) - 0.5); /* clips now and then */
        }
        afe_out_row_v(&wide, v, degc, &(struct looks){t_ns, n, 976});
        forbidden = true;
        afe_out_row_v(&plain, w, degc, &(struct looks){t_ns, n, 976});
        forbidden = false;
        for (unsigned i = 0; i < n; i++) afe_out_row_v(&one, &x[i], degc, &(struct looks){t_ns + i, 1, 976});
        assert_memory_equal(v, w, n * sizeof *v);
        assert_memory_equal(v, x, n * sizeof *v);
    }
}

static void draws_are_those_without_bmi2(void **state)
{
    (void)state;
    const struct draws d = draws_of(3, 1, "lanes");
    for (unsigned n = 0; n <= MAX; n++) {
        uint64_t wide[MAX], plain[MAX];
        draws_row(&d, INT64_C(1) << n, n, wide);
        forbidden = true;
        draws_row(&d, INT64_C(1) << n, n, plain);
        forbidden = false;
        assert_memory_equal(wide, plain, n * sizeof *wide);
    }
}

/* Runs of any length beside the plain recurrence, its decode formula and the integrators one by one. */
static void runs_of_the_modulator_are_its_clocks(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(4), 0, "lanes");
    struct ads1282_mod one = {{0}, {0}, 0, 0}, run = one;
    struct ads1282_cic by_one, by_run;
    ads1282_cic_init(&by_one, 128);
    ads1282_cic_init(&by_run, 128);
    ads1282_mod_start(&run, &by_run);
    for (unsigned round = 0; round < 4000; round++) {
        const unsigned left = 128 - by_run.n, most = left < ADS1282_MOD_RUN ? left : ADS1282_MOD_RUN;
        const unsigned n = 1 + (unsigned)(rng_u64(&r) % most);
        int64_t x[ADS1282_MOD_RUN], want = 0, got = 0;
        bool due = false;
        for (unsigned i = 0; i < n; i++) {
            x[i] = ads1282_saturate_lsb(0x1p35 * (rng_uniform(&r) - 0.5));
            ads1282_mod_step(&one, x[i]);
            due = ads1282_cic_take(&by_one, ads1282_mod_decode(&one), &want);
        }
        ads1282_mod_run(&run, &by_run, x, n);
        assert_int_equal(ads1282_cic_output(&by_run, &got), due);
        assert_memory_equal(&run, &one, sizeof run);
        if (due) assert_int_equal(got, want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(input_is_that_of_one_sample), cmocka_unit_test(analog_chain_is_that_of_one_sample),
        cmocka_unit_test(draws_are_those_without_bmi2), cmocka_unit_test(runs_of_the_modulator_are_its_clocks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
