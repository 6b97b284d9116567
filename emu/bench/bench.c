#include "bench/bench.h"

#include "gen/uds_dids.h"

#include <stdlib.h>
#include <string.h>

enum { START_NS = 1000000, NMT_START = 1, SDO_WRITE_U8 = 0x2F, OBJECT_FRAME_FORM = 0x2020 };

int bench_find_unit(const struct scenario *s, const char *name)
{
    for (unsigned i = 0; i < s->unit_count; i++) {
        if (strcmp(s->units[i].name, name) == 0) return (int)i;
    }
    return -1;
}

static void on_monitor(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct bench *b = ctx;
    if (b->on_frame) b->on_frame(b->ctx, m, t_ns);
}

static void on_refused(void *ctx, const char *unit, const char *why)
{
    struct bench *b = ctx;
    if (b->on_refused) b->on_refused(b->ctx, unit, why);
}

/* What a host would do first, in frames that everybody sees. */
static void on_start(void *ctx, int64_t t_ns)
{
    struct bench *b = ctx;
    for (unsigned i = 0; i < b->scenario.unit_count; i++) {
        const struct scenario_unit *u = &b->scenario.units[i];
        struct can_msg m = {.id = 0x600u + u->cfg.node, .len = 8};
        const uint8_t write[] = {SDO_WRITE_U8, OBJECT_FRAME_FORM & 0xFF, OBJECT_FRAME_FORM >> 8, 0, u->frame_form};
        memcpy(m.data, write, sizeof write);
        if (u->frame_form) can_send(&b->bus[u->bus], &b->starter.node[u->bus], &m, t_ns);
    }
    const struct can_msg start = {.id = 0, .len = 2, .data = {NMT_START, 0}};
    for (unsigned i = 0; b->scenario.start && i < b->buses; i++)
        can_send(&b->bus[i], &b->starter.node[i], &start, t_ns);
}

static void init_unit(struct bench *b, unsigned i)
{
    const struct scenario_unit *u = &b->scenario.units[i];
    unit_init(&b->unit[i], &u->cfg, &b->lab, &b->sched);
    unit_trace(&b->unit[i])->group = &b->traces;
    const struct board_can_cfg cfg = {.name = u->name, .node_id = u->cfg.node, .refused = on_refused, .ctx = b};
    unit_connect(&b->unit[i], &cfg, &b->bus[u->bus], &b->sched);
    if (u->uds_ecu) uds_door_init(&b->uds[u->bus][u->uds_ecu - 1], u->uds_ecu, &uds_dids, unit_co(&b->unit[i]));
}

static void init_bus(struct bench *b, unsigned i)
{
    can_bus_init(&b->bus[i], &b->scenario.bus[i].cfg, &b->sched);
    b->starter.node[i] = (struct can_node){.name = "bench", .order = CAN_ORDER_FIFO, .fd = true};
    b->monitor[i] = (struct can_node){.name = "monitor", .fd = true, .rx = on_monitor, .ctx = b};
}

/* ---- supply */

static void switch_units(struct bench *b, bool on, int64_t t_ns)
{
    b->fed = on;
    for (unsigned i = 0; i < b->scenario.unit_count; i++) {
        if (on) unit_power_up(&b->unit[i], t_ns);
        else unit_power_down(&b->unit[i], t_ns);
    }
}

void bench_supply_changed(struct bench *b, int64_t t_ns)
{
    const bool feeds = supply_feeds(&b->lab.supply, b->fed, t_ns);
    if (feeds != b->fed) switch_units(b, feeds, t_ns);
    const int64_t next_ns = supply_next_ns(&b->lab.supply, b->fed, t_ns);
    if (next_ns == INT64_MAX) sched_cancel(&b->sched, &b->power);
    else sched_at(&b->sched, &b->power, next_ns);
}

static void on_power(void *ctx, int64_t t_ns)
{
    bench_supply_changed(ctx, t_ns);
}

/* ---- parallel buses */

static void cycle_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct bench_cycle *b = ctx;
    b->busy = false;
    if (b->done) b->done(b->ctx, c, r, t_ns);
}

