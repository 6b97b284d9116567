/* Board profiles: the arithmetic of INT, what is refused and in which words, and the shipped files. */
#include "psa2_profiles.h"

#include <string.h>

static void shipped_profiles_run_and_have_these_times(void **state)
{
    (void)state;
    const struct {
        const char *name;
        unsigned clks;
        int64_t int_low_ns;
        unsigned steps;
    } rows[] = {
        {"article", 148, 74000, 6}, {"intent", 148, 74000, 5}, {"ungated", 148, 74000, 6}, {"w24", 108, 79101, 6},
        {"w16", 76, 74218, 6},      {"lab32", 148, 74000, 6},  {"psa1", 148, 74000, 6},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct psa2_profile p = psa2_profile_file(rows[i].name);
        char why[300] = "";
        assert_string_equal(p.name, rows[i].name);
        if (!psa2_profile_check(&p, why, sizeof why)) fail_msg("%s: %s", rows[i].name, why);
        assert_int_equal(psa2_frame_clks(&p), rows[i].clks);
        assert_int_equal(psa2_int_low_ns(&p), rows[i].int_low_ns);
        assert_int_equal(p.setup_count, rows[i].steps);
        assert_int_equal(psa2_profile_period_ns(&p), 1000000);
    }
}

static void the_default_is_the_file_article(void **state)
{
    (void)state;
    struct psa2_profile want;
    fields_default(&psa2_fields, &want);
    const struct psa2_profile got = psa2_profile_file("article");
    psa2_assert_same(&got, &want, "article");
}

/* From "article", with these fields changed: the sentence. */
static void what_a_board_cannot_run_is_refused_in_words(void **state)
{
    (void)state;
    const struct {
        const char *set[3][2];
        const char *why;
    } rows[] = {
        {{{"lead_in_clk", "7"}},
         "INT low: expected 74 us or more (lead_in_clk >= 8 or line_div >= 2), got (7 + 4*32 + 3*4) CLK / 2.000 MHz = "
         "73.500 us"},
        {{{"line_hz", "2048000"}, {"lead_in_clk", "0"}},
         "INT low: expected 74 us or more (lead_in_clk >= 12 or line_div >= 2), got (0 + 4*32 + 3*4) CLK / 2.048 MHz = "
         "68.359 us"},
        {{{"word_bits", "16"}, {"code_bits", "16"}},
         "INT low: expected 74 us or more (lead_in_clk >= 72 or line_div >= 2), got (8 + 4*16 + 3*4) CLK / 2.000 MHz = "
         "42.000 us"},
        {{{"word_bits", "24"}},
         "INT low: expected 74 us or more (lead_in_clk >= 40 or line_div >= 2), got (8 + 4*24 + 3*4) CLK / 2.000 MHz = "
         "58.000 us"},
        {{{"word_bits", "16"}}, "code_bits: expected up to word_bits = 16, got 24"},
        {{{"word_bits", "20"}}, "word_bits: expected 16, 24 or 32, got 20"},
        {{{"code_bits", "32"}}, "code_bits: expected up to read_bits = 24, got 32"},
        {{{"sclk_hz", "2048000"}}, "sclk_hz: expected up to temp_clkin_hz / 4 = 1920000, got 2048000"},
        {{{"line_hz", "2000300"}},
         "INT low: expected 74 us or more (lead_in_clk >= 9 or line_div >= 2), got (8 + 4*32 + 3*4) CLK / 2.000 MHz = "
         "73.988 us"},
        {{{"fclk_hz", "1500000"}}, "sclk_hz: expected up to fclk_hz / 2 = 750000, got 1024000"},
        {{{"sclk_hz", "200000"}}, "sclk_hz: expected fclk_hz / 16 = 256000 or more, got 200000"},
        {{{"adc_pga", "3"}}, "adc_pga: expected 1, 2, 4, 8, 16, 32 or 64, got 3"},
        {{{"adc_is_1281", "true"}},
         "adc_pga: expected 1 (the ADS1281 has no gain stage), or adc_is_1281: false, got 2"},
        {{{"line_div", "10"}}, "word: expected up to 150 us (a faster CLK), got 32 CLK / 0.200 MHz = 160.000 us"},
        {{{"word", "Y"}}, "word: expected each of X, Y, Z, T once"},
        {{{"setup", "DRD_A write_A 41 00 51"}},
         "setup: CONFIG0: expected pulse sync (bit 7 = 0), DR 000 to 100 and FILTR 10, which KPSA reads, got 51h"},
        {{{"setup", "DRD_A write_A 41 00 D6"}},
         "setup: CONFIG0: expected pulse sync (bit 7 = 0), DR 000 to 100 and FILTR 10, which KPSA reads, got D6h"},
        {{{"setup", "DRD_A write_A 41 00 6E"}},
         "setup: CONFIG0: expected pulse sync (bit 7 = 0), DR 000 to 100 and FILTR 10, which KPSA reads, got 6Eh"},
        {{{"setup", "DRD_A write_A 41 00 66"}, {"line_div", "4"}},
         "frame: expected up to the data period, 250.000 us (a faster sclk_hz or CLK, or a lower data rate in setup), "
         "got "
         "24 bits at 1.024 MHz (27.390 us) and INT low (296.000 us), 323.390 us in all"},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct psa2_profile p;
        fields_default(&psa2_fields, &p);
        char why[300] = "";
        for (int k = 0; k < 3 && rows[i].set[k][0]; k++)
            if (!fields_set(&psa2_fields, &p, rows[i].set[k][0], 0, rows[i].set[k][1], why, sizeof why))
                fail_msg("%s", why);
        if (psa2_profile_check(&p, why, sizeof why)) fail_msg("row %zu passed", i);
        assert_string_equal(why, rows[i].why);
    }
}

