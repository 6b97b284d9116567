/* The CAN side of a board that is none of the real ones, and a host that sees every frame. */
#ifndef PSABENCH_TESTS_NODE_RIG_H
#define PSABENCH_TESTS_NODE_RIG_H

#include "host_wire.h"

#include "board/node.h"
#include "gen/pik_od.h"
#include "gen/pmka_od.h"
#include "gen/psd1_od.h"

enum { NODE = 6, SEEN_MAX = 1024, COUNTERS_MAX = 64, ADDRESSES = 4, OWN_OBJECT = 0x1009 };

/* The fake board: what it will say, and what it was asked. */
struct fake {
    struct board base; /* first */
    uint32_t counter[COUNTERS_MAX];
    enum board_cycle_result accept;
    struct board_cycle *cycle;
    unsigned submits, resets;
    int64_t period_ns;
};

struct rig {
    struct sched s;
    struct can_bus bus;
    struct board_node can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    struct fake board;
    unsigned refusals, syncs, starts, defaults;
    char told[BOARD_NODE_TEXT + 16];
};
static struct rig rig;

static inline enum board_cycle_result fake_submit(struct board *board, struct board_cycle *c, int64_t t_ns)
{
    struct fake *f = (struct fake *)board;
    (void)t_ns;
    f->submits++;
    if (f->accept != BOARD_CYCLE_OK) return f->accept;
    f->cycle = c;
    return BOARD_CYCLE_OK;
}

static const struct board_register fake_registers[ADDRESSES] = {
    {.name = "X"}, {.name = "Y"}, {.name = "Z"}, {.name = "STATUS"}};

/* As board.h has it: a reset cuts the cycle under way. */
static inline void fake_reset(struct board *board, int64_t t_ns)
{
    struct fake *f = (struct fake *)board;
    struct board_cycle *c = f->cycle;
    f->resets++;
    f->cycle = NULL;
    if (c) c->done(c->ctx, c, BOARD_CYCLE_OFF, t_ns);
}

static inline int64_t fake_period(const void *board)
{
    return ((const struct fake *)board)->period_ns;
}

/* An object of the board's own, with a value that no common handler would give. */
static inline double own_read(const struct board_node *n, const struct co_entry *e)
{
    (void)e;
    return 40000 + ((const struct fake *)n->board)->counter[0];
}

static inline struct rig *rig_of(struct board_node *n)
{
    return (struct rig *)((char *)n - offsetof(struct rig, can));
}

static inline struct board_strobe fake_strobe(const struct board *board)
{
    (void)board;
    return (struct board_strobe){800, 200};
}

static inline void on_defaults(struct board_node *n)
{
    rig_of(n)->defaults++;
}

static inline void on_sync(struct board_node *n, int64_t t_ns)
{
    (void)t_ns;
    rig_of(n)->syncs++;
}

static inline void on_started(struct board_node *n, int64_t t_ns)
{
    (void)t_ns;
    rig_of(n)->starts++;
}

static inline void on_refused(void *ctx, const char *name, const char *why)
{
    struct rig *r = ctx;
    r->refusals++;
    (void)snprintf(r->told, sizeof r->told, "%s %s", name, why);
}

static inline void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->count < SEEN_MAX) r->seen[r->count++] = *m;
}

static inline void settle(struct rig *r)
{
    host_settle(&r->bus);
}

static inline void host_sends(struct rig *r, uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&r->bus, &r->host, id, len, data);
    settle(r);
}

static inline void nmt(struct rig *r, uint8_t command)
{
    r->count = 0;
    host_sends(r, 0, 2, (const uint8_t[]){command, NODE});
}

