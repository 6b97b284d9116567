/* SCPI: standard syntax, standard error numbers, messages, IEEE 488.2 status, the page of headers. */
#include "scpi_say.h"

#include "app/list/list.h"

/* ---- matching */

static const struct {
    const char *pattern, *header;
    bool matches;
    unsigned suffix;
} headers[] = {
    {"AXIS#:POSition", "AXIS1:POS", true, 1},
    {"AXIS#:POSition", "axis2:position", true, 2},
    {"AXIS#:POSition", "AXIS:Pos", true, 1}, /* a suffix left out is 1: SCPI-99 volume 1, 6.2.5.2 */
    {"AXIS#:POSition", "AXIS12:POS", true, 12},
    {"AXIS#:POSition", "AXIS1:POSI", false, 0}, /* neither short nor long */
    {"AXIS#:POSition", "AXIS1:POS2", false, 0},
    {"AXIS#:POSition", "AXIS1", false, 0},
    {"AXIS#:POSition", "POS", false, 0},
    {"AXIS#:POSition", "AXIS1:POS:X", false, 0},
    {"SYSTem:ERRor[:NEXT]?", "SYST:ERR", true, 0},
    {"SYSTem:ERRor[:NEXT]?", "SYSTEM:ERROR:NEXT", true, 0},
    {"SYSTem:ERRor[:NEXT]?", "SYST:ERR:COUN", false, 0},
    {"SYSTem:ERRor[:NEXT]?", "SYST", false, 0},
    {"*IDN?", "*idn", true, 0},
    {"*IDN?", "IDN", false, 0},
};

static void headers_match_in_short_and_long_form(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(headers); i++) {
        unsigned suffix[4] = {0};
        const struct scpi_text h = {headers[i].header, strlen(headers[i].header)};
        if (scpi_match(headers[i].pattern, h, suffix) != headers[i].matches) fail_msg("%s", headers[i].header);
        if (headers[i].matches) assert_int_equal(suffix[0], headers[i].suffix);
    }
}

static const struct {
    const char *unit, *suffix;
    double number, want;
} units[] = {
    {"deg", "DEG", 2, 2},      {"deg", "rad", 1, 57.295779513082320877},
    {"deg", "MNT", 30, 0.5},   {"deg/s", "deg/s", 3, 3},
    {"deg/s", "RPM", 1, 6},    {"s", "ms", 5, 0.005},
    {"s", "MIN", 2, 120},      {"degC", "CEL", 20, 20},
    {"degC", "K", 273.15, 0},  {"degC", "FAR", 212, 100},
    {"K/min", "K/S", 0.5, 30}, {"V", "mV", 1500, 1.5},
    {"Hz", "kHz", 2, 2000},    {"Hz", "MHZ", 1, 1e6},
};

static void units_are_those_of_the_argument(void **state)
{
    (void)state;
    double x;
    for (size_t i = 0; i < COUNT(units); i++) {
        const struct scpi_text suffix = {units[i].suffix, strlen(units[i].suffix)};
        assert_int_equal(scpi_to_unit(units[i].unit, suffix, units[i].number, &x), 0);
        if (!(x > units[i].want - 1e-9 && x < units[i].want + 1e-9)) fail_msg("%s: %.15g", units[i].suffix, x);
    }
    assert_int_equal(scpi_to_unit("deg", (struct scpi_text){"V", 1}, 1, &x), -131);
    assert_int_equal(scpi_to_unit(NULL, (struct scpi_text){"V", 1}, 1, &x), -138);
}

/* ---- bad input: the standard's numbers, SCPI-99 volume 2, 21.8 */

static const struct {
    const char *line;
    int error;
} bad[] = {
    {"FLY", -113},
    {"ANG 5", -113}, /* no short form */
    {"ANGLe:X 5", -113},
    {"*FLY", -113},
    {"*IDN", -113}, /* only the query is there */
    {"*RST?", -113},
    {":*IDN?", -102},
    {"5", -101},
    {"@", -101},
    {":", -102},
    {"ANGL:", -102},
    {"ANGL,5", -111},
    {"ANGL\"5\"", -111},
    {"ANGLEANGLEANGLE 5", -112},
    {"ANGL12345 5", -114},
    {"ANGL", -109},
    {"ANGL 5,6", -108},
    {"ANGL 5,", -102},
    {"ANGL ,5", -102},
    {"ANGL 5 6", -103},
    {"ANGL 1E99999", -123},
    {"ANGL 1E400", -222},
    {"ANGL --5", -121},
    {"ANGL 5 V", -131},
    {"ANGL 5 DEGREESANDMORE", -134},
    {"ANGL UP", -148},
    {"ANGL 'x'", -158},
    {"ANGL \"x", -151},
    {"ANGL #15hello", -168},
    {"ANGL #HZZ", -121},
    {"ANGL (1)", -178},
    {"ANGL ?", -101},
    {"ANGL 3601", -222},
    {"ANGL -3601 DEG", -222},
    {"FACE 5", -128},
    {"FACE UP", -224},
    {"FACE abcdefghijabcdefghijabcdefghijklm", -144},
    {"*ESE", -109},
    {"*ESE 256", -222},
    {"*ESE 1 V", -138},
    {"*ESE ON", -148},
    {"*ESE 'x'", -158},
    {"*CLS 1", -108},
    {"ANGL? 5", -224},
    {"ANGL? MAX,MIN", -108},
    {"REST? MAX", -108},
};

