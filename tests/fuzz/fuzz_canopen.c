/* A PSA-2 node on a CAN bus with a fake board: any frames, at any instants. What it sends is valid and its own, an SDO
 * request has at most one answer, which names its object, and what the controller was asked is answered once. */
#include "fuzz.h"

#include "base/bits.h"
#include "board/psa2/board.h"

#include <string.h>

enum { NODE = 5, STEPS_MAX = 400, ASKED_MAX = 2 * STEPS_MAX };

struct world {
    struct sched s;
    struct can_bus bus;
    struct psa2_can can;
    struct can_node host;
    struct psa2_can_info info;
    struct psa2_request *request; /* what the fake board is asked */
    enum psa2_result accept;
    uint32_t seq;
    uint64_t sdo_requests, sdo_answers, time_outs;
    uint8_t asked[ASKED_MAX][3]; /* objects that requests have named */
    int64_t heard_ns;
};

/* ---- the fake board ---- */

static enum psa2_result submit(void *ctx, struct psa2_request *r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && r->done && r->group <= PSA2_TEMP && r->op <= PSA2_PULSE_SYNC);
    if (w->accept != PSA2_OK) return w->accept;
    if (w->request) return PSA2_BUSY;
    w->request = r;
    return PSA2_OK;
}

static void answer(struct world *w, enum psa2_result result)
{
    struct psa2_request *r = w->request;
    if (!r) return;
    w->request = NULL;
    r->done(r->ctx, r, result, w->s.now_ns);
}

/* As psa2.h has it: a reset ends a request with a time-out. */
static void reset(struct board *board, int64_t t_ns)
{
    (void)t_ns;
    answer((struct world *)board, PSA2_TIMEOUT); /* the port's context */
}

static const struct board_type board = {.reset = reset};

static void info(void *ctx, struct psa2_can_info *out)
{
    *out = ((struct world *)ctx)->info;
}

static void refused(void *ctx, const char *name, const char *why)
{
    (void)ctx;
    assert(strcmp(name, "unit") == 0 && strlen(why) > 0 && strlen(why) < BOARD_NODE_TEXT);
}

/* ---- what the node sends ---- */

static bool was_asked(const struct world *w, const uint8_t object[3])
{
    for (uint64_t i = w->sdo_requests; i-- > 0;)
        if (memcmp(object, w->asked[i], 3) == 0) return true;
    return false;
}

/* An answer names an object that somebody has named, a segment none; what is out of place may be aborted without one. */
static void heard_sdo(struct world *w, const struct can_msg *m)
{
    const uint8_t specifier = m->data[0] >> 5;
    w->sdo_answers++;
    assert(m->len == 8 && specifier <= 4);
    const bool nameless = specifier < 2 || (specifier == 4 && bits_get_le(m->data + 1, 3) == 0);
    assert(nameless || was_asked(w, m->data + 1));
}

static bool known_state(uint8_t state)
{
    return state == CO_INITIALISING || state == CO_STOPPED || state == CO_OPERATIONAL || state == CO_PRE_OPERATIONAL;
}

static void hear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct world *w = ctx;
    assert(can_valid(m) && !(m->flags & (CAN_EXT | CAN_RTR | CAN_ERROR)));
    assert(t_ns >= w->heard_ns && t_ns <= w->s.now_ns);
    w->heard_ns = t_ns;
    if (m->id == 0x580 + NODE) heard_sdo(w, m);
    else if (m->id == 0x700 + NODE) assert(m->len == 1 && known_state(m->data[0]));
    else if (m->id == 0x080 + NODE) assert(m->len == 8);
    else assert(m->id >= 0x100 && m->id < 0x6E0); /* a PDO: the host may choose where, but no service's place */
}

/* ---- operations ---- */

static void send(struct world *w, struct can_msg *m)
{
    if (can_send(&w->bus, &w->host, m, w->s.now_ns) != CAN_OK) return;
    if (m->id == 0x600 + NODE) memcpy(w->asked[w->sdo_requests++], m->data + 1, 3);
    sched_run_until(&w->s, w->s.now_ns + 300000);
}

/* Frames of any kind, mostly such as the node listens to. */
static void op_frame(struct world *w, struct script *s)
{
    static const uint16_t ids[] = {0x000, 0x080, 0x600 + NODE, 0x600 + NODE};
    const uint8_t b = script_byte(s);
    struct can_msg m = {
        .id = b & 4 ? (uint32_t)script_uint(s, 2) : ids[b & 3], .flags = b >> 3 & 15, .len = script_byte(s)};
    if (m.len > 64) m.len = 8;
    for (unsigned i = 0; i < m.len; i++) m.data[i] = script_byte(s);
    send(w, &m);
}

