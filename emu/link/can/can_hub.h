/* The bus as the adapters see it: every client of an adapter is a node of its own, with counters that show each loss.
 *
 * The hub is owned by the application. Clients are embedded in their adapters' structs. */
#ifndef PSABENCH_LINK_CAN_CAN_HUB_H
#define PSABENCH_LINK_CAN_CAN_HUB_H

#include "base/can.h"
#include "link/link.h"

struct can_hub;

struct can_client {
    uint32_t number;     /* of its coming to the hub, from 1 */
    uint32_t came;       /* the same over all hubs of the bench */
    uint32_t place;      /* came of the first at its place on the bus, whose heirs took it over one after the other */
    const char *adapter; /* socketcand, slcan, socketcan */
    char name[32];       /* channel the client opened, or interface */
    struct can_node node;
    bool up;                             /* takes part in the bus */
    bool vacant;                         /* a ghost whose place goes to who comes next */
    uint32_t heir_of;                    /* number of the ghost whose place it took; 0: it came to a place of its own */
    bool leaving;                        /* its program has gone, frames of its still wait for the bus */
    bool stalled;                        /* a fault: its output is kept back, as if it did not read */
    void (*stall)(struct can_client *c); /* stalled has changed; may be NULL */
    uint64_t kept;                       /* frames in its output since it stalled: delivered when it goes on */
    uint64_t delivered;                  /* frames handed to its output since it came up: the barrier of step pace */
    uint64_t taken;                      /* frames of its that were queued for the bus */
    uint64_t dropped;                    /* frames lost because it read too slowly (wall pace, or stalled) */
    uint64_t overrun;                    /* frames of its that the kernel lost before we read them (SocketCAN) */
    uint64_t refused;                    /* messages that were no frame, or one that the bus or the link cannot carry */
    struct can_client *next;             /* in order of coming up */
};

/* What a client did to the bus: a journal of these makes the same bus again. */
enum can_hub_deed { CAN_HUB_CAME, CAN_HUB_WENT, CAN_HUB_SENT };

struct can_hub_tap {
    void (*deed)(void *ctx, const struct can_hub *h, const struct can_client *c, enum can_hub_deed deed,
                 const struct can_msg *m); /* m: the frame that was queued; NULL: no observer */
    void *ctx;
};

struct can_hub {
    const char *name; /* of the bus, where there are several; may be NULL */
    struct can_bus *bus;
    struct links *links;
    uint32_t *comings; /* counts who came to any hub of the bench; NULL: this one is alone */
    bool lossless;     /* step and free pace: output is kept and time waits; wall pace: a slow client loses frames */
    int64_t epoch_ns;  /* added to the simulated time in time stamps */
    void (*say)(void *ctx, const char *text); /* one line for the log: a peer came, went, lost something */
    void *say_ctx;
    struct can_hub_tap tap;
    /* read-only outside can/can_hub.c */
    struct can_client *clients; /* ghosts among them: `leaving`, no one behind them */
    struct can_client gone;     /* counters of those who left */
    uint64_t taken;
    uint32_t clients_seen;
};

/* Attaches the client: its node's rx, sent, fd, order and ctx and its adapter and name have been filled in. */
void can_hub_up(struct can_hub *h, struct can_client *c);

/* The client starts again without having left the bus: its counters begin at zero, what they were is added to the gone. */
void can_hub_restart(struct can_hub *h, struct can_client *c);

/* Detaches it; its counters are added to those of the gone. Frames of its still queued are dropped. */
void can_hub_down(struct can_hub *h, struct can_client *c);

/* The client's place on the bus, with what it has queued, is taken by a ghost, which leaves when its frames are out, or gives
 * its place to who comes before time moves; the client itself is down. False when there is no memory: then it is down and its frames are dropped. */
bool can_hub_haunt(struct can_hub *h, struct can_client *c);

void can_hub_haunt_all(struct can_hub *h); /* whoever is no ghost yet */

/* A ghost from the start: a client of a run that is done again. NULL when there is no memory. */
struct can_client *can_hub_ghost(struct can_hub *h, uint32_t number, const char *name, bool fd);

/* A ghost leaves at once, with what it has queued; it is freed. */
void can_hub_dismiss(struct can_hub *h, struct can_client *ghost);

/* The places of all ghosts are free: who comes next takes the first, frames that wait and all, and then the next one. */
void can_hub_vacate(struct can_hub *h);

/* Time has moved: ghosts keep their places. Ghosts with nothing left to send leave; all: every ghost, with what it has queued. */
void can_hub_sweep(struct can_hub *h, bool all);

/* Queues a frame of the client's; false: refused, and counted. */
bool can_hub_send(struct can_hub *h, struct can_client *c, const struct can_msg *m, int64_t t_ns);

/* The client's program stalls, or goes on: what comes for it is kept, as long as there is room, and time does not wait. */
void can_hub_stall(struct can_client *c, bool on);

/* A frame has been put into the client's output. */
static inline void can_hub_delivered(struct can_client *c)
{
    if (c->stalled) c->kept++;
    else c->delivered++;
}

/* Whether another frame of the client's would find room. */
static inline bool can_hub_room(const struct can_client *c)
{
    return !c->up || can_room(&c->node) > 0;
}

#endif
