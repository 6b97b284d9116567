#include "rig.h"

#include "base/why.h"

#include <string.h>

static void an_error_says_where_what_and_what_was_got(void **state)
{
    char why[64];
    (void)state;
    assert_false(why_expected(why, sizeof why, "--pace", WHY_TEXT("x"), "%s or %s", "wall", "step"));
    assert_string_equal(why, "--pace: expected wall or step, got \"x\"");
    assert_false(why_expected(why, sizeof why, "node", WHY_REAL(200), "%d to %d", 1, 127));
    assert_string_equal(why, "node: expected 1 to 127, got 200");
    assert_false(why_expected(why, sizeof why, "units", NULL, "at least one"));
    assert_string_equal(why, "units: expected at least one");
}

/* What a stranger wrote is quoted: it stays one line, within the room there is. */
static void what_was_got_is_one_line_and_cut(void **state)
{
    char why[200], small[24], text[301] = {0};
    (void)state;
    why_expected(why, sizeof why, "name", WHY_TEXT("a\nb\x7F"), "a word");
    assert_string_equal(why, "name: expected a word, got \"a?b?\"");
    memset(text, 'y', sizeof text - 1);
    why_expected(why, sizeof why, "name", WHY_TEXT(text), "a word");
    assert_int_equal(strlen(why), strlen("name: expected a word, got \"...\"") + 76);
    why_expected(small, sizeof small, "name", WHY_TEXT(text), "a word");
    assert_string_equal(small, "name: expected a word, ");
}

static void a_list_has_commas(void **state)
{
    char list[12] = "";
    (void)state;
    why_list_add(list, sizeof list, "one");
    why_list_add(list, sizeof list, "two");
    assert_string_equal(list, "one, two");
    why_list_add(list, sizeof list, "three");
    assert_string_equal(list, "one, two, t");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_error_says_where_what_and_what_was_got),
        cmocka_unit_test(what_was_got_is_one_line_and_cut),
        cmocka_unit_test(a_list_has_commas),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
