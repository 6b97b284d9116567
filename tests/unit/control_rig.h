/* Two PSA-2 behind a control port and a truth port, and what the commands ask of the program that runs them. */
#ifndef PSABENCH_TESTS_CONTROL_RIG_H
#define PSABENCH_TESTS_CONTROL_RIG_H

#include "rig.h"

#include "app/list/list.h"
#include "bench/bench.h"
#include "control/control.h"

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
    bool wires;
} asked;

static inline bool on_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    (void)ctx;
    if (asked.refuse) snprintf(why, CONTROL_WHY_MAX, "not now");
    asked.runs++;
    asked.for_ns = for_ns;
    asked.after_tx = after_tx;
    return !asked.refuse;
}

static inline void on_run_stop(void *ctx)
{
    (void)ctx;
    asked.stops++;
    asked.stop_ns = bench->sched.now_ns;
}

static inline void on_push(void *ctx, void *client, const char *line)
{
    (void)ctx;
    asked.pushes++;
    asked.to = client;
    snprintf(asked.pushed, sizeof asked.pushed, "%s", line);
}

static inline bool on_vcd_start(void *ctx, const char *path, unsigned unit, bool wires, uint64_t max_bytes, char *why)
{
    (void)ctx, (void)max_bytes;
    snprintf(asked.path, sizeof asked.path, "%s", path);
    snprintf(why, CONTROL_WHY_MAX, "no room");
    asked.unit = unit;
    asked.wires = wires;
    return !asked.refuse;
}

static inline bool on_vcd_stop(void *ctx, char *why)
{
    (void)ctx;
    (void)why;
    return true;
}

static inline void on_journal(void *ctx, const struct control_command *row, const struct cJSON *args, bool done,
                              int64_t t_ns)
{
    (void)ctx;
    char *text = cJSON_PrintUnformatted(args);
    snprintf(asked.pushed, sizeof asked.pushed, "%s%s %s %lld", done ? "" : "refused ", row->name, text,
             (long long)t_ns);
    cJSON_free(text);
    asked.pushes++;
}

static inline bool on_endpoints(void *ctx, struct cJSON *result)
{
    (void)ctx;
    if (!asked.refuse) cJSON_AddArrayToObject(result, "endpoints");
    return !asked.refuse;
}

static inline void on_quit(void *ctx)
{
    (void)ctx;
    asked.quits++;
}

static inline bool on_vcd_flush(void *ctx, char *why)
{
    (void)ctx;
    snprintf(why, CONTROL_WHY_MAX, "no recording");
    return false;
}

static inline uint64_t on_can_rx(void *ctx)
{
    (void)ctx;
    return 42;
}

static inline bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){
        .adapter = "socketcand", .name = "can0", .connection = 3, .delivered = 42, .refused = 1};
    return i == 0;
}

static inline void on_gone(void *ctx, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.delivered = 3};
}

static inline void on_pace(void *ctx, struct control_pace *out)
{
    (void)ctx;
    *out = (struct control_pace){.name = "step", .turns = 9};
}

static inline int fresh(void **state)
{
    static struct scenario s;
    char why[256];
    (void)state;
    assert_true(scenario_parse("test.yaml", scenario_text, strlen(scenario_text), &s, why, sizeof why));
    bench_free(bench);
    assert_true(bench_init(bench, &s, 0));
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
                                  .sim.run = on_run,
                                  .sim.run_stop = on_run_stop,
                                  .process.push = on_push,
                                  .recording.start = on_vcd_start,
                                  .recording.stop = on_vcd_stop,
                                  .sched = &bench->sched,
                                  .process.endpoints = on_endpoints,
                                  .process.quit = on_quit,
                                  .recording.flush = on_vcd_flush,
                                  .clients.can_rx = on_can_rx,
                                  .clients.nth = on_client,
                                  .clients.gone = on_gone,
                                  .sim.pace = on_pace};
    control_init(&control, control_tables, &view);
    control_init(&truth, control_truth_tables, &view);
    return 0;
}

static inline const char *say(const char *line)
{
    return control_line(&control, line, bench->sched.now_ns);
}

/* The reply has this text in it. */
static inline void assert_says(const char *line, const char *want)
{
    const char *reply = say(line);
    assert_non_null(reply);
    if (!strstr(reply, want)) fail_msg("%s\n  gave %s\n  want %s", line, reply, want);
}

/* The table in Markdown, to be read from its beginning; the caller closes it. */
static inline FILE *table_file(const struct control_table *const *tables)
{
    FILE *file = tmpfile();
    assert_non_null(file);
    list_table(file, tables);
    rewind(file);
    return file;
}

#endif
