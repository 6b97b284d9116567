/* Programs on the CAN buses, as commands and counters see them. */
#include "app/service.h"

#include "app/mavlink.h"

#include <inttypes.h>
#include <stdio.h>

/* The client of any bus that came next after `came`; NULL: the last. */
static const struct can_client *client_after(const struct ports *p, uint32_t connection)
{
    const struct can_client *next = NULL;
    for (unsigned i = 0; i < p->hubs; i++) {
        for (const struct can_client *c = p->hub[i].clients; c; c = c->next)
            if (c->connection > connection && (!next || c->connection < next->connection)) next = c;
    }
    return next;
}

static uint64_t do_can_rx(void *ctx)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    const struct can_client *c = client_after(p, 0);
    while (c && c->leaving) c = client_after(p, c->connection);
    return c ? c->delivered : 0;
}

static void put_client(const struct can_client *c, struct control_client *out)
{
    *out = (struct control_client){.adapter = c->adapter,
                                   .name = c->name,
                                   .connection = c->connection,
                                   .slot = c->slot,
                                   .delivered = c->delivered,
                                   .taken = c->taken,
                                   .dropped = c->dropped,
                                   .overrun = c->overrun,
                                   .refused = c->refused};
}

/* The i-th in order of coming. */
static const struct can_client *client_at(const struct service *s, unsigned i)
{
    const struct can_client *c = client_after(&s->ports, 0);
    while (c && i--) c = client_after(&s->ports, c->connection);
    return c;
}

static bool do_client(void *ctx, unsigned i, struct control_client *out)
{
    const struct can_client *c = client_at(ctx, i);
    if (c) put_client(c, out);
    return c != NULL;
}

static struct can_node *do_client_node(void *ctx, uint32_t slot)
{
    const struct service *s = ctx;
    const struct can_client *c = client_after(&s->ports, 0);
    while (c && c->slot != slot) c = client_after(&s->ports, c->connection);
    return c ? &((struct can_client *)c)->node : NULL;
}

static bool do_stall(void *ctx, const struct can_node *node, bool on)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    const struct can_client *c = client_after(p, 0);
    while (c && &c->node != node) c = client_after(p, c->connection);
    if (c) can_hub_stall((struct can_client *)c, on);
    return c != NULL;
}

static void do_gone(void *ctx, struct control_client *out)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    struct can_client sum = {.adapter = NULL};
    for (unsigned i = 0; i < p->hubs; i++) {
        const struct can_client *gone = &p->hub[i].gone;
        sum.delivered += gone->delivered;
        sum.taken += gone->taken;
        sum.dropped += gone->dropped;
        sum.overrun += gone->overrun;
        sum.refused += gone->refused;
    }
    put_client(&sum, out);
}

const struct control_clients service_clients = {
    .can_rx = do_can_rx, .nth = do_client, .gone = do_gone, .node = do_client_node, .stall = do_stall};

/* A client that has sent more than its queue holds can only be heard on when time moves. */
bool service_taken(void *ctx, uint64_t count)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    uint64_t sum = 0;
    bool room = true;
    for (unsigned i = 0; i < p->hubs; i++) {
        sum += p->hub[i].taken;
        for (const struct can_client *c = p->hub[i].clients; c; c = c->next) room &= c->leaving || can_hub_room(c);
    }
    return sum >= count || !room;
}

void service_sweep_detached(struct service *s, bool all)
{
    for (unsigned i = 0; i < s->ports.hubs; i++) can_hub_sweep_detached(&s->ports.hub[i], all);
}

void service_print_clients(struct service *s)
{
    for (const struct can_client *c = client_after(&s->ports, 0); c; c = client_after(&s->ports, c->connection)) {
        fprintf(stderr,
                "psa-emu: %s %s: delivered %" PRIu64 ", taken %" PRIu64 ", dropped %" PRIu64 ", overrun %" PRIu64
                ", refused %" PRIu64 "\n",
                c->adapter, c->name, c->delivered, c->taken, c->dropped, c->overrun, c->refused);
    }
    struct control_client gone;
    do_gone(s, &gone);
    fprintf(stderr,
            "psa-emu: clients gone: delivered %" PRIu64 ", taken %" PRIu64 ", dropped %" PRIu64 ", refused %" PRIu64
            "\n",
            gone.delivered, gone.taken, gone.dropped, gone.refused);
    for (unsigned i = 0; i < s->ports.mavlink_count; i++) mavlink_print_counters(s->ports.mavlink[i], stderr);
}
