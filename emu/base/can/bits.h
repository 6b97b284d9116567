/* Length of a CAN frame in bits, start of frame to the end of the 3-bit interframe space (ISO 11898-1).
 *
 * Exact: the stuff bits of the actual content are counted, in a classic frame those of its CRC too. FD (ISO form, with
 * stuff count): dynamic stuffing up to the last data bit, then fixed stuff bits, whose number does not depend on content.
 * A bit rate switch is counted at the boundary of bits: BRS and the CRC delimiter are whole nominal bits, where silicon
 * switches at their sample points (0.8 us less at 1/5 Mbit/s with samples at 80 %). Pure. */
#ifndef PSABENCH_BASE_CAN_BITS_H
#define PSABENCH_BASE_CAN_BITS_H

#include "base/can/can.h"

#include <stdint.h>

#define CAN_IFS_BITS 3u /* interframe space: the last bits of every count below */

/* Bits at the nominal rate and at the data rate; data is 0 without CAN_BRS. */
struct can_bits {
    unsigned nominal, data;
};

/* Of this very frame; it must be can_valid(). */
struct can_bits can_bits_exact(const struct can_msg *m);

/* Bound over all identifiers and contents for flags (CAN_EXT, CAN_RTR, CAN_FD, CAN_BRS) and a valid len: a stuff bit wherever
 * the stuffing rule allows one. */
struct can_bits can_bits_worst(uint8_t flags, uint8_t len);

/* Time they take, each phase rounded to the nearest nanosecond; 0 on an ideal bus. */
int64_t can_bits_ns(struct can_bits n, const struct can_bus_cfg *cfg);

/* Code of a length in the frame's DLC field (9..15 for 12..64 bytes; the next larger one for an odd length). */
uint8_t can_dlc(uint8_t len);

#endif
