/* A whole bench: any commands, frames of programs that come and go, faults, time. What holds at any moment: data-ready never
 * falls without a conversion, registers have their reset values after a reset, counters never go back, replies are one line
 * of JSON. In the end the journal makes the same bench again. */
#include "fuzz.h"

#include "bench/snapshot.h"
#include "command/args.h"
#include "fault/fault.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CLIENTS = 3, OPS_MAX = 64, RUN_MAX_NS = 20000000, ALL_MAX_NS = 400000000 };

static const char scenario_text[] =
    "seed: 3\n"
    "table: {axes: 2}\n"
    "chamber: {start_degc: 20}\n"
    "supply: {volt_v: 12, brownout_v: 9, hysteresis_v: 0.5}\n"
    "units:\n"
    "  - {name: a, node: 5, on: table, adc_chain: direct, axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}\n"
    "  - {name: b, node: 6, adc_chain: direct, axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}\n";

/* What a unit had when it was last looked at. */
struct seen {
    struct unit_observer observer;
    struct world *world;
    unsigned unit;
    int64_t period, sync_count; /* of converter X at the last DRD_A */
    struct psa2_counters board;
    uint32_t conversions, tx_frames, rx_frames;
};

struct world {
    struct can_hub hub;
    struct control control;
    struct control_bench view;
    struct fault_engine faults;
    struct journal journal;
    struct snapshot_observers observers;
    struct can_client client[CLIENTS];
    struct seen seen[2];
    bool odd; /* faults were planned: data-ready and registers may be anything */
    uint64_t frames;
    struct bench bench; /* last: it clears what it needs itself */
};

static struct scenario scenario;

/* ---- what the commands reach */

static uint64_t can_rx(void *ctx)
{
    (void)ctx;
    return 0;
}

static struct can_client *nth_client(struct world *w, unsigned i)
{
    struct can_client *c = w->hub.clients;
    while (c && i--) c = c->next;
    return c;
}

static bool client(void *ctx, unsigned i, struct control_client *out)
{
    const struct can_client *c = nth_client(ctx, i);
    if (c) {
        *out = (struct control_client){
            .adapter = c->adapter, .name = c->name, .connection = c->connection, .slot = c->slot, .taken = c->taken};
    }
    return c != NULL;
}

static struct can_node *client_node(void *ctx, uint32_t slot)
{
    struct can_client *c = ((struct world *)ctx)->hub.clients;
    while (c && c->slot != slot) c = c->next;
    return c ? &c->node : NULL;
}

static void gone(void *ctx, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = "", .name = ""};
}

static void pace(void *ctx, struct control_pace *out)
{
    (void)ctx;
    *out = (struct control_pace){.name = "step"};
}

static void supply_changed(void *ctx, int64_t t_ns)
{
    bench_supply_changed(&((struct world *)ctx)->bench, t_ns);
}

static void on_journal(void *ctx, const struct control_command *row, const cJSON *args, bool done, int64_t t_ns)
{
    struct world *w = ctx;
    (void)t_ns;
    w->odd |= strncmp(row->name, "fault.", 6) == 0;
    journal_command(&w->journal, row, args, done);
}

/* ---- what must hold */

/* Registers whose bits a bus write can change are as the table says; those of the accelerometers' converters at once. */
static void check_reset(const struct psa2 *b)
{
    for (unsigned axis = 0; axis < 3; axis++) {
        const struct reg_file *r = &b->adc[axis].regs;
        for (unsigned i = 0; i < r->count; i++) assert(!((reg_peek(r, i) ^ r->map[i].reset) & r->map[i].rw));
    }
}

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    struct seen *s = ctx;
    const struct unit *u = &s->world->bench.unit[s->unit];
    const struct ads1282 *adc = &((const struct psa2 *)u->board)->adc[0];
    assert(t_ns <= s->world->bench.sched.now_ns);
    if (s->world->odd) return;
    if (e == PSA2_EV_RES) check_reset(&u->store.psa2);
    if (e == PSA2_EV_DRD_A) assert(adc->period != s->period || adc->sync_count != s->sync_count);
    s->period = adc->period;
    s->sync_count = adc->sync_count;
}

