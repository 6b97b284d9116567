/* SDO client of the MAVLink link: one expedited access at a time, over the bus, in frames that everybody sees.
 *
 * It is a client of the CAN hub from its first access on (so that snapshots repeat its frames), and it waits its turn: while
 * another host has an access under way at the same unit, its own does not begin. An access that the unit does not answer
 * within MAV_SDO_TIMEOUT_NS ends. Owned by the link, one thread, no allocation. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_SDO_H
#define PSABENCH_LINK_MAVLINK_MAV_SDO_H

#include "base/sched.h"
#include "link/can/can_hub.h"

#define MAV_SDO_TIMEOUT_NS NS_PER_S
#define MAV_SDO_NO_ANSWER  0x05040000u /* the abort code of CiA 301 for it */

struct mav_access {
    bool write;
    uint16_t index;
    uint8_t sub, bytes; /* bytes: of a write, 1..4 */
    uint32_t raw;       /* of a write */
};

struct mav_sdo {
    struct can_hub *hub;
    struct sched *sched;
    uint8_t node;
    /* The access is over: abort 0 and of a read the bytes, little-endian; or the abort code. It may begin the next one. */
    void (*done)(void *ctx, uint32_t abort, uint32_t raw, int64_t t_ns);
    void *ctx;
    /* read-only outside mav_sdo.c */
    struct can_client client;
    enum mav_sdo_state { MAV_SDO_IDLE, MAV_SDO_WAITING, MAV_SDO_SENT } state;
    struct mav_access access;
    struct can_msg request;
    bool other_last;       /* the other host's latest request ends its transfer, if the unit confirms it */
    int64_t busy_until_ns; /* another host's access is under way, at most until then */
    struct sched_ev ev;
    uint32_t timeouts, aborts;
};

/* hub, sched, node, done and ctx are filled in by the caller. */
void mav_sdo_init(struct mav_sdo *s);

/* Idle only. The request goes out with a turn of the loop, as the frames of every other program. */
void mav_sdo_begin(struct mav_sdo *s, const struct mav_access *a);
void mav_sdo_turn(struct mav_sdo *s, int64_t t_ns);

/* Every frame of the bus, its own included. */
void mav_sdo_frame(struct mav_sdo *s, const struct can_msg *m, int64_t t_ns);

void mav_sdo_close(struct mav_sdo *s);

static inline bool mav_sdo_idle(const struct mav_sdo *s)
{
    return s->state == MAV_SDO_IDLE;
}

#endif
