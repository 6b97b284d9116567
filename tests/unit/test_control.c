#include "page.h"
#include "rig.h"

#include "app/bench.h"
#include "control/control.h"
#include "control/events.h"

#include <string.h>

static const char scenario_text[] =
    "seed: 7\n"
    "head: {resolution_arcsec: 0, turn_s: 2}\n"
    "units:\n"
    "  - {name: a, node: 5, serial: 17, axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0, alpha0_deg: 0.1121}}}\n"
    "  - {name: b, node: 7, serial: 18}\n";

static struct bench *bench;
static struct control_bench view;
static struct control control, truth;
static struct {
    int runs, quits;
    int64_t for_ns;
    uint64_t after_tx;
    bool refuse;
    int stops;
    int64_t stop_ns;
    unsigned pushes;
    void *to;
    char pushed[2048]; /* the latest line */
    char path[64];
    unsigned unit;
} asked;

static bool on_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    (void)ctx;
    if (asked.refuse) snprintf(why, CONTROL_WHY_MAX, "not now");
    asked.runs++;
    asked.for_ns = for_ns;
    asked.after_tx = after_tx;
    return !asked.refuse;
}

static void on_run_stop(void *ctx)
{
    (void)ctx;
    asked.stops++;
    asked.stop_ns = bench->sched.now_ns;
}

static void on_push(void *ctx, void *client, const char *line)
{
    (void)ctx;
    asked.pushes++;
    asked.to = client;
    snprintf(asked.pushed, sizeof asked.pushed, "%s", line);
}

static bool on_vcd_start(void *ctx, const char *path, unsigned unit, char *why)
{
    (void)ctx;
    snprintf(asked.path, sizeof asked.path, "%s", path);
    snprintf(why, CONTROL_WHY_MAX, "no room");
    asked.unit = unit;
    return !asked.refuse;
}

static bool on_vcd_stop(void *ctx, char *why)
{
    (void)ctx;
    (void)why;
    return true;
}

static void on_journal(void *ctx, const struct control_command *row, const struct cJSON *args, bool done, int64_t t_ns)
{
    (void)ctx;
    char *text = cJSON_PrintUnformatted(args);
    snprintf(asked.pushed, sizeof asked.pushed, "%s%s %s %lld", done ? "" : "refused ", row->name, text,
             (long long)t_ns);
    cJSON_free(text);
    asked.pushes++;
}

static bool on_endpoints(void *ctx, struct cJSON *result)
{
    (void)ctx;
    if (!asked.refuse) cJSON_AddArrayToObject(result, "endpoints");
    return !asked.refuse;
}

static void on_quit(void *ctx)
{
    (void)ctx;
    asked.quits++;
}

static bool on_vcd_flush(void *ctx, char *why)
{
    (void)ctx;
    snprintf(why, CONTROL_WHY_MAX, "no recording");
    return false;
}

static uint64_t on_can_rx(void *ctx)
{
    (void)ctx;
    return 42;
}

static bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = "socketcand", .name = "can0", .came = 3, .delivered = 42, .refused = 1};
    return i == 0;
}

static void on_gone(void *ctx, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.delivered = 3};
}

static void on_pace(void *ctx, struct control_pace *out)
{
    (void)ctx;
    *out = (struct control_pace){.name = "step", .turns = 9};
}

static int fresh(void **state)
{
    static struct scenario s;
    char why[256];
    (void)state;
    assert_true(scenario_parse("test.yaml", scenario_text, strlen(scenario_text), &s, why, sizeof why));
    bench_init(bench, &s, 0);
    bench_power_up(bench);
    memset(&asked, 0, sizeof asked);
    view = (struct control_bench){.lab = &bench->lab,
                                  .bus = {&bench->bus[0]},
                                  .buses = 1,
                                  .units = 2,
                                  .seed = 7,
                                  .scenario = "test.yaml",
                                  .unit = {&bench->unit[0], &bench->unit[1]},
                                  .unit_name = {"a", "b"},
                                  .run = on_run,
                                  .run_stop = on_run_stop,
                                  .push = on_push,
                                  .vcd_start = on_vcd_start,
                                  .vcd_stop = on_vcd_stop,
                                  .sched = &bench->sched,
                                  .endpoints = on_endpoints,
                                  .quit = on_quit,
                                  .vcd_flush = on_vcd_flush,
                                  .can_rx = on_can_rx,
                                  .client = on_client,
                                  .gone = on_gone,
                                  .pace = on_pace};
    control_init(&control, control_tables, &view);
    control_init(&truth, control_truth_tables, &view);
    return 0;
}

