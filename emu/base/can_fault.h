/* Faults of a CAN bus: what befalls frames, error counters of nodes, bus-off. See base/can.h.
 *
 * Error frames and counters follow ISO 11898-1 (2015), 12.1: a frame that is destroyed costs its sender 8 and each receiver
 * 1, one that passes gives 1 back to all; above 127 a node is error-passive and waits 8 bits longer after its own frames, above 255
 * it is off the bus until it has seen 128 times 11 recessive bits. The other kinds are not of the wire but of links and
 * gateways: the sender believes that its frame has arrived.
 * Simplified: the sender finds the error itself (bit error), so that flags overlap to 12 bits; nobody sends overload frames;
 * an unacknowledged frame passes. An ideal bus has no error frames, and bus-off there lasts as at 1 Mbit/s. */
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

/* What a node is told by can_node.error: a can_msg with CAN_ERROR and 8 bytes in the bits of linux/can/error.h. id is the
 * class, data[1] the state of the node's own controller, data[2] what was wrong with the frame, data[6] and data[7] the
 * controller's TEC and REC, up to 255. */
enum {
    CAN_CLASS_CONTROLLER =
        0x004,                  /* it has become error-passive, data[1] 10h (REC) or 20h (TEC), or active again, 40h */
    CAN_CLASS_PROTOCOL = 0x008, /* with the next: data[2] 81h for the sender, which saw a wrong bit; 04h: stuff error */
    CAN_CLASS_BUS_ERROR = 0x080, /* an error frame was on the bus */
    CAN_CLASS_BUS_OFF = 0x040,   /* it has left the bus */
    CAN_CLASS_RESTARTED = 0x100  /* and is back */
};

enum can_fault_kind {
    CAN_FAULT_DROP,      /* not received, though the sender thinks so */
    CAN_FAULT_DUPLICATE, /* received twice: the sender missed the end of its frame and repeats it (one receiver: at once) */
    CAN_FAULT_REORDER, /* received after the next frame that the fault picks, or after delay_ns */
    CAN_FAULT_DELAY,   /* received delay_ns later */
    CAN_FAULT_ALTER,   /* a data bit is inverted and nobody notices: as by a gateway, not by the wire with its CRC */
    CAN_FAULT_ERROR /* destroyed by an error frame, and sent again until the sender is off the bus; none on an ideal bus */
};

#define CAN_HELD_MAX 64u /* frames that DELAY and REORDER hold; more are lost and counted */

/* Filled in and owned by the caller; not moved while it is added. */
struct can_fault {
    enum can_fault_kind kind;
    const struct can_node *from; /* frames of this one and of those that share its controller; NULL: of anybody */
    struct can_node *to;         /* and only as this one receives them; NULL: everybody. Not for ERROR */
    uint32_t id, mask;           /* and of identifiers equal to id in the bits of mask; 0: any */
    double probability;          /* that such a frame is hit: 0 .. 1 */
    uint32_t limit;              /* ends after so many hits; 0: none */
    int64_t delay_ns;            /* DELAY, REORDER; REORDER: 0: wait for the next frame however long */
    struct rng rng;
    /* read-only outside can_fault.c */
    uint32_t hits, lost;
    struct can_bus *bus;
    unsigned held; /* frames */
    struct sched_ev due;
    struct can_fault *next;
};

void can_fault_add(struct can_bus *b, struct can_fault *f);

/* What it holds is received now. Harmless for one that is not added. */
void can_fault_remove(struct can_bus *b, struct can_fault *f, int64_t t_ns);

/* The node goes for good: faults that name it end. */
void can_fault_forget(struct can_bus *b, const struct can_node *n);

/* The node loses its power: what it sends breaks off, which the others see as an error frame, then can_detach(). */
void can_unplug(struct can_bus *b, struct can_node *n, int64_t t_ns);

/* The node's controller goes off the bus at once, as after many errors, and comes back by itself as they do. Its frames
 * wait. */
void can_bus_off(struct can_bus *b, struct can_node *n, int64_t t_ns);

/* The node whose controller this one uses: its tec, rec and state. */
const struct can_node *can_controller(const struct can_node *n);

#endif
