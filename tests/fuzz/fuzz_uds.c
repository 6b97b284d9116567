/* A node with a UDS door and a fake owner on a CAN bus: any frames to it, and time. What the door sends is a frame of the
 * transport, no longer than it may be and a response to what was asked; the SDO server answers beside it as ever; and after a
 * minute of silence the door is as new. */
#include "fuzz.h"

#include "canopen/uds_door.h"
#include "gen/psa2_od.h"
#include "gen/uds_dids.h"

#include <string.h>

enum { NODE = 5, STEPS_MAX = 300, REQUEST = 0x7E0, RESPONSE = 0x7E8, TO_ALL = 0x7DF };

struct world {
    struct sched s;
    struct can_bus bus;
    struct co_node node;
    struct uds_door door;
    struct can_node host;
    uint32_t abort; /* what the owner answers */
    bool pending;
    uint32_t ticket;
    bool asked[256]; /* services */
    uint64_t requests, responses, sdo_requests, sdo_answers;
    unsigned left; /* bytes of the response under way */
    uint8_t sn;
    uint8_t last[8];
};

/* ---- the owner of the objects ---- */

static uint32_t touch(struct world *w)
{
    if (w->abort != CO_PENDING) return w->abort;
    if (w->pending) return CO_AB_STATE;
    w->pending = true;
    w->ticket = w->node.sdo.ticket;
    return CO_PENDING;
}

static uint32_t on_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && e->access != CO_WO);
    v->number = e->value;
    v->len = e->type == CO_VISIBLE_STRING ? CO_TEXT_MAX : 0; /* the longest there is */
    return touch(w);
}

static uint32_t on_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && e->access != CO_RO && e->access != CO_CONST);
    assert(e->type == CO_VISIBLE_STRING ? v->len <= e->high : v->number >= e->low && v->number <= e->high);
    return touch(w);
}

static void on_event(void *ctx, enum co_event ev, int64_t t_ns)
{
    (void)ctx;
    (void)ev;
    (void)t_ns;
}

static void on_sync(void *ctx, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
}

/* ---- what the door sends ---- */

/* First bytes of a response. */
static void hear_response(struct world *w, const uint8_t *data, unsigned n)
{
    w->responses++;
    if (data[0] == 0x7F) assert(n == 3 && w->asked[data[1]] && data[2] != 0);
    else assert(w->asked[(uint8_t)(data[0] - 0x40)]);
}

static void hear_door(struct world *w, const struct can_msg *m)
{
    const unsigned n = (m->data[0] & 15u) << 8 | m->data[1];
    assert(m->len == 8 && m->flags == 0);
    memcpy(w->last, m->data, 8);
    switch (m->data[0] >> 4) {
    case 0:
        assert((m->data[0] & 15) >= 1 && (m->data[0] & 15) <= 7);
        hear_response(w, &m->data[1], m->data[0] & 15);
        return;
    case 1:
        assert(n > 7 && n <= UDS_RESPONSE_MAX);
        hear_response(w, &m->data[2], n);
        w->left = n - 6;
        w->sn = 1;
        return;
    case 2:
        assert(w->left > 0 && (m->data[0] & 15) == w->sn);
        w->sn = (w->sn + 1) & 15;
        w->left -= w->left < 7 ? w->left : 7;
        return;
    default:
        assert(m->data[0] == 0x30 || m->data[0] == 0x32);
    }
}

static void hear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct world *w = ctx;
    (void)t_ns;
    if (m->id == RESPONSE) hear_door(w, m);
    else if (m->id == 0x580 + NODE) w->sdo_answers++;
    else assert(m->id != REQUEST && m->id != TO_ALL);
}

/* ---- operations ---- */

static void put(struct world *w, struct can_msg *m)
{
    if (can_send(&w->bus, &w->host, m, w->s.now_ns) != CAN_OK) return;
    if (m->id == REQUEST || m->id == TO_ALL) w->requests++;
    w->sdo_requests += m->id == 0x600 + NODE;
    sched_run_until(&w->s, w->s.now_ns + 500000);
}

/* Any service may have begun with any byte of a frame: what a message becomes is the transport's business. */
static void mark_asked(struct world *w, const struct can_msg *m)
{
    for (unsigned i = 1; i < m->len && i < 8; i++) w->asked[m->data[i]] = true;
}

