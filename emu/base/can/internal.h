/* What can.c (bus), can_error.c (error confinement) and can_fault.c (fault injection) share. Not for others. */
#ifndef PSABENCH_BASE_CAN_INTERNAL_H
#define PSABENCH_BASE_CAN_INTERNAL_H

#include "base/can/can.h"

/* Fault injection (can_fault.c). */
struct can_tap {
    int64_t (*error_after_ns)(struct can_bus *b); /* from start of frame to its error; -1: the frame is not destroyed */
    void (*deliver)(struct can_bus *b, int64_t t_ns); /* the frame on the wire to its receivers */
    void (*detach)(struct can_bus *b, struct can_node *n);
    void (*replace)(struct can_bus *b, struct can_node *n, struct can_node *by);
};

/* can.c, for can_fault.c */
void can_deliver(struct can_node *n, const struct can_msg *m, int64_t t_ns);
void can_deliver_all(struct can_bus *b, const struct can_msg *m, const struct can_node *sender, int64_t t_ns);

/* can_error.c */
int64_t can_nominal_ns(const struct can_bus *b, int64_t bits); /* time of bits; of an ideal bus: at 1 Mbit/s */
bool can_is_sending(const struct can_bus *b, const struct can_node *controller); /* at this instant */
bool can_shares(const struct can_node *n, const struct can_node *controller);    /* sends through this controller */
void can_update_degraded(struct can_bus *b);
void can_start_error_frame(struct can_bus *b, int64_t end_ns);
void can_interrupt_frame(struct can_bus *b, int64_t t_ns); /* its sender stops in the middle */
void can_requeue_wire(struct can_bus *b, bool repeat);     /* the sender's frame comes first again */
struct can_node *can_suspended(struct can_bus *b, const struct can_node *winner); /* its controller, or NULL; once */

/* can_error.c: called only while b->degraded. */
void can_error_frame_start(struct can_bus *b, int64_t t_ns);
void can_error_frame_passed(struct can_bus *b, struct can_node *sender, int64_t t_ns);
void can_error_frame_destroyed(struct can_bus *b, int64_t t_ns); /* end of the error frame's delimiter */
void can_error_recessive(struct can_bus *b, int64_t t_ns);       /* end of an interframe space */
void can_error_detach(struct can_bus *b, struct can_node *n);
void can_error_replace(struct can_bus *b, struct can_node *n, struct can_node *by);

#endif
