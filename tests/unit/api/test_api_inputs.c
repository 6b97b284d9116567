/* libpsabench: inputs, noise, and pins that are both inputs and outputs. */
#include "api_rig.h"

#include <math.h>

/* ---- inputs and noise ---- */

/* A word that saw nothing but the present inputs; at 3750 SPS one conversion is enough. */
static int32_t rdata(psabench_part *p)
{
    static const uint8_t command = 0x01;
    uint8_t word[3];
    psabench *b = psabench_of(p);
    run(b, MS);
    until(p, "DRDY", 1);
    until(p, "DRDY", 0);
    set(p, "CS", 0);
    good(b, psabench_spi(p, &command, NULL, 1));
    run(b, 7000);
    good(b, psabench_spi(p, NULL, word, 3));
    run(b, 2000);
    set(p, "CS", 1);
    return code24(word);
}

static void wreg(psabench_part *p, uint8_t address, uint8_t value)
{
    const uint8_t bytes[] = {(uint8_t)(0x50 | address), 0, value};
    set(p, "CS", 0);
    good(psabench_of(p), psabench_spi(p, bytes, NULL, sizeof bytes));
    run(psabench_of(p), 2000);
    set(p, "CS", 1);
}

/* Calibrated, at 3750 SPS, whose full scale is that of the rate it was calibrated at. */
static psabench_part *slow(psabench *b, const char *kind, const char *name, const char *options)
{
    psabench_part *p = part(b, kind, name, options);
    until(p, "DRDY", 0);
    wreg(p, 3, 0xC0);
    return p;
}

struct source {
    int64_t last_ns[9];
    unsigned calls[9], wrong;
};

static double ramp(void *ctx, psabench_part *p, int input, int64_t t_ns)
{
    struct source *s = ctx;
    if (input < 0 || input > 8) {
        s->wrong++;
        return 0.0;
    }
    s->wrong += t_ns < s->last_ns[input] || t_ns > psabench_now_ns(psabench_of(p));
    s->last_ns[input] = t_ns;
    s->calls[input]++;
    return input == 2 ? 1.25 : input == 8 ? (double)NAN : input == 3 ? 2e6 : input == 4 ? 3e6 : 0.25;
}

static void inputs_are_volts_by_number_or_by_function(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = slow(b, "ads1256", "u", "noise_scale=0 start=at_once");
    struct source s = {.wrong = 0};
    assert_true(rdata(p) == 0);
    good(b, psabench_set_volts(p, 0, 1.0));
    good(b, psabench_set_volts(p, 1, 0.5));
    assert_int_equal(rdata(p), 838861); /* 0.5 V of 5 V */
    good(b, psabench_set_input(p, ramp, &s));
    assert_int_equal(rdata(p), 0); /* 0.25 V on both */
    good(b, psabench_set_volts(p, 0, 0.5));
    const unsigned calls = s.calls[0];
    assert_int_equal(rdata(p), 419430); /* AIN0 constant again, AIN1 not; 419430.4 */
    assert_int_equal(s.calls[0], calls);
    wreg(p, 1, 0x28); /* AIN2 against AINCOM, which is no number and counts as 0 V */
    assert_int_equal(rdata(p), 2097152);
    wreg(p, 1, 0x38); /* 2 MV */
    assert_int_equal(rdata(p), 0x7FFFFF);
    wreg(p, 1, 0x34); /* 2 MV and 3 MV count as 1 MV */
    assert_int_equal(rdata(p), 0);
    assert_true(s.calls[1] > 1 && s.calls[2] > 1 && s.calls[8] > 1 && s.calls[7] == 0);
    assert_int_equal(s.wrong, 0);
    good(b, psabench_set_input(p, NULL, NULL));
    wreg(p, 1, 0x01);
    assert_int_equal(rdata(p), 0); /* the constants, which were set last: 0.5 V and 0.5 V */
    psabench_free(b);
}

static void noise_depends_on_seed_and_name_only(void **state)
{
    (void)state;
    static const struct {
        uint64_t seed;
        const char *name;
        bool beside; /* another part on the bench */
    } rows[] = {{1, "u", false}, {1, "u", true}, {1, "v", false}, {2, "u", false}};
    int32_t code[COUNT(rows)][8];
    for (size_t i = 0; i < COUNT(rows); i++) {
        psabench *b = psabench_new(rows[i].seed);
        if (rows[i].beside) (void)part(b, "ads1256", "beside", NULL);
        psabench_part *p = slow(b, "ads1256", rows[i].name, NULL);
        for (int k = 0; k < 8; k++) code[i][k] = rdata(p);
        psabench_free(b);
    }
    assert_memory_equal(code[0], code[1], sizeof code[0]);
    assert_memory_not_equal(code[0], code[2], sizeof code[0]);
    assert_memory_not_equal(code[0], code[3], sizeof code[0]);
}

static void an_ads1255_has_fewer_inputs_and_pins(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1255", "u", "noise_scale=0 start=at_once");
    static const bool has[9] = {true, true, [8] = true};
    for (int i = 0; i < 9; i++) assert_int_equal(psabench_set_volts(p, i, 1.0) == PSABENCH_OK, has[i]);
    assert_int_equal(psabench_pin(p, "D2"), PSABENCH_BAD_ARGUMENT);
    wreg(p, 1, 0x28); /* AIN2 is not there */
    (void)rdata(p);
    assert_true(counter(p, "bad_mux") > 0);
    psabench_free(b);
}

/* ---- pins that are both ---- */

static void gpio_is_driven_by_whom_its_direction_says(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1256", "u", "start=at_once");
    struct rig_seen s = {.p = p, .pin = pin(p, "D1")};
    until(p, "DRDY", 0);
    good(b, psabench_watch(p, s.pin, rig_note, &s));
    assert_int_equal(psabench_pin_is_input(p, s.pin), 1);
    set(p, "D1", 1);
    assert_int_equal(get(p, "D1"), 1);
    assert_int_equal(psabench_peek(p, 4), 0xE2);
    wreg(p, 4, 0xD0); /* D1 an output, low; the 1 outside does not matter */
    assert_int_equal(get(p, "D1"), 0);
    wreg(p, 4, 0xD2);
    assert_int_equal(get(p, "D1"), 1);
    assert_int_equal(s.count, 3);
    assert_int_equal(s.wrong, 0);
    assert_int_equal(get(p, "D0"), 0); /* CLKOUT */
    assert_int_equal(counter(p, "clkout_hz"), 7680000);
    psabench_free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inputs_are_volts_by_number_or_by_function),
        cmocka_unit_test(noise_depends_on_seed_and_name_only),
        cmocka_unit_test(an_ads1255_has_fewer_inputs_and_pins),
        cmocka_unit_test(gpio_is_driven_by_whom_its_direction_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
