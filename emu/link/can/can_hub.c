#include "link/can/can_hub.h"

#include "base/can_fault.h"

#include <stdio.h>
#include <stdlib.h>

static const char ghostly[] = "ghost"; /* adapter of a ghost */

static void tell(const struct can_hub *h, const struct can_client *c, enum can_hub_deed deed, const struct can_msg *m)
{
    if (h->tap.deed) h->tap.deed(h->tap.ctx, h, c, deed, m);
}

static void start_counters(struct can_client *c)
{
    c->delivered = c->kept = c->taken = c->dropped = c->overrun = 0;
}

static void keep_counters(struct can_hub *h, const struct can_client *c)
{
    h->gone.delivered += c->delivered;
    h->gone.taken += c->taken;
    h->gone.dropped += c->dropped;
    h->gone.overrun += c->overrun;
}

void can_hub_restart(struct can_hub *h, struct can_client *c)
{
    keep_counters(h, c);
    start_counters(c);
}

/* by: who takes its place in the list, or NULL. */
static void unlist(struct can_hub *h, struct can_client *c, struct can_client *by)
{
    for (struct can_client **p = &h->clients; *p; p = &(*p)->next) {
        if (*p != c) continue;
        *p = by ? by : c->next;
        if (by) by->next = c->next;
        break;
    }
}

/* The first place that is free for who comes next, or NULL. */
static struct can_client *vacancy(const struct can_hub *h)
{
    struct can_client *g = h->clients;
    while (g && !g->vacant) g = g->next;
    return g;
}

/* On the bus the client is what the ghost was, but calls are its own. */
static void inherit(struct can_hub *h, struct can_client *g, struct can_client *c)
{
    const struct can_node own = c->node;
    can_replace(h->bus, &g->node, &c->node);
    c->node.order = own.order;
    c->node.fd = own.fd;
    c->node.rx = own.rx;
    c->node.sent = own.sent;
    c->node.error = own.error;
    c->node.state = own.state;
    c->node.ctx = own.ctx;
    c->place = g->place;
    unlist(h, g, c);
    keep_counters(h, g);
    h->gone.refused += g->refused;
    free(g);
}

static void append(struct can_hub *h, struct can_client *c)
{
    struct can_client **p = &h->clients;
    while (*p) p = &(*p)->next;
    c->next = NULL;
    *p = c;
    can_attach(h->bus, &c->node);
}

void can_hub_up(struct can_hub *h, struct can_client *c)
{
    struct can_client *place = vacancy(h);
    start_counters(c);
    c->heir_of = place ? place->number : 0;
    if (place) inherit(h, place, c);
    else append(h, c);
    c->node.name = c->name;
    c->up = true;
    c->leaving = c->vacant = false;
    c->number = ++h->clients_seen;
    c->came = h->comings ? ++*h->comings : c->number;
    if (!place) c->place = c->came;
    can_hub_stall(c, false); /* a fault of whoever was here before */
    tell(h, c, CAN_HUB_CAME, NULL);
}

void can_hub_down(struct can_hub *h, struct can_client *c)
{
    if (!c->up) return;
    unlist(h, c, NULL);
    keep_counters(h, c);
    h->gone.refused += c->refused;
    c->refused = 0;
    c->up = false;
    can_detach(h->bus, &c->node);
    can_fault_forget(h->bus, &c->node);
    tell(h, c, CAN_HUB_WENT, NULL);
}

/* ---- ghosts */

static void silence(struct can_client *g)
{
    g->adapter = ghostly;
    g->leaving = true;
    g->node.name = g->name;
    g->node.rx = NULL;
    g->node.sent = NULL;
    g->node.error = NULL;
    g->node.state = NULL;
    g->stalled = false;
    g->stall = NULL;
    g->node.ctx = NULL;
}

bool can_hub_haunt(struct can_hub *h, struct can_client *c)
{
    struct can_client *g = c->up ? malloc(sizeof *g) : NULL;
    if (!g) {
        can_hub_down(h, c);
        return false;
    }
    *g = *c;
    unlist(h, c, g);
    can_replace(h->bus, &c->node, &g->node);
    silence(g);
    g->vacant = true;
    c->up = false;
    c->refused = 0;
    return true;
}

void can_hub_haunt_all(struct can_hub *h)
{
    for (struct can_client *c = h->clients, *next; c; c = next) {
        next = c->next;
        if (c->adapter != ghostly) can_hub_haunt(h, c);
    }
}

struct can_client *can_hub_ghost(struct can_hub *h, uint32_t number, const char *name, bool fd)
{
    struct can_client *g = calloc(1, sizeof *g);
    if (!g) return NULL;
    snprintf(g->name, sizeof g->name, "%.31s", name);
    g->node.order = CAN_ORDER_FIFO;
    g->node.fd = fd;
    silence(g);
    h->clients_seen = number - 1;
    can_hub_up(h, g);
    g->leaving = true;
    return g;
}

void can_hub_dismiss(struct can_hub *h, struct can_client *ghost)
{
    can_hub_down(h, ghost);
    free(ghost);
}

void can_hub_sweep(struct can_hub *h, bool all)
{
    for (struct can_client *c = h->clients, *next; c; c = next) {
        next = c->next;
        c->vacant = false;
        if (c->adapter == ghostly && (c->node.queued == 0 || all)) can_hub_dismiss(h, c);
    }
}

void can_hub_vacate(struct can_hub *h)
{
    for (struct can_client *c = h->clients; c; c = c->next) c->vacant = c->adapter == ghostly;
}

void can_hub_stall(struct can_client *c, bool on)
{
    if (c->stalled == on) return;
    c->stalled = on;
    if (!on) {
        c->delivered += c->kept;
        c->kept = 0;
    }
    if (c->stall) c->stall(c);
}

bool can_hub_send(struct can_hub *h, struct can_client *c, const struct can_msg *m, int64_t t_ns)
{
    if (!c->up || can_send(h->bus, &c->node, m, t_ns) != CAN_OK) {
        c->refused++;
        return false;
    }
    c->taken++;
    h->taken++;
    tell(h, c, CAN_HUB_SENT, m);
    return true;
}
