/* Readings of a PSA-2 unit out of its CAN frames, all four forms (docs/reference/protocol.md). No I/O. */
#ifndef PSABENCH_APP_MAVLINK_PSA2_H
#define PSABENCH_APP_MAVLINK_PSA2_H

#include "base/can.h"
#include "link/mavlink/mav_station.h"

#define MAVLINK_PSA2_READINGS 5u /* most in one frame */

struct mavlink_psa2 { /* all zero but the node: at the beginning */
    uint8_t node;
    struct can_msg xy; /* first half of a pair */
    bool has_xy, has_seq, has_toggle;
    uint16_t seq;
    uint8_t toggle;
    uint32_t block_us; /* time stamp of the latest block */
    bool has_block;
};

/* Readings that are complete with this frame, oldest first; their number. */
unsigned mavlink_psa2_take(struct mavlink_psa2 *d, const struct can_msg *m, int64_t t_ns,
                           struct mav_reading out[MAVLINK_PSA2_READINGS]);

#endif
