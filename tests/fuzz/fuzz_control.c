/* A control line of any bytes gives one line of JSON, or a run to be answered later. The bench lives on between inputs. */
#include "fuzz.h"

#include "bench/bench.h"
#include "control/control.h"

#include <stdlib.h>
#include <string.h>

static bool on_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    (void)ctx;
    (void)after_tx;
    (void)why;
    assert(for_ns >= 0);
    return true;
}

static void on_quit(void *ctx)
{
    (void)ctx;
}

static bool on_vcd_flush(void *ctx, char *why)
{
    (void)ctx;
    (void)why;
    return true;
}

static uint64_t on_can_rx(void *ctx)
{
    (void)ctx;
    return 0;
}

static bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = "a", .name = "n"};
    return i == 0;
}

static void on_gone(void *ctx, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = ""};
}

static void on_pace(void *ctx, struct control_pace *out)
{
    (void)ctx;
    *out = (struct control_pace){.name = "step"};
}

static struct bench *make_bench(void)
{
    static const char text[] = "units: [{name: a, axes: {x: {sensor: mems}}}]\n";
    static struct scenario s;
    char why[256];
    struct bench *b = malloc(sizeof *b);
    if (!b || !scenario_parse("fuzz", text, sizeof text - 1, &s, why, sizeof why) || !bench_init(b, &s, 0)) abort();
    bench_power_up(b);
    return b;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct bench *bench;
    static struct control_bench view;
    static struct control control;
    char line[4096];
    if (!bench) {
        bench = make_bench();
        view = (struct control_bench){.lab = &bench->lab,
                                      .bus = {&bench->bus[0]},
                                      .buses = 1,
                                      .unit = {&bench->unit[0]},
                                      .unit_name = {"a"},
                                      .units = 1,
                                      .scenario = "fuzz",
                                      .sim.run = on_run,
                                      .process.quit = on_quit,
                                      .recording.flush = on_vcd_flush,
                                      .clients.can_rx = on_can_rx,
                                      .clients.nth = on_client,
                                      .clients.gone = on_gone,
                                      .sim.pace = on_pace};
        control_init(&control, control_tables, &view);
    }
    const size_t n = size < sizeof line ? size : sizeof line - 1;
    memcpy(line, data, n);
    line[n] = '\0';
    const char *reply = control_line(&control, line, bench->sched.now_ns);
    if (!reply) reply = control_run_done(&control, bench->sched.now_ns);
    assert(reply[0] == '{' && !strchr(reply, '\n'));
    return 0;
}
