/* libpsabench: what only the ADS1281 and ADS1282 have: two inputs, MFLAG, PWDN, modulator pins, mode pins, chains. */
#include "api_rig.h"
#include "base/clk.h"

#include <math.h>

static void sdatac_wreg(psabench_part *p, uint8_t address, uint8_t value)
{
    const uint8_t bytes[] = {0x11, (uint8_t)(0x40 | address), 0, value, 0x10};
    psabench *b = psabench_of(p);
    good(b, psabench_spi_clock(p, 1024000, 6000)); /* 24 tCLK between the bytes */
    good(b, psabench_spi(p, bytes, NULL, sizeof bytes));
    run(b, 6000);
    good(b, psabench_spi_clock(p, 1024000, 0));
    assert_int_equal(psabench_peek(p, address), value);
}

/* Volts of the newest word, gain 1, VREF 5 V; the filters have settled. */
static double settled_v(psabench_part *p)
{
    uint8_t b[4];
    run(psabench_of(p), 70 * MS);
    until(p, "DRDY", 1);
    until(p, "DRDY", 0);
    run(psabench_of(p), 1000);
    good(psabench_of(p), psabench_spi(p, NULL, b, 4));
    const uint32_t word = (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
    return 2.5 * (double)(int32_t)word / 2147483648.0;
}

static void is_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("got %.9g, want %.9g within %g", got, want, tolerance);
}

static void each_input_reaches_its_place_in_the_multiplexer(void **state)
{
    (void)state;
    static const struct {
        uint8_t config1;
        double want_v;
    } rows[] = {{0x08, 1.0}, {0x18, -0.5}, {0x28, 0.0}, {0x38, 0.25}, {0x48, 0.0}};
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1282", "u", "power_up_tclk=0 noise_scale=0");
    good(b, psabench_set_volts(p, 0, 1.0));
    good(b, psabench_set_volts(p, 1, -0.5));
    for (size_t i = 0; i < COUNT(rows); i++) {
        if (i) sdatac_wreg(p, 2, rows[i].config1);
        is_near(settled_v(p), rows[i].want_v, 2e-4 * fabs(rows[i].want_v) + 1e-8);
    }
    assert_int_equal(psabench_set_volts(p, 2, 0.0), PSABENCH_BAD_ARGUMENT);
    assert_int_equal(counter(p, "gap_violations"), 0);
    psabench_free(b);
    b = psabench_new(1);
    p = part(b, "ads1281", "u", "power_up_tclk=0 noise_scale=0");
    good(b, psabench_set_volts(p, 0, 1.0));
    assert_int_equal(psabench_set_volts(p, 1, 0.0), PSABENCH_BAD_ARGUMENT);
    is_near(settled_v(p), 1.0, 2e-4);
    psabench_free(b);
}

/* The past keeps its volts: a step in the middle of a data period is felt from there on, not from its beginning. */
static void a_step_begins_when_it_is_made(void **state)
{
    (void)state;
    double v[3];
    for (int k = 0; k < 3; k++) { /* at the beginning, in the middle, and at the end of a data period */
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, "ads1282", "u", "power_up_tclk=0 noise_scale=0");
        until(p, "DRDY", 0);
        run(b, k * 480000);
        good(b, psabench_set_volts(p, 0, 1.0));
        for (int i = 0; i < 32 - (k > 0); i++) { /* the delay of the linear-phase chain: half of the step is there */
            until(p, "DRDY", 1);
            until(p, "DRDY", 0);
        }
        uint8_t byte[4];
        good(b, psabench_spi(p, NULL, byte, 4));
        v[k] = 2.5 * (double)(int32_t)((uint32_t)byte[0] << 24 | (uint32_t)byte[1] << 16) / 2147483648.0;
        psabench_free(b);
    }
    assert_true(fabs(v[0] - v[1]) > 0.1 && fabs(v[1] - v[2]) > 0.1);
}

