/* libpsabench: parts, options and errors, as the header promises them. */
#include "api_rig.h"

#include "api/internal.h"

#include <math.h>

/* ---- parts and options ---- */

static void the_list_of_parts_is_the_table(void **state)
{
    (void)state;
    char list[200] = "";
    for (unsigned i = 0; i < api_kind_count; i++) {
        if (i) strcat(list, " ");
        strcat(list, api_kinds[i]->name);
        assert_non_null(psabench_options(api_kinds[i]->name));
    }
    assert_string_equal(psabench_parts(), list);
    assert_null(psabench_options("ads1299"));
    assert_null(psabench_options(NULL));
}

static bool makes(const char *kind, const char *options, char *why, size_t cap)
{
    psabench *b = psabench_new(1);
    psabench_part *p = psabench_part_new(b, kind, "u", options);
    if (p) run(b, MS);
    (void)snprintf(why, cap, "%s", psabench_error_text(b));
    psabench_free(b);
    return p != NULL;
}

static void expect(const struct api_kind *k, const struct api_option *o, double value, bool good_value)
{
    char options[100];
    char why[500];
    (void)snprintf(options, sizeof options, o->type == API_UINT ? "%s=%.0f" : "%s=%.9g", o->key, value);
    if (strstr(options, "e+")) return; /* the language of options has no plus */
    if (makes(k->name, options, why, sizeof why) != good_value) fail_msg("%s %s: %s", k->name, options, why);
    if (!good_value && !strstr(why, o->key)) fail_msg("%s", why);
}

static void every_option_takes_its_default_and_range_and_no_more(void **state)
{
    (void)state;
    char text[200];
    char why[500];
    for (unsigned i = 0; i < api_kind_count; i++) {
        const struct api_kind *k = api_kinds[i];
        for (unsigned j = 0; j < k->option_count; j++) {
            const struct api_option *o = &k->options[j];
            (void)snprintf(text, sizeof text, "%s=%s", o->key, o->standard);
            if (!makes(k->name, text, why, sizeof why)) fail_msg("%s %s: %s", k->name, text, why);
            strcat(text, "  "); /* as psabench_options() has it, at the beginning of a line */
            const char *line = strstr(k->options_text, text);
            if (!line || (line > k->options_text && line[-1] != '\n')) fail_msg("%s: no line %s", k->name, text);
            if (o->type == API_BOOL || o->type == API_CHOICE) continue;
            const double step = o->type == API_UINT ? 1.0 : (o->max - o->min) * 1e-3;
            expect(k, o, o->min, true);
            expect(k, o, o->max, true);
            expect(k, o, o->min - step, false);
            expect(k, o, o->max + step, false);
        }
    }
}

static void every_choice_can_be_made(void **state)
{
    (void)state;
    char words[200];
    char text[300];
    char why[500];
    for (unsigned i = 0; i < api_kind_count; i++)
        for (unsigned j = 0; j < api_kinds[i]->option_count; j++) {
            const struct api_option *o = &api_kinds[i]->options[j];
            if (o->type != API_CHOICE) continue;
            (void)snprintf(words, sizeof words, "%s", o->choices);
            unsigned count = 0;
            for (char *word = strtok(words, "|"); word; word = strtok(NULL, "|"), count++) {
                (void)snprintf(text, sizeof text, "%s=%s", o->key, word);
                if (!makes(api_kinds[i]->name, text, why, sizeof why)) fail_msg("%s: %s", text, why);
            }
            assert_true(o->min == 0.0 && o->max == count - 1.0);
        }
}

static void what_is_wrong_with_options_is_said(void **state)
{
    (void)state;
    static const struct {
        const char *options, *says;
    } rows[] = {
        {"vref_v", "expected key=value, got vref_v"},
        {"vref=2.5", "option of ads1256: expected one of clkin_hz"},
        {"noise_scale=1 =5", "option of ads1256: expected one of"},
        {"vref_v=", "expected a number from 0.5 to 5.5"},
        {"vref_v=2,5", "expected a number from"},
        {"vref_v=nan", "expected a number from"},
        {"vref_v=inf", "expected a number from"},
        {"vref_v=0x2", "expected a number from"},
        {"vref_v=2.5V", "expected a number from"},
        {"vref_v=2.5.0", "expected a number from"},
        {"vref_v=--2", "expected a number from"},
        {"vref_v=2e", "expected a number from"},
        {"vref_v=2e99", "expected a number from"},
        {"vref_v=2e999999999999999999999", "expected a number from"},
        {"offset_v=1e-1.5", "expected a number from"},
        {"offset_v=1e-30", "expected a number from"},             /* its power of ten is not exact */
        {"vref_v=2.50000000000000000", "expected a number from"}, /* more digits than are exact */
        {"clkin_hz=7680000.5", "expected a whole number from 100000 to 10000000"},
        {"strict_cs=yes", "expected 0 or 1, got yes"},
        {"start=later", "start: expected one of at_once|clock|crystal, got later"},
        {"start=at_once|clock", "expected one of at_once"},
        {"start=at", "expected one of at_once"},
        {"a_key_that_is_longer_than_any_key_of_ours=1", "expected a key of up to 31"},
        {"vref_v=22222222222222222222222222222222222222222222222222222222222222222222", "a value of up to 63"},
    };
    char why[500];
    for (size_t i = 0; i < COUNT(rows); i++) {
        if (makes("ads1256", rows[i].options, why, sizeof why)) fail_msg("%s was taken", rows[i].options);
        if (!strstr(why, rows[i].says)) fail_msg("%s: got %s, want %s", rows[i].options, why, rows[i].says);
        assert_memory_equal(why, "u: ", 3);
    }
    static const char *const taken[] = {NULL,
                                        "",
                                        "  ",
                                        " vref_v=2.5 ",
                                        "vref_v=25e-1",
                                        "vref_v=.25e1",
                                        "vref_v=2.",
                                        "offset_v=-1e-3",
                                        "vref_v=1 vref_v=2",
                                        "source_ohm=1e9"};
    for (size_t i = 0; i < COUNT(taken); i++)
        if (!makes("ads1256", taken[i], why, sizeof why)) fail_msg("%s: %s", taken[i], why);
}

