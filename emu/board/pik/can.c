#include "board/pik/board.h"

#include "base/bits.h"
#include "board/pik/pik.h"
#include "gen/pik_od.h"

#include <string.h>

enum { SOURCE_CONVERTER = 1, NS_PER_US = 1000 };
enum { SATURATED = PIK_ST_SATURATED_X | PIK_ST_SATURATED_Y | PIK_ST_SATURATED_Z };

static const struct pik *pik_of(const struct board_node *n)
{
    return n->board;
}

/* ---- objects ---- */

static double read_totals(const struct board_node *n, const struct co_entry *e)
{
    return pik_of(n)->latched.total[e->sub - 1];
}

static double read_increments(const struct board_node *n, const struct co_entry *e)
{
    return (int16_t)pik_of(n)->latched.increment[e->sub - 1];
}

static double read_reading(const struct board_node *n, const struct co_entry *e)
{
    const struct pik_reading *r = &pik_of(n)->latched;
    const uint32_t value[] = {0,         r->seq,          (uint32_t)(r->t_ns / NS_PER_US),
                              r->status, (uint8_t)r->seq, r->status & SATURATED};
    return value[e->sub];
}

static uint32_t read_plate(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    const struct pik_profile *p = &pik_of(n)->profile;
    const double value[] = {0.0, 0.0, pik_profile_k_hz_per_v(p) * 1e3, pik_profile_limit_hz(p), p->k_error_pct * 1e2};
    (void)t_ns;
    v->number = (double)(uint32_t)(value[e->sub] + 0.5);
    if (e->sub != 1) return CO_OK;
    v->len = (uint16_t)strlen(p->name);
    memcpy(v->text, p->name, (size_t)v->len + 1);
    return CO_OK;
}

static const struct board_object objects[] = {
    {PIK_OD_TOTALS, .value = read_totals},
    {PIK_OD_INCREMENTS, .value = read_increments},
    {PIK_OD_READING, .value = read_reading},
    {PIK_OD_PLATE, .read = read_plate},
};

/* ---- notifications of the board ---- */

static void on_reading(void *ctx, const struct pik_reading *r, int64_t t_ns)
{
    struct can_msg m[PIK_TPDOS] = {{.len = 8}, {.len = 8}, {.len = 8}};
    for (unsigned i = 0; i < PIK_AXES; i++) bits_put_le(m[0].data + 2 * i, (uint16_t)r->increment[i], 2);
    m[0].data[6] = (uint8_t)r->seq;
    m[0].data[7] = r->status & SATURATED;
    for (unsigned i = 0; i < PIK_AXES; i++) bits_put_le(m[1 + i / 2].data + i % 2 * 4, (uint32_t)r->total[i], 4);
    bits_put_le(m[2].data + 4, (uint32_t)(r->t_ns / NS_PER_US), 4);
    board_node_stream(ctx, PIK_COUNTS_TPDO, m, PIK_TPDOS, t_ns);
}

static void on_saturated(void *ctx, bool on, int64_t t_ns)
{
    board_node_condition(ctx, PIK_EMCY_SATURATED, SOURCE_CONVERTER, on, t_ns);
}

static const struct board_node_type type = {
    .device = &pik_device, BOARD_NODE_OBJECTS(objects), .period_ns = pik_period_ns};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    board_node_init(can, &type, cfg, board, bus, s);
    ((struct pik *)board)->host = (struct pik_host){.ctx = can, .reading = on_reading, .saturated = on_saturated};
}

const struct board_can pik_can = {.size = sizeof(struct pik_can), .init = init_can, BOARD_NODE_LIFE};
