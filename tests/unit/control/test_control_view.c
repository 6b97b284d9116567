/* The control port: what it tells of instruments, units, itself and the truth. */
#include "control_rig.h"
#include "page.h"

static void instruments_that_are_not_there_are_refused(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"table.read\",\"args\":{\"axis\":1}}", "this scenario has no rate table");
    assert_says("{\"cmd\":\"chamber.read\"}", "this scenario has no thermal chamber");
    assert_says("{\"cmd\":\"supply.read\"}", "this scenario has no power supply");
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
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(unit, "zero_moved_v")), 3);
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
                "{\"name\":\"a\",\"board\":\"psa2\",\"serial\":17,\"node\":5,\"profile\":\"article\",\"on\":\"head\","
                "\"ready\":false,\"eager\":\"the controller has not set it up yet\"}");
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
    char line[8192];
    unsigned lines = 0;
    FILE *table = table_file(control_tables);
    while (next_line(table, line, sizeof line)) lines++;
    fclose(table);
    assert_int_equal(lines, count + 2);
}

static void the_page_shows_the_same_table(void **state)
{
    (void)state;
    const struct control_table *const *const tables[] = {control_tables, control_truth_tables};
    for (unsigned i = 0; i < 2; i++) {
        char line[2048];
        FILE *table = table_file(tables[i]);
        while (next_line(table, line, sizeof line)) {
            if (!page_has("docs/emulator.md", line))
                fail_msg("docs/emulator.md lacks (psa-emu --list-commands):\n%s", line);
        }
        fclose(table);
    }
}

static void endpoints_are_told_by_the_bench(void **state)
{
    (void)state;
    assert_says("{\"cmd\":\"endpoints\"}", "\"result\":{\"endpoints\":[]}");
    asked.refuse = true;
    assert_says("{\"cmd\":\"endpoints\"}", "{\"code\":\"machine\",\"text\":\"out of memory\"}");
    view.process.endpoints = NULL;
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
    bench = calloc(1, sizeof *bench);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    bench_free(bench);
    free(bench);
    return failed;
}
