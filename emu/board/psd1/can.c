#include "board/psd1/board.h"

#include "gen/psabench_can.h"
#include "gen/psd1_od.h"

enum { SOURCE_CONVERTERS = 1 };

static struct psd1 *board_of(const struct board_node *n)
{
    return n->board;
}

/* ---- stream ---- */

static uint32_t at_most(int64_t value, uint32_t most)
{
    return value < (int64_t)most ? (uint32_t)value : most;
}

static uint16_t length_of(const struct psd1_cycle *c)
{
    return (uint16_t)at_most((c->t_end_ns - c->t_a0_ns) / PSD1_PERIOD_NS, 65535);
}

static uint8_t waited_of(const struct psd1_cycle *c)
{
    return (uint8_t)at_most((c->t_a0_ns - c->t_dr_ns) / PSD1_PERIOD_NS, 255);
}

static void pack_cycle(const struct psd1_cycle *c, struct can_msg *m)
{
    const struct psabench_psd1_cycle_t p = {
        .x = c->word[0],
        .y = c->word[1],
        .z = c->word[2],
        .cnt = (uint8_t)c->seq,
        .read_x = c->status & 1,
        .read_y = c->status >> 1 & 1,
        .read_z = c->status >> 2 & 1,
        .overrun = (c->status & PSD1_CY_OVERRUN) != 0,
        .late = (c->status & PSD1_CY_LATE) != 0,
        .mixed = (c->status & PSD1_CY_MIXED) != 0,
        .clip = (c->status & PSD1_CY_CLIP) != 0,
    };
    m->len = (uint8_t)psabench_psd1_cycle_pack(m->data, &p, sizeof m->data);
}

static void pack_time(const struct psd1_cycle *c, struct can_msg *m)
{
    const struct psabench_psd1_time_t p = {
        .tstamp = (uint32_t)(c->t_a0_ns / 1000),
        .length = length_of(c),
        .waited = waited_of(c),
        .cnt = (uint8_t)c->seq,
    };
    m->len = (uint8_t)psabench_psd1_time_pack(m->data, &p, sizeof m->data);
}

static void pack_gyro(const struct psd1_cycle *c, struct can_msg *m)
{
    const struct psabench_psd1_gyro_t p = {
        .x = (int16_t)c->gyro[0], .y = (int16_t)c->gyro[1], .z = (int16_t)c->gyro[2], .cnt = (uint8_t)c->seq};
    m->len = (uint8_t)psabench_psd1_gyro_pack(m->data, &p, sizeof m->data);
}

static void pack_rate(const struct psd1_cycle *c, struct can_msg *m)
{
    const struct psabench_psd1_rate_t p = {.x = c->rate[0], .y = c->rate[1], .z = c->rate[2], .cnt = (uint8_t)c->seq};
    m->len = (uint8_t)psabench_psd1_rate_pack(m->data, &p, sizeof m->data);
}

static void on_cycle(void *ctx, const struct psd1_cycle *c, int64_t t_ns)
{
    struct psd1_can *can = ctx;
    struct can_msg m[PSD1_TPDOS] = {{0}, {0}, {0}, {0}};
    pack_cycle(c, &m[PSD1_CYCLE_TPDO]);
    pack_time(c, &m[PSD1_TIME_TPDO]);
    pack_gyro(c, &m[PSD1_GYRO_TPDO]);
    pack_rate(c, &m[PSD1_RATE_TPDO]);
    board_node_stream(&can->node, PSD1_CYCLE_TPDO, m, PSD1_TPDOS, t_ns);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    board_node_condition(ctx, PSD1_EMCY_NO_DR, SOURCE_CONVERTERS, code != 0, t_ns);
}

/* ---- objects ---- */

static void request_done(void *ctx, struct psd1_request *r, enum board_cycle_result result, int64_t t_ns)
{
    struct psd1_can *can = ctx;
    const struct co_value v = {.number = r->word};
    const bool read = r->command >= PSD1_CMD_CONTROL;
    can->busy = false;
    co_node_answer(&can->node.node, can->ticket, result == BOARD_CYCLE_OK ? CO_OK : CO_AB_TRANSFER, read ? &v : NULL,
                   t_ns);
}