static const char *say(const char *line)
{
    return control_line(&control, line, bench->sched.now_ns);
}

/* The reply has this text in it. */
static void assert_says(const char *line, const char *want)
{
    const char *reply = say(line);
    assert_non_null(reply);
    if (!strstr(reply, want)) fail_msg("%s\n  gave %s\n  want %s", line, reply, want);
}

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
    {"", "syntax", "not a JSON object"},
    {"garbage", "syntax", "not a JSON object"},
    {"[1,2]", "syntax", "not a JSON object"},
    {"{\"id\":1", "syntax", "not a JSON object"},
    {"{\"cmd\":\"time\"} {\"cmd\":\"quit\"}", "syntax", "not a JSON object"},
    {"{\"cmd\":\"time\",\"cmd\":\"quit\"}", "syntax", "cmd is given twice"},
    {"{\"id\":1}", "syntax", "cmd: a command's name is wanted"},
    {"{\"cmd\":5}", "syntax", "cmd: a command's name is wanted"},
    {"{\"cmd\":\"time\",\"ards\":{}}", "syntax", "\\\"ards\\\": unknown member"},
    {"{\"cmd\":\"time\",\"args\":[1]}", "syntax", "args: an object is wanted"},
    {"{\"cmd\":\"fly\"}", "command", "\\\"fly\\\": unknown command; help lists them"},
    {"{\"cmd\":\"time\",\"args\":{\"x\":1}}", "argument", "no argument \\\"x\\\"; it takes none"},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle\":1}}", "argument", "no argument \\\"angle\\\"; it takes angle_deg"},
    {"{\"cmd\":\"head.turn\"}", "argument", "angle_deg is missing: degrees on the head's scale"},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":\"5\"}}", "type", "angle_deg: a number is wanted"},
    {"{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":3600.5}}", "range", "angle_deg: 3600.5 is outside -3600 ... 3600"},
    {"{\"cmd\":\"head.mount\",\"args\":{\"face\":\"up\"}}", "range",
     "is none of direct, reversed, side, side_reversed"},
    {"{\"cmd\":\"head.mount\",\"args\":{\"face\":2}}", "type", "face: a string is wanted"},
    {"{\"cmd\":\"run\",\"args\":{\"for_s\":-0.1}}", "range", "for_s: -0.1 is outside 0 ... 86400"},
    {"{\"cmd\":\"run\",\"args\":{\"for_s\":1,\"after_tx\":1.5}}", "type", "after_tx: 1.5 is not an integer"},
    {"{\"cmd\":\"unit.reset\"}", "argument", "unit is missing: there are 2 units"},
    {"{\"cmd\":\"unit.reset\",\"args\":{\"unit\":\"c\"}}", "range", "no unit \\\"c\\\"; there is a, b"},
    {"{\"cmd\":\"counters\",\"args\":{\"unit\":5}}", "type", "unit: a string is wanted"},
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
    assert_says("{\"id\":10,\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "another run is under way");
    assert_int_equal(asked.runs, 1);
    assert_string_equal(control_run_done(&control, 10000000),
                        "{\"id\":9,\"ok\":true,\"t_ns\":10000000,\"can_rx\":42,\"rx\":{\"3\":42},\"result\":{}}");
    assert_null(say("{\"id\":11,\"cmd\":\"run\",\"args\":{\"for_s\":0}}"));
    control_run_forget(&control);
    asked.refuse = true;
    assert_says("{\"id\":12,\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "{\"code\":\"state\",\"text\":\"not now\"}");
}

static void run_until_ends_at_the_very_event(void **state)
{
    (void)state;
    int64_t first_ns;
    assert_null(say("{\"id\":1,\"cmd\":\"run.until\",\"args\":{\"event\":\"DRD_A\",\"unit\":\"b\",\"limit_s\":2}}"));
    assert_int_equal(asked.for_ns, 2000000000);
    assert_says("{\"cmd\":\"run\",\"args\":{\"for_s\":1}}", "another run is under way");
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
    assert_null(bench->unit[0].listeners); /* nobody listens any more */
    assert_int_equal(asked.stops, 1);
    asked.refuse = true;
    assert_says("{\"cmd\":\"run.until\",\"args\":{\"event\":\"RES\"}}", "not now");
    assert_null(bench->unit[0].listeners);
    assert_says("{\"cmd\":\"run.until\",\"args\":{\"event\":\"FLY\"}}",
                "event: no event \\\"FLY\\\" on a, a PSA-2; there is RES, SETUP_DONE, SYNC_A");
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
    char list[4096];
    for (unsigned line = 0; control_markdown(control_tables, line, list, sizeof list); line++) {
        if (strstr(list, "`run.until`")) break;
    }
    for (unsigned i = 0; i < all; i++) assert_non_null(strstr(list, control_event(i)));
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
    assert_null(bench->unit[1].listeners);
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
    assert_says("{\"cmd\":\"vcd.stop\"}", "\"ok\":true");
    asked.refuse = true;
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"x.vcd\"}}", "\"text\":\"no room\"");
    assert_says("{\"cmd\":\"vcd.start\",\"args\":{\"path\":\"\"}}", "path: is empty");
}