static void check_counters(struct world *w)
{
    assert(w->bench.bus[0].frames >= w->frames);
    w->frames = w->bench.bus[0].frames;
    for (unsigned i = 0; i < 2; i++) {
        struct seen *s = &w->seen[i];
        const struct psa2 *b = &w->bench.unit[i].store.psa2;
        const struct can_node *n = unit_node(&w->bench.unit[i]);
        assert(b->counters.frames >= s->board.frames && b->counters.resets >= s->board.resets);
        assert(b->counters.requests >= s->board.requests && b->counters.timeouts >= s->board.timeouts);
        assert(b->adc[0].count.conversions >= s->conversions);
        assert(n->tx_frames >= s->tx_frames && n->rx_frames >= s->rx_frames);
        s->board = b->counters;
        s->conversions = b->adc[0].count.conversions;
        s->tx_frames = n->tx_frames;
        s->rx_frames = n->rx_frames;
    }
}

/* ---- the world */

static void up(struct world *w, bool watched)
{
    memset(w, 0, offsetof(struct world, bench));
    if (!bench_init(&w->bench, &scenario, 0)) abort();
    w->hub.bus = &w->bench.bus[0];
    w->view = (struct control_bench){.ctx = w,
                                     .clients.can_rx = can_rx,
                                     .clients.nth = client,
                                     .clients.node = client_node,
                                     .clients.gone = gone,
                                     .sim.pace = pace,
                                     .sim.supply_changed = supply_changed,
                                     .process.journal = on_journal};
    bench_view(&w->bench, &w->view);
    w->view.faults = &w->faults;
    fault_init(&w->faults, &w->view, &w->bench.sched);
    control_init(&w->control, control_tables, &w->view);
    journal_init(&w->journal, &w->bench);
    journal_follow(&w->journal, &w->hub, 0);
    bench_power_up(&w->bench);
    for (unsigned i = 0; i < 2 && watched; i++) {
        w->seen[i] = (struct seen){.world = w, .unit = i, .period = -1};
        w->seen[i].observer = (struct unit_observer){.fn = on_event, .ctx = &w->seen[i]};
        unit_subscribe(&w->bench.unit[i], &w->seen[i].observer);
    }
}

static void down(struct world *w)
{
    for (unsigned i = 0; i < CLIENTS; i++) can_hub_leave(&w->hub, &w->client[i]);
    can_hub_sweep_detached(&w->hub, true);
    snapshot_release_lines(&w->observers, &w->bench);
    control_run_forget(&w->control);
    journal_free(&w->journal);
    bench_free(&w->bench);
}

static void run(struct world *w, int64_t for_ns)
{
    sched_run_until(&w->bench.sched, w->bench.sched.now_ns + for_ns);
    bench_follow(&w->bench);
    journal_moved(&w->journal);
}

/* ---- what is done to it */

static void do_client(struct world *w, struct script *s)
{
    struct can_client *c = &w->client[script_byte(s) % CLIENTS];
    if (c->up) {
        can_hub_leave(&w->hub, c);
        return;
    }
    *c = (struct can_client){.adapter = "fuzz", .name = "fuzz"};
    c->node = (struct can_node){.order = CAN_ORDER_FIFO, .fd = script_byte(s) & 1};
    can_hub_join(&w->hub, c);
}

static void do_frame(struct world *w, struct script *s)
{
    static const uint32_t ids[] = {0x000, 0x080, 0x605, 0x606};
    const uint8_t kind = script_byte(s);
    struct can_msg m = {.id = ids[kind % 4], .len = kind % 4 == 0 ? 2 : kind % 4 == 1 ? 0 : 8};
    if (kind & 0x40) m = (struct can_msg){.id = (uint32_t)script_uint(s, 2) & 0x7FF, .len = script_byte(s) % 9};
    for (unsigned i = 0; i < m.len; i++) m.data[i] = script_byte(s);
    can_hub_send(&w->hub, &w->client[script_byte(s) % CLIENTS], &m, w->bench.sched.now_ns);
}

static double number(struct script *s, const struct control_arg *a)
{
    const uint8_t b = script_byte(s);
    const double share = (double)b / 255.0;
    if (b == 1) return a->max * 2 + 1;
    const double x = a->min + (a->max - a->min) * share * share * share;
    return a->type == CONTROL_COUNT ? (double)(int64_t)x : x;
}