enum board_cycle_result bench_cycle(struct bench *b, unsigned unit, const struct bench_cycle *c, int64_t t_ns)
{
    struct bench_cycle *own = &b->cycle[unit];
    const struct unit *u = &b->unit[unit];
    if (b->on_cycle) b->on_cycle(b->ctx, unit, &c->cycle);
    if (own->busy) return BOARD_CYCLE_BUSY;
    *own = *c;
    own->cycle.done = cycle_done;
    own->cycle.ctx = own;
    const enum board_cycle_result r = u->type->bus->submit(u->board, &own->cycle, t_ns);
    own->busy = r == BOARD_CYCLE_OK;
    return r;
}

void bench_cycle_forget(struct bench *b, unsigned unit)
{
    b->cycle[unit].done = NULL;
}

/* ---- */

void bench_view(struct bench *b, struct control_bench *v)
{
    v->lab = &b->lab;
    v->sched = &b->sched;
    v->buses = b->buses;
    v->units = b->scenario.unit_count;
    v->seed = b->scenario.seed;
    v->scenario = b->scenario.path;
    for (unsigned i = 0; i < b->buses; i++) {
        v->bus[i] = &b->bus[i];
        v->bus_name[i] = b->scenario.bus[i].name;
        v->host[i] = &b->starter.node[i];
    }
    for (unsigned i = 0; i < v->units; i++) {
        v->unit[i] = &b->unit[i];
        v->unit_name[i] = b->unit[i].cfg.name;
        v->node[i] = unit_node(&b->unit[i]);
    }
}

bool bench_init(struct bench *b, const struct scenario *s, unsigned watched)
{
    memset(b, 0, offsetof(struct bench, uds));
    scenario_copy(&b->scenario, s);
    b->unit = calloc(s->unit_count, sizeof *b->unit); /* pages never written take no memory */
    b->cycle = calloc(s->unit_count, sizeof *b->cycle);
    if (!b->unit || !b->cycle) return false;
    b->watched = watched;
    scenario_bind(&b->scenario);
    sched_init(&b->sched);
    b->buses = s->bus_count;
    for (unsigned i = 0; i < b->buses; i++) init_bus(b, i);
    lab_init(&b->lab, &b->scenario.lab, s->seed);
    for (unsigned i = 0; i < s->unit_count; i++) init_unit(b, i);
    sched_ev(&b->starter.ev, on_start, b);
    sched_ev(&b->power, on_power, b);
    return true;
}

void bench_free(struct bench *b)
{
    free(b->unit);
    free(b->cycle);
    b->unit = NULL;
    b->cycle = NULL;
}

uint64_t bench_recorded(struct bench *b, unsigned unit, bool wires)
{
    const struct unit *u = &b->unit[unit];
    if (!wires) return TRACE_FIRST(u->type->line_count);
    line_pairs_show(&u->board->line);
    return TRACE_FIRST(unit_trace(u)->count);
}

bool bench_record(struct bench *b, const struct bench_recording *r, FILE *out)
{
    struct unit *u = &b->unit[r->unit];
    const struct vcd_cfg cfg = {.out = out,
                                .scope = u->type->name, /* whatever the unit's name: share/psa2.gtkw opens it */
                                .unit_ns = r->unit_ns,
                                .max_bytes = r->max_bytes,
                                .reals = r->reals,
                                .mask = bench_recorded(b, r->unit, r->wires),
                                .from_ns = b->sched.now_ns};
    b->recording = vcd_open(&b->vcd, &cfg, unit_trace(u));
    return b->recording;
}

void bench_power_up(struct bench *b)
{
    for (unsigned i = 0; i < b->buses; i++) {
        can_attach(&b->bus[i], &b->monitor[i]);
        can_attach(&b->bus[i], &b->starter.node[i]);
    }
    bench_supply_changed(b, 0);
    sched_at(&b->sched, &b->starter.ev, START_NS);
}

void bench_follow(struct bench *b)
{
    trace_advance_group(&b->traces, b->sched.now_ns - TRACE_LAG_NS);
}

void bench_finish(struct bench *b)
{
    trace_advance_group(&b->traces, b->sched.now_ns);
    if (b->recording) vcd_close(&b->vcd, b->sched.now_ns);
    b->recording = false;
}
