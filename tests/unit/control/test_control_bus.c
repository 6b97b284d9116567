/* bus.read and bus.write: who is answered when, what is refused with which code, and what the journal keeps of it. */
#include "rig.h"

#include "fake_board.h"

#include "control/control.h"

#include <stdio.h>
#include <string.h>

static struct {
    struct sched s;
    struct lab lab;
    struct unit unit[2]; /* f has a bus, p is a PSA-2 */
    struct fake_board board;
    struct control_bench view;
    struct control control;
    bool by_step, cannot_run;
    int runs, stops, replies;
    int64_t stopped_ns;
    void *to;
    char replied[512], journal[512];
} r;

static bool on_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    (void)ctx;
    assert_true(for_ns >= NS_PER_S && after_tx == 0);
    r.runs++;
    snprintf(why, CONTROL_WHY_MAX, "not now");
    return !r.cannot_run;
}

static void on_run_stop(void *ctx)
{
    (void)ctx;
    r.stops++;
    r.stopped_ns = r.s.now_ns;
}

static void on_reply(void *ctx, void *client, const char *line)
{
    (void)ctx;
    r.replies++;
    r.to = client;
    snprintf(r.replied, sizeof r.replied, "%s", line);
}

static void on_pace(void *ctx, struct control_pace *out)
{
    (void)ctx;
    *out = (struct control_pace){.name = r.by_step ? "step" : "wall", .by_step = r.by_step};
}

static uint64_t on_can_rx(void *ctx)
{
    (void)ctx;
    return 0;
}

static bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    (void)i;
    (void)out;
    return false;
}

static void on_journal(void *ctx, const struct control_command *row, const struct cJSON *args, bool done, int64_t t_ns)
{
    char *text = cJSON_PrintUnformatted(args);
    (void)ctx;
    snprintf(r.journal, sizeof r.journal, "%s%s %s %lld", done ? "" : "refused ", row->name, text, (long long)t_ns);
    cJSON_free(text);
}

static int fresh(void **state)
{
    const struct lab_cfg lab = lab_default();
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    lab_init(&r.lab, &lab, 1);
    fake_unit(&r.unit[0], &r.board, "f", &r.lab, &r.s);
    const struct unit_cfg psa2 = unit_default("p");
    unit_init(&r.unit[1], &psa2, &r.lab, &r.s);
    r.view = (struct control_bench){.lab = &r.lab,
                                    .unit = {&r.unit[0], &r.unit[1]},
                                    .unit_name = {"f", "p"},
                                    .units = 2,
                                    .sched = &r.s,
                                    .sim.run = on_run,
                                    .sim.run_stop = on_run_stop,
                                    .process.reply = on_reply,
                                    .sim.pace = on_pace,
                                    .clients.can_rx = on_can_rx,
                                    .clients.nth = on_client,
                                    .process.journal = on_journal};
    control_init(&r.control, control_tables, &r.view);
    r.board.word[0] = 4711;
    r.board.waits = true;
    return 0;
}

/* Of a client, 0: no client waits, as in a timeline. Single quotes for double ones. */
static const char *say(int *client, const char *line)
{
    char json[512];
    snprintf(json, sizeof json, "%s", line);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    r.control.client = client;
    return control_line(&r.control, json, r.s.now_ns);
}

static void assert_has(const char *reply, const char *part)
{
    assert_non_null(reply);
    if (!strstr(reply, part)) fail_msg("%s does not say %s", reply, part);
}

#define READ_0  "{'id':7,'cmd':'bus.read','args':{'unit':'f','address':0}}"
#define WRITE_3 "{'id':8,'cmd':'bus.write','args':{'unit':'f','address':3,'data':65535,'strobe_ns':2000}}"

static void in_real_time_the_answer_comes_when_the_cycle_is_done(void **state)
{
    (void)state;
    int me;
    assert_null(say(&me, READ_0));
    sched_run_until(&r.s, FAKE_STROBE_NS - 1);
    assert_int_equal(r.replies, 0);
    sched_run_until(&r.s, FAKE_STROBE_NS);
    assert_int_equal(r.replies, 1);
    assert_ptr_equal(r.to, &me);
    assert_has(r.replied, "\"id\":7,\"ok\":true,\"t_ns\":800,");
    assert_has(r.replied, "\"result\":{\"name\":\"word\",\"data\":4711,\"ended_s\":8e-07}");
    assert_int_equal(r.runs + r.stops, 0);
    assert_null(say(&me, WRITE_3));
    sched_run_until(&r.s, 2799);
    assert_int_equal(r.replies, 1);
    sched_run_until(&r.s, 2800);
    assert_has(r.replied, "\"id\":8,\"ok\":true");
    assert_int_equal(r.board.word[3], 65535);
}

