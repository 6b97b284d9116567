/* Faults of a CAN bus: what befalls frames, error counters of nodes, bus-off. See base/can.h.
 *
 * Error frames and counters follow ISO 11898-1 (2015), 12.1: a frame that is destroyed costs its sender 8 and each receiver
 * 1, one that passes gives 1 back; above 127 a node is error-passive and waits 8 bits longer after its own frames, above 255
 * it is off the bus until it has seen 128 times 11 recessive bits. The other kinds are not of the wire but of links and
 * gateways: the sender believes that its frame has arrived.
 * Simplified: the sender finds the error itself (bit error), so that flags overlap to 12 bits; nobody sends overload frames;
 * an unacknowledged frame passes; a frame that goes while another's error is signalled is not told apart. */
#ifndef PSABENCH_BASE_CAN_FAULT_H
#define PSABENCH_BASE_CAN_FAULT_H

#include "base/rng.h"
#include "base/sched.h"

#include <stdbool.h>
#include <stdint.h>

struct can_bus;
struct can_msg;
struct can_node;

enum can_state { CAN_ACTIVE, CAN_PASSIVE, CAN_BUS_OFF };

/* What an error frame's can_msg says (flags CAN_ERROR, len 8), in the bits of linux/can/error.h: id is the class, data[1]
 * the controller's state, data[2] the kind, data[6] and data[7] TEC and REC of the sender, up to 255. */
enum {
    CAN_CLASS_CONTROLLER = 0x004, /* a node has become error-passive: data[1] 20h, or active again: 40h */
    CAN_CLASS_PROTOCOL = 0x008,   /* data[2] 01h: a bit error */
    CAN_CLASS_BUS_OFF = 0x040,
    CAN_CLASS_BUS_ERROR = 0x080, /* an error frame was on the bus; with CAN_CLASS_PROTOCOL */
    CAN_CLASS_RESTARTED = 0x100  /* back from bus-off */
};

enum can_fault_kind {
    CAN_FAULT_DROP,      /* not received, though the sender thinks so */
    CAN_FAULT_DUPLICATE, /* received twice: the sender missed the end of its frame and repeats it (one receiver: at once) */
    CAN_FAULT_REORDER, /* received after the next frame that the fault picks, or after delay_ns */
    CAN_FAULT_DELAY,   /* received delay_ns later */
    CAN_FAULT_ALTER,   /* a data bit is inverted and nobody notices: as by a gateway, not by the wire with its CRC */
    CAN_FAULT_ERROR    /* destroyed by an error frame, and sent again until the sender is off the bus */
};

#define CAN_HELD_MAX 64u /* frames that DELAY and REORDER hold; more are lost and counted */

struct can_held;

/* Filled in and owned by the caller; not moved while it is added. */
struct can_fault {
    enum can_fault_kind kind;
    const struct can_node *from[2]; /* frames of these; both NULL: of anybody */
    struct can_node *to;            /* and only as this one receives them; NULL: everybody. Not for ERROR */
    uint32_t id, mask;              /* and of identifiers equal to id in the bits of mask; 0: any */
    double probability;             /* that such a frame is hit: 0 .. 1 */
    uint32_t limit;                 /* ends after so many hits; 0: none */
    int64_t delay_ns;               /* DELAY, REORDER; REORDER: 0: wait for the next frame however long */
    struct rng rng;
    /* read-only outside can_fault.c */
    uint32_t hits, lost;
    struct can_bus *bus;
    struct can_held *held; /* oldest first, in slots of the bus */
    struct sched_ev due;
    struct can_fault *next;
};

void can_fault_add(struct can_bus *b, struct can_fault *f);

/* What it holds is received now. Harmless for one that is not added. */
void can_fault_remove(struct can_bus *b, struct can_fault *f, int64_t t_ns);

/* The node's controller goes off the bus at once, as after many errors, and comes back by itself as they do. Its frames
 * wait. */
void can_bus_off(struct can_bus *b, struct can_node *n, int64_t t_ns);

/* Of the node's controller. */
enum can_state can_node_state(const struct can_node *n);

#endif
