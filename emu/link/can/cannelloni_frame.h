/* Datagrams of cannelloni, format version 2: a header, then CAN frames one behind the other; pure codec.
 *
 *     version 2, op_code 0 (data), seq_no, count of frames (2 bytes)
 *     can_id (4 bytes, flags as in linux/can.h), len | 80h for FD, flags for FD only, data; a remote frame has none
 *
 * Numbers are big-endian. Source: cannelloni 2.1.1, doc/udp_format.md, parser.cpp. */
#ifndef PSABENCH_LINK_CAN_CANNELLONI_FRAME_H
#define PSABENCH_LINK_CAN_CANNELLONI_FRAME_H

#include "base/can/can.h"

#include <stddef.h>
#include <stdint.h>

enum {
    CANNELLONI_HEADER = 5,                /* bytes */
    CANNELLONI_FRAME_MAX = 4 + 1 + 1 + 64 /* bytes of a frame */
};

void cannelloni_put_header(uint8_t seq, uint16_t count, uint8_t out[CANNELLONI_HEADER]);

/* Bytes written. ESI is 0. */
size_t cannelloni_put_frame(const struct can_msg *m, uint8_t out[CANNELLONI_FRAME_MAX]);

/* Whether it is a datagram of data whose frames fill it exactly. False: *seq and *count are untouched. */
bool cannelloni_check(const uint8_t *bytes, size_t size, uint8_t *seq, unsigned *count);

/* The frame at the beginning; ESI is passed over. Returns its bytes, 0: cut short, or more than 64 bytes of data. It may be
 * one that no CAN has: can_valid(). */
size_t cannelloni_take_frame(const uint8_t *bytes, size_t size, struct can_msg *m);

#endif