static void in_step_pace_time_moves_until_the_cycle_is_done(void **state)
{
    (void)state;
    int me;
    r.by_step = true;
    assert_null(say(&me, READ_0));
    assert_int_equal(r.runs, 1);
    assert_true(r.control.waiting);
    assert_has(say(&me, READ_0), "another run is in progress");
    sched_run_until(&r.s, FAKE_STROBE_NS);
    assert_int_equal(r.stops, 1);
    assert_int_equal(r.stopped_ns, FAKE_STROBE_NS);
    assert_int_equal(r.replies, 0);
    assert_has(control_run_done(&r.control, r.s.now_ns), "\"id\":7,\"ok\":true,\"t_ns\":800,");
    assert_false(r.control.waiting);
    assert_null(say(&me, "{'id':9,'cmd':'run','args':{'for_s':1}}")); /* and a run is a run again */
    assert_has(control_run_done(&r.control, r.s.now_ns),
               "\"id\":9,\"ok\":true,\"t_ns\":800,\"can_rx\":0,\"rx\":{},\"result\":{}}");
}

static void a_run_that_ends_before_the_cycle_is_refused_and_the_cycle_goes_its_way(void **state)
{
    (void)state;
    int me;
    r.by_step = true;
    assert_null(say(&me, READ_0));
    assert_has(control_run_done(&r.control, 100), "the cycle did not complete");
    assert_null(say(&me, "{'cmd':'run','args':{'for_s':1}}"));
    sched_run_until(&r.s, FAKE_STROBE_NS);
    assert_int_equal(r.stops + r.replies, 0);
    assert_null(r.control.cycle[0].control);
    assert_has(control_run_done(&r.control, FAKE_STROBE_NS), "\"result\":{}");
    r.cannot_run = true;
    assert_has(say(&me, READ_0), "\"state\",\"text\":\"not now\"");
    assert_false(r.control.waiting);
    sched_run_until(&r.s, 3 * FAKE_STROBE_NS);
    assert_int_equal(r.stops + r.replies, 0);
    assert_null(r.control.cycle[0].control);
}

static void a_refusal_has_the_code_of_its_reason(void **state)
{
    (void)state;
    int me;
    const struct {
        const char *line, *code;
    } rows[] = {
        {"{'cmd':'bus.read','args':{'unit':'f','address':4}}",
         "\"address\",\"text\":\"f: read of address 04h (nothing), strobe 800 ns: nothing answers at this address; 00h "
         "to "
         "02h do\""},
        {"{'cmd':'bus.read','args':{'unit':'f','address':10}}", "address 0Ah (nothing)"},
        {"{'cmd':'bus.write','args':{'unit':'f','address':0,'data':1}}",
         "\"read_only\",\"text\":\"f: write of 1 to address 00h (word), strobe 800 ns: this register is read-only\""},
        {"{'cmd':'bus.read','args':{'unit':'f','address':1}}", "\"write_only\""},
        {"{'cmd':'bus.read','args':{'unit':'f','address':3,'strobe_ns':400}}",
         "\"too_short\",\"text\":\"f: read of address 03h (nothing), strobe 400 ns: the strobe is shorter than the "
         "board "
         "needs, at least 401 ns\""},
        {"{'cmd':'bus.write','args':{'unit':'f','address':2,'data':13}}",
         "\"value\",\"text\":\"f: write of 13 to address 02h (level), strobe 800 ns: the register does not take this "
         "value: it takes 2\""},
        {"{'cmd':'bus.read','args':{'unit':'p','address':0}}",
         "unit: expected a board with a parallel bus, got p, a PSA-2"},
        {"{'cmd':'bus.read','args':{'unit':'f','address':16}}", "expected 0 to 15"},
        {"{'cmd':'bus.read','args':{'address':1}}", "unit: expected a value"},
        {"{'cmd':'bus.write','args':{'unit':'f','address':3}}", "data: expected a value"},
        {"{'cmd':'bus.write','args':{'unit':'f','address':3,'data':65536}}", "expected 0 to 65535"},
        {"{'cmd':'bus.read','args':{'unit':'f','address':3,'strobe_ns':0}}", "expected 1 to "},
        {"{'cmd':'bus.read','args':{'unit':'f','address':3,'data':0}}", "args: expected unit, address, strobe_ns, got"},
    };
    for (int step = 0; step < 2; step++) {
        r.by_step = step;
        for (size_t i = 0; i < COUNT(rows); i++) {
            assert_has(say(&me, rows[i].line), "\"ok\":false");
            assert_has(r.control.reply, rows[i].code);
        }
    }
    assert_int_equal(r.runs, 0);
    assert_int_equal(r.board.cycles, 12);
    for (unsigned i = 0; i < CONTROL_CYCLES_MAX; i++) assert_null(r.control.cycle[i].control);
    r.board.on = false;
    assert_has(say(&me, READ_0), "\"code\":\"off\",\"text\":\"f: read of address 00h (word), strobe 800 ns: the board "
                                 "has no power or is in reset\"");
}

