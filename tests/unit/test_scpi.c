/* SCPI: standard syntax, standard error numbers, IEEE 488.2 status, and the instruments of the bench behind it. */
#include "page.h"
#include "rig.h"
#include "scpi_rig.h"

#include "base/text.h"
#include "control/scpi_lex.h"

#include <stdio.h>
#include <stdlib.h>

static struct scpi_rig rig;

static int head(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "head");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static int table(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "table");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static int chamber(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "chamber");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static int supply(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "supply");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static const char *say(const char *line)
{
    return scpi_rig_say(&rig, &rig.scpi, line);
}

#define SAYS(line, want) assert_string_equal(say(line), want)

/* The number of the oldest error, taken off the queue. */
static int error(void)
{
    return atoi(say("SYST:ERR?"));
}

static void run_s(double s)
{
    sched_run_until(&rig.sched, rig.sched.now_ns + (int64_t)(s * 1e9));
}

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
    SAYS("SYST:ERR?", "-222,\"Data out of range;angle_deg: 5000 is outside -3600 ... 3600 deg\"");
    SAYS("SYST:ERR?", "0,\"No error\"");
    say("FLY:HIGH");
    SAYS("SYST:ERR?", "-113,\"Undefined header;FLY:HIGH\"");
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
    SAYS("SYSTEM:ERROR:ALL?", "-113,\"Undefined header;FLY\",-222,\"Data out of range;angle_deg: 5000 is outside -3600 "
                              "... 3600 deg\"");
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
    say("AXIS2:RATE 5;ZERO 3"); /* of axis 2: a header without a colon stands in the path of the one before */
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

/* ---- the end of a motion */

static void opc_query_answers_when_the_head_is_at_rest(void **state)
{
    (void)state;
    SAYS("ANGL 90;*OPC?;ANGL?", "");
    assert_true(scpi_busy(&rig.scpi));
    run_s(1.999);
    assert_int_equal(rig.answers, 0);
    run_s(0.001);
    assert_string_equal(rig.said, "1;90");
    assert_int_equal(rig.sched.now_ns, 2000000000);
    assert_int_equal(rig.idles, 1);
    assert_false(scpi_busy(&rig.scpi));
    SAYS("*OPC?", "1"); /* at rest: at once */
}

static void opc_sets_its_bit_and_wai_holds_the_message(void **state)
{
    (void)state;
    say("ANGL 10;*OPC");
    SAYS("*ESR?", "0");
    run_s(2);
    SAYS("*ESR?", "1");
    SAYS("ANGL 90;*WAI;ANGL 180;ANGL?", "");
    run_s(2);
    assert_string_equal(rig.said, "90"); /* turns on at 4 s, without an error of a turning head */
    assert_int_equal(error(), 0);
    SAYS("REST?", "0");
    run_s(2);
    SAYS("ANGL?", "180");
    say("*OPC;*CLS"); /* forgets */
    run_s(5);
    SAYS("*ESR?", "0");
}

static void a_closed_session_waits_no_more(void **state)
{
    (void)state;
    say("ANGL 10;*OPC?");
    scpi_close(&rig.scpi);
    run_s(5);
    assert_int_equal(rig.answers, 0);
}

static void motion_shows_in_the_operation_register(void **state)
{
    (void)state;
    SAYS("STAT:OPER:COND?", "0");
    say("STAT:OPER:ENAB 2;:ANGL 5");
    SAYS("STAT:OPER:COND?;:*STB?", "2"); /* no colon before a common command */
    assert_int_equal(error(), -102);
    SAYS("*STB?", "128");
    SAYS("STAT:OPER?;OPER?;OPER:COND?", "2;0;2"); /* told once, though it goes on */
    run_s(2);
    SAYS("STAT:OPER:COND?", "0");
    say("ANGL 9");
    run_s(2);
    SAYS("STAT:OPER?;OPER?", "2;0"); /* it had begun; reading clears */
    say("STAT:PRES");
    SAYS("STAT:OPER:ENAB?", "0");
}

