#include "board/toy/board.h"
#include "gen/toy_od.h"

static const struct toy *board_of(const struct board_node *n)
{
    return (const struct toy *)n->board;
}

/* ---- objects ---- */

static double read_codes(const struct board_node *n, const struct co_entry *e)
{
    return board_of(n)->latest.code[e->sub - 1];
}

static double read_sample(const struct board_node *n, const struct co_entry *e)
{
    const struct toy_sample *s = &board_of(n)->latest;
    const uint32_t value[] = {0, s->seq, (uint8_t)s->seq, s->clipped};
    return value[e->sub];
}

static const struct board_object objects[] = {
    {TOY_OD_CODES, .value = read_codes},
    {TOY_OD_SAMPLE, .value = read_sample},
};

/* ---- stream ---- */

static void send_sample(void *can, const struct toy_sample *s, int64_t t_ns)
{
    struct can_msg m = {.len = 8};
    for (unsigned i = 0; i < BOARD_AXES; i++) {
        m.data[2 * i] = (uint8_t)(uint16_t)s->code[i];
        m.data[2 * i + 1] = (uint8_t)((uint16_t)s->code[i] >> 8);
    }
    m.data[6] = (uint8_t)s->seq;
    m.data[7] = s->clipped;
    board_node_stream(can, TOY_SAMPLE_TPDO, &m, 1, t_ns);
}

static int64_t period_ns(const void *board)
{
    return toy_period_ns(&((const struct toy *)board)->profile);
}

static const struct board_node_type type = {
    .device = &toy_device,
    BOARD_NODE_OBJECTS(objects),
    .period_ns = period_ns,
};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    struct toy *b = (struct toy *)board;
    board_node_init(can, &type, cfg, board, bus, s);
    b->on_sample = send_sample;
    b->can = can;
}

const struct board_can toy_can = {
    .size = sizeof(struct toy_can),
    .init = init_can,
    BOARD_NODE_LIFE,
};
