/* The control port: replies, refusals, runs, events, recordings, the journal. */
#include "control_rig.h"
#include "page.h"

#include "command/events.h"

static void a_reply_has_id_time_and_barrier(void **state)
{
    (void)state;
    sched_run_until(&bench->sched, 1500000000);
    assert_string_equal(say("{\"id\":1,\"cmd\":\"time\"}"),
                        "{\"id\":1,\"ok\":true,\"t_ns\":1500000000,\"can_rx\":42,\"rx\":{\"3\":42},\"result\":{"
                        "\"t_s\":1.5,\"pace\":\"step\"}}");
    assert_says("{\"cmd\":\"time\",\"id\":\"any JSON\"}", "{\"id\":\"any JSON\",\"ok\":true");
    assert_says("{\"cmd\":\"time\"}", "{\"id\":null,\"ok\":true");
    assert_says("{\"cmd\":\"time\",\"id\":[1,{\"x\":2}]}", "{\"id\":[1,{\"x\":2}],\"ok\":true");
}

static const struct {
    const char *line, *code, *text;
} refusals[] = {
    {"", "syntax", "expected a JSON object"},
    {"garbage", "syntax", "expected a JSON object"},
    {"[1,2]", "syntax", "expected a JSON object"},
    {"{\"id\":1", "syntax", "expected a JSON object"},
    {"{\"cmd\":\"time\"} {\"cmd\":\"quit\"}", "syntax", "expected a JSON object"},
    {"{\"cmd\":\"time\",\"cmd\":\"quit\"}", "syntax", "cmd: expected one value, got two"},
    {"{\"id\":1}", "syntax", "cmd: expected the name of a command"},
    {"{\"cmd\":5}", "syntax", "cmd: expected the name of a command"},
    {"{\"cmd\":\"time\",\"ards\":{}}", "syntax", "expected the members id, cmd and args, got \\\"ards\\\""},
    {"{\"cmd\":\"time\",\"args\":[1]}", "syntax", "args: expected an object, got a list"},
    {"{\"cmd\":\"fly\"}", "command", "\\\"fly\\\": unknown command; see help"},
    {"{\"cmd\":\"time\",\"args\":{\"x\":1}}", "argument", "args: expected no arguments, got \\\"x\\\""},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle\":1}}", "argument", "args: expected angle_deg, got \\\"angle\\\""},
    {"{\"cmd\":\"head.turn\"}", "argument", "angle_deg: expected a value (angle on the head's scale), got nothing"},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":\"5\"}}", "type", "angle_deg: expected a number"},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":3600.5}}", "range",
     "angle_deg: expected -3600 to 3600 deg, got 3600.5"},
    {"{\"cmd\":\"head.mount\",\"args\":{\"face\":\"up\"}}", "range",
     "expected one of direct, reversed, side, side_reversed"},
    {"{\"cmd\":\"head.mount\",\"args\":{\"face\":2}}", "type", "face: expected a string"},
    {"{\"cmd\":\"run\",\"args\":{\"for_s\":-0.1}}", "range", "for_s: expected 0 to 86400 s, got -0.1"},
    {"{\"cmd\":\"run\",\"args\":{\"for_s\":1,\"after_tx\":1.5}}", "type", "after_tx: expected an integer, got 1.5"},
    {"{\"cmd\":\"unit.reset\"}", "argument", "unit: expected one of 2 units, got nothing"},
    {"{\"cmd\":\"unit.reset\",\"args\":{\"unit\":\"c\"}}", "range", "unit: expected a unit: a, b, got \\\"c\\\""},
    {"{\"cmd\":\"counters\",\"args\":{\"unit\":5}}", "type", "unit: expected a string"},
    {"{\"cmd\":\"vcd.flush\"}", "state", "no recording"},
    {"{\"cmd\":\"truth\"}", "command", "unknown command"}, /* not on this port */
};