static void op_frame(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    struct can_msg m = {.id = b & 7 ? REQUEST : TO_ALL, .len = b >> 3 & 7, .flags = b >> 6 == 3 ? CAN_RTR : 0};
    if (m.len == 7) m.len = 8;
    for (unsigned i = 0; i < m.len; i++) m.data[i] = script_byte(s);
    mark_asked(w, &m);
    put(w, &m);
}

static void op_single(struct world *w, struct script *s)
{
    static const uint8_t sid[] = {0x10, 0x11, 0x14, 0x19, 0x22, 0x2E, 0x3E, 0x27};
    const uint8_t b = script_byte(s);
    struct can_msg m = {
        .id = b & 0x80 ? TO_ALL : REQUEST, .len = 8, .data = {(uint8_t)(1 + (b >> 3 & 7) % 7), sid[b & 7]}};
    for (unsigned i = 2; i <= m.data[0]; i++) m.data[i] = script_byte(s);
    mark_asked(w, &m);
    put(w, &m);
}

/* Reads objects of the dictionary, up to three at once; or writes one. */
static void op_object(struct world *w, struct script *s)
{
    const struct co_entry *e = &psa2_od.entry[script_uint(s, 2) % psa2_od.count];
    const uint8_t b = script_byte(s);
    const unsigned did =
        e->index >= 0x2000 && e->index < 0x2080 ? 0x2000 + 0x40 * (e->index - 0x2000u) + e->sub : 0xF187u + (b >> 4);
    struct can_msg m = {
        .id = REQUEST, .len = 8, .data = {(b & 3) == 3 ? 7 : 3, 0x22, (uint8_t)(did >> 8), (uint8_t)did}};
    for (unsigned i = 4; i < 8; i++) m.data[i] = (b & 3) == 3 ? m.data[i - 2] : 0xCC;
    if ((b & 3) == 2) {
        const size_t n = co_type_size(e->type);
        m.data[0] = (uint8_t)(3 + n);
        m.data[1] = 0x2E;
        for (unsigned i = 0; i < n; i++) m.data[4 + i] = script_byte(s);
    }
    mark_asked(w, &m);
    put(w, &m);
}

/* A message in segments, some of them missing or wrong. */
static void op_segments(struct world *w, struct script *s)
{
    const unsigned n = (unsigned)script_uint(s, 2) % 600;
    struct can_msg m = {.id = REQUEST, .len = 8, .data = {(uint8_t)(0x10 | n >> 8), (uint8_t)n}};
    for (unsigned i = 2; i < 8; i++) m.data[i] = script_byte(s);
    mark_asked(w, &m);
    put(w, &m);
    const uint8_t stop = script_byte(s), wrong = script_byte(s);
    for (unsigned i = 1; i <= n / 7 + 1 && i != stop; i++) {
        struct can_msg c = {.id = REQUEST, .len = 8, .data = {(uint8_t)(0x20 | ((i + (i == wrong)) & 15))}};
        put(w, &c);
    }
}

static void op_flow(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    struct can_msg m = {.id = REQUEST, .len = 3, .data = {(uint8_t)(0x30 | (b & 3)), b >> 4, script_byte(s)}};
    put(w, &m);
}

static void op_flow_through(struct world *w, struct script *s)
{
    struct can_msg m = {.id = REQUEST, .len = 3, .data = {0x30, 0, 0}};
    put(w, &m);
    sched_run_until(&w->s, w->s.now_ns + script_span_ns(s) * 8);
}

static void op_sdo(struct world *w, struct script *s)
{
    const struct co_entry *e = &psa2_od.entry[script_uint(s, 2) % psa2_od.count];
    struct can_msg m = {.id = 0x600 + NODE, .len = 8, .data = {script_byte(s) & 1 ? 0x2F : 0x40}};
    m.data[1] = (uint8_t)e->index;
    m.data[2] = (uint8_t)(e->index >> 8);
    m.data[3] = e->sub;
    put(w, &m);
}

