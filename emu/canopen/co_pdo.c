#include "canopen/co_pdo.h"

#include "canopen/co_node.h"

enum { FIRST = 0x1800, COB_SUB = 1, TYPE_SUB = 2, INHIBIT_SUB = 3 };
enum { TYPE_SYNC_MAX = 240, TYPE_EVENT = 254, NS_PER_100US = 100000 };

#define COB_INVALID UINT32_C(0x80000000)
#define COB_NO_RTR  UINT32_C(0x40000000)

static struct co_pdo *pdo_of(struct co_node *n, const struct co_entry *e)
{
    const unsigned k = (unsigned)e->index - FIRST;
    return k < n->cfg.tpdos ? &n->pdo[k] : NULL;
}

static double default_of(const struct co_node *n, unsigned k, uint8_t sub)
{
    return co_default_number(n->cfg.od, (uint16_t)(FIRST + k), sub, n->cfg.id);
}

void co_pdo_reset(struct co_node *n)
{
    for (unsigned k = 0; k < n->cfg.tpdos; k++) {
        const bool selected = n->pdo[k].selected;
        n->pdo[k] = (struct co_pdo){
            .cob = (uint16_t)((uint32_t)default_of(n, k, COB_SUB) & 0x7FFu),
            .selected = selected,
            .type = (uint8_t)default_of(n, k, TYPE_SUB),
            .inhibit_100us = (uint16_t)default_of(n, k, INHIBIT_SUB),
        };
    }
}

void co_pdo_select(struct co_node *n, unsigned mask)
{
    for (unsigned k = 0; k < n->cfg.tpdos; k++) {
        n->pdo[k].selected = mask >> k & 1u;
        n->pdo[k].fresh = false;
        n->pdo[k].latest.len = 0;
        n->pdo[k].syncs = 0;
    }
}

static bool is_valid(const struct co_pdo *p)
{
    return p->selected && !p->off;
}

void co_pdo_switch_off(struct co_node *n, unsigned mask)
{
    for (unsigned k = 0; k < n->cfg.tpdos; k++) n->pdo[k].off = n->pdo[k].off || (mask >> k & 1u);
}

bool co_pdo_flows(const struct co_node *n, unsigned k)
{
    return is_valid(&n->pdo[k]) && n->pdo[k].type > TYPE_SYNC_MAX;
}

bool co_pdo_room(const struct co_node *n, unsigned frames)
{
    return n->stream.queued + frames <= CO_PDO_BACKLOG;
}

static enum co_pdo_result send_pdo(struct co_node *n, struct co_pdo *p, int64_t t_ns)
{
    if (!co_pdo_room(n, 1) || can_send(n->bus, &n->stream, &p->latest, t_ns) != CAN_OK) return CO_PDO_FULL;
    p->fresh = false;
    p->syncs = 0;
    p->next_ns = t_ns + (int64_t)p->inhibit_100us * NS_PER_100US;
    return CO_PDO_SENT;
}

enum co_pdo_result co_pdo_offer(struct co_node *n, unsigned k, struct can_msg *m, int64_t t_ns)
{
    struct co_pdo *p = &n->pdo[k];
    if (!is_valid(p) || n->state != CO_OPERATIONAL) return CO_PDO_OFF;
    m->id = p->cob;
    p->latest = *m;
    p->fresh = true;
    if (p->type <= TYPE_SYNC_MAX) return CO_PDO_HELD;
    if (t_ns < p->next_ns) {
        n->pdo_inhibited++;
        return CO_PDO_INHIBITED;
    }
    return send_pdo(n, p, t_ns);
}

/* CiA 301 table 72: type 0 sends at SYNC what is new, type n at every n-th SYNC whatever there is. */
static bool sync_due(struct co_pdo *p)
{
    if (p->type == 0) return p->fresh;
    p->syncs++;
    return p->syncs >= p->type && p->latest.len > 0;
}

void co_pdo_sync(struct co_node *n, int64_t t_ns)
{
    if (n->state != CO_OPERATIONAL) return;
    for (unsigned k = 0; k < n->cfg.tpdos; k++) {
        struct co_pdo *p = &n->pdo[k];
        if (!is_valid(p) || p->type > TYPE_SYNC_MAX || !sync_due(p)) continue;
        if (send_pdo(n, p, t_ns) == CO_PDO_FULL) n->pdo_lost++;
    }
}

uint32_t co_pdo_read(const struct co_node *n, const struct co_entry *e, struct co_value *v)
{
    const unsigned k = (unsigned)e->index - FIRST;
    if (k >= n->cfg.tpdos) return CO_AB_NO_OBJECT;
    const struct co_pdo *p = &n->pdo[k];
    switch (e->sub) {
    case COB_SUB:
        v->number = (double)(p->cob | COB_NO_RTR | (is_valid(p) ? 0 : COB_INVALID));
        return CO_OK;
    case TYPE_SUB:
        v->number = p->type;
        return CO_OK;
    case INHIBIT_SUB:
        v->number = p->inhibit_100us;
        return CO_OK;
    default:
        return CO_AB_NO_SUB;
    }
}

/* CiA 301 table 74: identifiers that no PDO may take. */
static bool is_restricted(uint32_t id)
{
    static const struct {
        uint16_t first, last;
    } range[] = {{0x000, 0x07F}, {0x080, 0x0FF}, {0x101, 0x180}, {0x581, 0x5FF},
                 {0x601, 0x67F}, {0x6E0, 0x6FF}, {0x701, 0x77F}, {0x780, 0x7FF}};
    for (unsigned i = 0; i < sizeof range / sizeof range[0]; i++) {
        if (id >= range[i].first && id <= range[i].last) return true;
    }
    return false;
}

static uint32_t write_cob(struct co_pdo *p, uint32_t word)
{
    const bool off = word & COB_INVALID;
    const uint32_t id = word & ~(COB_INVALID | COB_NO_RTR);
    if (!(word & COB_NO_RTR) || id > 0x7FF || is_restricted(id)) return CO_AB_VALUE;
    if (!off && !p->selected) return CO_AB_STATE;                /* the frame form does not feed it */
    if (!off && is_valid(p) && id != p->cob) return CO_AB_VALUE; /* switch it off first */
    p->cob = (uint16_t)id;
    p->off = off;
    return CO_OK;
}

static uint32_t write_type(struct co_pdo *p, uint32_t type)
{
    if (type > TYPE_SYNC_MAX && type < TYPE_EVENT) return CO_AB_VALUE; /* reserved, or asks for RTR */
    p->type = (uint8_t)type;
    p->syncs = 0;
    p->fresh = false;
    return CO_OK;
}

uint32_t co_pdo_write(struct co_node *n, const struct co_entry *e, const struct co_value *v)
{
    struct co_pdo *p = pdo_of(n, e);
    if (!p) return CO_AB_NO_OBJECT;
    switch (e->sub) {
    case COB_SUB:
        return write_cob(p, (uint32_t)v->number);
    case TYPE_SUB:
        return write_type(p, (uint32_t)v->number);
    case INHIBIT_SUB:
        p->inhibit_100us = (uint16_t)v->number;
        return CO_OK;
    default:
        return CO_AB_NO_SUB;
    }
}
