/* The CAN side of a PSA-2 beside a board that is none, and a host that sees every frame. */
#ifndef PSABENCH_TESTS_PSA2_CAN_RIG_H
#define PSABENCH_TESTS_PSA2_CAN_RIG_H

#include "host_wire.h"

#include "board/psa2/board.h"
#include "gen/psabench_can.h"
#include "unit/unit.h"

enum { NODE = 5, SEEN_MAX = 4096, FCLK_HZ = 4096000 };

struct rig {
    struct sched s;
    struct can_bus bus;
    struct psa2_can can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    int64_t seen_ns[SEEN_MAX];
    unsigned count;
    /* the fake board */
    struct psa2_request *request;
    enum psa2_result accept; /* what submit says */
    struct psa2_can_info info;
    unsigned resets, pulses;
    uint32_t seq;
    /* the listener */
    unsigned refusals;
    char told[BOARD_NODE_TEXT + 16];
};
static struct rig rig;

static inline enum psa2_result fake_submit(void *ctx, struct psa2_request *r, int64_t t_ns)
{
    struct rig *rg = ctx;
    (void)t_ns;
    if (rg->accept != PSA2_OK) return rg->accept;
    if (rg->request) return PSA2_BUSY;
    rg->pulses += r->op == PSA2_PULSE_SYNC;
    rg->request = r;
    return PSA2_OK;
}

static inline void fake_done(struct rig *r, enum psa2_result result)
{
    struct psa2_request *q = r->request;
    assert_non_null(q);
    r->request = NULL;
    q->done(q->ctx, q, result, r->s.now_ns);
}

/* As psa2.h has it: a reset ends a request with a time-out. */
static inline void fake_reset(struct board *board, int64_t t_ns)
{
    struct rig *r = (struct rig *)board; /* the port's context */
    (void)t_ns;
    r->resets++;
    if (r->request) fake_done(r, PSA2_TIMEOUT);
}

static const struct board_type fake_type = {.reset = fake_reset};

static inline void fake_info(void *ctx, struct psa2_can_info *out)
{
    *out = ((struct rig *)ctx)->info;
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
    if (r->count == SEEN_MAX) return;
    r->seen_ns[r->count] = t_ns;
    r->seen[r->count++] = *m;
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
    host_sends(r, 0, 2, (const uint8_t[]){command, NODE});
    r->count = 0;
}

static inline void join_bus(struct rig *r, const struct board_type *type, const struct psa2_can_port *port,
                            uint32_t bitrate_hz, uint32_t data_bitrate_hz)
{
    sched_init(&r->s);
    const struct can_bus_cfg bus = {bitrate_hz, data_bitrate_hz};
    can_bus_init(&r->bus, &bus, &r->s);
    r->host = (struct can_node){.name = "host", .fd = true, .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    const struct board_can_cfg cfg = {.name = "unit", .type = type, .node_id = NODE, .refused = on_refused, .ctx = r};
    psa2_can_init(&r->can, &cfg, port, &r->bus, &r->s);
}

/* A fake board at data_hz on a bus; operational. */
static inline struct rig *rig_up(uint32_t bitrate_hz, uint32_t data_bitrate_hz, uint32_t data_hz)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    r->info =
        (struct psa2_can_info){.period_ns = NS_PER_S / data_hz, .fclk_hz = FCLK_HZ, .serial = 1234, .word_bits = 32};
    const struct psa2_can_port port = {r, fake_submit, fake_info};
    join_bus(r, &fake_type, &port, bitrate_hz, data_bitrate_hz);
    board_node_power_up(&r->can, 0);
    settle(r);
    nmt(r, 1);
    return r;
}

static inline struct psa2_frame sample(struct rig *r)
{
    return (struct psa2_frame){
        .seq = r->seq++,
        .t_sample_ns = r->s.now_ns,
        .code = {0x123456, -2, -8388608},
        .raw = {0x12345678, 0xFFFFFEFF, 0x80000000},
        .temp_code = 0xFFF0,
        .temp_channel = 3,
        .status = PSA2_ST_SETTLED | PSA2_ST_TEMP_NEW,
    };
}

/* n frames of the board, one a data period; the instant given to the module is that of INT's rise. */
static inline void board_sends(struct rig *r, unsigned n)
{
    for (unsigned i = 0; i < n; i++) {
        const struct psa2_frame f = sample(r);
        psa2_can_frame(&r->can, &f, r->s.now_ns);
        sched_run_until(&r->s, r->s.now_ns + r->info.period_ns);
    }
}

/* One request; the answer is the newest frame seen, if there is one yet. */
static inline void ask(struct rig *r, uint8_t command, uint16_t index, uint8_t sub, uint32_t data)
{
    r->count = 0;
    host_asks(&r->bus, &r->host, NODE, command, index, sub, data);
    settle(r);
}

static inline uint32_t answer(const struct rig *r)
{
    for (unsigned i = r->count; i-- > 0;) {
        if (r->seen[i].id == 0x580 + NODE) return (uint32_t)bits_get_le(&r->seen[i].data[4], 4);
    }
    fail_msg("no SDO answer");
    return 0;
}

static inline uint32_t upload(struct rig *r, uint16_t index, uint8_t sub)
{
    ask(r, 0x40, index, sub, 0);
    return answer(r);
}

static inline uint32_t write_u8(struct rig *r, uint16_t index, uint8_t sub, uint8_t value)
{
    ask(r, 0x2F, index, sub, value);
    return answer(r);
}

static inline const struct can_msg *seen_id(const struct rig *r, uint32_t id)
{
    for (unsigned i = 0; i < r->count; i++) {
        if (r->seen[i].id == id) return &r->seen[i];
    }
    return NULL;
}

static inline unsigned count_id(const struct rig *r, uint32_t id)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->count; i++) n += r->seen[i].id == id;
    return n;
}

#endif