static void op_owner(struct world *w, struct script *s)
{
    static const uint32_t aborts[] = {CO_OK,       CO_OK,        CO_PENDING,     CO_PENDING,
                                      CO_AB_STATE, CO_AB_NO_SUB, CO_AB_TRANSFER, CO_AB_VALUE};
    const uint8_t b = script_byte(s);
    w->abort = aborts[b & 7];
    if (!w->pending || !(b & 8)) return;
    w->pending = false;
    const struct co_value v = {.number = b};
    co_node_answer(&w->node, w->ticket, b & 16 ? CO_AB_TRANSFER : CO_OK, &v, w->s.now_ns);
}

static void op_wait(struct world *w, struct script *s)
{
    sched_run_until(&w->s, w->s.now_ns + script_span_ns(s) * 256);
}

static void op_nmt(struct world *w, struct script *s)
{
    static const uint8_t command[] = {1, 128, 2, 129, 130, 1, 1, 1};
    struct can_msg m = {.len = 2, .data = {command[script_byte(s) & 7], NODE}};
    put(w, &m);
}

/* ---- invariants ---- */

static void check(const struct world *w)
{
    const struct isotp *p = &w->door.transport;
    const struct uds *u = &w->door.server;
    assert(p->rx.state == ISOTP_RX_IDLE || (p->rx.at < p->rx.size && p->rx.size <= UDS_REQUEST_MAX));
    assert(p->tx.state == ISOTP_TX_IDLE || (p->tx.at <= p->tx.size && p->tx.size <= UDS_RESPONSE_MAX));
    assert(u->session == UDS_SESSION_DEFAULT || u->session == UDS_SESSION_EXTENDED);
    assert(u->session == UDS_SESSION_EXTENDED || !u->s3.queued);
    assert((u->state == UDS_WORKING) == u->p2.queued);
    assert(u->state != UDS_ANSWERING || p->tx.state != ISOTP_TX_IDLE);
    assert(w->responses <= 2 * w->requests); /* responsePending and the response */
    assert(w->sdo_answers <= w->sdo_requests + w->node.sdo.timeouts);
}

/* The slowest response, of 2065 bytes with 127 ms between frames, takes 38 s. */
static void check_as_new(struct world *w)
{
    struct can_msg start = {.len = 2, .data = {128, NODE}}, present = {.id = REQUEST, .len = 3, .data = {2, 0x3E, 0}};
    sched_run_until(&w->s, w->s.now_ns + 60 * NS_PER_S);
    put(w, &start);
    check(w);
    assert(w->door.server.state == UDS_IDLE && w->door.server.session == UDS_SESSION_DEFAULT);
    assert(w->door.transport.tx.state == ISOTP_TX_IDLE && w->door.transport.rx.state == ISOTP_RX_IDLE);
    mark_asked(w, &present);
    put(w, &present);
    assert(memcmp(w->last, "\x02\x7E\x00", 3) == 0);
}

static void power_up(struct world *w, uint8_t choice)
{
    static const struct can_bus_cfg bus[] = {{1000000, 0}, {0, 0}};
    memset(w, 0, sizeof *w);
    sched_init(&w->s);
    can_bus_init(&w->bus, &bus[choice & 1], &w->s);
    w->host = (struct can_node){.name = "host", .rx = hear, .ctx = w};
    can_attach(&w->bus, &w->host);
    const struct co_node_cfg cfg = {.name = "unit", .id = NODE, .od = &psa2_od, .tpdos = PSA2_TPDOS};
    const struct co_node_io io = {w, on_read, on_write, on_event, on_sync, NULL};
    co_node_init(&w->node, &cfg, &io, &w->bus, &w->s);
    uds_door_init(&w->door, 1, &uds_dids, &w->node);
    co_node_power_up(&w->node, 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const ops[])(struct world * w, struct script * s) = {
        op_single,       op_object, op_object, op_frame, op_segments, op_flow,
        op_flow_through, op_sdo,    op_owner,  op_owner, op_wait,     op_nmt,
    };
    static struct world w;
    struct script s = script_of(data, size);
    power_up(&w, script_byte(&s));
    for (unsigned i = 0; i < STEPS_MAX && script_more(&s); i++) {
        ops[script_byte(&s) % (sizeof ops / sizeof ops[0])](&w, &s);
        check(&w);
    }
    check_as_new(&w);
    return 0;
}