static uint32_t next_word(psabench_part *p)
{
    uint8_t b[4];
    until(p, "DRDY", 1);
    until(p, "DRDY", 0);
    run(psabench_of(p), 1000);
    good(psabench_of(p), psabench_spi(p, NULL, b, 4));
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

static void chains_agree_about_a_constant_and_differ_as_they_say(void **state)
{
    (void)state;
    static const struct {
        const char *options;
        bool restless, abrupt; /* quantisation noise; a step has nothing between its ends */
    } rows[] = {{"power_up_tclk=0 noise_scale=0 chain=exact", false, false},
                {"power_up_tclk=0 noise_scale=0 chain=modulator", true, false},
                {"power_up_tclk=0 noise_scale=0 chain=direct", false, true}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        unsigned changes = 0;
        unsigned between = 0;
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, "ads1282", "u", rows[i].options);
        good(b, psabench_set_volts(p, 0, 1.0));
        is_near(settled_v(p), 1.0, 2e-4);
        const uint32_t one = next_word(p);
        for (int k = 0; k < 20; k++) changes += next_word(p) != one;
        good(b, psabench_set_volts(p, 0, 0.0));
        for (int k = 0; k < 70; k++) {
            const uint32_t word = next_word(p);
            between += word > one / 10 && word < one / 10 * 9;
        }
        assert_int_equal(changes > 0, rows[i].restless);
        assert_int_equal(between == 0, rows[i].abrupt);
        psabench_free(b);
    }
}

static void mflag_says_over_range(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1282", "u", "power_up_tclk=0 noise_scale=0");
    run(b, MS);
    assert_int_equal(get(p, "MFLAG"), 0);
    good(b, psabench_set_volts(p, 0, -2.6));
    good(b, psabench_run_until_level(p, pin(p, "MFLAG"), 1, 100000)); /* within a sample, not a data period */
    good(b, psabench_set_volts(p, 0, 0.0));
    good(b, psabench_run_until_level(p, pin(p, "MFLAG"), 0, 100000));
    psabench_free(b);
}

static void power_down_and_reset_begin_anew(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1282", "u", "noise_scale=0");
    until(p, "DRDY", 0);
    assert_true(psabench_now_ns(b) > 79 * MS && psabench_now_ns(b) < 80 * MS); /* 65536 tCLK and t_DR */
    sdatac_wreg(p, 5, 0x77);
    set(p, "RESET", 0);
    run(b, 1000);
    set(p, "RESET", 1);
    assert_int_equal(psabench_peek(p, 5), 0);
    int64_t t0_ns = psabench_now_ns(b);
    until(p, "DRDY", 0);
    assert_true(psabench_now_ns(b) - t0_ns > 63 * MS && psabench_now_ns(b) - t0_ns < 64 * MS);
    set(p, "PWDN", 0);
    assert_int_equal(get(p, "DRDY"), 1);
    assert_int_equal(psabench_run_until_level(p, pin(p, "DRDY"), 0, S), PSABENCH_TIMEOUT);
    set(p, "PWDN", 1);
    t0_ns = psabench_now_ns(b);
    until(p, "DRDY", 0);
    assert_true(psabench_now_ns(b) - t0_ns > 79 * MS && psabench_now_ns(b) - t0_ns < 80 * MS);
    psabench_free(b);
}

