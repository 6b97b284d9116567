#include "link/can_hub.h"

static void start_counters(struct can_client *c)
{
    c->delivered = c->taken = c->dropped = c->overrun = 0;
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

void can_hub_up(struct can_hub *h, struct can_client *c)
{
    start_counters(c);
    c->node.name = c->name;
    c->up = true;
    c->leaving = false;
    c->next = NULL;
    struct can_client **p = &h->clients;
    while (*p) p = &(*p)->next;
    *p = c;
    h->clients_seen++;
    can_attach(h->bus, &c->node);
}

void can_hub_down(struct can_hub *h, struct can_client *c)
{
    if (!c->up) return;
    for (struct can_client **p = &h->clients; *p; p = &(*p)->next) {
        if (*p != c) continue;
        *p = c->next;
        break;
    }
    keep_counters(h, c);
    h->gone.refused += c->refused;
    c->refused = 0;
    c->up = false;
    can_detach(h->bus, &c->node);
}

bool can_hub_send(struct can_hub *h, struct can_client *c, const struct can_msg *m, int64_t t_ns)
{
    if (!c->up || can_send(h->bus, &c->node, m, t_ns) != CAN_OK) {
        c->refused++;
        return false;
    }
    c->taken++;
    h->taken++;
    return true;
}
