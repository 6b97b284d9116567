/* The bus as the adapters see it: every client of an adapter is a node of its own, with counters that show each loss.
 *
 * The hub is owned by the application. Clients are embedded in their adapters' structs. */
#ifndef PSABENCH_LINK_CAN_HUB_H
#define PSABENCH_LINK_CAN_HUB_H

#include "base/can.h"
#include "link/link.h"

struct can_client {
    const char *adapter; /* socketcand, slcan, socketcan */
    char name[32];       /* channel the client opened, or interface */
    struct can_node node;
    bool up;                 /* takes part in the bus */
    bool leaving;            /* its program has gone, frames of its still wait for the bus */
    uint64_t delivered;      /* frames handed to its output since it came up: the barrier of step pace */
    uint64_t taken;          /* frames of its that were queued for the bus */
    uint64_t dropped;        /* frames lost because it read too slowly (wall pace only) */
    uint64_t overrun;        /* frames of its that the kernel lost before we read them (SocketCAN) */
    uint64_t refused;        /* messages that were no frame, or one that the bus or the link cannot carry */
    struct can_client *next; /* in order of coming up */
};

struct can_hub {
    struct can_bus *bus;
    struct links *links;
    bool lossless;    /* step and free pace: output is kept and time waits; wall pace: a slow client loses frames */
    int64_t epoch_ns; /* added to the simulated time in time stamps */
    void (*say)(void *ctx, const char *text); /* one line for the log: a peer came, went, lost something */
    void *say_ctx;
    /* read-only outside can_hub.c */
    struct can_client *clients;
    struct can_client gone; /* counters of those who left */
    uint64_t taken;
    uint32_t clients_seen;
};

/* Attaches the client: its node's rx, sent, fd, order and ctx and its adapter and name have been filled in. */
void can_hub_up(struct can_hub *h, struct can_client *c);

/* The client starts anew without having left the bus: its counters begin at zero, what they were is added to the gone. */
void can_hub_restart(struct can_hub *h, struct can_client *c);

/* Detaches it; its counters are added to those of the gone. Frames of its still queued are dropped. */
void can_hub_down(struct can_hub *h, struct can_client *c);

/* Queues a frame of the client's; false: refused, and counted. */
bool can_hub_send(struct can_hub *h, struct can_client *c, const struct can_msg *m, int64_t t_ns);

/* Whether another frame of the client's would find room. */
static inline bool can_hub_room(const struct can_client *c)
{
    return !c->up || can_room(&c->node) > 0;
}

#endif