/* One of a client that has given up is still the board's. */
static uint32_t submit_request(struct board_node *n, uint8_t command, uint32_t word, int64_t t_ns)
{
    struct psd1_can *can = (struct psd1_can *)n;
    const char *why = NULL;
    if (can->busy) return CO_AB_STATE;
    can->request = (struct psd1_request){.command = command, .word = word, .done = request_done, .ctx = can};
    can->ticket = n->node.sdo.ticket;
    const enum board_cycle_result r = psd1_request(board_of(n), &can->request, &why, t_ns);
    can->busy = r == BOARD_CYCLE_OK;
    if (why) board_node_reject(n, why);
    return can->busy ? CO_PENDING : board_node_abort_of(r);
}

static double read_uc(const struct board_node *n, const struct co_entry *e)
{
    return e->index == PSD1_OD_UC1 ? board_of(n)->uc1 : board_of(n)->uc2;
}

static uint32_t write_uc(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    return submit_request(n, e->index == PSD1_OD_UC1 ? PSD1_CMD_UC1 : PSD1_CMD_UC2, (uint32_t)v->number, t_ns);
}

static uint32_t read_control(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)v;
    return submit_request(n, (uint8_t)(PSD1_CMD_CONTROL + e->sub - 1), 0, t_ns);
}

/* As latched or stored: no traffic. */
static double read_stored(const struct board_node *n, const struct co_entry *e)
{
    const struct psd1 *b = board_of(n);
    const unsigned axis = e->sub - 1u;
    if (e->index == PSD1_OD_ZERO_COEF) return b->zero[axis];
    if (e->index == PSD1_OD_FULL_COEF) return b->full[axis];
    if (e->index == PSD1_OD_GYRO) return b->latest.gyro[axis];
    if (e->index == PSD1_OD_GYRO_LOW) return (int16_t)b->latest.gyro[axis];
    if (e->index == PSD1_OD_RATE) return b->latest.rate[axis];
    return b->latest.word[axis];
}

/* In the order of proto/psd1.yaml, as the messages have it. */
static double read_cycle(const struct board_node *n, const struct co_entry *e)
{
    const struct psd1_cycle *c = &board_of(n)->latest;
    const uint32_t value[] = {
        0, (uint8_t)c->seq, c->status & 0x7Fu, (uint32_t)(c->t_a0_ns / 1000), length_of(c), waited_of(c), 0};
    return value[e->sub];
}

static const struct board_object objects[] = {
    {PSD1_OD_UC1, .value = read_uc, .write = write_uc},
    {PSD1_OD_UC2, .value = read_uc, .write = write_uc},
    {PSD1_OD_ZERO_COEF, .value = read_stored},
    {PSD1_OD_FULL_COEF, .value = read_stored},
    {PSD1_OD_CONTROL, .read = read_control},
    {PSD1_OD_GYRO, .value = read_stored},
    {PSD1_OD_CODES, .value = read_stored},
    {PSD1_OD_CYCLE, .value = read_cycle},
    {PSD1_OD_GYRO_LOW, .value = read_stored},
    {PSD1_OD_RATE, .value = read_stored},
};

static int64_t period_ns(const void *board)
{
    return ad7712_period_ns(&((const struct psd1 *)board)->adc[0]);
}

static const struct board_node_type type = {
    .device = &psd1_device, BOARD_NODE_OBJECTS(objects), .period_ns = period_ns};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    struct psd1_can *c = can;
    struct psd1 *b = (struct psd1 *)board;
    board_node_init(&c->node, &type, cfg, board, bus, s);
    c->busy = false;
    b->host = (struct psd1_host){.ctx = can, .cycle = on_cycle, .fault = on_fault};
}

const struct board_can psd1_can = {.size = sizeof(struct psd1_can), .init = init_can, BOARD_NODE_LIFE};