/* ---- the instruments */

static void a_turning_head_refuses_with_a_conflict(void **state)
{
    (void)state;
    say("ANGL 90;ANGL 0");
    SAYS("SYST:ERR?", "-221,\"Settings conflict;the head is turning, at rest in 2.000 s\"");
    SAYS("REST?", "0");
}

/* The head has no row for *RST. IEEE 488.2, 10.32.1: it leaves status, enables and error queue alone, and ends an *OPC. */
static void a_reset_leaves_a_head_where_it_is(void **state)
{
    (void)state;
    say("*CLS;*ESE 36;*SRE 32;FACE SIDE;FLY"); /* the error of FLY stays in the queue */
    run_s(3);
    say("ANGL 45");
    run_s(1);
    say("*OPC;*RST");
    SAYS("REST?;*ESE?;*SRE?;SYST:ERR:COUN?;*STB?", "0;36;32;1;116"); /* still turning; 4 + 16 + 32 + 64 */
    run_s(2);
    SAYS("REST?;ANGL?;FACE?", "1;45;SIDE");
    SAYS("*ESR?", "32"); /* the command error; no bit 0 */
    SAYS("SYST:ERR?", "-113,\"Undefined header;FLY\"");
    say("*RST");
    SAYS("ANGL?;FACE?;SYST:ERR:COUN?", "45;SIDE;0");
}

static void an_angle_reads_as_it_was_set(void **state)
{
    (void)state;
    say("ANGL 30");
    run_s(3);
    SAYS("ANGL?", "30"); /* not 29.999999999999996, which the way through radians makes of it */
}

static void faces_have_short_forms_where_they_are_unique(void **state)
{
    (void)state;
    static const struct {
        const char *line, *want;
    } rows[] = {
        {"FACE REVERSED", "REVERSED"},
        {"FACE rev", "REVERSED"},
        {"FACE SIDE", "SIDE"},
        {"FACE DIR", "DIRECT"},
        {"FACE side_reversed", "SIDE_REVERSED"},
        {"FACE 'direct'", "DIRECT"},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        say(rows[i].line);
        SAYS("FACE?", rows[i].want);
    }
}

static void limits_are_asked_with_the_settings_name(void **state)
{
    (void)state;
    SAYS("ANGL? MAX;ANGL? MIN;ANGL? DEFAULT", "3600;-3600;0");
    say("ANGL MIN");
    run_s(2);
    SAYS("ANGL?", "-3600");
}

static void limits_of_a_table_are_its_axes_own(void **state)
{
    (void)state;
    rig.lab.table.cfg.axis[1].rate_max_dps = 100;
    SAYS("AXIS1:RATE? MAX;RATE? MIN;:AXIS2:RATE? MAX", "720;-720;100");
    say("AXIS2:RATE 101");
    SAYS("SYST:ERR?", "-222,\"Data out of range;rate_dps: 101 is outside -100 ... 100 deg/s\"");
    say("AXIS3:RATE 1");
    SAYS("SYST:ERR?", "-114,\"Header suffix out of range;axis: 3 is outside 1 ... 2\"");
    say("AXIS0:RATE 1");
    assert_int_equal(error(), -114);
    SAYS("AXIS3:RATE?", "");
    assert_int_equal(error(), -114);
}

/* Limits are asked and told as the readout shows them. */
static void limits_of_an_axis_follow_its_readout(void **state)
{
    (void)state;
    struct table *t = &rig.lab.table;
    t->cfg.axis[0].angle_min_deg = -100;
    t->cfg.axis[0].angle_max_deg = 100;
    const struct table_cfg cfg = t->cfg;
    table_init(t, &cfg, &rig.lab.site, 1);
    say("AXIS1:ZERO 90");
    SAYS("AXIS1:POS? MAX;POS? MIN", "190;-10");
    SAYS("AXIS1:POS 150,30;*OPC?", "");
    run_s(10);
    SAYS("AXIS1:POS?", "150");
    say("AXIS1:POS MAX;POS MIN");
    assert_int_equal(error(), 0);
    say("AXIS1:POS -11");
    SAYS("SYST:ERR?", "-222,\"Data out of range;angle_deg: -11 is outside -10 ... 190 deg\"");
}

