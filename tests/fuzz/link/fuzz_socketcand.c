/* socketcand: bytes to messages; an accepted frame is valid and has a text, a refusal has words. */
#include "fuzz.h"

#include "link/can/socketcand.h"
#include "link/lines.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char buf[SOCKETCAND_MSG_MAX + 1], text[SOCKETCAND_MSG_MAX];
    struct lines l;
    lines_init(&l, buf, sizeof buf, '>');
    for (size_t at = 0, used; at < size; at += used) {
        struct socketcand_msg m;
        if (lines_feed(&l, (const char *)data + at, size - at, &used) != LINES_LINE) continue;
        const enum socketcand_err err = socketcand_decode(l.buf, l.len, &m);
        assert(socketcand_strerror(err));
        if (err || m.verb != SOCKETCAND_SEND) continue;
        assert(can_valid(&m.frame));
        assert(socketcand_frame(&m.frame, INT64_MAX, 64, text, sizeof text) > 0);
    }
    return 0;
}