static void what_changes_the_bench_goes_into_the_journal(void **state)
{
    (void)state;
    view.journal = on_journal;
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
    const bool good = control_check(&view, cmd, j, why);
    cJSON_Delete(j);
    return good;
}

static void a_command_can_be_checked_without_being_carried_out(void **state)
{
    (void)state;
    char why[CONTROL_WHY_MAX];
    assert_true(check("head.turn", "{\"angle_deg\":90}", why));
    assert_false(check("head.turn", "{\"angle_deg\":4000}", why));
    assert_string_equal(why, "angle_deg: 4000 is outside -3600 ... 3600 deg");
    assert_false(check("head.fly", "{}", why));
    assert_string_equal(why, "\"head.fly\": unknown command");
    assert_true(check("unit.reset", "{\"unit\":\"b\"}", why));
    assert_false(check("unit.reset", "{\"unit\":\"c\"}", why));
    assert_true(check("table.profile", "{\"axis\":1,\"times_s\":[0,1],\"rates_dps\":[1,2]}", why));
    assert_false(check("table.profile", "{\"axis\":1,\"times_s\":[],\"rates_dps\":[1]}", why));
    assert_false(check("table.profile", "{\"axis\":1,\"times_s\":[\"0\"],\"rates_dps\":[1]}", why));
    assert_false(check("supply.output", "{\"on\":1}", why));
    assert_string_equal(why, "on: true or false is wanted");
    assert_false(check("run.until", "{\"event\":\"DRD_A\",\"event\":\"RES\"}", why));
    assert_string_equal(why, "event is given twice");
    assert_true(head_at_rest(&bench->lab.head, 0));
}

static void instruments_that_are_not_there_are_refused(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"table.read\",\"args\":{\"axis\":1}}", "there is no rate table in this scenario");
    assert_says("{\"cmd\":\"chamber.read\"}", "there is no thermal chamber in this scenario");
    assert_says("{\"cmd\":\"supply.read\"}", "there is no supply in this scenario");
    assert_says("{\"cmd\":\"supply.reset\"}", "\"code\":\"state\"");
}