/* A crystal is 100 ppm fast: CLK is, too, and INT low for 73.993 us; 74.000 us are nominal. */
static void clocks_may_be_fast_by_a_crystals_tolerance(void **state)
{
    (void)state;
    const char *const rows[][2] = {
        {"fclk_hz", "4096410"}, {"temp_clkin_hz", "7680768"}, {"sclk_hz", "1024102"}, {"line_hz", "2000200"}};
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    char why[300] = "";
    for (size_t i = 0; i < COUNT(rows); i++)
        if (!fields_set(&psa2_fields, &p, rows[i][0], 0, rows[i][1], why, sizeof why)) fail_msg("%s", why);
    if (!psa2_profile_check(&p, why, sizeof why)) fail_msg("%s", why);
}

/* KPSA makes all frequencies from the crystal, the article says: 32-bit words at fCLK/2 fit with a longer lead-in. */
static void words_of_32_bits_fit_at_half_the_crystal(void **state)
{
    (void)state;
    const char *const rows[][2] = {{"line_hz", "4096000"}, {"line_div", "2"}, {"lead_in_clk", "12"}};
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    char why[300] = "";
    for (size_t i = 0; i < COUNT(rows); i++)
        if (!fields_set(&psa2_fields, &p, rows[i][0], 0, rows[i][1], why, sizeof why)) fail_msg("%s", why);
    if (!psa2_profile_check(&p, why, sizeof why)) fail_msg("%s", why);
    assert_int_equal(psa2_frame_clks(&p), 152);
    assert_int_equal(psa2_int_low_ns(&p), 74218);
    p.lead_in_clk = 8;
    assert_false(psa2_profile_check(&p, why, sizeof why));
    assert_string_equal(why,
                        "INT low: expected 74 us or more (lead_in_clk >= 12 or line_div >= 3), got (8 + 4*32 + 3*4) "
                        "CLK / 2.048 MHz = 72.265 us");
}

/* A fall is later than its rise by the skew, at least at once, and less than half a period of CLK: 250 ns at 2 MHz. */
static void delays_of_the_pairs_lose_no_pulse(void **state)
{
    (void)state;
    struct psa2_profile p;
    char why[300] = "";
    fields_default(&psa2_fields, &p);
    for (unsigned i = 0; i < PSA2_DELAYS; i++) assert_true(p.line_delay_ns[i] == 0.0 && p.line_skew_ns[i] == 0.0);
    p.line_skew_ns[2] = -5.0;
    assert_false(psa2_profile_check(&p, why, sizeof why));
    assert_string_equal(why, "line_skew_ns: expected -line_delay_ns = 0 or more, got -5");
    p.line_delay_ns[2] = 5.0;
    if (!psa2_profile_check(&p, why, sizeof why)) fail_msg("%s", why);
    p.line_hz = 50000000;
    p.line_div = 10; /* 5 MHz */
    p.lead_in_clk = 255;
    p.line_skew_ns[1] = 99.9;
    if (!psa2_profile_check(&p, why, sizeof why)) fail_msg("%s", why);
    p.line_skew_ns[1] = 100.0;
    assert_false(psa2_profile_check(&p, why, sizeof why));
    assert_string_equal(why, "line_skew_ns: expected less than half a period of CLK = 100 ns, got 100");
}