/* A fake board with all counters that the device has, on a bus; pre-operational. */
static inline struct rig *rig_of_device(const struct co_device *d, uint32_t bitrate_hz)
{
    static struct board_counter counters[COUNTERS_MAX];
    static struct board_part part;
    static const struct board_bus bus = {
        .submit = fake_submit, .addresses = ADDRESSES, .registers = fake_registers, .strobe = fake_strobe};
    static struct board_type board;
    static const struct board_object own[] = {{OWN_OBJECT, .value = own_read}};
    static struct board_node_type type;
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    assert_true(d->counter_count <= COUNTERS_MAX);
    for (unsigned i = 0; i < d->counter_count; i++) /* in reverse: they are found by name */
        counters[i] = (struct board_counter){d->counters[d->counter_count - 1 - i], i * sizeof(uint32_t)};
    part = (struct board_part){.label = "board",
                               .offset = offsetof(struct fake, counter),
                               .counters = counters,
                               .counter_count = d->counter_count};
    board = (struct board_type){.parts = &part, .part_count = 1, .bus = &bus, .reset = fake_reset};
    type = (struct board_node_type){.device = d,
                                    .objects = own,
                                    .object_count = sizeof own / sizeof own[0],
                                    .period_ns = fake_period,
                                    .defaults = on_defaults,
                                    .sync = on_sync,
                                    .started = on_started};
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){bitrate_hz, 0}, &r->s);
    r->host = (struct can_node){.name = "host", .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    r->board.period_ns = NS_PER_S / 1000;
    r->board.base.cfg.serial = 4711;
    const struct board_can_cfg cfg = {.name = "unit", .type = &board, .node_id = NODE, .refused = on_refused, .ctx = r};
    board_node_init(&r->can, &type, &cfg, &r->board, &r->bus, &r->s);
    board_node_power_up(&r->can, 0);
    settle(r);
    return r;
}

static inline struct rig *rig_up(void)
{
    return rig_of_device(&psd1_device, 1000000);
}

static inline void ask(struct rig *r, uint8_t command, uint16_t index, uint8_t sub, uint32_t data)
{
    r->count = 0;
    host_asks(&r->bus, &r->host, NODE, command, index, sub, data);
    settle(r);
}

static inline const struct can_msg *seen_id(const struct rig *r, uint32_t id)
{
    for (unsigned i = r->count; i-- > 0;) {
        if (r->seen[i].id == id) return &r->seen[i];
    }
    return NULL;
}

/* Data of the newest SDO answer: a value, or an abort code. */
static inline uint32_t answer(const struct rig *r)
{
    const struct can_msg *m = seen_id(r, 0x580 + NODE);
    assert_non_null(m);
    return m ? (uint32_t)bits_get_le(&m->data[4], 4) : 0;
}

static inline bool aborted(const struct rig *r)
{
    const struct can_msg *m = seen_id(r, 0x580 + NODE);
    return m && m->data[0] == 0x80;
}

static inline uint32_t upload(struct rig *r, uint16_t index, uint8_t sub)
{
    ask(r, 0x40, index, sub, 0);
    return answer(r);
}

static inline const char *upload_text(struct rig *r, uint16_t index)
{
    static char text[256];
    size_t at = 0;
    ask(r, 0x40, index, 0, 0);
    for (uint8_t toggle = 0; at + 7 < sizeof text; toggle ^= 0x10) {
        ask(r, (uint8_t)(0x60 | toggle), 0, 0, 0);
        const struct can_msg *m = seen_id(r, 0x580 + NODE);
        assert_non_null(m);
        if (!m || m->data[0] == 0x80) break;
        memcpy(&text[at], &m->data[1], 7);
        at += 7u - (m->data[0] >> 1 & 7u);
        if (m->data[0] & 1) break;
    }
    text[at] = '\0';
    return text;
}

static inline void write_u32(struct rig *r, uint16_t index, uint8_t sub, uint32_t value)
{
    ask(r, 0x23, index, sub, value);
}

/* Sub-indices of 2030h, as docs/reference/protocol_psd1.md numbers them. */
enum { READINGS = 1, DROPPED, LOAD, TEC, REC, INHIBITED, SYNCS, SDO_REFUSED, MALFORMED, CYCLES, CYCLES_REFUSED };

#endif