static void bad_input_gives_the_standard_number_and_changes_nothing(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++) {
        SAYS(bad[i].line, "");
        const int got = error();
        if (got != bad[i].error) fail_msg("%s gave %d, want %d", bad[i].line, got, bad[i].error);
        assert_int_equal(error(), 0);
    }
    SAYS("ANGL?;FACE?;REST?", "0;DIRECT;1");
    assert_true(head_at_rest(&rig.lab.head, 0));
}

static void an_error_tells_what_is_the_matter_and_the_permitted_range(void **state)
{
    (void)state;
    say("ANGL 5000");
    SAYS("SYST:ERR?", "-222,\"Data out of range;angle_deg: expected -3600 to 3600 deg, got 5000\"");
    SAYS("SYST:ERR?", "0,\"No error\"");
    say("FLY:HIGH");
    SAYS("SYST:ERR?", "-113,\"Undefined header;FLY:HIGH\"");
}

/* Most VISA libraries read replies as ASCII: one other byte, and the reply is lost with what came with it. */
static void an_error_cites_a_line_in_printable_ascii(void **state)
{
    (void)state;
    say("FACE \"\xd0\xa4\"");
    SAYS("SYST:ERR?", "-224,\"Illegal parameter value;face: expected one of direct, reversed, side, side_reversed, "
                      "got '?\?'\"");
}

static void a_line_that_is_too_long_is_an_overrun(void **state)
{
    (void)state;
    scpi_line(&rig.scpi, NULL, 0, 0);
    assert_int_equal(error(), -363);
}

static void a_full_queue_ends_in_overflow(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) say("FLY");
    SAYS("SYST:ERR:COUN?", "16");
    for (int i = 0; i < 15; i++) assert_int_equal(error(), -113);
    SAYS("SYST:ERR?", "-350,\"Queue overflow\"");
    SAYS("SYST:ERR:COUNT?", "0");
    say("FLY;*ESE 1");
    say("ANGL 5000");
    SAYS("SYSTEM:ERROR:ALL?", "-113,\"Undefined header;FLY\",-222,\"Data out of range;angle_deg: expected -3600 "
                              "to 3600 deg, got 5000\"");
    SAYS("SYST:ERR:ALL?", "0,\"No error\"");
}

/* ---- messages */

static void a_message_of_several_units_gives_one_answer(void **state)
{
    (void)state;
    SAYS("*IDN?;*OPC?;SYST:VERS?", "psabench,DIVIDING HEAD,0," TEXT_OF(PSABENCH_VERSION) ";1;1999.0");
    SAYS(" ; ;*TST? ; ", "0");
    SAYS("", "");
    SAYS("\t\r", "");
    SAYS("REST?\r", "1");
}

static void a_header_goes_on_from_the_one_before(void **state)
{
    (void)state;
    say("AXIS2:RATE 5;ZERO 3"); /* of axis 2: a header without a colon is in the path of the one before */
    assert_int_equal(error(), 0);
    assert_true(rig.lab.table.set_zero_rad[1] != 0 && rig.lab.table.set_zero_rad[0] == 0);
    say("AXIS2:RATE 5;:AXIS1:ZERO 3");
    assert_true(rig.lab.table.set_zero_rad[0] != 0);
    say("AXIS2:RATE 5;*CLS;STOP"); /* common commands leave the path as it is */
    assert_int_equal(error(), 0);
    say("AXIS2:RATE 5;AXIS1:STOP");
    assert_int_equal(error(), -113); /* AXIS2:AXIS1:STOP */
    say("AXIS2:RATE 5;:STOP");
    assert_int_equal(error(), -113);
    say("RATE 5"); /* a new message begins at the root */
    assert_int_equal(error(), -113);
}

static void a_command_error_ends_the_message_an_execution_error_does_not(void **state)
{
    (void)state;
    SAYS("*TST?;FLY;REST?", "0");
    assert_int_equal(error(), -113);
    SAYS("*TST?;ANGL 5000;REST?", "0;1");
    assert_int_equal(error(), -222);
}