/* An axis that would take longer than there is time never gets there. */
static void what_is_never_over_is_waited_for(void **state)
{
    (void)state;
    struct table *t = &rig.lab.table;
    t->cfg.axis[0].rate_max_dps = 1e5;
    t->cfg.axis[0].accel_max_dps2 = 1e-6;
    const struct table_cfg cfg = t->cfg;
    table_init(t, &cfg, &rig.lab.site, 1);
    SAYS("AXIS1:RATE 1E5;*OPC?", "");
    run_s(10);
    assert_string_equal(rig.said, "");
}

static void a_table_turns_and_stops(void **state)
{
    (void)state;
    SAYS("AXIS:POS 90 DEG, 30 DPS;*OPC?", "");
    run_s(10);
    assert_string_equal(rig.said, "1");
    SAYS("AXIS1:MODE?;REST?", "POSITION;1");
    assert_true(atof(say("AXIS1:POS?")) > 89.999 && atof(rig.said) < 90.001);
    SAYS("AXIS1:RATE 50;*OPC?", ""); /* over when it has the rate: 0.1 s at 500 deg/s^2 */
    run_s(0.099);
    assert_string_equal(rig.said, "");
    run_s(0.002);
    assert_string_equal(rig.said, "1");
    SAYS("AXIS1:RATE?;MODE?;REST?", "50;RATE;0");
    say("*RST");
    run_s(1);
    SAYS("AXIS1:RATE?;REST?", "0;1");
}

static void a_wait_follows_what_others_make_of_the_motion(void **state)
{
    (void)state;
    static struct scpi other;
    scpi_rig_session(&rig, &other, "table");
    SAYS("AXIS1:POS 90,30;*OPC?", ""); /* 3 s */
    run_s(1);
    scpi_rig_say(&rig, &other, "AXIS1:POS 180,30"); /* further, 6 s in all */
    run_s(3);
    assert_string_equal(rig.said, "");
    scpi_rig_say(&rig, &other, "AXIS1:STOP"); /* sooner */
    scpi_look(&rig.scpi, rig.sched.now_ns);
    run_s(0.1);
    assert_string_equal(rig.said, "1");
}

static void a_table_swings_and_runs_profiles(void **state)
{
    (void)state;
    say("AXIS1:SINE 1,0.5HZ;:AXIS2:PROF 0,10, 1,-10, 2,0");
    assert_int_equal(error(), 0);
    run_s(0.5);
    SAYS("AXIS1:MODE?;:AXIS2:MODE?;RATE?", "SINE;PROFILE;10");
    SAYS("STAT:OPER:COND?", "10"); /* settling to the sine or the profile's end, sweeping */
    run_s(1);
    SAYS("AXIS2:RATE?", "-10");
    run_s(1);
    SAYS("AXIS2:RATE?", "0");
    say("AXIS1:SINE 300,400");
    assert_int_equal(error(), -222);
    say("AXIS1:PROF 0,1,2");
    assert_int_equal(error(), -222); /* two times, one rate */
    say("AXIS1:PROF 1,5, 0,5");
    assert_int_equal(error(), -222); /* times that do not rise */
}

