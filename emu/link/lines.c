#include "link/lines.h"

#include <assert.h>
#include <string.h>

void lines_init(struct lines *l, char *buf, size_t cap, char end)
{
    assert(cap > 1);
    *l = (struct lines){.buf = buf, .cap = cap, .end = end};
}

void lines_reset(struct lines *l)
{
    l->fill = l->len = 0;
    l->skipping = false;
}

static void store_bytes(struct lines *l, const char *in, size_t n)
{
    if (l->skipping) return;
    if (n > l->cap - 1 - l->fill) {
        l->skipping = true;
        return;
    }
    memcpy(l->buf + l->fill, in, n);
    l->fill += n;
}

static enum lines_result finish_line(struct lines *l)
{
    const bool overlong = l->skipping;
    l->len = overlong ? 0 : l->fill;
    l->buf[l->len] = '\0';
    l->fill = 0;
    l->skipping = false;
    l->overlong += overlong;
    return overlong ? LINES_OVERLONG : LINES_LINE;
}

enum lines_result lines_feed(struct lines *l, const char *in, size_t n, size_t *used)
{
    const char *end = n ? memchr(in, l->end, n) : NULL;
    const size_t take = end ? (size_t)(end - in) : n;
    if (take) store_bytes(l, in, take);
    *used = end ? take + 1 : take;
    return end ? finish_line(l) : LINES_MORE;
}
