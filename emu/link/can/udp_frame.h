/* A CAN frame in a datagram, as python-can's udp_multicast interface writes it: one msgpack map of eleven keys, pure codec.
 *
 * Source: python-can 4.6, interfaces/udp_multicast/utils.py (pack_message, unpack_message), and the msgpack specification.
 * Keys: timestamp (s), arbitration_id, is_extended_id, is_remote_frame, is_error_frame, channel, dlc (bytes), data, is_fd,
 * bitrate_switch, error_state_indicator. */
#ifndef PSABENCH_LINK_CAN_UDP_FRAME_H
#define PSABENCH_LINK_CAN_UDP_FRAME_H

#include "base/can/can.h"

#include <stddef.h>
#include <stdint.h>

#define UDP_FRAME_MAX 320u /* bytes that udp_frame_encode() needs at most, and the longest that is decoded */

/* Bytes written to out, the same ones that pack_message() writes; channel: up to 31 characters, NULL: nil. */
size_t udp_frame_encode(const struct can_msg *m, double timestamp_s, const char *channel, uint8_t out[UDP_FRAME_MAX]);

/* What unpack_message() takes, with its defaults for keys that are absent; the values of timestamp, channel and
 * error_state_indicator are passed over. False: not such a map, or not a frame (lengths, identifier or flags that no CAN frame has, error
 * frames, which no node can send); *out is untouched then. */
bool udp_frame_decode(const uint8_t *bytes, size_t size, struct can_msg *out);

#endif
