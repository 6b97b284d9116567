/* Analog chain: each part by itself against hand arithmetic, then the filter and its noise. */
#include "rig.h"

#include "base/rng.h"
#include "board/afe.h"

#include <math.h>

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static double out_v(struct afe *a, double signal, double degc, int64_t t_ns)
{
    double v = signal;
    afe_out_row_v(a, &v, degc, &(struct looks){&t_ns, 1, 31250});
    return v;
}

/* The first sample: at power-on the filter has long been settled. */
static double static_v(const struct afe_cfg *cfg, double signal, double degc)
{
    struct afe a;
    afe_init(&a, cfg, draws_of(1, 1, "afe.x"));
    return out_v(&a, signal, degc, 0);
}

/* Nominal: 1 kohm load, divider 8, so 10 mA -> 10 V -> 1.25 V. */
static void static_transfer(void **state)
{
    (void)state;
    struct afe_cfg i = afe_nominal(AFE_CURRENT);
    const struct afe_cfg v = afe_nominal(AFE_VOLTAGE);
    struct afe_cfg load_tol = i, load_tc = i, div_tol = i, div_tc = i, offset = v, offset_tc = v;
    load_tol.load_tol_ppm = 100;
    load_tc.load_tc_ppm_per_k = 5;
    div_tol.divider_tol_ppm = -200;
    div_tc.divider_tc_ppm_per_k = 2;
    offset.buffer_offset_v = 8e-3;
    offset_tc.buffer_offset_tc_v_per_k = 1e-6;
    const struct {
        const struct afe_cfg *cfg;
        double signal, degc, volts;
    } rows[] = {
        {&i, 10e-3, 25, 1.25},
        {&i, -10e-3, 25, -1.25},
        {&i, 0, 25, 0},
        {&v, 2.5, 25, 0.3125},
        {&v, 2.5, 60, 0.3125},
        {&i, 20e-3, 25, 10.5 / 8},
        {&i, -20e-3, 25, -10.5 / 8},
        {&load_tol, 8e-3, 25, 1.0001},
        {&load_tc, 8e-3, 45, 1.0001},
        {&load_tc, 8e-3, 5, 0.9999},
        {&div_tol, 8e-3, 25, 1.0 / 0.9998},
        {&div_tc, 8e-3, 75, 1.0 / 1.0001},
        {&offset, 0, 25, 1e-3},
        {&offset_tc, 0, 33, 1e-6},
        {&offset, 10.499, 25, 10.5 / 8},
    };
    for (size_t k = 0; k < COUNT(rows); k++)
        near(static_v(rows[k].cfg, rows[k].signal, rows[k].degc), rows[k].volts, 1e-15);
}

/* A step of 8 V through 1 kHz: 1 - exp(-2 pi f t) of it, whatever the steps of time. */
static void one_pole_is_exact_at_any_pace(void **state)
{
    (void)state;
    const int64_t paces_ns[] = {31250, 7812, 125000, 1000};
    struct afe_cfg cfg = afe_nominal(AFE_VOLTAGE);
    cfg.filter_hz = 1000.0;
    for (size_t p = 0; p < COUNT(paces_ns); p++) {
        struct afe a;
        afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
        near(out_v(&a, 0.0, 25, 0), 0.0, 0.0);
        for (int64_t k = 1; k <= 20; k++) {
            const int64_t t_ns = k * paces_ns[p];
            near(out_v(&a, 8.0, 25, t_ns), 1.0 - exp(-6.283185307179586e-6 * (double)t_ns), 1e-12);
            near(out_v(&a, 8.0, 25, t_ns), a.state_v, 0.0); /* the same instant again */
        }
    }
}

static void without_a_filter_the_chain_has_no_memory(void **state)
{
    (void)state;
    struct afe_cfg cfg = afe_nominal(AFE_VOLTAGE);
    cfg.filter_hz = 0.0;
    struct afe a;
    afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
    (void)out_v(&a, 0.0, 25, 0);
    near(out_v(&a, 8.0, 25, 1), 1.0, 0.0);
}

/* 1 uV/rtHz at the load, no filter: 1e-6 sqrt(1 / (2 * 31.25 us)) = 126.5 uV, / 8 at the converter. With one pole at f the
 * variance falls by (1 - k) / (1 + k), k = exp(-2 pi f dt). */
static void noise_has_its_density(void **state)
{
    (void)state;
    enum { N = 40000 };
    const double filters_hz[] = {0.0, 1000.0};
    for (size_t i = 0; i < 2; i++) {
        struct afe_cfg cfg = afe_nominal(AFE_VOLTAGE);
        cfg.noise_v_rthz = 1e-6;
        cfg.filter_hz = filters_hz[i];
        struct afe a;
        afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
        double sum2 = 0.0;
        for (int64_t k = 0; k < N; k++) {
            const double v = out_v(&a, 0.0, 25, k * 31250);
            sum2 += v * v;
        }
        const double k = filters_hz[i] > 0.0 ? exp(-6.283185307179586 * filters_hz[i] * 31.25e-6) : 0.0;
        const double want = 126.491e-6 / 8.0 * sqrt((1.0 - k) / (1.0 + k));
        near(sqrt(sum2 / N), want, 0.03 * want);
    }
}

