/* slcan: bytes to lines to frames; what is accepted is a valid frame and has the same length of text again. */
#include "fuzz.h"

#include "link/can/slcan.h"
#include "link/lines.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char buf[SLCAN_LINE_MAX + 1], again[SLCAN_LINE_MAX];
    struct lines l;
    lines_init(&l, buf, sizeof buf, '\r');
    for (size_t at = 0, used; at < size; at += used) {
        struct can_msg m;
        if (lines_feed(&l, (const char *)data + at, size - at, &used) != LINES_LINE) continue;
        if (slcan_decode(l.buf, l.len, &m)) continue;
        assert(can_valid(&m));
        assert(slcan_encode(&m, again, sizeof again) == l.len);
    }
    return 0;
}