static void texts_that_are_no_values_leave_the_profile_alone(void **state)
{
    (void)state;
    const struct {
        const char *key;
        unsigned index;
        const char *text, *why;
    } rows[] = {
        {"colour", 0, "red",
         "colour: unknown key; expected one of name, fclk_hz, temp_clkin_hz, sclk_hz, line_hz, line_div, word_bits, "
         "lead_in_clk, word, code_bits, line_delay_ns, line_skew_ns, read_bits, gate_sclk, temp_channels, "
         "adc_is_1281, adc_vref_v, common_mode_v, adc_avss_v, adc_avdd_v, uref_ppm_per_pct, uref_dropout_ratio, "
         "adc_pga, temp_vref_v, temp_sensor_a_per_k, temp_load_ohm, setup"},
        {"fclk_hz", 0, "4100001", "fclk_hz: expected an integer from 1000000 to 4100000, got \"4100001\""},
        {"word_bits", 0, "thirty", "word_bits: expected an integer from 16 to 32, got \"thirty\""},
        {"word_bits", 0, "-24", "word_bits: expected an integer from 16 to 32, got \"-24\""},
        {"word_bits", 0, "33", "word_bits: expected an integer from 16 to 32, got \"33\""},
        {"adc_vref_v", 0, "nan", "adc_vref_v: expected a number from 0.5 to 5.5, got \"nan\""},
        {"adc_vref_v", 0, "5 V", "adc_vref_v: expected a number from 0.5 to 5.5, got \"5 V\""},
        {"gate_sclk", 0, "yes", "gate_sclk: expected true or false, got \"yes\""},
        {"name", 0, "", "name: expected 1 to 31 characters, got \"\""},
        {"name", 0, "a-name-of-more-than-thirty-one-characters",
         "name: expected 1 to 31 characters, got \"a-name-of-more-than-thirty-one-characters\""},
        {"word", 4, "X", "word: expected up to 4 elements, got more"},
        {"word", 0, "XY", "word: expected one of X, Y, Z, T, got \"XY\""},
        {"setup", 16, "DRD_T sync_T", "setup: expected up to 16 elements, got more"},
        {"setup", 0, "DRD_A write_A",
         "setup: expected a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\", got \"DRD_A write_A\""},
        {"setup", 0, "DRD_A write_A 100",
         "setup: expected a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\", got \"DRD_A write_A 100\""},
        {"setup", 0, "DRD_A sync_A 00",
         "setup: expected a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\", got \"DRD_A sync_A 00\""},
        {"setup", 0, "DRD_B sync_A",
         "setup: expected a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\", got \"DRD_B sync_A\""},
        {"setup", 0, "DRD_A write_A 1 2 3 4 5 6 7 8 9",
         "setup: expected a step such as \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\", got \"DRD_A write_A 1 2 3 4 5 "
         "6 7 8 9\""},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct psa2_profile p;
        struct psa2_profile before;
        memset(&p, 0x5A, sizeof p);
        memcpy(&before, &p, sizeof p);
        char why[400] = "";
        assert_false(fields_set(&psa2_fields, &p, rows[i].key, rows[i].index, rows[i].text, why, sizeof why));
        assert_string_equal(why, rows[i].why);
        assert_memory_equal(&p, &before, sizeof p);
    }
}

/* CONFIG0 as the set-up writes it -> data period. */
static void the_data_period_follows_config0(void **state)
{
    (void)state;
    const struct {
        const char *step;
        int64_t period_ns;
    } rows[] = {
        {"DRD_A write_A 41 00 46", 4000000}, {"DRD_A write_A 41 00 4E", 2000000}, {"DRD_A write_A 41 00 56", 1000000},
        {"DRD_A write_A 41 00 5E", 500000},  {"DRD_A write_A 41 00 66", 250000},  {"DRD_A write_A 41 00 51", 31250},
        {"DRD_A write_A 42 00 09", 1000000}, {"DRD_T write_T 41 00 66", 1000000},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct psa2_profile p;
        fields_default(&psa2_fields, &p);
        char why[100];
        assert_true(fields_set(&psa2_fields, &p, "setup", 0, rows[i].step, why, sizeof why));
        assert_int_equal(p.setup_count, 1);
        assert_int_equal(psa2_profile_period_ns(&p), rows[i].period_ns);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_profiles_run_and_have_these_times),
        cmocka_unit_test(the_default_is_the_file_article),
        cmocka_unit_test(what_a_board_cannot_run_is_refused_in_words),
        cmocka_unit_test(clocks_may_be_fast_by_a_crystals_tolerance),
        cmocka_unit_test(words_of_32_bits_fit_at_half_the_crystal),
        cmocka_unit_test(delays_of_the_pairs_lose_no_pulse),
        cmocka_unit_test(texts_that_are_no_values_leave_the_profile_alone),
        cmocka_unit_test(the_data_period_follows_config0),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