static void the_true_state_is_told_on_the_truth_port(void **state)
{
    (void)state;
    say("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":90}}");
    sched_run_until(&bench->sched, 2000000000);
    cJSON *j = cJSON_Parse(control_line(&truth, "{\"cmd\":\"truth.state\"}", 2000000000));
    const cJSON *result = cJSON_GetObjectItem(j, "result"), *unit = cJSON_GetObjectItem(result, "unit");
    const cJSON *f = cJSON_GetObjectItem(unit, "f_mps2");
    const double angle_deg = cJSON_GetObjectItem(cJSON_GetObjectItem(result, "head"), "angle_deg")->valuedouble;
    assert_true(angle_deg > 89.999 && angle_deg < 90.001);
    assert_true(cJSON_GetArrayItem(f, 0)->valuedouble > 9.8 && cJSON_GetArrayItem(f, 0)->valuedouble < 9.82);
    assert_string_equal(cJSON_GetObjectItem(unit, "name")->valuestring, "a");
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(unit, "w_radps")), 3);
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(unit, "sensor_v")), 3);
    cJSON_Delete(j);
    assert_says("{\"cmd\":\"truth.state\"}", "unknown command"); /* not on this port */
}

static void the_head_turns_reads_and_takes_its_time(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":90}}", "\"at_rest\":false,\"rest_in_s\":2}");
    assert_says("{\"cmd\":\"head.turn\",\"args\":{\"angle_deg\":0}}", "the head is turning, at rest in 2.000 s");
    assert_says("{\"cmd\":\"head.mount\",\"args\":{\"face\":\"side\"}}", "the head is turning");
    sched_run_until(&bench->sched, 2000000000);
    assert_says("{\"cmd\":\"head.read\"}", "\"face\":\"direct\",\"at_rest\":true,\"rest_in_s\":0}");
    cJSON *j = cJSON_Parse(say("{\"cmd\":\"head.read\"}"));
    const cJSON *angle = cJSON_GetObjectItem(cJSON_GetObjectItem(j, "result"), "angle_deg");
    assert_true(angle->valuedouble > 89.999999 && angle->valuedouble < 90.000001);
    cJSON_Delete(j);
    assert_says("{\"cmd\":\"head.mount\",\"args\":{\"face\":\"side_reversed\"}}", "\"face\":\"side_reversed\"");
}

static void a_unit_is_reset_by_name(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"unit.reset\",\"args\":{\"unit\":\"b\"}}", "\"ok\":true");
    sched_run_until(&bench->sched, 1000000000);
    assert_int_equal(((const struct psa2 *)bench->unit[0].board)->counters.resets, 0);
    assert_int_equal(((const struct psa2 *)bench->unit[1].board)->counters.resets, 1);
    assert_says("{\"cmd\":\"counters\",\"args\":{\"unit\":\"b\"}}", "\"resets\":1");
    assert_says("{\"cmd\":\"counters\",\"args\":{\"unit\":\"a\"}}", "\"resets\":0");
}

static void counters_frames_and_units_tell_what_they_promise(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"frames\"}", "{\"adapter\":\"socketcand\",\"name\":\"can0\",\"came\":3,\"delivered\":42");
    assert_says("{\"cmd\":\"frames\"}", "\"gone\":{\"delivered\":3");
    assert_says("{\"cmd\":\"counters\"}", "\"pace\":{\"name\":\"step\",\"turns\":9");
    assert_says("{\"cmd\":\"counters\"}", "\"bitrate_hz\":1000000");
    assert_says("{\"cmd\":\"units\"}",
                "{\"name\":\"a\",\"board\":\"psa2\",\"serial\":17,\"node\":5,\"profile\":\"article\",\"ready\":false}");
    assert_says("{\"cmd\":\"quit\"}", "\"ok\":true");
    assert_int_equal(asked.quits, 1);
}

static void help_lists_every_command_and_argument(void **state)
{
    (void)state;
    const char *help = say("{\"cmd\":\"help\"}");
    const struct control_command *row;
    unsigned count = 0;
    for (; (row = control_row(control_tables, count)); count++) {
        char want[64];
        snprintf(want, sizeof want, "{\"name\":\"%s\",\"what\":", row->name);
        assert_non_null(strstr(help, want));
        assert_true(row->what[strlen(row->what) - 1] == '.');
    }
    assert_non_null(
        strstr(help, "{\"name\":\"angle_deg\",\"type\":\"number\",\"optional\":false,\"min\":-3600,\"max\":3600"));
    char line[2048];
    unsigned lines = 0;
    while (control_markdown(control_tables, lines, line, sizeof line)) lines++;
    assert_int_equal(lines, count + 2);
}