static void bad_commands_are_refused_in_words_and_change_nothing(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(refusals); i++) {
        char want[64];
        snprintf(want, sizeof want, "\"error\":{\"code\":\"%s\"", refusals[i].code);
        assert_says(refusals[i].line, want);
        assert_says(refusals[i].line, refusals[i].text);
        assert_says(refusals[i].line, "\"ok\":false");
    }
    assert_int_equal(control.refused, 3 * COUNT(refusals));
    assert_int_equal(asked.runs + asked.quits, 0);
    assert_true(head_at_rest(&bench->lab.head, 0));
    assert_int_equal(bench->lab.head.face, HEAD_DIRECT);
    assert_int_equal(((const struct psa2 *)bench->unit[0].board)->counters.resets, 0);
}

static void an_overlong_line_is_refused(void **state)
{
    (void)state;
    assert_non_null(strstr(control_line(&control, NULL, 0), "\"code\":\"syntax\""));
}

static void run_is_answered_when_it_is_over(void **state)
{
    (void)state;
    assert_null(say("{\"id\":9,\"cmd\":\"run\",\"args\":{\"for_s\":0.01,\"after_tx\":3}}"));
    assert_int_equal(asked.for_ns, 10000000);
    assert_int_equal(asked.after_tx, 3);
    assert_says("{\"id\":10,\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "another run is in progress");
    assert_int_equal(asked.runs, 1);
    assert_string_equal(control_run_done(&control, 10000000),
                        "{\"id\":9,\"ok\":true,\"t_ns\":10000000,\"can_rx\":42,\"rx\":{\"3\":42},\"result\":{}}");
    assert_null(say("{\"id\":11,\"cmd\":\"run\",\"args\":{\"for_s\":0}}"));
    control_run_forget(&control);
    asked.refuse = true;
    assert_says("{\"id\":12,\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "{\"code\":\"state\",\"text\":\"not now\"}");
}

/* Frames delivered to client 3, and to the oldest one: 42. */
static void run_ends_at_the_first_look_that_finds_the_frames(void **state)
{
    (void)state;
    assert_null(say("{\"cmd\":\"run\",\"args\":{\"for_s\":0.0025,\"after_tx\":3,\"rx\":43,\"client\":3}}"));
    assert_int_equal(asked.after_tx, 3);
    assert_int_equal(asked.for_ns, 1000000);
    assert_null(control_run_done(&control, 1000000));
    assert_null(control_run_done(&control, 2000000));
    assert_int_equal(asked.for_ns, 500000);
    assert_non_null(strstr(control_run_done(&control, 2500000), "\"ok\":true"));
    assert_int_equal(asked.runs, 3);
    static const struct {
        const char *args;
        bool ends;
    } row[] = {{"\"rx\":42,\"client\":3", true},
               {"\"rx\":42", true},
               {"\"rx\":43", false},
               {"\"rx\":1,\"client\":4", false}, /* there is no such client */
               {"\"rx\":1,\"every_s\":0.02", false}};
    for (unsigned i = 0; i < COUNT(row); i++) {
        char line[128];
        snprintf(line, sizeof line, "{\"cmd\":\"run\",\"args\":{\"for_s\":0.1,%s}}", row[i].args);
        assert_null(say(line));
        assert_int_equal(asked.for_ns, i == 4 ? 20000000 : 1000000);
        if (i == 4) assert_non_null(control_run_done(&control, 1000000)); /* --for is over */
        else if (row[i].ends) assert_non_null(control_run_done(&control, 1000000));
        else assert_null(control_run_done(&control, 1000000));
        control_run_forget(&control);
    }
}

static void run_until_ends_at_the_very_event(void **state)
{
    (void)state;
    int64_t first_ns;
    assert_null(say("{\"id\":1,\"cmd\":\"run.until\",\"args\":{\"event\":\"DRD_A\",\"unit\":\"b\",\"limit_s\":2}}"));
    assert_int_equal(asked.for_ns, 2000000000);
    assert_says("{\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "another run is in progress");
    sched_run_until(&bench->sched, 2000000000);
    assert_int_equal(asked.stops, 1);
    first_ns = asked.stop_ns;
    assert_true(first_ns > 0 && first_ns < 2000000000);
    assert_non_null(strstr(control_run_done(&control, 0), "\"result\":{\"reached\":true,\"seen\":1}"));
    assert_null(say("{\"cmd\":\"run.until\",\"args\":{\"event\":\"DRD_A\",\"count\":1000000}}"));
    assert_int_equal(asked.for_ns, 60000000000);
    sched_run_until(&bench->sched, 2010000000);
    const char *reply = control_run_done(&control, 0);
    assert_non_null(strstr(reply, "\"reached\":false,\"seen\":"));
    assert_null(strstr(reply, "\"seen\":0"));
    assert_null(bench->unit[0].observers); /* no client waits any more */
    assert_int_equal(asked.stops, 1);
    asked.refuse = true;
    assert_says("{\"cmd\":\"run.until\",\"args\":{\"event\":\"RES\"}}", "not now");
    assert_null(bench->unit[0].observers);
    assert_says("{\"cmd\":\"run.until\",\"args\":{\"event\":\"FLY\"}}",
                "event: expected an event of a, a PSA-2: RES, SETUP_DONE, SYNC_A");
}

static unsigned in_union(const char *name)
{
    unsigned times = 0;
    const char *other;
    for (unsigned i = 0; (other = control_event(i)); i++) times += strcmp(other, name) == 0;
    return times;
}

/* Each name of each type of board, once. */
static void names_of_events_are_the_boards_own(void **state)
{
    (void)state;
    unsigned names = 0;
    for (const struct board_type *const *t = board_types; *t; t++) {
        for (unsigned e = 0; e < (*t)->event_count; e++) assert_int_equal(in_union((*t)->events[e]), 1);
        names += (*t)->event_count;
    }
    unsigned all = 0;
    while (control_event(all)) all++;
    assert_true(all > 0 && all <= names);
    char line[8192] = "";
    FILE *table = table_file(control_tables);
    while (!strstr(line, "`run.until`") && next_line(table, line, sizeof line)) continue;
    fclose(table);
    for (unsigned i = 0; i < all; i++) assert_non_null(strstr(line, control_event(i)));
}

static void subscribers_are_told_of_events_and_status(void **state)
{
    (void)state;
    int me, other;
    control.client = &me;
    assert_says("{\"cmd\":\"subscribe\",\"args\":{\"what\":\"events\"}}", "\"ok\":true");
    sched_run_until(&bench->sched, 1);
    assert_string_equal(asked.pushed, "");
    say("{\"cmd\":\"unit.reset\",\"args\":{\"unit\":\"b\"}}");
    sched_run_until(&bench->sched, 1000);
    assert_string_equal(asked.pushed, "{\"event\":\"RES\",\"unit\":\"b\",\"t_ns\":1}");
    assert_ptr_equal(asked.to, &me);
    say("{\"cmd\":\"unsubscribe\"}");
    assert_null(bench->unit[1].observers);
    asked.pushes = 0;
    control.client = &other;
    assert_says("{\"cmd\":\"subscribe\",\"args\":{\"what\":\"status\",\"every_s\":0.05}}", "\"ok\":true");
    sched_run_until(&bench->sched, 200000000);
    assert_int_equal(asked.pushes, 3);
    assert_non_null(strstr(asked.pushed, "{\"event\":\"status\",\"t_ns\":150001000,\"pace\":\"step\",\"frames\":"));
    assert_ptr_equal(asked.to, &other);
    control_gone(&control, &other);
    sched_run_until(&bench->sched, 400000000);
    assert_int_equal(asked.pushes, 3);
}

static void levels_are_those_of_now(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"lines\"}", "{\"lines\":{\"SYNC_A\":0,");
    for (int64_t t_ns = 0; t_ns <= 500000000; t_ns += 1000000) {
        sched_run_until(&bench->sched, t_ns);
        bench_follow(bench);
    }
    assert_says("{\"cmd\":\"lines\"}", "\"Res\":1");
    say("{\"cmd\":\"unit.reset\",\"args\":{\"unit\":\"a\"}}");
    assert_says("{\"cmd\":\"lines\"}", "\"Res\":0");
    assert_says("{\"cmd\":\"lines\",\"args\":{\"unit\":\"b\"}}", "\"Res\":1");
}

static void recordings_go_to_the_bench(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"x.vcd\",\"unit\":\"b\"}}", "\"ok\":true");
    assert_string_equal(asked.path, "x.vcd");
    assert_int_equal(asked.unit, 1);
    assert_false(asked.wires);
    assert_says("{\"cmd\":\"vcd.stop\"}", "\"ok\":true");
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"x.vcd\",\"pairs\":true}}", "\"ok\":true");
    assert_true(asked.wires);
    asked.refuse = true;
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"x.vcd\"}}", "\"text\":\"no room\"");
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"\"}}", "path: expected a text");
}

