/* What probe.arm waits for, as text. */
#include "rig.h"

#include "control/arm_text.h"

#include <string.h>

static void triggers_are_understood_or_rejected(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        bool ok;
        struct arm_text want;
    } rows[] = {
        {"fault", true, {ARM_FAULT, "", CAPTURE_OUTSIDE}},
        {"fault:line.stuck", true, {ARM_FAULT, "line.stuck", CAPTURE_OUTSIDE}},
        {"event:DRD_A", true, {ARM_EVENT, "DRD_A", CAPTURE_OUTSIDE}},
        {"line:Int:rising", true, {ARM_LINE, "Int", CAPTURE_RISING}},
        {"line:Int:falling", true, {ARM_LINE, "Int", CAPTURE_FALLING}},
        {"line:Int:edge", true, {ARM_LINE, "Int", CAPTURE_EDGE}},
        {"line:Int:high", true, {ARM_LINE, "Int", CAPTURE_HIGH}},
        {"line:Int:low", true, {ARM_LINE, "Int", CAPTURE_LOW}},
        {"", false, {0}},
        {":", false, {0}},
        {"faults", false, {0}},
        {"fault:", false, {0}},
        {"fault:a:b", false, {0}},
        {"event", false, {0}},
        {"event:", false, {0}},
        {"event:DRD_A:rising", false, {0}},
        {"line", false, {0}},
        {"line:Int", false, {0}},
        {"line::rising", false, {0}},
        {"line:Int:", false, {0}},
        {"line:Int:up", false, {0}},
        {"line:Int:rising:", false, {0}},
        {"event:0123456789012345678901234567890",
         true,
         {ARM_EVENT, "0123456789012345678901234567890", CAPTURE_OUTSIDE}},
        {"event:01234567890123456789012345678901", false, {0}},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct control_error why = {0};
        struct arm_text got = {.kind = ARM_LINE, .name = "untouched"};
        if (arm_text_parse(rows[i].text, &got, &why) != rows[i].ok) fail_msg("\"%s\"", rows[i].text);
        if (!rows[i].ok) {
            assert_string_equal(got.name, "untouched");
            assert_string_equal(why.code, "argument");
            assert_non_null(strstr(why.why, "on: expected fault[:KIND], event:NAME or line:NAME:"));
            continue;
        }
        assert_int_equal(got.kind, rows[i].want.kind);
        assert_string_equal(got.name, rows[i].want.name);
        assert_int_equal(got.when, rows[i].want.when);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(triggers_are_understood_or_rejected)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
