#include "rig.h"

#include "base/rng.h"
#include "command/exact.h"
#include "command/utf8.h"

#include <math.h>
#include <string.h>

static void numbers_print_short_where_that_is_exact(void **state)
{
    static const struct {
        double x;
        const char *text;
    } rows[] = {
        {0.0, "0"},
        {-0.0, "-0"},
        {0.1, "0.1"},
        {0.1 + 0.2, "0.30000000000000004"}, /* cJSON prints 0.3 */
        {9007199254740991.0, "9007199254740991"},
        {1e300, "1e+300"},
        {INFINITY, "null"},
        {NAN, "null"},
    };
    char text[EXACT_MAX];
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        exact_number(rows[i].x, text);
        assert_string_equal(text, rows[i].text);
    }
}

static void any_double_reads_back_as_itself(void **state)
{
    struct rng r = rng_stream(rig_seed(1), 0, "exact");
    (void)state;
    for (int i = 0; i < 20000; i++) {
        const uint64_t bits = rng_u64(&r);
        double x, back;
        memcpy(&x, &bits, sizeof x);
        if (!isfinite(x)) continue;
        cJSON *list = cJSON_CreateArray();
        cJSON_AddItemToArray(list, cJSON_CreateNumber(x));
        char *line = exact_line(list);
        cJSON *again = cJSON_Parse(line);
        back = cJSON_GetArrayItem(again, 0)->valuedouble;
        assert_memory_equal(&back, &x, sizeof x);
        cJSON_Delete(again);
        cJSON_Delete(list);
        free(line);
    }
}

static void a_tree_keeps_its_shape(void **state)
{
    static const char text[] = "{\"a\":[1,2.5,{\"b\":\"3\"}],\"c\":true,\"d\":null,\"e\":{}}";
    (void)state;
    cJSON *tree = cJSON_Parse(text);
    char *line = exact_line(tree);
    assert_string_equal(line, text);
    free(line);
    cJSON_Delete(tree);
}

/* Markus Kuhn's list of what decoders get wrong, and what they must take. */
static void utf_8_is_what_the_standard_says(void **state)
{
    static const char *const good[] = {
        "", "abc", "я", "\xE2\x82\xAC", "\xED\x9F\xBF", "\xEE\x80\x80", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"};
    static const char *const bad[] = {"\x80",
                                      "\xBF",
                                      "\xC0\xAF",
                                      "\xC1\xBF",
                                      "\xC2",
                                      "\xE0\x9F\xBF",
                                      "\xED\xA0\x80",
                                      "\xE2\x82",
                                      "\xF0\x8F\xBF\xBF",
                                      "\xF4\x90\x80\x80",
                                      "\xF5\x80\x80\x80",
                                      "\xFE",
                                      "a\xFF"};
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) assert_true(utf8_valid(good[i]));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) assert_false(utf8_valid(bad[i]));
}

static void a_text_that_was_cut_is_mended(void **state)
{
    char text[] = "a\xE2\x82 \xD1\x8F\xD1";
    (void)state;
    utf8_clean(text);
    assert_string_equal(text, "a?? \xD1\x8F?");
    assert_true(utf8_valid(text));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_print_short_where_that_is_exact),
        cmocka_unit_test(any_double_reads_back_as_itself),
        cmocka_unit_test(a_tree_keeps_its_shape),
        cmocka_unit_test(utf_8_is_what_the_standard_says),
        cmocka_unit_test(a_text_that_was_cut_is_mended),
    };
    return cmocka_run_group_tests_name("exact", tests, NULL, NULL);
}
