/* Datagrams of cannelloni: the frames of one that is accepted fill it exactly, and each valid one is the same frame after
 * another round. */
#include "fuzz.h"

#include "link/can/cannelloni_frame.h"

#include <string.h>

static void check_round(const struct can_msg *m)
{
    uint8_t bytes[CANNELLONI_FRAME_MAX];
    struct can_msg again;
    const size_t n = cannelloni_put_frame(m, bytes);
    assert(n <= sizeof bytes && cannelloni_take_frame(bytes, n, &again) == n);
    assert(again.id == m->id && again.flags == m->flags && again.len == m->len);
    assert(m->flags & CAN_RTR || memcmp(again.data, m->data, m->len) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t seq, header[CANNELLONI_HEADER];
    unsigned count;
    size_t at = CANNELLONI_HEADER;
    if (!cannelloni_check(data, size, &seq, &count)) return 0;
    cannelloni_put_header(seq, (uint16_t)count, header);
    assert(memcmp(header, data, sizeof header) == 0);
    for (unsigned i = 0; i < count; i++) {
        struct can_msg m;
        const size_t n = cannelloni_take_frame(data + at, size - at, &m);
        assert(n && n <= CANNELLONI_FRAME_MAX);
        if (can_valid(&m)) check_round(&m);
        at += n;
    }
    assert(at == size);
    return 0;
}
