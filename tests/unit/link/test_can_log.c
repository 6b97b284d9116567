/* Frames as text, in a file and by command: can_text, can_log, can.put. */
#define _GNU_SOURCE /* mkstemp */
#include "rig.h"

#include "base/can/text.h"
#include "control/control.h"
#include "link/can/can_log.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct {
    struct sched s;
    struct can_bus bus[2];
    struct can_node host[2], ear;
    struct can_msg heard;
    unsigned frames;
    struct control control;
    struct control_bench view;
    struct can_log log;
    char path[64];
} r;

static void on_heard(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    r.heard = *m;
    r.frames++;
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

static int fresh(void **state)
{
    const struct can_bus_cfg cfg = {.bitrate_hz = 1000000};
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    for (unsigned i = 0; i < 2; i++) {
        can_bus_init(&r.bus[i], &cfg, &r.s);
        r.host[i] = (struct can_node){.name = "bench", .order = CAN_ORDER_FIFO};
        can_attach(&r.bus[i], &r.host[i]);
    }
    r.ear = (struct can_node){.name = "ear", .rx = on_heard};
    can_attach(&r.bus[1], &r.ear);
    r.view = (struct control_bench){.bus = {&r.bus[0], &r.bus[1]},
                                    .bus_name = {"can0", "can1"},
                                    .host = {&r.host[0], &r.host[1]},
                                    .buses = 2,
                                    .sched = &r.s,
                                    .clients.can_rx = on_can_rx,
                                    .clients.nth = on_client};
    control_init(&r.control, control_tables, &r.view);
    strcpy(r.path, "/tmp/psabench-log-XXXXXX");
    const int fd = mkstemp(r.path);
    assert_true(fd >= 0);
    close(fd);
    return 0;
}

static int forget(void **state)
{
    (void)state;
    return unlink(r.path);
}

/* ---- text */

static const char *const frames[] = {"000#",        "7FF#R0",     "123#1122",           "185#15DA1F0100000000",
                                     "12345678#R4", "123##01122", "1FFFFFFF##1FF000102"};

static void text_and_frame_are_the_same_both_ways(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(frames); i++) {
        struct can_msg m;
        char text[CAN_TEXT_MAX];
        assert_true(can_text_get(frames[i], &m));
        assert_int_equal(can_text_put(&m, text), strlen(frames[i]));
        assert_string_equal(text, frames[i]);
    }
    const struct can_msg error = {.id = 4, .flags = CAN_ERROR, .len = 8};
    char text[CAN_TEXT_MAX];
    can_text_put(&error, text);
    assert_string_equal(text, "20000004#0000000000000000");
}

static void what_is_no_frame_is_told_from_one(void **state)
{
    static const char *const rows[] = {"",          "#",         "12#",       "1234#",   "123",
                                       "123#1",     "123#zz",    "123#ab",    "800#",    "123#112233445566778899",
                                       "123#R9",    "123#R11",   "123##",     "123##2",  "123##0112233445566778899",
                                       "20000000#", "123 #1122", "123#11 22", "123##R1", "123#R"};
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct can_msg m;
        if (can_text_get(rows[i], &m)) fail_msg("%s passes for a frame", rows[i]);
    }
}

/* ---- the command; single quotes for double ones */

static const char *say(const char *line)
{
    char json[512];
    snprintf(json, sizeof json, "%s", line);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    return control_line(&r.control, json, r.s.now_ns);
}

static void a_command_puts_a_frame_on_the_bus_that_it_names(void **state)
{
    (void)state;
    assert_non_null(strstr(say("{'cmd':'can.put','args':{'frame':'609#2F00210104','bus':'can1'}}"), "\"ok\":true"));
    assert_int_equal(r.frames, 0); /* it takes its bits */
    sched_run_until(&r.s, 1000000);
    assert_int_equal(r.frames, 1);
    assert_int_equal(r.heard.id, 0x609);
    assert_memory_equal(r.heard.data, ((const uint8_t[]){0x2F, 0, 0x21, 1, 4}), 5);
    assert_non_null(strstr(say("{'cmd':'can.put','args':{'frame':'609#00'}}"), "\"ok\":true"));
    sched_run_until(&r.s, 2000000);
    assert_int_equal(r.frames, 1); /* that was the other bus */
    assert_int_equal(r.bus[0].frames, 1);
}

