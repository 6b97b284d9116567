/* MAVLink on the wire: the generated headers of proto/mavlink, and frames made and parsed with them.
 *
 * Pure: no I/O, no globals; a sender keeps its sequence number, a peer its parser. MAVLink 2 goes out, 1 and 2 are understood.
 * Signatures are neither made nor checked: everything stays on this machine. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_WIRE_H
#define PSABENCH_LINK_MAVLINK_MAV_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MAVLINK_COMM_NUM_BUFFERS 1
#define MAVLINK_NO_CONVERSION_HELPERS
#define MAVLINK_NO_SIGNATURE_CHECK
#define MAVLINK_NO_SIGN_PACKET
#include <psabench/mavlink.h>

enum { MAV_FRAME_MAX = MAVLINK_MAX_PACKET_LEN };

struct mav_sender {
    uint8_t sysid, compid, seq; /* seq: of the next frame */
};

/* Number, lengths and checksum seed of a message, as mav_frame() takes them: MAV_KIND(HEARTBEAT). */
struct mav_kind {
    uint32_t id;
    uint8_t min_len, len, crc_extra;
};
#define MAV_KIND(name)                                                                                                 \
    ((struct mav_kind){MAVLINK_MSG_ID_##name, MAVLINK_MSG_ID_##name##_MIN_LEN, MAVLINK_MSG_ID_##name##_LEN,            \
                       MAVLINK_MSG_ID_##name##_CRC})

/* A whole frame of the message, whose generated struct is at `payload`; its length. */
size_t mav_frame(struct mav_sender *s, struct mav_kind kind, const void *payload, uint8_t out[MAV_FRAME_MAX]);

struct mav_parser { /* all zero: at the beginning */
    mavlink_message_t rx;
    mavlink_status_t status;
    uint32_t received, malformed; /* malformed: bad checksum, or a message that the dialect does not have */
};

/* One byte; true: a message is complete, and in *out. */
bool mav_parse(struct mav_parser *p, uint8_t byte, mavlink_message_t *out);

/* Text of a field of `cap` characters, which has no NUL where it is full; what is not printable ASCII becomes '?'. out has cap + 1. */
void mav_text(char *out, const char *field, size_t cap);

#endif