/* FILTR = 00: two bit streams on MCLK, whose weighted sum is the input (sources 1.7). */
static void modulator_pins_carry_the_input(void **state)
{
    (void)state;
    static struct rig_vcd v;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1281", "u", "power_up_tclk=0 noise_scale=0 chain=modulator");
    good(b, psabench_set_volts(p, 0, 0.8));
    run(b, MS);
    sdatac_wreg(p, 1, 0x50);
    run(b, MS);
    rig_vcd_path(&v);
    good(b, psabench_vcd(b, v.path));
    run(b, 4 * MS);
    good(b, psabench_vcd_close(b));
    psabench_free(b);
    rig_vcd_read(&v);
    int m[2] = {-1, -1};
    double x1[3] = {0};
    double sum = 0.0;
    unsigned rises = 0;
    int64_t last_ns = 0;
    double last[5] = {0};
    for (unsigned i = 0; i < v.count; i++) {
        const struct rig_change *c = &v.change[i];
        const bool mclk = strcmp(c->name, "u.MCLK") == 0;
        if (strcmp(c->name, "u.M0") == 0) m[0] = c->level;
        if (strcmp(c->name, "u.M1") == 0) m[1] = c->level;
        if (!mclk || c->level) continue;                           /* both are taken where MCLK falls */
        if (last_ns) assert_in_range(c->t_ns - last_ns, 976, 977); /* CLK/4 */
        last_ns = c->t_ns;
        for (int k = 4; k > 0; k--) last[k] = last[k - 1];
        last[0] = m[0] > 0 ? 1.0 : -1.0;
        for (int k = 2; k > 0; k--) x1[k] = x1[k - 1];
        x1[0] = m[1] > 0 ? 1.0 : -1.0;
        if (++rises < 10) continue;
        sum += 3 * last[2] - 6 * last[3] + 4 * last[4] + 9 * (x1[0] - 2 * x1[1] + x1[2]);
    }
    assert_true(rises > 4000);
    is_near(2.5 * 1.25 * sum / (rises - 9), 0.8,
            0.05); /* full scale is 4/5 of the bits' range; ends of the window: 0.03 */
}

static void is_a_clk_edge(void *ctx, psabench_part *p, int pin, int level, int64_t t_ns)
{
    static const struct clk clk = {.hz = 4096000, .div = 1};
    (void)p;
    (void)pin;
    (void)level;
    assert_int_equal(t_ns, clk_edge_ns(&clk, clk_count_at(&clk, t_ns)));
    ++*(unsigned *)ctx;
}

/* MCLK is CLK/4: both its edges are CLK's, to the nanosecond. */
static void mclk_moves_with_clk(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1281", "u", "power_up_tclk=0 noise_scale=0");
    sdatac_wreg(p, 1, 0x50);
    unsigned edges = 0;
    good(b, psabench_watch(p, psabench_pin(p, "MCLK"), is_a_clk_edge, &edges));
    run(b, MS);
    assert_in_range(edges, 2046, 2050);
    psabench_free(b);
}

/* DR[1:0] 01: 500 words/s. */
static void mode_pins_set_the_rate_without_registers(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1281", "u", "power_up_tclk=0 noise_scale=0 pin_mode=1");
    good(b, psabench_set_volts(p, 0, 1.0));
    set(p, "DR0", 1);
    until(p, "DRDY", 0);
    const int64_t t0_ns = psabench_now_ns(b);
    until(p, "DRDY", 1);
    until(p, "DRDY", 0);
    assert_true(psabench_now_ns(b) - t0_ns == 2 * MS);
    set(p, "DR0", 0);
    set(p, "DR1", 1);
    set(p, "PHS", 1);
    is_near(settled_v(p), 1.0, 3e-4);
    good(b, psabench_set_volts(p, 0, 0.0));
    run(b, 12 * MS); /* minimum phase: 5 ms of delay; with linear phase nothing would have come yet */
    assert_true((int32_t)next_word(p) < 400000000);
    good(b, psabench_set_volts(p, 0, 1.0));
    is_near(settled_v(p), 1.0, 3e-4);
    set(p, "HPF", 1);
    run(b, 3 * S);
    is_near(settled_v(p), 0.0, 1e-3);
    psabench_free(b);
    b = psabench_new(1);
    p = part(b, "ads1281", "u", "power_up_tclk=0");
    set(p, "DR0", 1); /* in register mode no one looks at it */
    until(p, "DRDY", 0);
    assert_true(psabench_now_ns(b) < 64 * MS);
    assert_null(psabench_part_new(b, "ads1282", "v", "pin_mode=1"));
    psabench_free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_input_reaches_its_place_in_the_multiplexer),
        cmocka_unit_test(a_step_begins_when_it_is_made),
        cmocka_unit_test(chains_agree_about_a_constant_and_differ_as_they_say),
        cmocka_unit_test(mflag_says_over_range),
        cmocka_unit_test(power_down_and_reset_begin_anew),
        cmocka_unit_test(modulator_pins_carry_the_input),
        cmocka_unit_test(mclk_moves_with_clk),
        cmocka_unit_test(mode_pins_set_the_rate_without_registers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