static cJSON *value(struct world *w, struct script *s, const struct control_arg *a)
{
    static const char *const words[] = {"a",          "DRD_A",      "sensor.bias", "a.sensor.x",
                                        "line.stuck", "b.line.INT", "can.drop",    "bus.can0"};
    if (a->type == CONTROL_BOOL) return cJSON_CreateBool(script_byte(s) & 1);
    if (a->type == CONTROL_UNIT) return cJSON_CreateString(w->view.unit_name[script_byte(s) % w->view.units]);
    if (a->type == CONTROL_CHOICE && a->choices[0])
        return cJSON_CreateString(a->choices[script_byte(s) % 2 && a->choices[1]]);
    if (a->type == CONTROL_REALS) {
        cJSON *list = cJSON_CreateArray();
        for (unsigned n = script_byte(s) % 4; n > 0; n--) cJSON_AddItemToArray(list, cJSON_CreateNumber(number(s, a)));
        return list;
    }
    if (a->type == CONTROL_REAL || a->type == CONTROL_COUNT) return cJSON_CreateNumber(number(s, a));
    return cJSON_CreateString(words[script_byte(s) % (sizeof words / sizeof *words)]);
}

/* Nothing that opens files or ends the program; `run` needs a loop. */
static bool allowed(const char *name)
{
    static const char *const no[] = {"run",  "run.until", "vcd.",        "quit", "snapshot",
                                     "fork", "subscribe", "unsubscribe", "lines"};
    for (unsigned i = 0; i < sizeof no / sizeof *no; i++) {
        const size_t n = strlen(no[i]);
        if (strncmp(name, no[i], n) == 0 && (no[i][n - 1] == '.' || !name[n])) return false;
    }
    return true;
}

static void do_command(struct world *w, struct script *s)
{
    unsigned rows = 0;
    while (control_row(control_tables, rows)) rows++;
    const struct control_command *row = control_row(control_tables, script_byte(s) % rows);
    if (!allowed(row->name)) return;
    cJSON *request = cJSON_CreateObject();
    cJSON_AddStringToObject(request, "cmd", row->name);
    cJSON *args = cJSON_AddObjectToObject(request, "args");
    for (unsigned i = 0; i < control_arg_count(row); i++) {
        const struct control_arg *a = &row->arg[i];
        if (!a->optional || script_byte(s) < 32) cJSON_AddItemToObject(args, a->name, value(w, s, a));
    }
    char *line = cJSON_PrintUnformatted(request);
    const char *reply = control_line(&w->control, line, w->bench.sched.now_ns);
    if (getenv("FUZZ_TELL")) fprintf(stderr, "%s -> %.200s\n", line, reply);
    assert(reply && reply[0] == '{' && !strchr(reply, '\n'));
    cJSON_free(line);
    cJSON_Delete(request);
}

/* ---- the same again */

static void do_again(struct world *first, struct world *again)
{
    char why[1024] = "";
    struct snapshot s = {.journal = first->journal.text ? first->journal.text : "",
                         .end_ns = first->bench.sched.now_ns,
                         .ran = first->journal.ran && first->bench.sched.now_ns == first->journal.last_ns};
    journal_watchers(&first->journal);
    assert(!first->journal.lost);
    s.journal_len = first->journal.len;
    digest_bench(&first->bench, &first->journal, s.state);
    up(again, false);
    const struct snapshot_world w = {.bench = &again->bench,
                                     .journal = &again->journal,
                                     .hub = {&again->hub},
                                     .buses = 1,
                                     .control = &again->control,
                                     .observers = &again->observers};
    if (!snapshot_replay(&s, &w, why, sizeof why)) {
        fprintf(stderr, "%s\n%.*s", why, (int)s.journal_len, s.journal);
        abort();
    }
    assert(again->journal.len == first->journal.len);
    assert(!first->journal.len || memcmp(again->journal.text, first->journal.text, first->journal.len) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct world first, again;
    struct script s = script_of(data, size);
    char why[512];
    if (!scenario.unit_count &&
        !scenario_parse("fuzz", scenario_text, sizeof scenario_text - 1, &scenario, why, sizeof why)) {
        fprintf(stderr, "%s\n", why);
        abort();
    }
    up(&first, true);
    for (unsigned i = 0; i < OPS_MAX && script_more(&s) && first.bench.sched.now_ns < ALL_MAX_NS; i++) {
        const uint8_t op = script_byte(&s);
        if (op < 60) do_command(&first, &s);
        else if (op < 80) do_client(&first, &s);
        else if (op < 160) do_frame(&first, &s);
        else if (op < 240) run(&first, script_span_ns(&s) % RUN_MAX_NS);
        else run(&first, 280000000); /* a set-up's time */
        check_counters(&first);
    }
    do_again(&first, &again);
    down(&again);
    down(&first);
    return 0;
}