static void answers_that_do_not_fit_are_a_deadlock(void **state)
{
    (void)state;
    static char line[4000];
    for (size_t i = 0; i + 6 < sizeof line; i += 6) memcpy(line + i, "*IDN?;", 6);
    SAYS(line, "");
    assert_int_equal(error(), -430);
    SAYS("*TST?", "0");
}

static void numbers_come_in_every_form(void **state)
{
    (void)state;
    static const struct {
        const char *line, *want;
    } rows[] = {
        {"*ESE 16", "16"},     {"*ESE +16", "16"},  {"*ESE 1.6E1", "16"},  {"*ESE 1.6e+1", "16"},
        {"*ESE 160e-1", "16"}, {"*ESE 15.6", "16"}, {"*ESE .6e1", "6"},    {"*ESE #H1F", "31"},
        {"*ESE #Q17", "15"},   {"*ESE #b101", "5"}, {"*ESE   16  ", "16"}, {"*ESE\t7", "7"},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        say(rows[i].line);
        SAYS("*ESE?", rows[i].want);
    }
}

/* ---- status */

static void the_status_byte_sums_up(void **state)
{
    (void)state;
    SAYS("*STB?", "0");
    SAYS("*IDN?;*STB?", "psabench,DIVIDING HEAD,0," TEXT_OF(PSABENCH_VERSION) ";16"); /* MAV: an answer waits */
    say("FLY");
    SAYS("*STB?", "4");
    SAYS("*ESR?", "32");
    SAYS("*ESR?", "0"); /* reading clears */
    say("*ESE 32;FLY");
    SAYS("*STB?", "36");
    say("*SRE 255");
    SAYS("*SRE?", "191"); /* bit 6 cannot be enabled */
    SAYS("*STB?", "100");
    say("*CLS");
    SAYS("*STB?;*SRE?;*ESE?", "0;191;32");
    say("ANGL 5000");
    SAYS("*ESR?", "16");
    say("STAT:OPER:ENAB 2;ENAB 65535");
    SAYS("STAT:OPER:ENAB?", "32767"); /* bit 15 is always 0 */
}

static void power_on_shows_once(void **state)
{
    (void)state;
    static struct scpi other;
    scpi_rig_session(&rig, &other, "head");
    assert_string_equal(scpi_rig_say(&rig, &other, "*ESR?"), "128");
    assert_string_equal(scpi_rig_say(&rig, &other, "*ESR?"), "0");
}

static void every_client_has_errors_of_its_own(void **state)
{
    (void)state;
    static struct scpi other;
    scpi_rig_session(&rig, &other, "head");
    scpi_rig_say(&rig, &other, "*CLS;FLY");
    SAYS("SYST:ERR?;*ESR?", "0,\"No error\";0");
    assert_string_equal(scpi_rig_say(&rig, &other, "SYST:ERR:COUN?;:SYST:ERR?"), "1;-113,\"Undefined header;FLY\"");
}

/* ---- the page */

static void the_page_shows_every_header(void **state)
{
    (void)state;
    char line[2048];
    unsigned lines = 0;
    FILE *table = tmpfile();
    assert_non_null(table);
    list_scpi(table);
    rewind(table);
    for (; next_line(table, line, sizeof line); lines++) {
        if (!page_has("docs/scpi.md", line)) fail_msg("docs/scpi.md lacks (make docs):\n%s", line);
    }
    fclose(table);
    assert_true(lines > 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(headers_match_in_short_and_long_form),
        cmocka_unit_test(units_are_those_of_the_argument),
        cmocka_unit_test_setup(bad_input_gives_the_standard_number_and_changes_nothing, head),
        cmocka_unit_test_setup(an_error_tells_what_is_the_matter_and_the_permitted_range, head),
        cmocka_unit_test_setup(an_error_cites_a_line_in_printable_ascii, head),
        cmocka_unit_test_setup(a_line_that_is_too_long_is_an_overrun, head),
        cmocka_unit_test_setup(a_full_queue_ends_in_overflow, head),
        cmocka_unit_test_setup(a_message_of_several_units_gives_one_answer, head),
        cmocka_unit_test_setup(a_header_goes_on_from_the_one_before, table),
        cmocka_unit_test_setup(a_command_error_ends_the_message_an_execution_error_does_not, head),
        cmocka_unit_test_setup(answers_that_do_not_fit_are_a_deadlock, head),
        cmocka_unit_test_setup(numbers_come_in_every_form, head),
        cmocka_unit_test_setup(the_status_byte_sums_up, head),
        cmocka_unit_test_setup(power_on_shows_once, head),
        cmocka_unit_test_setup(every_client_has_errors_of_its_own, head),
        cmocka_unit_test(the_page_shows_every_header),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
