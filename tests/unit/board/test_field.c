/* Fields of a profile: every kind of value in, what is no such value out with a sentence. */
#include "rig.h"

#include "board/field.h"

#include <string.h>

struct profile {
    char name[32];
    unsigned count;
    double gain, at[3];
    bool on;
    int mode;
    unsigned step[4], steps;
};

static bool parse_step(void *profile, unsigned i, const char *text)
{
    struct profile *p = profile;
    if (strlen(text) != 1 || *text < '0' || *text > '9') return false;
    p->step[i] = (unsigned)(*text - '0');
    p->steps = i + 1;
    return true;
}

static bool step_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct profile *p = profile;
    if (i >= p->steps) return false;
    (void)snprintf(out, cap, "%u", p->step[i]);
    return true;
}

#define OF(m) offsetof(struct profile, m)
static const char *const modes[] = {"slow", "fast", "both", NULL};
static const struct field field_rows[] = {
    {.key = "name",
     .type = FIELD_TEXT,
     .offset = OF(name),
     .min = 1,
     .max = 32,
     .standard_of = (const char *const[]){"new", NULL}},
    {.key = "count", .type = FIELD_U32, .offset = OF(count), .min = 2, .max = 9, .standard = 3},
    {.key = "gain", .type = FIELD_REAL, .offset = OF(gain), .min = -1, .max = 1, .standard = -0.5},
    {.key = "at_m", .type = FIELD_REALS, .offset = OF(at), .min = 0, .max = 5, .count = 3},
    {.key = "on", .type = FIELD_BOOL, .offset = OF(on), .standard = true},
    {.key = "mode", .type = FIELD_CHOICE, .offset = OF(mode), .choices = modes, .standard = 1},
    {.key = "steps",
     .type = FIELD_LIST,
     .max = 4,
     .like = "a digit",
     .parse = parse_step,
     .text = step_text,
     .standard_of = (const char *const[]){"4", "2", NULL}},
};
static const struct fields fields = FIELDS_OF(struct profile, field_rows);
enum { ROWS = COUNT(field_rows) };

static struct profile p;
static char why[200];

static int sound(void **state)
{
    (void)state;
    p = (struct profile){.name = "a", .count = 2, .at = {1, 2, 3}};
    why[0] = '\0';
    return 0;
}

static bool set(const char *key, unsigned index, const char *text)
{
    return fields_set(&fields, &p, key, index, text, why, sizeof why);
}

static void each_kind_takes_its_text(void **state)
{
    (void)state;
    assert_true(set("name", 0, "psd1"));
    assert_true(set("count", 0, "0x9"));
    assert_true(set("gain", 0, "-1"));
    assert_true(set("at_m", 2, "2.5e-1"));
    assert_true(set("on", 0, "true"));
    assert_true(set("mode", 0, "both"));
    assert_true(set("steps", 0, "7"));
    assert_true(set("steps", 1, "8"));
    assert_string_equal(p.name, "psd1");
    assert_int_equal(p.count, 9);
    assert_true(p.gain == -1 && p.at[0] == 1 && p.at[1] == 2 && p.at[2] == 0.25);
    assert_true(p.on);
    assert_int_equal(p.mode, 2);
    assert_int_equal(p.steps, 2);
    assert_int_equal(p.step[1], 8);
    assert_true(set("steps", 0, "1")); /* begins again */
    assert_int_equal(p.steps, 1);
}

