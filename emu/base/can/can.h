/* CAN frames, and a CAN bus in simulated time.
 *
 * A board, a recorder and every client of an adapter is a node. A bus with a bit rate serves one frame at a time: among
 * the nodes that have something to send, the lowest identifier wins (classic arbitration), the frame takes its exact
 * number of bits including stuffing (base/can/bits.h), and at the end of frame every other node receives it; the interframe
 * space follows. Frames sent at one instant all take part in the arbitration of that instant. A bus whose bit rate is 0
 * is ideal: frames pass at once in the order of sending, each in its own event, so that a receiver that answers does
 * not recurse. Nodes are owned by their owners and linked in; nothing allocates. The wire itself has no errors: they are
 * injected (can_fault.h) and confined by can_error.h; a frame without receivers passes. */
#ifndef PSABENCH_BASE_CAN_CAN_H
#define PSABENCH_BASE_CAN_CAN_H

#include "base/can/error.h"
#include "base/sched.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    CAN_EXT = 1, /* 29-bit identifier */
    CAN_RTR = 2, /* remote frame: passed on, never sent by us */
    CAN_FD = 4,  /* FD frame, up to 64 bytes */
    CAN_BRS = 8, /* FD data phase at the data bit rate */
    CAN_ERROR = 16
};

struct can_msg {
    uint32_t id;
    uint8_t flags;
    uint8_t len; /* bytes of data: 0..8 classic; 0..8, 12, 16, 20, 24, 32, 48, 64 FD */
    uint8_t data[64];
};

#define CAN_QUEUE_MAX 128u

struct can_waiting {
    uint64_t number; /* order of can_send() on the whole bus */
    bool repeat;     /* has been received: the sender missed it */
    struct can_msg m;
};

/* How a node chooses among its own waiting frames. */
enum can_order { CAN_ORDER_PRIORITY, CAN_ORDER_FIFO };

struct can_node {
    const char *name;
    enum can_order order;
    bool fd; /* FD controller; a classic node does not receive FD frames and counts them */
    /* End of another node's frame; may be NULL. */
    void (*rx)(void *ctx, const struct can_msg *m, int64_t t_ns);
    void (*sent)(void *ctx, const struct can_msg *m, int64_t t_ns);  /* end of a frame of its own; may be NULL */
    void (*error)(void *ctx, const struct can_msg *m, int64_t t_ns); /* error message, see can_error.h; may be NULL */
    void (*state)(void *ctx, enum can_state s, int64_t t_ns);        /* new state of its controller; may be NULL */
    struct can_node *of; /* the node whose controller it shares as a second queue; NULL: it has its own */
    void *ctx;
    /* read-only outside can*.c */
    uint32_t tx_frames, rx_frames, tx_overflow;
    uint32_t fd_refused; /* FD frames that it could not send or receive */
    struct can_waiting queue[CAN_QUEUE_MAX];
    unsigned queued;
    bool silent; /* bus-off: neither sends nor receives */
    struct can_bus *bus;
    struct can_node *next;
    /* of the controller, where `of` is NULL */
    uint16_t tec, rec; /* error counters */
    enum can_state error_state;
    unsigned recovery_left; /* bus-off: times 11 recessive bits before recovery */
    int64_t idle_since_ns;  /* bus-off: start of the present idle time; -1: the bus is busy */
    struct sched_ev recovery;
};

struct can_bus_cfg {
    uint32_t bitrate_hz;      /* nominal phase; 0: ideal bus, no time passes */
    uint32_t data_bitrate_hz; /* data phase of FD frames with BRS; 0: a classic bus, FD frames are rejected */
};

enum can_phase { CAN_IDLE, CAN_ARBITRATION, CAN_FRAME, CAN_ERROR_FRAME, CAN_IFS };

#define CAN_HELD_MAX 64u /* frames that faults hold; more are lost and counted */

struct can_fault;
struct can_held {         /* a frame that a fault holds */
    struct can_fault *by; /* NULL: free */
    struct can_node *from, *to;
    uint64_t number; /* order of holding */
    int64_t due_ns;
    struct can_msg m;
};

/* Read-only outside can*.c. */
struct can_bus {
    struct can_bus_cfg cfg;
    struct sched *sched;
    struct can_node *nodes; /* in order of attachment, which is the order of delivery */
    struct sched_ev step;   /* end of the present phase */
    enum can_phase phase;
    struct can_node *sender;  /* of the frame on the wire; NULL if it has left */
    struct can_node *next_rx; /* cursor of the delivery under way */
    struct can_msg wire;
    bool repeat;               /* of the frame on the wire */
    bool degraded;             /* faults, error counters above 0 or nodes in bus-off: can_error.c has work to do */
    const struct can_tap *tap; /* fault injection (can_fault.c); NULL: none */
    struct can_fault *faults;
    struct can_node *suspended; /* error-passive controller that sent the last frame: suspends transmission */
    struct can_held held[CAN_HELD_MAX];
    uint64_t held_number;
    uint32_t error_frames;
    int64_t start_ns; /* start of the frame on the wire */
    int64_t busy_ns;  /* of finished frames with their interframe space, since power-on */
    uint64_t frames, number;
};

enum can_result { CAN_OK, CAN_FULL, CAN_NO_FD, CAN_BAD };

void can_bus_init(struct can_bus *b, const struct can_bus_cfg *cfg, struct sched *s);

/* The node's name, order, fd, rx, sent and ctx are filled in by the caller. */
void can_attach(struct can_bus *b, struct can_node *n);
void can_detach(struct can_bus *b, struct can_node *n); /* drops what it had queued; a frame on the wire is finished */

/* The node loses its power: a frame that it sends breaks off, the others see an error frame; then can_detach(). */
void can_unplug(struct can_bus *b, struct can_node *n, int64_t t_ns);

/* `by` is where n stood, with all that n was, its waiting frames and the one on the wire included; n is off the bus. */
void can_replace(struct can_bus *b, struct can_node *n, struct can_node *by);

/* Queues a copy. CAN_FULL: counted in tx_overflow; CAN_NO_FD: FD frame on a classic bus; CAN_BAD: no such length or id. */
enum can_result can_send(struct can_bus *b, struct can_node *n, const struct can_msg *m, int64_t t_ns);

/* Drops what the node has queued, as the reset of a controller does. */
void can_flush(struct can_node *n);

unsigned can_room(const struct can_node *n);

/* Time on the wire, from start of frame to the end of the 3-bit interframe space. */
int64_t can_frame_ns(const struct can_bus_cfg *cfg, const struct can_msg *m);

/* Time the wire was in use since power-on, interframe spaces included. */
int64_t can_busy_ns(const struct can_bus *b, int64_t t_ns);

/* Whether the frame has a legal length, identifier and combination of flags. */
bool can_valid(const struct can_msg *m);

/* Value the identifier field has in arbitration: the lower one wins (base before extended, data before remote). */
uint32_t can_arbitration(const struct can_msg *m);

#endif