static void what_changes_the_bench_goes_into_the_journal(void **state)
{
    (void)state;
    view.process.journal = on_journal;
    say("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":90}}");
    assert_string_equal(asked.pushed, "head.turn {\"angle_deg\":90} 0");
    say("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":9}}"); /* it is turning */
    assert_string_equal(asked.pushed, "refused head.turn {\"angle_deg\":9} 0");
    say("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":4000}}"); /* does not get as far as the handler */
    say("{\"cmd\":\"head.read\"}");
    assert_int_equal(asked.pushes, 2);
    sched_run_until(&bench->sched, 2000000000);
    say("{\"cmd\":\"head.mount\",\"args\":{\"face\":\"side\"}}");
    assert_string_equal(asked.pushed, "head.mount {\"face\":\"side\"} 2000000000");
}

static bool check(const char *cmd, const char *args, char *why)
{
    cJSON *j = cJSON_Parse(args);
    const bool good = control_check(control_tables, &view, cmd, j, why);
    cJSON_Delete(j);
    return good;
}

static void a_command_can_be_checked_without_being_carried_out(void **state)
{
    (void)state;
    char why[CONTROL_WHY_MAX];
    assert_true(check("head.turn", "{\"angle_deg\":90}", why));
    assert_false(check("head.turn", "{\"angle_deg\":4000}", why));
    assert_string_equal(why, "angle_deg: expected -3600 to 3600 deg, got 4000");
    assert_false(check("head.fly", "{}", why));
    assert_string_equal(why, "\"head.fly\": unknown command");
    assert_true(check("unit.reset", "{\"unit\":\"b\"}", why));
    assert_false(check("unit.reset", "{\"unit\":\"c\"}", why));
    assert_true(check("table.profile", "{\"axis\":1,\"times_s\":[0,1],\"rates_dps\":[1,2]}", why));
    assert_false(check("table.profile", "{\"axis\":1,\"times_s\":[],\"rates_dps\":[1]}", why));
    assert_false(check("table.profile", "{\"axis\":1,\"times_s\":[\"0\"],\"rates_dps\":[1]}", why));
    assert_false(check("supply.output", "{\"on\":1}", why));
    assert_string_equal(why, "on: expected true or false, got a number");
    assert_false(check("run.until", "{\"event\":\"DRD_A\",\"event\":\"RES\"}", why));
    assert_string_equal(why, "event: expected one value, got two");
    assert_true(head_at_rest(&bench->lab.head, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_reply_has_id_time_and_barrier, fresh),
        cmocka_unit_test_setup(bad_commands_are_refused_in_words_and_change_nothing, fresh),
        cmocka_unit_test_setup(an_overlong_line_is_refused, fresh),
        cmocka_unit_test_setup(run_is_answered_when_it_is_over, fresh),
        cmocka_unit_test_setup(run_ends_at_the_first_look_that_finds_the_frames, fresh),
        cmocka_unit_test_setup(run_until_ends_at_the_very_event, fresh),
        cmocka_unit_test(names_of_events_are_the_boards_own),
        cmocka_unit_test_setup(subscribers_are_told_of_events_and_status, fresh),
        cmocka_unit_test_setup(levels_are_those_of_now, fresh),
        cmocka_unit_test_setup(recordings_go_to_the_bench, fresh),
        cmocka_unit_test_setup(what_changes_the_bench_goes_into_the_journal, fresh),
        cmocka_unit_test_setup(a_command_can_be_checked_without_being_carried_out, fresh),
    };
    bench = calloc(1, sizeof *bench);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    bench_free(bench);
    free(bench);
    return failed;
}
