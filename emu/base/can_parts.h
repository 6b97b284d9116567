/* What can.c (the bus as it should be) and can_fault.c (as it should not) share. Not for others. */
#ifndef PSABENCH_BASE_CAN_PARTS_H
#define PSABENCH_BASE_CAN_PARTS_H

#include "base/can.h"

/* can.c */
struct can_node *can_winner(const struct can_bus *b, unsigned *slot); /* of an arbitration now, or NULL */
void can_give(struct can_node *n, const struct can_msg *m, int64_t t_ns);
void can_start_ifs(struct can_bus *b, int64_t t_ns);

/* can_fault.c: called only while b->odd. */
bool can_odd_wait(struct can_bus *b, struct can_node **n, unsigned *slot, int64_t t_ns); /* nobody may send yet */
bool can_odd_start(struct can_bus *b, unsigned slot, int64_t t_ns); /* true: an error frame will destroy it */
void can_odd_end(struct can_bus *b, int64_t t_ns);                  /* of a frame */
void can_odd_error(struct can_bus *b, int64_t t_ns);                /* end of an error frame's delimiter */
void can_odd_recessive(struct can_bus *b, int64_t t_ns);            /* end of an interframe space */
void can_odd_detach(struct can_bus *b, struct can_node *n);
void can_odd_replace(struct can_bus *b, struct can_node *n, struct can_node *by);

#endif
