/* Adapter: a serial port of a board on a pseudo-terminal, bytes out of the board alone.
 *
 * Bytes that leave while no program has the port open are gone, as on a wire. In wall pace a reader that is too slow loses
 * bytes; otherwise time waits for it. What a reader writes is discarded. */
#ifndef PSABENCH_LINK_LINE_SERIAL_PTY_H
#define PSABENCH_LINK_LINE_SERIAL_PTY_H

#include "link/line/line_pty.h"

#define SERIAL_PTY_RING 16384u

struct serial_pty {
    struct line_pty pty;           /* first */
    uint8_t ring[SERIAL_PTY_RING]; /* not yet taken by the pseudo-terminal */
    size_t first, count;
    bool open;
};

/* 0, or -errno. The struct must not move afterwards. lossless: time waits for a slow reader. name: symbolic link, may be NULL;
 * kept by pointer. */
int serial_pty_open(struct serial_pty *p, struct links *links, bool lossless, const char *name);
void serial_pty_close(struct serial_pty *p);

/* A byte has left the board: ctx is the struct serial_pty. */
void serial_pty_byte(void *ctx, uint8_t byte, int64_t t_ns);

#endif