/* Without filter and noise each sample is the static transfer at the temperature of its own instant. */
static void temperature_acts_at_once(void **state)
{
    (void)state;
    const enum afe_input inputs[] = {AFE_CURRENT, AFE_VOLTAGE};
    const double degc[] = {25.0, 60.0, 60.0, -40.0, 25.0};
    for (size_t k = 0; k < COUNT(inputs); k++) {
        struct afe_cfg c = afe_nominal(inputs[k]);
        c.filter_hz = 0.0;
        c.load_tc_ppm_per_k = 5.0;
        c.divider_tc_ppm_per_k = -3.0;
        c.buffer_offset_tc_v_per_k = 1e-6;
        const double signal = inputs[k] == AFE_CURRENT ? 0.004 : 4.0;
        struct afe a;
        afe_init(&a, &c, draws_of(1, 1, "afe"));
        for (size_t i = 0; i < COUNT(degc); i++)
            assert_true(out_v(&a, signal, degc[i], 1000 * (int64_t)i) == static_v(&c, signal, degc[i]));
        assert_true(static_v(&c, signal, 60.0) != static_v(&c, signal, 25.0));
    }
}

/* Rows of any length, steps that are now the usual ones and now not, none at all among them, changes of temperature. */
static void a_row_is_its_samples_one_by_one(void **state)
{
    (void)state;
    struct rng g = rng_stream(rig_seed(4), 0, "rows");
    for (int noisy = 0; noisy < 2; noisy++) {
        struct afe_cfg c = afe_nominal(AFE_CURRENT);
        c.divider_tc_ppm_per_k = -300.0;
        c.buffer_offset_v = 1e-3;
        c.buffer_offset_tc_v_per_k = 1e-5;
        c.noise_v_rthz = noisy ? 1e-6 : 0.0;
        struct afe one, row;
        afe_init(&one, &c, draws_of(1, 1, "afe"));
        afe_init(&row, &c, draws_of(1, 1, "afe"));
        int64_t last_ns = 0;
        for (unsigned n = 0; n < 3000; n++) {
            int64_t t_ns[32];
            double v[32], want[32];
            const uint64_t u = rng_u64(&g);
            const unsigned count = 1 + (unsigned)u % 32;
            const double degc = u >> 8 & 3 ? 25.0 : 30.0;
            for (unsigned i = 0; i < count; i++) {
                const uint64_t w = rng_u64(&g);
                last_ns += w % 20 ? 31250 + (int64_t)(w >> 8) % 2 : (int64_t)(w >> 8) % 3 * 7000;
                t_ns[i] = last_ns;
                v[i] = 0.024 * ((double)(w >> 40) / (double)(1 << 24) - 0.5); /* clips now and then */
                want[i] = out_v(&one, v[i], degc, last_ns);
            }
            afe_out_row_v(&row, v, degc, &(struct looks){t_ns, count, 31250});
            assert_memory_equal(v, want, count * sizeof *v);
        }
    }
}

/* 10 kHz at 4000 words/s, where most of the state stays from step to step: after a few hundred of them nothing of what was
 * before is left, not even a last bit, of an input at rest as of one that moves. */
static void two_pasts_become_one(void **state)
{
    (void)state;
    const struct afe_cfg c = afe_nominal(AFE_VOLTAGE);
    for (int moving = 0; moving < 2; moving++) {
        struct afe a, b;
        afe_init(&a, &c, draws_of(1, 1, "afe"));
        b = a;
        (void)out_v(&a, 9.0, 25, 0);
        (void)out_v(&b, -3.0, 25, 0);
        for (int64_t k = 1; k <= 500; k++) {
            const double v = moving ? 3.3 + 1e-4 * (double)k : 3.3;
            const double va = out_v(&a, v, 25, k * 7812), vb = out_v(&b, v, 25, k * 7812);
            if (k >= 400) assert_true(va == vb);
        }
    }
}

