/* SCPI: the instruments of the bench, and the end of their motions. */
#include "scpi_say.h"

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

static void run_s(double s)
{
    sched_run_until(&rig.sched, rig.sched.now_ns + (int64_t)(s * 1e9));
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
    SAYS("SYST:ERR?", "-222,\"Data out of range;rate_dps: expected -100 to 100 deg/s, got 101\"");
    say("AXIS3:RATE 1");
    SAYS("SYST:ERR?", "-114,\"Header suffix out of range;axis: expected 1 to 2, got 3\"");
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
    SAYS("SYST:ERR?", "-222,\"Data out of range;angle_deg: expected -10 to 190 deg, got -11\"");
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
    SAYS("SYST:ERR?", "-222,\"Data out of range;temp_degc: expected -60 to 85 degC, got 100\"");
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

int main(void)
{
    const struct CMUnitTest tests[] = {
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
