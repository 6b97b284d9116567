#include "link/line/serial_pty.h"

#include <stdio.h>

void serial_pty_byte(void *ctx, uint8_t byte, int64_t t_ns)
{
    struct serial_pty *p = ctx;
    (void)t_ns;
    if (!p->open) return;
    if (p->count == SERIAL_PTY_RING) {
        p->pty.link.notice = "its reader is too slow: bytes are lost";
        return;
    }
    p->ring[(p->first + p->count++) % SERIAL_PTY_RING] = byte;
}

static bool start_port(void *ctx, int64_t t_ns)
{
    struct serial_pty *p = ctx;
    (void)t_ns;
    p->first = p->count = 0;
    return p->open = true;
}

static void stop_port(void *ctx)
{
    ((struct serial_pty *)ctx)->open = false;
}

static size_t take_bytes(void *ctx, uint8_t *buf, size_t cap)
{
    struct serial_pty *p = ctx;
    size_t n = 0;
    for (; n < cap && p->count; n++, p->count--) {
        buf[n] = p->ring[p->first];
        p->first = (p->first + 1) % SERIAL_PTY_RING;
    }
    return n;
}

static size_t count_waiting(void *ctx)
{
    return ((struct serial_pty *)ctx)->count;
}

int serial_pty_open(struct serial_pty *p, struct links *links, bool lossless, const char *name)
{
    const size_t high = lossless ? SERIAL_PTY_RING / 2 : 0;
    const struct line_source source = {p, start_port, stop_port, take_bytes, count_waiting, high};
    p->first = p->count = 0;
    p->open = false;
    const int err = line_pty_open(&p->pty, links, &source, name);
    if (!err) snprintf(p->pty.link.who, sizeof p->pty.link.who, "serial port %s", p->pty.pty.path);
    return err;
}

void serial_pty_close(struct serial_pty *p)
{
    line_pty_close(&p->pty);
}
