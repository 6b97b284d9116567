#include "link/mavlink/mav_wire.h"

#include <string.h>

size_t mav_frame(struct mav_sender *s, struct mav_kind kind, const void *payload, uint8_t out[MAV_FRAME_MAX])
{
    mavlink_message_t m;
    mavlink_status_t status = {.current_tx_seq = s->seq};
    m.msgid = kind.id & 0xFFFFFFu;
    memcpy(_MAV_PAYLOAD_NON_CONST(&m), payload, kind.len);
    (void)mavlink_finalize_message_buffer(&m, s->sysid, s->compid, &status, kind.min_len, kind.len, kind.crc_extra);
    s->seq = status.current_tx_seq;
    return mavlink_msg_to_send_buffer(out, &m);
}

bool mav_parse(struct mav_parser *p, uint8_t byte, mavlink_message_t *out)
{
    mavlink_status_t unused;
    const uint8_t result = mavlink_frame_char_buffer(&p->rx, &p->status, byte, out, &unused);
    p->malformed += result == MAVLINK_FRAMING_BAD_CRC;
    p->received += result == MAVLINK_FRAMING_OK;
    return result == MAVLINK_FRAMING_OK;
}

void mav_text(char *out, const char *field, size_t cap)
{
    const char *end = memchr(field, '\0', cap);
    const size_t n = end ? (size_t)(end - field) : cap;
    for (size_t i = 0; i < n; i++) out[i] = field[i] < ' ' || field[i] > '~' ? '?' : field[i];
    out[n] = '\0';
}