/* An SDO request to an object of the dictionary, or beside one. */
static void op_sdo(struct world *w, struct script *s)
{
    static const uint8_t begin[] = {0x40, 0x2F, 0x2B, 0x23, 0x21, 0x22, 0x20, 0x27};
    const struct co_od *od = w->can.node.node.cfg.od;
    const struct co_entry *e = &od->entry[script_uint(s, 2) % od->count];
    struct can_msg m = {.id = 0x600 + NODE, .len = 8, .data = {begin[script_byte(s) % 8]}};
    bits_put_le(m.data + 1, e->index, 2);
    m.data[3] = (uint8_t)(e->sub + (script_byte(s) == 1));
    for (unsigned i = 4; i < 8; i++) m.data[i] = script_byte(s);
    send(w, &m);
}

static void op_segment(struct world *w, struct script *s)
{
    struct can_msg m = {.id = 0x600 + NODE, .len = 8, .data = {script_byte(s) & 0x7F}};
    if (m.data[0] >> 5 == 1 || m.data[0] >> 5 == 2) m.data[0] &= 0x1F; /* those begin a transfer */
    for (unsigned i = 1; i < 8; i++) m.data[i] = script_byte(s);
    send(w, &m);
}

static void op_nmt(struct world *w, struct script *s)
{
    static const uint8_t command[] = {0x01, 0x02, 0x80, 0x81, 0x82, 0x00};
    struct can_msg m = {.len = 2, .data = {command[script_byte(s) % 6], script_byte(s) % 8}};
    send(w, &m);
}

static void op_wait(struct world *w, struct script *s)
{
    sched_run_until(&w->s, w->s.now_ns + script_span_ns(s) * 64);
}

static void op_board(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    w->accept = b & 8 ? (enum psa2_result)(b & 7) % 6 : PSA2_OK;
    if (b & 16) answer(w, b & 32 ? PSA2_TIMEOUT : PSA2_OK);
    if (b & 64) psa2_can_fault(&w->can, b & 1 ? PSA2_FAULT_ACCEL_PORT : PSA2_FAULT_TEMP_PORT, w->s.now_ns);
}

static void op_samples(struct world *w, struct script *s)
{
    const uint8_t n = script_byte(s) % 16;
    for (unsigned i = 0; i < n; i++) {
        const uint32_t code = (uint32_t)script_uint(s, 3);
        const int32_t x = bits_sign_extend(code, 24);
        const struct psa2_frame f = {.seq = w->seq++,
                                     .t_sample_ns = w->s.now_ns,
                                     .code = {x, -1, 0x7FFFFF},
                                     .raw = {code << 8, 0xFFFFFFFF, 0x7FFFFFFF},
                                     .temp_channel = (uint8_t)(i & 3),
                                     .status = (uint8_t)(code & 15)};
        psa2_can_frame(&w->can, &f, w->s.now_ns);
        sched_run_until(&w->s, w->s.now_ns + w->info.period_ns);
    }
}

static void check(const struct world *w)
{
    const struct co_sdo *sdo = &w->can.node.node.sdo;
    assert(w->sdo_answers <= w->sdo_requests + sdo->timeouts);
    assert(sdo->requests <= w->sdo_requests);
    assert(sched_next_ns(&w->s) >= w->s.now_ns);
    assert(w->can.node.node.services.queued <= CAN_QUEUE_MAX && w->can.node.node.stream.queued <= CO_PDO_BACKLOG + 2);
    assert(w->can.node.node.history_count <= CO_HISTORY);
    assert(memchr(w->can.node.refusal, 0, sizeof w->can.node.refusal) &&
           memchr(w->can.node.remark, 0, sizeof w->can.node.remark));
}

static void power_up(struct world *w, uint8_t choice)
{
    static const struct can_bus_cfg bus[] = {{1000000, 5000000}, {1000000, 0}, {0, 0}, {125000, 1000000}};
    static const int64_t period_ns[] = {1000000, 250000, 0, 4000000};
    memset(w, 0, sizeof *w);
    w->info = (struct psa2_can_info){
        .period_ns = period_ns[choice >> 2 & 3], .fclk_hz = 4096000, .serial = 17, .word_bits = choice & 16 ? 24 : 32};
    sched_init(&w->s);
    can_bus_init(&w->bus, &bus[choice & 3], &w->s);
    w->host = (struct can_node){.name = "host", .fd = true, .rx = hear, .ctx = w};
    can_attach(&w->bus, &w->host);
    const struct psa2_can_port port = {w, submit, info};
    const struct board_can_cfg cfg = {.name = "unit", .type = &board, .node_id = NODE, .refused = refused, .ctx = w};
    psa2_can_init(&w->can, &cfg, &port, &w->bus, &w->s);
    board_node_power_up(&w->can, 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const ops[])(struct world * w, struct script * s) = {
        op_frame, op_sdo, op_sdo, op_segment, op_nmt, op_wait, op_board, op_samples,
    };
    static struct world w;
    struct script s = script_of(data, size);
    power_up(&w, script_byte(&s));
    for (unsigned i = 0; i < STEPS_MAX && script_more(&s); i++) {
        ops[script_byte(&s) % (sizeof ops / sizeof ops[0])](&w, &s);
        check(&w);
    }
    return 0;
}
