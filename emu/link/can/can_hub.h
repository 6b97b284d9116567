/* The CAN bus as adapters use it: each client of an adapter is a node of its own, with counters that show every loss.
 *
 * A client whose program has disconnected may leave a detached client behind: its node stays on the bus without a program
 * until its frames are sent. Clients occupy slots, their positions on the bus. The slot of a detached client may be free
 * for adoption: the next client to join adopts it with the frames that wait, so that a bus whose programs reconnect while
 * time stands still is the same bus.
 * The hub is owned by the application. Clients are embedded in their adapters' structs. */
#ifndef PSABENCH_LINK_CAN_CAN_HUB_H
#define PSABENCH_LINK_CAN_CAN_HUB_H

#include "base/can/can.h"
#include "link/link.h"

struct can_hub;

struct can_client {
    uint32_t number;     /* connection number on this hub, from 1 */
    uint32_t connection; /* connection number on all hubs of the bench */
    uint32_t slot;       /* position on the bus: connection number of the first client there */
    const char *adapter; /* socketcand, slcan, socketcan, udp, cannelloni */
    char name[32];       /* channel that the client opened, or interface */
    struct can_node node;
    bool up;                             /* on the bus */
    bool slot_free;                      /* detached: the next client to join adopts its slot */
    uint32_t adopts;                     /* number of the detached client whose slot it adopted; 0: none */
    bool leaving;                        /* its program has disconnected, frames of its still wait for the bus */
    bool stalled;                        /* a fault: its output is kept back, as if it did not read */
    void (*stall)(struct can_client *c); /* stalled has changed; may be NULL */
    uint64_t kept;                       /* frames in its output since it stalled: delivered when the stall ends */
    uint64_t delivered;                  /* frames put into its output since it joined: the barrier of step pace */
    uint64_t taken;                      /* frames of its that were queued for the bus */
    uint64_t dropped;                    /* frames lost because it read too slowly (wall pace, or stalled) */
    uint64_t overrun;                    /* frames or datagrams of its that were lost before we read them */
    uint64_t refused;                    /* malformed messages, and frames that the bus or the link cannot carry */
    struct can_client *next;             /* in the order of slots */
};

/* What a client did to the bus: a journal of these events makes the same bus again. */
enum can_hub_event { CAN_HUB_JOINED, CAN_HUB_LEFT, CAN_HUB_SENT };

struct can_hub_tap {
    void (*event)(void *ctx, const struct can_hub *h, const struct can_client *c, enum can_hub_event event,
                  const struct can_msg *m); /* m: the frame that was queued. NULL: no tap */
    void *ctx;
};

struct can_hub {
    const char *name; /* of the bus, where there are several; may be NULL */
    struct can_bus *bus;
    struct links *links;
    uint32_t *connections; /* counter of all hubs of the bench; NULL: this is the only hub */
    bool lossless;    /* step and free pace: output is kept and time waits; wall pace: a slow client loses frames */
    int64_t epoch_ns; /* added to the simulated time in time stamps */
    void (*say)(const char *text); /* a line for the log: a client joined, left, lost frames */
    struct can_hub_tap tap;
    /* read-only outside can/can_hub.c */
    struct can_client *clients; /* detached ones included */
    struct can_client gone;     /* sums of the counters of clients that left */
    uint64_t taken;
    uint32_t clients_seen;
};

/* The client joins the bus. Its node's rx, sent, fd, order and ctx, its adapter and its name are set by the caller. */
void can_hub_join(struct can_hub *h, struct can_client *c);

/* A new session of a client that is on the bus: its counters are added to those of the gone and begin at zero. */
void can_hub_restart(struct can_hub *h, struct can_client *c);

/* The client leaves; its counters are added to those of the gone, frames that it has queued are dropped. */
void can_hub_leave(struct can_hub *h, struct can_client *c);

/* A detached client takes over the client's slot and queued frames; the client itself is down. The slot is free until time
 * moves. False: the client was not on the bus, or no memory; it is down and its frames are dropped. */
bool can_hub_detach(struct can_hub *h, struct can_client *c);

void can_hub_detach_all(struct can_hub *h);

/* Adds a detached client: a program of a run that is repeated. NULL: no memory. */
struct can_client *can_hub_add_detached(struct can_hub *h, uint32_t number, const char *name, bool fd);

/* A detached client leaves at once, with what it has queued; it is freed. */
void can_hub_remove_detached(struct can_hub *h, struct can_client *detached);

/* Makes the slots of all detached clients free: each client that joins adopts the first free one. */
void can_hub_free_slots(struct can_hub *h);

/* Time has moved: slots are no longer free, and detached clients without frames (all: every one) leave. */
void can_hub_sweep_detached(struct can_hub *h, bool all);

/* Queues a frame of the client's; false: rejected and counted. */
bool can_hub_send(struct can_hub *h, struct can_client *c, const struct can_msg *m, int64_t t_ns);

/* Begins or ends a stall: frames for the client are kept, as long as there is room, and time does not wait. */
void can_hub_stall(struct can_client *c, bool on);

/* A frame has been put into the client's output. */
static inline void can_hub_delivered(struct can_client *c)
{
    if (c->stalled) c->kept++;
    else c->delivered++;
}

/* Whether the client may queue another frame. */
static inline bool can_hub_room(const struct can_client *c)
{
    return !c->up || can_room(&c->node) > 0;
}

#endif
