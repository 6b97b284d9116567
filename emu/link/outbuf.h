/* Output that waits for the kernel: whole messages in, bytes out, bounded. One thread; storage from the heap. */
#ifndef PSABENCH_LINK_OUTBUF_H
#define PSABENCH_LINK_OUTBUF_H

#include <stdbool.h>
#include <stddef.h>

struct outbuf { /* read-only outside outbuf.c */
    char *buf;
    size_t cap, head, tail;
};

/* False when there is no memory. */
bool outbuf_init(struct outbuf *o, size_t cap);
void outbuf_free(struct outbuf *o);

/* The whole message or nothing: false when it does not fit. */
bool outbuf_put(struct outbuf *o, const void *bytes, size_t n);

/* Writes what the descriptor takes. 0, or -errno when the peer has gone; a full kernel buffer is no error. */
int outbuf_flush(struct outbuf *o, int fd);

void outbuf_clear(struct outbuf *o);

static inline size_t outbuf_pending(const struct outbuf *o)
{
    return o->tail - o->head;
}

#endif
