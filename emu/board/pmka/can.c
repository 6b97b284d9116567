#include "board/pmka/board.h"

#include "board/pmka/pmka.h"
#include "gen/pmka_od.h"
#include "gen/psabench_can.h"

static unsigned mask_of(const bool flag[PMKA_INTS])
{
    unsigned mask = 0;
    for (unsigned i = 0; i < PMKA_INTS; i++) mask |= (unsigned)flag[i] << i;
    return mask;
}

static void pack_codes(const struct pmka_reading *r, struct can_msg *m)
{
    const struct psabench_pmka_codes_t codes = {r->code[0], r->code[1], r->code[2], r->code[3]};
    m->len = (uint8_t)psabench_pmka_codes_pack(m->data, &codes, sizeof m->data);
}

static void pack_state(const struct pmka_reading *r, struct can_msg *m)
{
    const struct psabench_pmka_state_t state = {
        .seq = (uint16_t)r->seq,
        .reset_x = r->reset[0],
        .reset_y = r->reset[1],
        .reset_z = r->reset[2],
        .reset_k = r->reset[3],
        .serves_x = r->serves[0],
        .serves_y = r->serves[1],
        .serves_z = r->serves[2],
        .serves_k = r->serves[3],
        .tau = r->tau,
        .cal = (uint8_t)r->cal,
        .autonomous = r->autonomous,
        .saturated = (uint8_t)mask_of(r->saturated),
        .clipped = (uint8_t)mask_of(r->clipped),
        .t = r->temp_code,
    };
    m->len = (uint8_t)psabench_pmka_state_pack(m->data, &state, sizeof m->data);
}

static void on_reading(void *ctx, const struct pmka_reading *r, int64_t t_ns)
{
    struct pmka_can *c = ctx;
    struct can_msg m[2] = {{0}, {0}};
    pack_codes(r, &m[0]);
    pack_state(r, &m[1]);
    board_node_stream(&c->node, PMKA_CODES_TPDO, m, 2, t_ns);
}

static const struct pmka_reading *latest_reading(const struct board_node *n)
{
    return &((const struct pmka *)n->board)->latest;
}

static double read_code(const struct board_node *n, const struct co_entry *e)
{
    return latest_reading(n)->code[e->sub - 1];
}

/* The bytes of the message. */
static double read_state(const struct board_node *n, const struct co_entry *e)
{
    enum { RESETS = 2, TEMPERATURE = 6 };
    struct can_msg m = {0};
    pack_state(latest_reading(n), &m);
    if (e->sub < RESETS) return (uint16_t)latest_reading(n)->seq;
    return e->sub < TEMPERATURE ? m.data[e->sub] : latest_reading(n)->temp_code;
}

static const struct board_object objects[] = {{PMKA_OD_CODES, .value = read_code},
                                              {PMKA_OD_STATE, .value = read_state}};

static int64_t period_ns(const void *board)
{
    return ((const struct pmka *)board)->profile.ts_ns;
}

static const struct board_node_type type = {
    .device = &pmka_device, BOARD_NODE_OBJECTS(objects), .period_ns = period_ns};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    board_node_init(can, &type, cfg, board, bus, s);
    ((struct pmka *)board)->host = (struct pmka_host){.ctx = can, .reading = on_reading};
}

const struct board_can pmka_can = {.size = sizeof(struct pmka_can), .init = init_can, BOARD_NODE_LIFE};
