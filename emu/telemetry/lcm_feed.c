#include "telemetry/lcm_feed.h"

#include "gen/lcm/psabench_lcm_can_frame_t.h"
#include "telemetry/lcm_reading.h"
#include "telemetry/lcm_register.h"
#include "telemetry/lcm_state.h"

#include <stdio.h>
#include <string.h>

enum { NODE_BITS = 0x7F };

static void send_frame(struct lcm_bus *b, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX], data[sizeof m->data];
    const bool remote = m->flags & CAN_RTR;
    memcpy(data, m->data, sizeof data);
    const psabench_lcm_can_frame_t frame = {.t_ns = t_ns,
                                            .epoch_ns = b->feed->epoch_ns,
                                            .bus = b->name,
                                            .id = (int32_t)m->id,
                                            .extended = (m->flags & CAN_EXT) != 0,
                                            .remote = remote,
                                            .fd = (m->flags & CAN_FD) != 0,
                                            .brs = (m->flags & CAN_BRS) != 0,
                                            .error = (m->flags & CAN_ERROR) != 0,
                                            .length = m->len,
                                            .size = remote ? 0 : m->len,
                                            .data = data};
    lcm_feed_send(b->feed, b->frames, out, psabench_lcm_can_frame_t_encode(out, 0, sizeof out, &frame), t_ns);
}

/* A unit joins its bus when it gets its power: that is when its place is found. */
static uint16_t find_unit(struct lcm_bus *b, unsigned node_id)
{
    const struct control_bench *bench = b->feed->bench;
    uint16_t *unit = &b->unit_of[node_id];
    for (unsigned k = 0; *unit == LCM_NO_UNIT && node_id > 0 && k < bench->units; k++)
        if (bench->node[k] && bench->node[k]->bus == b->node.bus && bench->unit[k]->cfg.node == node_id)
            *unit = (uint16_t)k;
    return *unit;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct lcm_bus *b = ctx;
    send_frame(b, m, t_ns);
    if (m->flags & (CAN_EXT | CAN_RTR | CAN_ERROR)) return;
    const uint16_t unit = find_unit(b, m->id & NODE_BITS);
    if (unit == LCM_NO_UNIT) return;
    lcm_reading_take(b->feed, &b->feed->unit[unit], m, t_ns);
    lcm_register_take(b->feed, &b->feed->unit[unit], m, t_ns);
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    send_frame(ctx, m, t_ns);
}

/* ---- start and end */

static void init_unit(struct lcm_feed *f, unsigned i)
{
    struct lcm_unit *u = &f->unit[i];
    *u = (struct lcm_unit){.unit = f->bench->unit[i], .name = f->bench->unit_name[i]};
    u->psa2.node = u->unit->cfg.node;
    u->board = lcm_board_of(u->unit->type->name);
    if (u->board) snprintf(u->readings, sizeof u->readings, "%s%.31s", lcm_board_channel(u->board), u->name);
    snprintf(u->registers, sizeof u->registers, "PSABENCH_REGISTER_%.31s", u->name);
    snprintf(u->truth, sizeof u->truth, "PSABENCH_TRUTH_%.31s", u->name);
}

static void init_bus(struct lcm_feed *f, unsigned i)
{
    struct lcm_bus *b = &f->bus[i];
    const struct control_bench *bench = f->bench;
    b->feed = f;
    char name[sizeof b->name] = "";
    if (bench->bus_name[i]) snprintf(name, sizeof name, "%.15s", bench->bus_name[i]);
    else snprintf(name, sizeof name, "can%u", i % CONTROL_BUSES_MAX);
    memcpy(b->name, name, sizeof name);
    snprintf(b->frames, sizeof b->frames, "PSABENCH_CAN_%s", name);
    memset(b->unit_of, 0xFF, sizeof b->unit_of); /* LCM_NO_UNIT */
    b->node = (struct can_node){.name = "lcm", .fd = true, .rx = on_frame, .error = on_error, .ctx = b};
    can_attach(bench->bus[i], &b->node);
}

static void on_instruments(void *ctx, int64_t t_ns)
{
    struct lcm_feed *f = ctx;
    lcm_state_instruments(f, t_ns);
    if (f->tick) f->tick(f->ctx);
    sched_at(f->bench->sched, &f->instruments, t_ns + LCM_INSTRUMENTS_NS);
}

static void on_truth(void *ctx, int64_t t_ns)
{
    struct lcm_feed *f = ctx;
    for (unsigned i = 0; i < f->bench->units; i++) lcm_state_truth(f, &f->unit[i], t_ns);
    sched_at(f->bench->sched, &f->truth, t_ns + f->truth_every_ns);
}

/* At every multiple of every_ns from now on. */
static void start_event(struct lcm_feed *f, struct sched_ev *e, sched_fn *fn, int64_t every_ns)
{
    struct sched *s = f->bench->sched;
    sched_ev(e, fn, f);
    sched_at(s, e, s->now_ns ? (s->now_ns / every_ns + 1) * every_ns : 0);
}

void lcm_feed_start(struct lcm_feed *f, const struct control_bench *bench, int64_t epoch_ns, int64_t truth_every_ns)
{
    f->bench = bench;
    f->epoch_ns = epoch_ns;
    f->truth_every_ns = truth_every_ns;
    for (unsigned i = 0; i < bench->units; i++) init_unit(f, i);
    for (unsigned i = 0; i < bench->buses; i++) init_bus(f, i);
    start_event(f, &f->instruments, on_instruments, LCM_INSTRUMENTS_NS);
    if (truth_every_ns) start_event(f, &f->truth, on_truth, truth_every_ns);
}

void lcm_feed_stop(struct lcm_feed *f)
{
    if (!f->bench) return;
    sched_cancel(f->bench->sched, &f->instruments);
    if (f->truth_every_ns) sched_cancel(f->bench->sched, &f->truth);
    for (unsigned i = 0; i < f->bench->buses; i++) can_detach(f->bus[i].node.bus, &f->bus[i].node);
    f->bench = NULL;
}
