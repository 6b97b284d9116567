/* Error confinement of a CAN bus: error counters, states of controllers, bus-off and recovery. See base/can/can.h.
 *
 * ISO 11898-1 (2015), 12.1: a destroyed frame adds 8 to its sender's TEC and 1 to the REC of each receiver, a frame that
 * passes takes 1 from all. At 96 a node is in error warning, above 127 it is error-passive and suspends transmission for 8 bits after its own frames,
 * above 255 it is bus-off until it has seen 11 recessive bits 128 times. States have the names of linux/can/netlink.h.
 * Simplified: the sender detects the error itself (bit error), so that flags overlap to 12 bits; overload frames do not
 * occur; an unacknowledged frame passes. An ideal bus has no error frames, and bus-off there lasts as at 1 Mbit/s. */
#ifndef PSABENCH_BASE_CAN_ERROR_H
#define PSABENCH_BASE_CAN_ERROR_H

#include <stdint.h>

struct can_bus;
struct can_node;

enum can_state { CAN_STATE_ERROR_ACTIVE, CAN_STATE_ERROR_WARNING, CAN_STATE_ERROR_PASSIVE, CAN_STATE_BUS_OFF };

/* Error message, argument of can_node.error: a can_msg with CAN_ERROR and 8 bytes in the bits of linux/can/error.h. id is
 * the class, data[1] the state of the node's own controller, data[2] the error in the frame, data[6] and data[7] the
 * controller's TEC and REC, up to 255. */
enum {
    CAN_CLASS_CONTROLLER = 0x004, /* new state in data[1]: bits of the next enum */
    CAN_CLASS_PROTOCOL = 0x008,   /* with the next: data[2] 81h for the sender, bit error; 04h: stuff error */
    CAN_CLASS_BUS_ERROR = 0x080,  /* an error frame was on the bus */
    CAN_CLASS_BUS_OFF = 0x040,    /* the controller is bus-off */
    CAN_CLASS_RESTARTED = 0x100   /* and has recovered */
};

/* data[1]: the counter that is responsible, or error-active again. */
enum {
    CAN_CONTROLLER_RX_WARNING = 0x04,
    CAN_CONTROLLER_TX_WARNING = 0x08,
    CAN_CONTROLLER_RX_PASSIVE = 0x10,
    CAN_CONTROLLER_TX_PASSIVE = 0x20,
    CAN_CONTROLLER_ACTIVE = 0x40
};

/* The node's controller goes bus-off at once, as after many errors, and recovers by itself. Its frames wait. */
void can_bus_off(struct can_bus *b, struct can_node *n, int64_t t_ns);

/* The node whose controller this one uses: its tec, rec and error_state. */
const struct can_node *can_controller(const struct can_node *n);

#endif
