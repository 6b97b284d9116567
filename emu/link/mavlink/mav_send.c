/* What every file of the station sends with. */
#include "link/mavlink/mav_station.h"

#include <string.h>

void mav_send(struct mav_station *s, struct mav_kind kind, const void *payload)
{
    uint8_t frame[MAV_FRAME_MAX];
    const size_t n = mav_frame(&s->sender, kind, payload, frame);
    s->counters.sent++;
    s->io.send(s->io.ctx, frame, n);
}

uint64_t mav_time_us(const struct mav_station *s, int64_t t_ns)
{
    return (uint64_t)(t_ns + s->cfg.epoch_ns) / 1000u;
}

bool mav_is_for_us(const struct mav_station *s, uint8_t sysid, uint8_t compid)
{
    return (sysid == 0 || sysid == s->cfg.sysid) && (compid == 0 || compid == s->cfg.compid);
}

void mav_text_out(struct mav_station *s, uint8_t severity, const char *text)
{
    enum { CHUNK = MAVLINK_MSG_STATUSTEXT_FIELD_TEXT_LEN, CHUNKS_MAX = 8 };
    const size_t len = strlen(text);
    if (len > CHUNK && ++s->text_id == 0) s->text_id = 1;
    for (size_t at = 0, k = 0; (at < len || k == 0) && k < CHUNKS_MAX; at += CHUNK, k++) {
        mavlink_statustext_t m = {.severity = severity, .id = len > CHUNK ? s->text_id : 0, .chunk_seq = (uint8_t)k};
        const size_t left = len - at;
        memcpy(m.text, text + at, left < CHUNK ? left : CHUNK);
        mav_send(s, MAV_KIND(STATUSTEXT), &m);
    }
}