static void names_are_short_words_and_unique(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    static const char *const bad[] = {NULL, "", "a b", "a$b", "a\n", "n234567890123456789012345678901234567890"};
    for (size_t i = 0; i < COUNT(bad); i++) {
        assert_null(psabench_part_new(b, "ads1256", bad[i], NULL));
        assert_non_null(strstr(psabench_error_text(b), "expected 1 to 31 of the characters"));
        assert_null(strchr(psabench_error_text(b), '\n'));
    }
    psabench_part *p = part(b, "ads1256", "n123456789.123456789-12345678_0", NULL);
    assert_string_equal(psabench_part_name(p), "n123456789.123456789-12345678_0");
    assert_ptr_equal(psabench_of(p), b);
    assert_null(psabench_part_new(b, "psa2", "n123456789.123456789-12345678_0", NULL));
    assert_null(psabench_part_new(b, "psa3", "x", NULL));
    assert_non_null(strstr(psabench_error_text(b), "part: expected one of "));
    assert_null(psabench_part_new(b, NULL, "x", NULL));
    psabench_free(b);
}

/* ---- errors ---- */

static void null_is_an_error_and_no_crash(void **state)
{
    (void)state;
    uint8_t byte = 0;
    const int results[] = {
        psabench_run_until(NULL, 0),
        psabench_run_for(NULL, 0),
        psabench_vcd(NULL, "x"),
        psabench_vcd_close(NULL),
        psabench_pin(NULL, "CS"),
        psabench_pin_is_input(NULL, 0),
        psabench_set(NULL, 0, 0),
        psabench_get(NULL, 0),
        psabench_watch(NULL, 0, NULL, NULL),
        psabench_run_until_level(NULL, 0, 0, 0),
        psabench_set_input(NULL, NULL, NULL),
        psabench_set_volts(NULL, 0, 0.0),
        psabench_spi(NULL, &byte, &byte, 1),
        psabench_spi_clock(NULL, 1000, 0),
        psabench_peek(NULL, 0),
        psabench_on_frame(NULL, NULL, NULL),
        psabench_board_read(NULL, 0, 0, 0),
        psabench_board_write(NULL, 0, 0, 0, 0),
        (int)psabench_now_ns(NULL),
    };
    for (size_t i = 0; i < COUNT(results); i++)
        if (results[i] != PSABENCH_BAD_ARGUMENT) fail_msg("row %zu: %d", i, results[i]);
    psabench_free(NULL);
    assert_true(psabench_next_ns(NULL) == INT64_MAX);
    assert_non_null(psabench_error_text(NULL));
    assert_null(psabench_of(NULL));
    assert_null(psabench_part_name(NULL));
    assert_null(psabench_pin_name(NULL, 0));
    assert_null(psabench_counter(NULL, 0, NULL));
    assert_null(psabench_part_new(NULL, "ads1256", "x", NULL));
}

