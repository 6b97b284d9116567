#include "link/can/can_hub.h"

#include "base/can/fault.h"

#include <stdio.h>
#include <stdlib.h>

static const char detached_adapter[] = "detached";

static void notify_tap(const struct can_hub *h, const struct can_client *c, enum can_hub_event event,
                       const struct can_msg *m)
{
    if (h->tap.event) h->tap.event(h->tap.ctx, h, c, event, m);
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

/* by: the client that takes its slot, or NULL. */
static void unlist_client(struct can_hub *h, struct can_client *c, struct can_client *by)
{
    for (struct can_client **p = &h->clients; *p; p = &(*p)->next) {
        if (*p != c) continue;
        *p = by ? by : c->next;
        if (by) by->next = c->next;
        break;
    }
}

/* The client in the first free slot, or NULL. */
static struct can_client *find_free_slot(const struct can_hub *h)
{
    struct can_client *d = h->clients;
    while (d && !d->slot_free) d = d->next;
    return d;
}

/* The client continues the detached client's node with callbacks of its own. */
static void adopt_slot(struct can_hub *h, struct can_client *d, struct can_client *c)
{
    const struct can_node own = c->node;
    can_replace(h->bus, &d->node, &c->node);
    c->node.order = own.order;
    c->node.fd = own.fd;
    c->node.rx = own.rx;
    c->node.sent = own.sent;
    c->node.error = own.error;
    c->node.state = own.state;
    c->node.ctx = own.ctx;
    c->slot = d->slot;
    unlist_client(h, d, c);
    keep_counters(h, d);
    h->gone.refused += d->refused;
    free(d);
}

static void append_client(struct can_hub *h, struct can_client *c)
{
    struct can_client **p = &h->clients;
    while (*p) p = &(*p)->next;
    c->next = NULL;
    *p = c;
    can_attach(h->bus, &c->node);
}

void can_hub_join(struct can_hub *h, struct can_client *c)
{
    struct can_client *free_slot = find_free_slot(h);
    start_counters(c);
    c->adopts = free_slot ? free_slot->number : 0;
    if (free_slot) adopt_slot(h, free_slot, c);
    else append_client(h, c);
    c->node.name = c->name;
    c->up = true;
    c->leaving = c->slot_free = false;
    c->number = ++h->clients_seen;
    c->connection = h->connections ? ++*h->connections : c->number;
    if (!free_slot) c->slot = c->connection;
    can_hub_stall(c, false); /* a fault of the previous client of this slot */
    notify_tap(h, c, CAN_HUB_JOINED, NULL);
}

void can_hub_leave(struct can_hub *h, struct can_client *c)
{
    if (!c->up) return;
    unlist_client(h, c, NULL);
    keep_counters(h, c);
    h->gone.refused += c->refused;
    c->refused = 0;
    c->up = false;
    can_detach(h->bus, &c->node);
    can_fault_forget(h->bus, &c->node);
    notify_tap(h, c, CAN_HUB_LEFT, NULL);
}

/* ---- detached clients */

static void set_detached(struct can_client *d)
{
    d->adapter = detached_adapter;
    d->leaving = true;
    d->node.name = d->name;
    d->node.rx = NULL;
    d->node.sent = NULL;
    d->node.error = NULL;
    d->node.state = NULL;
    d->stalled = false;
    d->stall = NULL;
    d->node.ctx = NULL;
}

bool can_hub_detach(struct can_hub *h, struct can_client *c)
{
    struct can_client *d = c->up ? malloc(sizeof *d) : NULL;
    if (!d) {
        can_hub_leave(h, c);
        return false;
    }
    *d = *c;
    unlist_client(h, c, d);
    can_replace(h->bus, &c->node, &d->node);
    set_detached(d);
    d->slot_free = true;
    c->up = false;
    c->refused = 0;
    return true;
}

void can_hub_detach_all(struct can_hub *h)
{
    for (struct can_client *c = h->clients, *next; c; c = next) {
        next = c->next;
        if (c->adapter != detached_adapter) can_hub_detach(h, c);
    }
}

struct can_client *can_hub_add_detached(struct can_hub *h, uint32_t number, const char *name, bool fd)
{
    struct can_client *d = calloc(1, sizeof *d);
    if (!d) return NULL;
    snprintf(d->name, sizeof d->name, "%.31s", name);
    d->node.order = CAN_ORDER_FIFO;
    d->node.fd = fd;
    set_detached(d);
    h->clients_seen = number - 1;
    can_hub_join(h, d);
    d->leaving = true;
    return d;
}

void can_hub_remove_detached(struct can_hub *h, struct can_client *detached)
{
    can_hub_leave(h, detached);
    free(detached);
}

void can_hub_sweep_detached(struct can_hub *h, bool all)
{
    for (struct can_client *c = h->clients, *next; c; c = next) {
        next = c->next;
        c->slot_free = false;
        if (c->adapter == detached_adapter && (c->node.queued == 0 || all)) can_hub_remove_detached(h, c);
    }
}

void can_hub_free_slots(struct can_hub *h)
{
    for (struct can_client *c = h->clients; c; c = c->next) c->slot_free = c->adapter == detached_adapter;
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
    notify_tap(h, c, CAN_HUB_SENT, m);
    return true;
}