static void what_is_no_such_value_is_refused_and_changes_nothing(void **state)
{
    static const struct {
        const char *key;
        unsigned index;
        const char *text, *why;
    } rows[] = {
        {"name", 0, "", "name: expected 1 to 31 characters, got \"\""},
        {"name", 0, "01234567890123456789012345678901", "name: "},
        {"count", 0, "1", "count: expected an integer from 2 to 9, got \"1\""},
        {"count", 0, "-3", "count: "},
        {"count", 0, "3.0", "count: "},
        {"count", 0, "99999999999999999999", "count: "},
        {"gain", 0, "1.0000001", "gain: expected a number from -1 to 1, got \"1.0000001\""},
        {"gain", 0, "nan", "gain: "},
        {"gain", 0, "0 ", "gain: "},
        {"at_m", 3, "1", "at_m: expected up to 3 elements, got more"},
        {"at_m", 1, "-1", "at_m: expected a number from 0 to 5, got \"-1\""},
        {"on", 0, "yes", "on: expected true or false, got \"yes\""},
        {"on", 1, "true", "on: expected up to 1 elements, got more"},
        {"mode", 0, "fas", "mode: expected slow, fast or both, got \"fas\""},
        {"steps", 0, "x", "steps: expected a digit, got \"x\""},
        {"steps", 4, "1", "steps: expected up to 4 elements, got more"},
        {"gian", 0, "1", "gian: unknown key; expected one of name, count, gain, at_m, on, mode, steps"},
    };
    (void)state;
    const struct profile before = p;
    for (unsigned i = 0; i < COUNT(rows); i++) {
        assert_false(set(rows[i].key, rows[i].index, rows[i].text));
        if (strncmp(why, rows[i].why, strlen(rows[i].why)) != 0) fail_msg("%s\n  want %s", why, rows[i].why);
        assert_string_equal(p.name, before.name);
        assert_true(p.count == before.count && p.gain == before.gain && p.on == before.on && p.mode == before.mode);
        assert_true(p.at[1] == before.at[1] && p.steps == before.steps);
    }
}

static void a_check_finds_numbers_out_of_range_and_a_missing_name(void **state)
{
    (void)state;
    assert_true(fields_check(&fields, &p, why, sizeof why));
    p.at[2] = 5.5;
    assert_false(fields_check(&fields, &p, why, sizeof why));
    assert_string_equal(why, "at_m: expected 0 to 5, got 5.5");
    p.count = 1;
    assert_false(fields_check(&fields, &p, why, sizeof why));
    assert_string_equal(why, "count: expected 2 to 9, got 1");
    p.name[0] = '\0';
    assert_false(fields_check(&fields, &p, why, sizeof why));
    assert_non_null(strstr(why, "name: expected a name of 1 to 31 characters, got none"));
    p = (struct profile){.name = "a", .count = 2};
    p.gain = 0.0 / (p.gain * 0.0); /* NaN is in no range */
    assert_false(fields_check(&fields, &p, why, sizeof why));
}

static void lists_know_how_many_they_take(void **state)
{
    static const unsigned most[ROWS] = {1, 1, 1, 3, 1, 1, 4};
    (void)state;
    for (unsigned i = 0; i < ROWS; i++) {
        assert_int_equal(field_elements(&field_rows[i]), most[i]);
        assert_int_equal(field_is_list(&field_rows[i]), most[i] > 1);
        assert_ptr_equal(fields_find(&fields, field_rows[i].key), &field_rows[i]);
    }
    assert_null(fields_find(&fields, "nam"));
}

static void defaults_set_every_field(void **state)
{
    (void)state;
    p.steps = 3;
    fields_default(&fields, &p);
    assert_string_equal(p.name, "new");
    assert_int_equal(p.count, 3);
    assert_true(p.gain == -0.5 && p.on && p.mode == 1);
    assert_true(p.at[0] == 0 && p.steps == 2 && p.step[0] == 4 && p.step[1] == 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(each_kind_takes_its_text, sound),
        cmocka_unit_test_setup(what_is_no_such_value_is_refused_and_changes_nothing, sound),
        cmocka_unit_test_setup(a_check_finds_numbers_out_of_range_and_a_missing_name, sound),
        cmocka_unit_test_setup(lists_know_how_many_they_take, sound),
        cmocka_unit_test_setup(defaults_set_every_field, sound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