static void a_frame_that_cannot_be_sent_is_refused_in_words(void **state)
{
    static const struct {
        const char *args, *words;
    } rows[] = {
        {"{'frame':'609#0'}", "frame: expected a frame such as"},
        {"{'frame':'609#00','bus':'can7'}", "bus: expected a bus of this bench"},
        {"{'frame':'609##000'}", "does not carry"},
        {"{}", "frame"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        char line[256];
        snprintf(line, sizeof line, "{'cmd':'can.put','args':%s}", rows[i].args);
        const char *reply = say(line);
        assert_non_null(strstr(reply, "\"ok\":false"));
        if (!strstr(reply, rows[i].words)) fail_msg("%s does not say %s", reply, rows[i].words);
    }
    for (unsigned i = 0; i < CAN_QUEUE_MAX; i++) (void)say("{'cmd':'can.put','args':{'frame':'609#00'}}");
    assert_non_null(strstr(say("{'cmd':'can.put','args':{'frame':'609#00'}}"), "frames to send is full"));
    r.view.buses = 0;
    assert_non_null(strstr(say("{'cmd':'can.put','args':{'frame':'609#00'}}"), "bus: expected a bus of this bench"));
}

/* ---- the file */

static size_t contents(char *text, size_t cap)
{
    FILE *f = fopen(r.path, "rb");
    assert_non_null(f);
    const size_t n = fread(text, 1, cap - 1, f);
    fclose(f);
    text[n] = '\0';
    return n;
}

static void every_frame_becomes_a_line_with_its_instant(void **state)
{
    char text[512];
    long owner = 0;
    (void)state;
    assert_int_equal(can_log_open(&r.log, &r.bus[0], "can0", r.path, 1000000000, &owner), 0);
    sched_run_until(&r.s, 2000000);
    (void)say("{'cmd':'can.put','args':{'frame':'609#2F00210104'}}");
    (void)say("{'cmd':'can.put','args':{'frame':'12345678#R4'}}");
    sched_run_until(&r.s, 3000000);
    assert_int_equal(contents(text, sizeof text), 0); /* waits in memory */
    assert_int_equal(can_log_flush(&r.log), 0);
    can_log_close(&r.log);
    can_log_close(&r.log);
    contents(text, sizeof text);
    /* ends of frame: 90 bits with their stuffing; then 3 bits of space and 67 */
    assert_memory_equal(text, "(0000000001.0020", 16);
    assert_non_null(strstr(text, ") can0 609#2F00210104\n(0000000001.002"));
    assert_string_equal(text + strlen(text) - 18, " can0 12345678#R4\n");
    (void)say("{'cmd':'can.put','args':{'frame':'609#00'}}"); /* no client waits any more */
    sched_run_until(&r.s, 4000000);
    assert_int_equal(r.log.frames, 2);
}

static void more_than_the_buffer_is_all_there(void **state)
{
    enum { N = 3000 };
    static char text[N * 64];
    long owner = 0;
    (void)state;
    assert_int_equal(can_log_open(&r.log, &r.bus[0], NULL, r.path, 0, &owner), 0);
    for (unsigned i = 0; i < N; i++) {
        (void)say("{'cmd':'can.put','args':{'frame':'185#0011223344556677'}}");
        sched_run_until(&r.s, r.s.now_ns + 1000000);
    }
    can_log_close(&r.log);
    const size_t line = strlen("(0000000000.000123) can0 185#0011223344556677\n");
    assert_int_equal(contents(text, sizeof text), N * line);
}

static void a_file_that_takes_nothing_is_told_and_ends_the_writing(void **state)
{
    long owner = 0;
    (void)state;
    assert_int_equal(can_log_open(&r.log, &r.bus[0], "can0", "/nowhere/x.log", 0, &owner), -ENOENT);
    assert_int_equal(can_log_open(&r.log, &r.bus[0], "can0", "/dev/full", 0, &owner), 0);
    (void)say("{'cmd':'can.put','args':{'frame':'609#00'}}");
    sched_run_until(&r.s, 1000000);
    assert_int_equal(can_log_flush(&r.log), -ENOSPC);
    (void)say("{'cmd':'can.put','args':{'frame':'609#00'}}");
    sched_run_until(&r.s, 2000000);
    assert_int_equal(r.log.frames, 1);
    can_log_close(&r.log);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fresh, forget)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(text_and_frame_are_the_same_both_ways),
        TEST(what_is_no_frame_is_told_from_one),
        TEST(a_command_puts_a_frame_on_the_bus_that_it_names),
        TEST(a_frame_that_cannot_be_sent_is_refused_in_words),
        TEST(every_frame_becomes_a_line_with_its_instant),
        TEST(more_than_the_buffer_is_all_there),
        TEST(a_file_that_takes_nothing_is_told_and_ends_the_writing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
