/* A PSA-2 on a CAN bus, and what may affect them: faults of converters, controller, lines and bus, registers that flip,
 * power that fails, at any time and on top of one another. Watchers hear real changes in order; nothing hangs; once all is
 * lifted and the power has been off and on again, board, stream and bus are as good as new. */
#include "fuzz.h"
#include "listener.h"
#include "looks.h"

#include "base/can/fault.h"
#include "base/rng.h"
#include "board/psa2/board.h"

#include <string.h>

enum { RUN_NS = 40000000, UP_NS = 250000000, NODE = 5, CAN_FAULTS = 4, LINE_MASK = (1 << PSA2_LINES) - 1 };

struct world {
    struct sched s;
    struct psa2 b;
    struct can_bus bus;
    struct psa2_can can;
    struct can_node host;
    struct can_fault can_fault[CAN_FAULTS];
    bool added[CAN_FAULTS];
    uint32_t line_fault;
    struct chip_fault adc[3];
    struct chip_fault tadc;
    struct listener ear;
    bool attached, powered;
    unsigned frames, events, got;
};

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    (void)t_ns;
    (void)ctx;
    return (double)axis - 1.0;
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return 20.0 + channel;
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && w->powered);
    w->frames++;
    psa2_can_frame(&w->can, f, t_ns);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct world *w = ctx;
    psa2_can_fault(&w->can, code, t_ns);
}

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    struct world *w = ctx;
    assert(e < PSA2_EVENTS && psa2_events[e] && t_ns == w->s.now_ns);
    w->events++;
}

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct world *w = ctx;
    assert(can_valid(m) && t_ns == w->s.now_ns);
    w->got++;
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    assert(m->flags == CAN_ERROR && m->len == 8);
}

/* ---- operations */

static void run(struct world *w, int64_t ns)
{
    const int64_t end_ns = w->s.now_ns + ns;
    while (w->s.now_ns < end_ns) {
        sched_run_until(&w->s, end_ns - w->s.now_ns < 100000 ? end_ns : w->s.now_ns + 100000);
        trace_advance(&w->b.base.trace, w->s.now_ns - TRACE_LAG_NS);
    }
    assert(w->b.base.trace.late == 0 && w->b.base.trace.dropped == 0);
    assert(w->can.node.node.services.tec <= 256 + 8);
}

static void power(struct world *w, bool on)
{
    if (on == w->powered) return;
    w->powered = on;
    if (on) {
        psa2_power_up(&w->b, w->s.now_ns);
        board_node_power_up(&w->can, w->s.now_ns);
    } else {
        psa2_power_down(&w->b, w->s.now_ns);
        psa2_can_power_down(&w->can);
        assert(!psa2_ready(&w->b));
    }
}

static void chip(struct world *w, struct script *s)
{
    const uint8_t which = script_byte(s), what = script_byte(s);
    const int32_t ppm = (int32_t)(script_uint(s, 2) * 15) - 490000;
    if (which & 0x80) {
        if (which % 4 < 3) (void)reg_flip(&w->b.adc[which % 4].regs, which >> 2 & 15, what, w->s.now_ns);
        else (void)reg_flip(&w->b.tadc.regs, which >> 2 & 15, what, w->s.now_ns);
        return;
    }
    const int32_t clock_ppm = what & 0x20 ? ppm : 0;
    if (which % 4 < 3) {
        w->adc[which % 4] = (struct chip_fault){
            (enum chip_stuck)(what % 3), (enum chip_stuck)((what >> 2) % 3 * (what >> 7)), what & 0x10, clock_ppm};
        ads1282_fault(&w->b.adc[which % 4], &w->adc[which % 4], w->s.now_ns);
    } else {
        w->tadc = (struct chip_fault){(enum chip_stuck)(what % 3), (enum chip_stuck)((what >> 2) % 3 * (what >> 7)),
                                      what & 0x10, clock_ppm};
        ads1256_fault(&w->b.tadc, &w->tadc, w->s.now_ns);
    }
}

static void line(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    if (b & 0x80) {
        line_fault_end(&w->b.base.line, b & 0x7F ? b & 0x7F : w->line_fault, w->s.now_ns);
        return;
    }
    struct line_fault f = {.kind = (enum line_fault_kind)(b % 7), .line = script_byte(s) % PSA2_LINES};
    f.from_ns = w->s.now_ns + script_span_ns(s);
    f.until_ns = b & 0x40 ? f.from_ns + 1 + script_span_ns(s) : INT64_MAX;
    f.width_ns = 1 + script_span_ns(s) % 5000;
    f.pulse = script_byte(s);
    f.frame_line = script_byte(s) % PSA2_LINES;
    f.rate_hz = 1.0 + (double)script_byte(s) * 1000.0;
    f.rng = rng_stream(1, b, "fault");
    w->line_fault = line_fault_add(&w->b.base.line, &f);
}

static void bus(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const unsigned i = b % CAN_FAULTS;
    if (w->added[i]) can_fault_remove(&w->bus, &w->can_fault[i], w->s.now_ns);
    w->added[i] = b & 4;
    if (!w->added[i]) return;
    struct can_fault f = {.kind = (enum can_fault_kind)(script_byte(s) % 6), .probability = script_byte(s) / 255.0};
    f.from = b & 8 ? &w->host : b & 16 ? &w->can.node.node.services : NULL;
    f.to = b & 32 && f.kind != CAN_FAULT_ERROR ? b & 64 ? &w->host : &w->can.node.node.services : NULL;
    f.delay_ns = 1 + script_span_ns(s);
    f.limit = b & 128 ? script_byte(s) : 0;
    f.rng = rng_stream(1, b, "fault");
    w->can_fault[i] = f;
    can_fault_add(&w->bus, &w->can_fault[i]);
}