static void what_goes_wrong_later_is_told_later(void **state)
{
    (void)state;
    int me, other;
    r.board.waits = false;
    assert_null(say(&me, READ_0));
    assert_has(say(&other, READ_0), "\"busy\"");
    sched_run_until(&r.s, FAKE_STROBE_NS);
    assert_ptr_equal(r.to, &me);
    assert_has(r.replied, "\"id\":7,\"ok\":false");
    assert_has(r.replied, "\"not_ready\"");
    assert_has(r.replied, "too early: no word waits there; wait for 0\"");
    assert_null(say(&other, READ_0));
    assert_has(say(&me, "{'cmd':'unit.reset','args':{'unit':'f'}}"), "\"ok\":true");
    assert_ptr_equal(r.to, &other);
    assert_has(r.replied, "\"off\"");
    assert_int_equal(r.control.refused, 3);
}

static void the_journal_has_each_cycle_that_reached_the_board(void **state)
{
    (void)state;
    int me;
    sched_run_until(&r.s, 5);
    assert_null(say(&me, READ_0));
    assert_string_equal(r.journal, "bus.read {\"unit\":\"f\",\"address\":0} 5");
    (void)say(&me, READ_0);
    assert_string_equal(r.journal, "refused bus.read {\"unit\":\"f\",\"address\":0} 5");
    sched_run_until(&r.s, 1000);
    assert_null(say(&me, WRITE_3));
    assert_string_equal(r.journal, "bus.write {\"unit\":\"f\",\"address\":3,\"data\":65535,\"strobe_ns\":2000} 1000");
    r.journal[0] = '\0';
    (void)say(&me, "{'cmd':'bus.read','args':{'unit':'p','address':0}}");
    assert_string_equal(r.journal, "");
    control_cycles_forget(&r.control, &me); /* WRITE_3 is still under way */
}

/* Its socket is closed, or there never was one: a timeline, a snapshot done again. */
static void nobody_is_answered_who_is_not_there(void **state)
{
    (void)state;
    int me, other;
    assert_null(say(&me, READ_0));
    control_cycles_forget(&r.control, &other);
    assert_ptr_equal(r.control.cycle[0].client, &me);
    control_cycles_forget(&r.control, &me);
    sched_run_until(&r.s, FAKE_STROBE_NS);
    r.by_step = true;
    cJSON *args = cJSON_Parse("{\"unit\":\"f\",\"address\":2,\"data\":12}"), *result = cJSON_CreateObject();
    r.control.client = NULL;
    assert_int_equal(control_call(&r.control, "bus.write", args, result, r.s.now_ns), CONTROL_LATER);
    cJSON_Delete(args);
    cJSON_Delete(result);
    sched_run_until(&r.s, 2 * FAKE_STROBE_NS);
    assert_int_equal(r.board.word[2], 12);
    assert_int_equal(r.runs + r.stops + r.replies, 0);
    assert_null(r.control.cycle[0].control);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, fresh)
    const struct CMUnitTest tests[] = {
        TEST(in_real_time_the_answer_comes_when_the_cycle_is_done),
        TEST(in_step_pace_time_moves_until_the_cycle_is_done),
        TEST(a_run_that_ends_before_the_cycle_is_refused_and_the_cycle_goes_its_way),
        TEST(a_refusal_has_the_code_of_its_reason),
        TEST(what_goes_wrong_later_is_told_later),
        TEST(the_journal_has_each_cycle_that_reached_the_board),
        TEST(nobody_is_answered_who_is_not_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