static void a_chamber_goes_to_its_set_point(void **state)
{
    (void)state;
    SAYS("TEMP?;TEMP:SETP?;:STAB?;RAMP? MAX", "25;25;1;5");
    say("RAMP 2 K/MIN;TEMP 35");
    SAYS("STAB?;STAT:OPER:COND?;:STAT:QUES:COND?", "0;2;16");
    SAYS("*OPC?", "");
    run_s(60);
    SAYS("", "");
    run_s(239);
    assert_string_equal(rig.said, "");
    run_s(2);
    assert_string_equal(rig.said, "1");
    SAYS("TEMP?;STAB?;STAT:QUES:COND?", "35;1;0");
    say("TEMP 300 K");
    SAYS("TEMP:SETP?", "26.85");
    say("TEMP 100");
    SAYS("SYST:ERR?", "-222,\"Data out of range;temp_degc: 100 is outside -60 ... 85 degC\"");
    say("RAMP 6");
    assert_int_equal(error(), -222);
    say("*RST");
    SAYS("TEMP:SETP?", "25");
}

static void a_supply_is_set_switched_and_measured(void **state)
{
    (void)state;
    SAYS("VOLT?;OUTP?;MEAS:VOLT?", "12;1;12");
    say("VOLT 11500 MV");
    SAYS("VOLT?;MEAS:VOLT?", "11.5;11.5");
    say("OUTP OFF");
    SAYS("VOLT?;OUTP?;MEAS:VOLT?", "11.5;0;0");
    say("OUTP 1");
    SAYS("OUTP?", "1");
    say("OUTP MAYBE");
    assert_int_equal(error(), -224);
    say("VOLT 16");
    assert_int_equal(error(), -222);
    say("RIPP 0.1,100;VOLT 8");
    SAYS("RIPP?;STAT:QUES:COND?", "0.1,100;1"); /* below what the boards need */
    say("*RST");
    SAYS("VOLT?;STAT:QUES:COND?", "12;0");
    assert_true(rig.lab.supply.ripple_v <= 0);
}

/* ---- the page */

static void the_page_shows_every_header(void **state)
{
    (void)state;
    char line[2048];
    for (int k = -1; k < 0 || scpi_kinds[k].name; k++) {
        const struct scpi_kind *kind = k < 0 ? NULL : &scpi_kinds[k];
        for (unsigned i = 0; scpi_markdown(kind, i, line, sizeof line); i++) {
            if (!page_has("docs/scpi.md", line)) fail_msg("docs/scpi.md lacks (make docs):\n%s", line);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(headers_match_in_short_and_long_form),
        cmocka_unit_test(units_are_those_of_the_argument),
        cmocka_unit_test_setup(bad_input_gives_the_standard_number_and_changes_nothing, head),
        cmocka_unit_test_setup(an_error_tells_what_is_the_matter_and_the_permitted_range, head),
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
        cmocka_unit_test_setup(opc_query_answers_when_the_head_is_at_rest, head),
        cmocka_unit_test_setup(opc_sets_its_bit_and_wai_holds_the_message, head),
        cmocka_unit_test_setup(a_closed_session_waits_no_more, head),
        cmocka_unit_test_setup(motion_shows_in_the_operation_register, head),
        cmocka_unit_test_setup(a_turning_head_refuses_with_a_conflict, head),
        cmocka_unit_test_setup(a_reset_leaves_a_head_where_it_is, head),
        cmocka_unit_test_setup(an_angle_reads_as_it_was_set, head),
        cmocka_unit_test_setup(faces_have_short_forms_where_they_are_unique, head),
        cmocka_unit_test_setup(limits_are_asked_with_the_settings_name, head),
        cmocka_unit_test_setup(limits_of_a_table_are_its_axes_own, table),
        cmocka_unit_test_setup(limits_of_an_axis_follow_its_readout, table),
        cmocka_unit_test_setup(what_is_never_over_is_waited_for, table),
        cmocka_unit_test_setup(a_table_turns_and_stops, table),
        cmocka_unit_test_setup(a_wait_follows_what_others_make_of_the_motion, table),
        cmocka_unit_test_setup(a_table_swings_and_runs_profiles, table),
        cmocka_unit_test_setup(a_chamber_goes_to_its_set_point, chamber),
        cmocka_unit_test_setup(a_supply_is_set_switched_and_measured, supply),
        cmocka_unit_test(the_page_shows_every_header),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
