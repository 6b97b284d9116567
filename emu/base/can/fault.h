/* Fault injection into a CAN bus (base/can/can.h): frames lost, doubled, late, out of order, altered, destroyed.
 *
 * A destroyed frame (ERROR) is an error on the wire, with all that error confinement makes of it (can_error.h). The other
 * kinds are faults of links and gateways: the sender believes that its frame has arrived. */
#ifndef PSABENCH_BASE_CAN_FAULT_H
#define PSABENCH_BASE_CAN_FAULT_H

#include "base/can/can.h"
#include "base/rng.h"

enum can_fault_kind {
    CAN_FAULT_DROP,      /* not received, but acknowledged */
    CAN_FAULT_DUPLICATE, /* received twice: the sender missed the end of its frame and repeats it (one receiver: at once) */
    CAN_FAULT_REORDER, /* received after the next frame that the fault picks, or after delay_ns */
    CAN_FAULT_DELAY,   /* received delay_ns later */
    CAN_FAULT_ALTER,   /* a data bit is inverted and the CRC is right: the fault of a gateway, not of the wire */
    CAN_FAULT_ERROR /* destroyed by an error frame, and sent again until the sender is off the bus; none on an ideal bus */
};

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

#endif