static void bad_arguments_are_refused_and_named(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1256", "u", NULL);
    run(b, MS);
    assert_string_equal(psabench_error_text(b), "");
#define REFUSED(call, want, text)                                                                                      \
    do {                                                                                                               \
        const int got = call;                                                                                          \
        if (got != (want) || !strstr(psabench_error_text(b), text))                                                    \
            fail_msg(#call ": got %d %s", got, psabench_error_text(b));                                                \
    } while (0)
    const int drdy = pin(p, "DRDY");
    const int cs = pin(p, "CS");
    REFUSED(psabench_pin(p, "cs"), -1,
            "u: pin of ads1256: expected one of DRDY DOUT SCLK DIN CS SYNC RESET D0 D1 D2 D3, got cs");
    REFUSED(psabench_pin(p, NULL), -1, "got NULL");
    REFUSED(psabench_pin(p, "C\nS"), -1, ", got C?S"); /* one line, whatever is quoted */
    REFUSED(psabench_pin_is_input(p, 11), -1, "u: pin number: expected 0 to 10, got 11");
    REFUSED(psabench_get(p, -1), -1, "pin number: expected 0 to 10, got -1");
    REFUSED(psabench_set(p, 99, 0), -1, "pin number: expected 0 to 10, got 99");
    REFUSED(psabench_set(p, drdy, 0), -1, "u: DRDY: expected an input");
    REFUSED(psabench_set(p, cs, 2), -1, "CS: expected 0 or 1, got 2");
    REFUSED(psabench_set(p, cs, -1), -1, "expected 0 or 1, got -1");
    REFUSED(psabench_watch(p, cs, NULL, NULL), -1, "CS: expected an output, got an input");
    REFUSED(psabench_watch(p, 11, NULL, NULL), -1, "pin number: expected");
    REFUSED(psabench_run_until_level(p, drdy, 2, 0), -1, "expected a level of 0 or 1");
    REFUSED(psabench_run_until_level(p, drdy, 0, -1), -1, "a span >= 0");
    REFUSED(psabench_run_until_level(p, drdy, 0, INT64_MAX), -1, "a span >= 0");
    REFUSED(psabench_run_until_level(p, 11, 0, 0), -1, "pin number: expected");
    REFUSED(psabench_run_until(b, MS - 1), -1, "expected 1000000 ns (now) to");
    REFUSED(psabench_run_until(b, INT64_MAX), -1, "time: expected");
    REFUSED(psabench_run_for(b, -1), -1, "time span: expected 0 to ");
    REFUSED(psabench_run_for(b, INT64_MAX), -1, "time span: expected");
    REFUSED(psabench_set_volts(p, 9, 0.0), -1, "u: input of ads1256: expected one of 0 1 2 3 4 5 6 7 8, got 9");
    REFUSED(psabench_set_volts(p, -1, 0.0), -1, ", got -1");
    REFUSED(psabench_set_volts(p, 0, (double)NAN), -1, "u: input 0: expected volts within");
    REFUSED(psabench_set_volts(p, 0, (double)INFINITY), -1, "u: input 0: expected volts within");
    REFUSED(psabench_spi_clock(p, 0, 0), -1, "got 0 Hz");
    REFUSED(psabench_spi_clock(p, 50000001, 0), -1, "expected SCLK of 1 to 50000000 Hz");
    REFUSED(psabench_spi_clock(p, 1000000, -1), -1, "and -1 ns");
    REFUSED(psabench_peek(p, 11), -1, "u: expected a register of ads1256, got 00Bh");
    REFUSED(psabench_on_frame(p, NULL, NULL), PSABENCH_NOT_HERE, "expected a board with frames, got ads1256");
    REFUSED(psabench_board_read(p, 0, 0, 0), PSABENCH_NOT_HERE, "expected a board, got ads1256");
    REFUSED(psabench_board_write(p, 0, 0, 0, 0), PSABENCH_NOT_HERE, "expected a board, got ads1256");
    REFUSED(psabench_vcd(b, NULL), -1, "expected a path, got NULL");
    REFUSED(psabench_vcd(b, "/there/is/no/such/folder/x.vcd"), PSABENCH_SYSTEM, "/there/is/no/such/folder/x.vcd: ");
    good(b, psabench_spi_clock(p, 1, 0));
    REFUSED(psabench_spi(p, NULL, NULL, SIZE_MAX), -1, "expected fewer bytes");
    set(p, "SCLK", 1);
    REFUSED(psabench_spi(p, NULL, NULL, 1), -1, "expected SCLK low, got high");
    assert_true(psabench_now_ns(b) == MS); /* nothing of this moved time */
    assert_null(psabench_pin_name(p, 11));
    assert_null(psabench_pin_name(p, -1));
    assert_null(psabench_counter(p, 10000, NULL));
    assert_null(psabench_counter(p, -1, NULL));
    psabench_free(b);
}

static void the_version_is_of_this_build(void **state)
{
    (void)state;
    assert_int_equal(psabench_abi(), PSABENCH_ABI);
    assert_true(strspn(psabench_version(), "0123456789.") == strlen(psabench_version()));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_list_of_parts_is_the_table),
        cmocka_unit_test(every_option_takes_its_default_and_range_and_no_more),
        cmocka_unit_test(every_choice_can_be_made),
        cmocka_unit_test(what_is_wrong_with_options_is_said),
        cmocka_unit_test(names_are_short_words_and_unique),
        cmocka_unit_test(null_is_an_error_and_no_crash),
        cmocka_unit_test(bad_arguments_are_refused_and_named),
        cmocka_unit_test(the_version_is_of_this_build),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
