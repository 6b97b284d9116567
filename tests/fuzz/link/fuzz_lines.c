/* Bytes to lines in pieces of any size, against a reader of the whole; hexadecimal digits there and back. */
#include "fuzz.h"

#include "base/hex.h"
#include "link/lines.h"

#include <string.h>

enum { CAP_MAX = 32 };

static void digits(const char *line, size_t len)
{
    char again[8];
    const int64_t v = hex_get(line, len);
    assert(v >= -1 && v <= UINT32_MAX && (v == -1 || len <= 8));
    if (v < 0) return;
    hex_put(again, (uint32_t)v, len);
    for (size_t i = 0; i < len; i++) assert(hex_digit(again[i]) == hex_digit(line[i]));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char buf[CAP_MAX];
    struct script s = script_of(data, size);
    const size_t cap = 2 + script_byte(&s) % (CAP_MAX - 1);
    const size_t piece = 1 + script_byte(&s) % 16;
    const char *text = (const char *)s.at, *end = (const char *)s.end, *line = text;
    uint32_t overlong = 0;
    struct lines l;
    lines_init(&l, buf, cap, '\r');
    for (size_t used; text < end; text += used) {
        const size_t left = (size_t)(end - text), n = left < piece ? left : piece;
        const enum lines_result r = lines_feed(&l, text, n, &used);
        assert(used > 0 && used <= n);
        if (r == LINES_MORE) {
            assert(used == n && !memchr(text, '\r', n));
            continue;
        }
        const size_t len = (size_t)(text + used - 1 - line);
        assert(text[used - 1] == '\r');
        assert((r == LINES_OVERLONG) == (len > cap - 1));
        if (r == LINES_LINE) assert(l.len == len && memcmp(l.buf, line, len) == 0 && l.buf[len] == '\0');
        if (r == LINES_LINE) digits(l.buf, l.len);
        overlong += r == LINES_OVERLONG;
        assert(l.overlong == overlong);
        line = text + used;
    }
    return 0;
}
