/* Lines of the BeagleLogic protocol: what libsigrok sends, and what it must not. */
#include "rig.h"

#include "link/logic/beagle_text.h"

#include <string.h>

static char answer[BEAGLE_ANSWER_MAX];
static size_t n;

static enum beagle_action say(struct beagle_settings *s, const char *line)
{
    return beagle_text_line(s, line, strlen(line), answer, &n);
}

static void lines_have_their_answers(void **state)
{
    (void)state;
    static const struct {
        const char *line;
        enum beagle_action action;
        const char *answer;
    } rows[] = {
        {"version", BEAGLE_ANSWERED, "BeagleLogic 1.0\n"},
        {"samplerate", BEAGLE_ANSWERED, "8000000\n"},
        {"samplerate 10", BEAGLE_ANSWERED, "ok\n"},
        {"samplerate 100000000", BEAGLE_ANSWERED, "ok\n"},
        {"sampleunit", BEAGLE_ANSWERED, "0\n"},
        {"sampleunit 1\r", BEAGLE_ANSWERED, "ok\n"},
        {"triggerflags 1", BEAGLE_ANSWERED, "ok\n"},
        {"memalloc", BEAGLE_ANSWERED, "2147483646\n"},
        {"memalloc 33554432", BEAGLE_ANSWERED, "ok\n"},
        {"bufunitsize", BEAGLE_ANSWERED, "65536\n"},
        {"bufunitsize 1024", BEAGLE_ANSWERED, "ok\n"},
        {"get", BEAGLE_GET, ""},
        {"close", BEAGLE_CLOSE, ""},
        {"samplerate 9", BEAGLE_REJECTED, "samplerate: expected an integer from 10 to 100000000, got \"9\"\n"},
        {"samplerate 100000001", BEAGLE_REJECTED,
         "samplerate: expected an integer from 10 to 100000000, got \"100000001\"\n"},
        {"samplerate 42949672960000", BEAGLE_REJECTED,
         "samplerate: expected an integer from 10 to 100000000, got \"42949672960000\"\n"},
        {"samplerate -1", BEAGLE_REJECTED, "samplerate: expected an integer from 10 to 100000000, got \"-1\"\n"},
        {"samplerate 1e6", BEAGLE_REJECTED, "samplerate: expected an integer from 10 to 100000000, got \"1e6\"\n"},
        {"samplerate ", BEAGLE_REJECTED, "samplerate: expected an integer from 10 to 100000000, got \"\"\n"},
        {"sampleunit 2", BEAGLE_REJECTED, "sampleunit: expected an integer from 0 to 1, got \"2\"\n"},
        {"memalloc 2147483647", BEAGLE_REJECTED,
         "memalloc: expected an integer from 1 to 2147483646, got \"2147483647\"\n"},
        {"bufunitsize 1023", BEAGLE_REJECTED, "bufunitsize: expected an integer from 1024 to 4194304, got \"1023\"\n"},
        {"get 1", BEAGLE_REJECTED,
         "line: expected version, samplerate, sampleunit, triggerflags, memalloc, bufunitsize, get or close, got "
         "\"get\"\n"},
        {"", BEAGLE_REJECTED,
         "line: expected version, samplerate, sampleunit, triggerflags, memalloc, bufunitsize, get or close, got "
         "\"\"\n"},
        {"Version", BEAGLE_REJECTED,
         "line: expected version, samplerate, sampleunit, triggerflags, memalloc, bufunitsize, get or close, got "
         "\"Version\"\n"},
        {"ver\tsion", BEAGLE_REJECTED, "line: expected up to 80 printable characters\n"},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct beagle_settings s = beagle_settings();
        const enum beagle_action action = say(&s, rows[i].line);
        if (action != rows[i].action) fail_msg("\"%s\": %d", rows[i].line, (int)action);
        assert_string_equal(answer, rows[i].answer);
        assert_int_equal(n, strlen(answer));
    }
}

static void what_was_set_is_read_back_and_what_was_rejected_is_not(void **state)
{
    (void)state;
    struct beagle_settings s = beagle_settings();
    say(&s, "samplerate 2000000");
    say(&s, "samplerate 5");
    say(&s, "samplerate");
    assert_string_equal(answer, "2000000\n");
    say(&s, "sampleunit 1");
    say(&s, "bufunitsize 4096");
    say(&s, "triggerflags 1");
    assert_int_equal(s.hz, 2000000);
    assert_int_equal(s.unit, BEAGLE_8_BITS);
    assert_int_equal(s.buffer_bytes, 4096);
    assert_int_equal(s.continuous, 1);
}

static void length_is_bounded(void **state)
{
    (void)state;
    char line[BEAGLE_LINE_MAX + 2];
    struct beagle_settings s = beagle_settings();
    memset(line, 'x', sizeof line);
    assert_int_equal(beagle_text_line(&s, line, BEAGLE_LINE_MAX, answer, &n), BEAGLE_REJECTED);
    assert_non_null(strstr(answer, "expected version"));
    assert_int_equal(beagle_text_line(&s, line, BEAGLE_LINE_MAX + 1, answer, &n), BEAGLE_REJECTED);
    assert_string_equal(answer, "line: expected up to 80 printable characters\n");
    assert_int_equal(beagle_text_line(&s, NULL, 0, answer, &n), BEAGLE_REJECTED);
    assert_string_equal(answer, "line: expected up to 80 printable characters\n");
}

/* libsigrok sends the NUL of its buffer where the text already has a LF. */
static void nuls_around_a_line_are_ignored(void **state)
{
    (void)state;
    struct beagle_settings s = beagle_settings();
    assert_int_equal(beagle_text_line(&s, "\0get", 4, answer, &n), BEAGLE_GET);
    assert_int_equal(beagle_text_line(&s, "close\0", 6, answer, &n), BEAGLE_CLOSE);
    assert_int_equal(beagle_text_line(&s, "cl\0se", 5, answer, &n), BEAGLE_REJECTED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_have_their_answers),
        cmocka_unit_test(what_was_set_is_read_back_and_what_was_rejected_is_not),
        cmocka_unit_test(length_is_bounded),
        cmocka_unit_test(nuls_around_a_line_are_ignored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
