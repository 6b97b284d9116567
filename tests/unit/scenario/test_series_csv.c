/* A column of a CSV file, line by line: exact times, and one clear reason for what is no sample. */
#include "rig.h"

#include "scenario/series_csv.h"

#include <string.h>

static struct series_csv csv;
static struct series_sample got;
static char why[200];

static enum series_csv_line feed(const char *line)
{
    return series_csv_line(&csv, line, strlen(line), &got, why, sizeof why);
}

static void begin(const char *header)
{
    series_csv_init(&csv, "x_v");
    assert_int_equal(feed(header), SERIES_CSV_NONE);
}

static void takes(const char *line, int64_t t_ns, double value)
{
    if (feed(line) != SERIES_CSV_SAMPLE) fail_msg("%s: %s", line, why);
    assert_int_equal(got.t_ns, t_ns);
    assert_true(got.value == value);
}

static void refuses(const char *line, const char *reason)
{
    assert_int_equal(feed(line), SERIES_CSV_BAD);
    assert_string_equal(why, reason);
}

static void times_to_the_nanosecond(void **state)
{
    (void)state;
    begin("# a comment comes first");
    assert_int_equal(feed("t_s , y_v, x_v "), SERIES_CSV_NONE);
    takes("-0.5,,2", -500000000, 2.0);
    takes("0.1,0,-3", 100000000, -3.0);
    takes(" 0.100000001 ,0, +4 ", 100000001, 4.0);
    takes("0.1000000020000000000000,0,5", 100000002, 5.0);
    takes("999999.999999999,0,6", 999999999999999, 6.0);
    takes("1000000,0,7", 1000000000000000, 7.0);
    begin("t_ns,x_v");
    takes("-7,1", -7, 1.0);
    takes("1000000000000000,0.1", 1000000000000000, 0.1);
}

static void what_is_no_sample_is_refused_with_its_reason(void **state)
{
    (void)state;
    begin("t_s,x_v");
    refuses("1e-3,1", "expected seconds as a decimal of up to 9 places, got \"1e-3\"");
    refuses("0.0000000001,1", "expected seconds as a decimal of up to 9 places, got \"0.0000000001\"");
    refuses("1000000.000000001,1", "expected seconds as a decimal of up to 9 places, got \"1000000.000000001\"");
    refuses("99999999999999999999,1", "expected seconds as a decimal of up to 9 places, got \"99999999999999999999\"");
    refuses(",1", "expected seconds as a decimal of up to 9 places, got \"\"");
    refuses("", "expected seconds as a decimal of up to 9 places, got \"\"");
    refuses("1,nan", "expected a number of magnitude up to 1e6, got \"nan\"");
    refuses("1,0x10", "expected a number of magnitude up to 1e6, got \"0x10\"");
    refuses("1,1e7", "expected a number of magnitude up to 1e6, got \"1e7\"");
    refuses("1,1 2", "expected a number of magnitude up to 1e6, got \"1 2\"");
    refuses("1,\x01", "expected a number of magnitude up to 1e6, got \"?\"");
    refuses("1", "expected 2 columns, got 1");
    refuses("1,1,1", "expected 2 columns, got 3");
    takes("1,1", 1000000000, 1.0);
    refuses("1.0,2", "expected a time after that of the sample before, got \"1.0\"");
    begin("t_ns,x_v");
    refuses("1.5,1", "expected whole nanoseconds, got \"1.5\"");
    series_csv_init(&csv, "x_v");
    refuses("time,x_v", "expected a first column t_s or t_ns, got \"time\"");
    refuses("t_s,y_v", "expected a column x_v, got none");
    refuses("t_s,x_v,x_v", "expected one column x_v, got two");
    static char wide[SERIES_CSV_LINE + 2];
    memset(wide, ',', SERIES_CSV_LINE + 1);
    refuses(wide, "expected lines of up to 4096 bytes, got more");
    memcpy(wide, "t_s,x_v", 7);
    wide[1000] = '\0';
    refuses(wide, "expected up to 256 columns, got 995");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(times_to_the_nanosecond),
        cmocka_unit_test(what_is_no_sample_is_refused_with_its_reason),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
