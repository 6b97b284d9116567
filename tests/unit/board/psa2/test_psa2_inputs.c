/* What lies at the converters' pins: the common mode and its range, UREF and what the supply does to it. */
#include "psa2_words.h"

#define CODE_PER_V (2097506.0 / 2.5) /* at the load: test_psa2.c */

/* Volts at the load that the latest frame tells, to a code's fraction of a ppm. */
static void volts_are(unsigned axis, double volts)
{
    near(last(&rig)->code[axis], volts * CODE_PER_V, 4);
}

static void run(const struct psa2_profile *p, double (*supply)(void *ctx, int64_t t_ns))
{
    rig_init(&rig, p, 0.0);
    rig.b.base.io.supply_ratio = supply;
    rig.volts[0] = 5.0;
    rig.volts[1] = 5.0;
    rig.volts[2] = 9.0;
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 195000000);
    assert_true(rig.frames > 3);
}

/* Half of the signal is on each input. 0.625 V: +0.3125 and -0.3125 V around the middle; limits -1.8 and +1.25 V. */
static void an_input_beyond_its_range_stays_at_the_limit(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.common_mode_v[0] = 1.0;  /* 1.3125 V -> 1.25 V, so 0.5625 of 0.625 V */
    p.common_mode_v[1] = 0.6;  /* 0.9125 V: inside */
    p.common_mode_v[2] = -1.5; /* 1.125 V: -2.0625 V -> -1.8 V, so 0.8625 of 1.125 V */
    run(&p, NULL);
    volts_are(0, 4.5);
    volts_are(1, 5.0);
    volts_are(2, 6.9);
    assert_true(rig.b.adc[0].count.range_exceeded > 100);
    assert_int_equal(rig.b.adc[1].count.range_exceeded, 0);
    assert_true(rig.b.adc[2].count.range_exceeded > 100);
}

/* Signs of both kinds, as the article has it: the full scale of 1.25 V passes around +0.6 and around -1.1 V, on supplies of 2.5 V. */
static void common_mode_of_both_signs_changes_no_code(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    int32_t code[3];
    run(&p, NULL);
    memcpy(code, last(&rig)->code, sizeof code);
    const double middles[] = {0.6, -1.1};
    for (size_t i = 0; i < COUNT(middles); i++) {
        for (unsigned k = 0; k < 3; k++) p.common_mode_v[k] = middles[i];
        run(&p, NULL);
        assert_memory_equal(code, last(&rig)->code, sizeof code);
        for (unsigned k = 0; k < 3; k++) assert_int_equal(rig.b.adc[k].count.range_exceeded, 0);
    }
}

/* On a single supply of 5 V a middle at ground leaves half of each swing out. */
static void limits_follow_the_supplies_and_the_part(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.adc_avss_v = 0.0;
    p.adc_avdd_v = 5.0;
    p.common_mode_v[0] = 2.5; /* inside 0.7 to 3.75 V */
    p.common_mode_v[1] = 0.5; /* 0.8125 and 0.1875 -> 0.7 V: 0.1125 of 0.625 V */
    run(&p, NULL);
    volts_are(0, 5.0);
    volts_are(1, 0.9);
    p = psa2_profile_file("psa1"); /* without gain stage: -2.6 to 2.6 V */
    p.common_mode_v[0] = 1.0;
    run(&p, NULL);
    volts_are(0, 5.0);
    assert_int_equal(rig.b.adc[0].count.range_exceeded, 0);
}

static double nominal(void *ctx, int64_t t_ns)
{
    (void)ctx, (void)t_ns;
    return 1.0;
}

static double low(void *ctx, int64_t t_ns)
{
    (void)ctx, (void)t_ns;
    return 0.9;
}

static double very_low(void *ctx, int64_t t_ns)
{
    (void)ctx, (void)t_ns;
    return 0.8;
}

static double trebled(void *ctx, int64_t t_ns)
{
    (void)ctx, (void)t_ns;
    return 3.0;
}

/* 100 ppm of UREF for a percent of the supply; below 85 % of it UREF falls in proportion. */
static void uref_follows_the_supply(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.uref_ppm_per_pct = 100.0;
    p.uref_dropout_ratio = 0.85;
    run(&p, nominal);
    volts_are(0, 5.0);
    run(&p, low);
    volts_are(0, 5.0 / (1.0 - 1000e-6));
    volts_are(2, 9.0 / (1.0 - 1000e-6));
    run(&p, very_low);
    volts_are(0, 5.0 / ((1.0 - 2000e-6) * 0.8 / 0.85));
}

/* A law that would turn UREF round leaves a hundredth of it: the code is at its limit, of the sign of the input. */
static void uref_has_a_floor(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    p.uref_ppm_per_pct = -10000.0;
    run(&p, trebled);
    assert_int_equal(last(&rig)->code[0], 0x7FFFFF);
}

static void without_a_law_or_a_supply_uref_is_constant(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    run(&p, very_low);
    volts_are(0, 5.0);
    p.uref_ppm_per_pct = 100.0;
    run(&p, NULL);
    volts_are(0, 5.0);
}

static void supplies_that_no_converter_takes_are_rejected(void **state)
{
    (void)state;
    struct psa2_profile p = psa2_profile_file("article");
    char why[300] = "";
    p.adc_avdd_v = 5.0;
    assert_false(psa2_profile_check(&p, why, sizeof why));
    assert_string_equal(why, "adc_avdd_v: expected up to 5.25 V above adc_avss_v = -2.5, got 5");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_input_beyond_its_range_stays_at_the_limit),
        cmocka_unit_test(common_mode_of_both_signs_changes_no_code),
        cmocka_unit_test(limits_follow_the_supplies_and_the_part),
        cmocka_unit_test(uref_follows_the_supply),
        cmocka_unit_test(uref_has_a_floor),
        cmocka_unit_test(without_a_law_or_a_supply_uref_is_constant),
        cmocka_unit_test(supplies_that_no_converter_takes_are_rejected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