static void the_page_shows_the_same_table(void **state)
{
    (void)state;
    char line[2048];
    for (unsigned i = 0; control_markdown(control_tables, i, line, sizeof line); i++) {
        if (!page_has("docs/emulator.md", line))
            fail_msg("docs/emulator.md lacks (psa-emu --list-commands):\n%s", line);
    }
    for (unsigned i = 0; control_markdown(control_truth_tables, i, line, sizeof line); i++) {
        if (!page_has("docs/emulator.md", line))
            fail_msg("docs/emulator.md lacks (psa-emu --list-commands):\n%s", line);
    }
}

static void endpoints_are_told_by_the_bench(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"endpoints\"}", "\"result\":{\"endpoints\":[]}");
    asked.refuse = true;
    assert_says("{\"cmd\":\"endpoints\"}", "{\"code\":\"machine\",\"text\":\"no memory\"}");
    view.endpoints = NULL;
    assert_says("{\"cmd\":\"endpoints\"}", "{\"code\":\"state\",\"text\":\"this bench has no endpoints\"}");
}

static void hidden_parameters_are_told_on_the_truth_port_alone(void **state)
{
    (void)state;
    static const char *const hidden[] = {"u0_v", "alpha0_deg", "kx_v_per_g", "load_tol_ppm", "angle_rad"};
    static const char *const open[] = {"help", "time", "frames", "counters", "units", "endpoints", "head.read"};
    for (size_t i = 0; i < COUNT(open); i++) {
        char line[64];
        snprintf(line, sizeof line, "{\"cmd\":\"%s\"}", open[i]);
        const char *reply = say(line);
        for (size_t k = 0; k < COUNT(hidden); k++) assert_null(strstr(reply, hidden[k]));
    }
    const char *told = control_line(&truth, "{\"cmd\":\"truth\"}", 0);
    for (size_t k = 0; k < COUNT(hidden); k++) assert_non_null(strstr(told, hidden[k]));
    assert_non_null(strstr(told, "\"alpha0_deg\":0.1121"));
    assert_non_null(strstr(told, "\"seed\":7"));
    assert_non_null(strstr(control_line(&truth, "{\"cmd\":\"quit\"}", 0), "unknown command"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_reply_has_id_time_and_barrier, fresh),
        cmocka_unit_test_setup(bad_commands_are_refused_in_words_and_change_nothing, fresh),
        cmocka_unit_test_setup(an_overlong_line_is_refused, fresh),
        cmocka_unit_test_setup(run_is_answered_when_it_is_over, fresh),
        cmocka_unit_test_setup(run_until_ends_at_the_very_event, fresh),
        cmocka_unit_test(names_of_events_are_the_boards_own),
        cmocka_unit_test_setup(subscribers_are_told_of_events_and_status, fresh),
        cmocka_unit_test_setup(levels_are_those_of_now, fresh),
        cmocka_unit_test_setup(recordings_go_to_the_bench, fresh),
        cmocka_unit_test_setup(what_changes_the_bench_goes_into_the_journal, fresh),
        cmocka_unit_test_setup(a_command_can_be_checked_without_being_carried_out, fresh),
        cmocka_unit_test_setup(instruments_that_are_not_there_are_refused, fresh),
        cmocka_unit_test_setup(the_true_state_is_told_on_the_truth_port, fresh),
        cmocka_unit_test_setup(the_head_turns_reads_and_takes_its_time, fresh),
        cmocka_unit_test_setup(a_unit_is_reset_by_name, fresh),
        cmocka_unit_test_setup(counters_frames_and_units_tell_what_they_promise, fresh),
        cmocka_unit_test_setup(help_lists_every_command_and_argument, fresh),
        cmocka_unit_test(the_page_shows_the_same_table),
        cmocka_unit_test_setup(endpoints_are_told_by_the_bench, fresh),
        cmocka_unit_test_setup(hidden_parameters_are_told_on_the_truth_port_alone, fresh),
    };
    bench = malloc(sizeof *bench);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    free(bench);
    return failed;
}
