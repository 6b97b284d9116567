#include "link/can/cannelloni_frame.h"

#include "base/bits.h"

#include <string.h>

enum { VERSION = 2, DATA = 0, FD_LEN = 0x80, FD_BRS = 0x01, RTR_BYTE = 0x40 /* in the first byte of can_id */ };
enum { ID_MASK = 0x1FFFFFFF, BASE = 5 /* can_id and len */ };

/* linux/can.h: flags of can_id. */
static const struct {
    uint32_t bit;
    uint8_t flag;
} id_flags[] = {{UINT32_C(1) << 31, CAN_EXT}, {UINT32_C(1) << 30, CAN_RTR}, {UINT32_C(1) << 29, CAN_ERROR}};
enum { ID_FLAGS = sizeof id_flags / sizeof *id_flags };

void cannelloni_put_header(uint8_t seq, uint16_t count, uint8_t out[CANNELLONI_HEADER])
{
    out[0] = VERSION;
    out[1] = DATA;
    out[2] = seq;
    bits_put_be(out + 3, count, 2);
}

size_t cannelloni_put_frame(const struct can_msg *m, uint8_t out[CANNELLONI_FRAME_MAX])
{
    const bool is_fd = m->flags & CAN_FD;
    const size_t data = m->flags & CAN_RTR ? 0 : m->len;
    uint8_t *p = out + BASE;
    uint32_t id = m->id;
    for (unsigned i = 0; i < ID_FLAGS; i++)
        if (m->flags & id_flags[i].flag) id |= id_flags[i].bit;
    bits_put_be(out, id, 4);
    out[4] = (uint8_t)(m->len | (is_fd ? FD_LEN : 0));
    if (is_fd) *p++ = m->flags & CAN_BRS ? FD_BRS : 0;
    memcpy(p, m->data, data);
    return (size_t)(p - out) + data;
}

/* Bytes of the frame at the beginning; 0: cut short, or more data than a frame has. */
static size_t frame_size(const uint8_t *bytes, size_t size)
{
    if (size < BASE) return 0;
    const size_t head = BASE + (bytes[4] & FD_LEN ? 1 : 0);
    const size_t data = bytes[0] & RTR_BYTE ? 0 : bytes[4] & (FD_LEN - 1);
    return data > CANNELLONI_FRAME_MAX - BASE - 1 || size < head + data ? 0 : head + data;
}

size_t cannelloni_take_frame(const uint8_t *bytes, size_t size, struct can_msg *m)
{
    const size_t n = frame_size(bytes, size);
    if (!n) return 0;
    const uint32_t id = (uint32_t)bits_get_be(bytes, 4);
    const bool is_fd = bytes[4] & FD_LEN;
    const size_t head = BASE + (is_fd ? 1 : 0);
    *m = (struct can_msg){.id = id & ID_MASK, .flags = is_fd ? CAN_FD : 0, .len = bytes[4] & (FD_LEN - 1)};
    for (unsigned i = 0; i < ID_FLAGS; i++)
        if (id & id_flags[i].bit) m->flags |= id_flags[i].flag;
    if (is_fd && bytes[BASE] & FD_BRS) m->flags |= CAN_BRS;
    memcpy(m->data, bytes + head, n - head);
    return n;
}

bool cannelloni_check(const uint8_t *bytes, size_t size, uint8_t *seq, unsigned *count)
{
    if (size < CANNELLONI_HEADER || bytes[0] != VERSION || bytes[1] != DATA) return false;
    const unsigned frames = (unsigned)bits_get_be(bytes + 3, 2);
    size_t at = CANNELLONI_HEADER;
    for (unsigned i = 0; i < frames; i++) {
        const size_t n = frame_size(bytes + at, size - at);
        if (!n) return false;
        at += n;
    }
    if (at != size) return false;
    *seq = bytes[2];
    *count = frames;
    return true;
}
