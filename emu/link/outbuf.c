#include "link/outbuf.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

bool outbuf_init(struct outbuf *o, size_t cap)
{
    *o = (struct outbuf){.buf = malloc(cap), .cap = cap};
    return o->buf != NULL;
}

void outbuf_free(struct outbuf *o)
{
    free(o->buf);
    *o = (struct outbuf){0};
}

void outbuf_clear(struct outbuf *o)
{
    o->head = o->tail = 0;
}

bool outbuf_put(struct outbuf *o, const void *bytes, size_t n)
{
    if (n > o->cap - outbuf_pending(o)) return false;
    if (n > o->cap - o->tail) {
        memmove(o->buf, o->buf + o->head, outbuf_pending(o));
        o->tail -= o->head;
        o->head = 0;
    }
    memcpy(o->buf + o->tail, bytes, n);
    o->tail += n;
    return true;
}

int outbuf_flush(struct outbuf *o, int fd)
{
    while (o->head < o->tail) {
        const ssize_t n = write(fd, o->buf + o->head, o->tail - o->head);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -errno;
        o->head += (size_t)n;
    }
    outbuf_clear(o);
    return 0;
}