/* 2 V or 2 mA into the nominal chain, no filter; each fault from 1 s on. 10.5 V is the limit of the buffer, 8 the divider. */
static void each_fault_changes_the_chain_as_it_says(void **state)
{
    (void)state;
    const struct {
        enum afe_input input;
        enum afe_fault_kind kind;
        double value, rate_per_s, frequency_hz, signal;
        int64_t t_ns;
        double volts;
    } rows[] = {
        {AFE_CURRENT, AFE_LOAD_OPEN, 0, 0, 0, 2e-3, 999999999, 0.25}, /* not yet */
        {AFE_CURRENT, AFE_LOAD_OPEN, 0, 0, 0, 2e-3, 1000000000, 10.5 / 8},
        {AFE_CURRENT, AFE_LOAD_OPEN, 0, 0, 0, -2e-3, 1000000000, -10.5 / 8},
        {AFE_CURRENT, AFE_LOAD_OPEN, 0, 0, 0, 0, 1000000000, 10.5 / 8},
        {AFE_CURRENT, AFE_LOAD_SHORT, 0, 0, 0, 2e-3, 1000000000, 0},
        {AFE_VOLTAGE, AFE_REFERENCE, 0.25, 0, 0, 2, 9000000000, 0.2},
        {AFE_VOLTAGE, AFE_REFERENCE, 0, 0.125, 0, 2, 3000000000, 0.2}, /* after 2 s */
        {AFE_VOLTAGE, AFE_RIPPLE, 0.5, 0, 50, 2, 1000000000, 0.25},
        {AFE_VOLTAGE, AFE_RIPPLE, 0.5, 0, 50, 2, 1005000000, 2.5 / 8}, /* a quarter of 20 ms */
        {AFE_VOLTAGE, AFE_RIPPLE, 0.5, 0, 50, 2, 3015000000, 1.5 / 8},
    };
    for (size_t k = 0; k < COUNT(rows); k++) {
        struct afe_fault f = {.kind = rows[k].kind,
                              .value = rows[k].value,
                              .rate_per_s = rows[k].rate_per_s,
                              .frequency_hz = rows[k].frequency_hz,
                              .from_ns = 1000000000};
        struct afe_cfg cfg = afe_nominal(rows[k].input);
        struct afe a;
        cfg.filter_hz = 0.0;
        afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
        afe_fault_add(&a, &f);
        double row[] = {rows[k].signal, rows[k].signal};
        const int64_t t_ns[] = {rows[k].t_ns - 31250, rows[k].t_ns};
        near(out_v(&a, rows[k].signal, 25, rows[k].t_ns), rows[k].volts, 1e-12);
        afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
        afe_fault_add(&a, &f);
        afe_out_row_v(&a, row, 25, &(struct looks){t_ns, 2, 31250});
        near(row[1], rows[k].volts, 1e-12);
        afe_fault_remove(&a, &f);
        afe_fault_remove(&a, &f);
        near(out_v(&a, rows[k].signal, 25, rows[k].t_ns + 31250), static_v(&cfg, rows[k].signal, 25), 1e-15);
    }
}

/* Ten times the corner, and 70 Hz above the rate of the looks: what is left is the pole's 1/(1 + jf/fc), seen at 100 kHz and
 * at 70 Hz. A ripple up to AFE_SLOW_HZ goes through the pole of the looks. */
static void a_fast_ripple_passes_the_pole_as_in_the_part(void **state)
{
    (void)state;
    static const double hz[] = {100e3, 1024070.0};
    for (unsigned k = 0; k < COUNT(hz); k++) {
        struct afe_fault f = {.kind = AFE_RIPPLE, .value = 0.8, .frequency_hz = hz[k]};
        const struct afe_cfg cfg = afe_nominal(AFE_VOLTAGE);
        struct afe a;
        afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
        afe_fault_add(&a, &f);
        const double ratio = hz[k] / 10e3, gain = 1.0 / sqrt(1.0 + ratio * ratio), lag = atan(ratio);
        double largest_v = 0.0;
        for (int n = 1; n < 40000; n++) {
            const int64_t t_ns = (int64_t)(n * 976.5625);
            const double v = out_v(&a, 1.0, 25, t_ns);
            near(v, 0.125 + 0.1 * gain * sin(6.283185307179586 * hz[k] * 1e-9 * (double)t_ns - lag), 1e-9);
            largest_v = fmax(largest_v, v - 0.125);
        }
        assert_true(largest_v > 0.999 * 0.1 * gain);
    }
}

static void faults_of_a_chain_add_up(void **state)
{
    (void)state;
    struct afe_fault low = {.kind = AFE_REFERENCE, .value = 0.25}, again = {.kind = AFE_REFERENCE, .value = 0.6};
    struct afe_fault ripple = {.kind = AFE_RIPPLE, .value = 8.0, .frequency_hz = 1.0};
    struct afe_cfg cfg = afe_nominal(AFE_VOLTAGE);
    struct afe a;
    cfg.filter_hz = 0.0;
    afe_init(&a, &cfg, draws_of(1, 1, "afe.x"));
    afe_fault_add(&a, &low);
    afe_fault_add(&a, &ripple);
    afe_fault_add(&a, &again);
    near(out_v(&a, 8.0, 25, 250000000), 1.0, 1e-12); /* (8 + 8) / 8 / 1.25 / 1.6 */
    afe_fault_remove(&a, &ripple);
    near(out_v(&a, 8.0, 25, 260000000), 0.5, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(temperature_acts_at_once),      cmocka_unit_test(static_transfer),
        cmocka_unit_test(one_pole_is_exact_at_any_pace), cmocka_unit_test(without_a_filter_the_chain_has_no_memory),
        cmocka_unit_test(noise_has_its_density),         cmocka_unit_test(a_row_is_its_samples_one_by_one),
        cmocka_unit_test(two_pasts_become_one),          cmocka_unit_test(each_fault_changes_the_chain_as_it_says),
        cmocka_unit_test(faults_of_a_chain_add_up),      cmocka_unit_test(a_fast_ripple_passes_the_pole_as_in_the_part),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