static void host_sends(struct world *w, uint32_t id, const uint8_t *data, uint8_t len)
{
    struct can_msg m = {.id = id, .len = len};
    memcpy(m.data, data, len);
    (void)can_send(&w->bus, &w->host, &m, w->s.now_ns);
}

static void talk(struct world *w, struct script *s)
{
    uint8_t data[8];
    const uint8_t b = script_byte(s);
    for (unsigned i = 0; i < sizeof data; i++) data[i] = b & 1 ? script_byte(s) : 0;
    if (b & 2) host_sends(w, 0x600 + NODE, data, 8);
    else if (b & 4) host_sends(w, 0x080, data, 0);
    else host_sends(w, 0, (const uint8_t[]){1, 0}, 2);
}

static void op(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    switch (b % 12) {
    case 0:
        power(w, b & 0x80);
        return;
    case 1:
        chip(w, s);
        return;
    case 2:
        w->b.base.faults = (b & 0x80 ? PSA2_FAULT_SKIP_SYNC_T : 0u) | (b & 0x40 ? PSA2_FAULT_SETUP_ORDER : 0u) |
                           (b & 0x20 ? PSA2_FAULT_FROZEN_WORDS : 0u);
        return;
    case 3:
        line(w, s);
        return;
    case 4:
        bus(w, s);
        return;
    case 5:
        can_bus_off(&w->bus, b & 0x80 || !w->powered ? &w->host : &w->can.node.node.stream, w->s.now_ns);
        return;
    case 6:
        talk(w, s);
        return;
    case 7:
        if (w->attached) trace_detach(&w->b.base.trace, &w->ear.sink);
        else w->ear.known = 0;
        w->attached = !w->attached;
        if (w->attached) trace_attach(&w->b.base.trace, &w->ear.sink);
        return;
    case 8:
        w->b.base.io.event = on_event;
        w->b.base.observed = b & 0x80;
        return;
    case 9:
        psa2_reset(&w->b, w->s.now_ns);
        return;
    default:
        run(w, 1 + script_span_ns(s));
    }
}

/* ---- the end: all is well again */

static void lift(struct world *w)
{
    for (unsigned i = 0; i < 3; i++) ads1282_fault(&w->b.adc[i], &(struct chip_fault){.clock_ppm = 0}, w->s.now_ns);
    ads1256_fault(&w->b.tadc, &(struct chip_fault){.clock_ppm = 0}, w->s.now_ns);
    w->b.base.faults = 0;
    for (uint32_t id = 1; id <= w->b.base.line.last_id; id++) line_fault_end(&w->b.base.line, id, w->s.now_ns);
    for (unsigned i = 0; i < CAN_FAULTS; i++) can_fault_remove(&w->bus, &w->can_fault[i], w->s.now_ns);
    power(w, false);
    run(w, 20000000); /* a host off the bus comes back, lines follow again */
    assert(!w->b.base.trace.filter);
    power(w, true);
    run(w, 1000000);
    host_sends(w, 0, (const uint8_t[]){1, 0}, 2);
    const unsigned frames = w->frames, got = w->got;
    run(w, UP_NS);
    assert(psa2_ready(&w->b) && w->frames > frames + 40 && w->got > got + 2 * 40);
    /* The board's counters began again with its power; the host's fall by what it sends, and it has sent little. */
    assert(w->can.node.node.services.error_state == CAN_STATE_ERROR_ACTIVE && w->host.error_state != CAN_STATE_BUS_OFF);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct world w;
    struct script s = script_of(data, size);
    struct psa2_profile profile;
    fields_default(&psa2_fields, &profile);
    const struct board_io io = {.ctx = &w, .accel = accel_row, .temp_degc = degc};
    struct board_cfg unit = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 1, .serial = 1};
    unit.adc_chain = (enum ads1282_chain)(script_byte(&s) % 3);
    for (unsigned i = 0; i < 3; i++) unit.afe[i] = afe_nominal(AFE_VOLTAGE);
    memset(&w, 0, sizeof w);
    sched_init(&w.s);
    psa2_init(&w.b, &profile, &unit, &io, &w.s);
    w.b.host = (struct psa2_host){.ctx = &w, .frame = on_frame, .fault = on_fault};
    can_bus_init(&w.bus, &(struct can_bus_cfg){.bitrate_hz = script_byte(&s) & 1 ? 1000000 : 500000}, &w.s);
    const struct psa2_can_port port = psa2_can_port(&w.b);
    psa2_can_init(&w.can, &(struct board_can_cfg){.name = "a", .type = &psa2_board, .node_id = NODE}, &port, &w.bus,
                  &w.s);
    w.host = (struct can_node){.name = "host", .rx = on_rx, .error = on_error, .ctx = &w};
    w.ear.sink = (struct trace_sink){.mask = LINE_MASK, .steps = listener_steps, .ctx = &w.ear};
    can_attach(&w.bus, &w.host);
    power(&w, true);
    run(&w, script_byte(&s) & 1 ? 130000000 : 1000000); /* in the set-up, or beyond */
    const int64_t end_ns = w.s.now_ns + RUN_NS;
    while (script_more(&s) && w.s.now_ns < end_ns) op(&w, &s);
    lift(&w);
    return 0;
}
