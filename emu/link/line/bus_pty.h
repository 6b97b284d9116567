/* Adapter: the bus port, a pseudo-terminal with line-delimited read and write cycles of a board's parallel bus.
 *
 * The text is that of line/bus_text.h; docs/busport.md is its page. One client; lines are carried out one after the other: the next
 * is taken when the one before has been answered, so that a host may send many at once. A cycle takes simulated time: in
 * step pace it ends when the bench is commanded to run. What a client that has left had sent is still carried out, the answers
 * are thrown away. */
#ifndef PSABENCH_LINK_LINE_BUS_PTY_H
#define PSABENCH_LINK_LINE_BUS_PTY_H

#include "link/line/bus_text.h"
#include "link/pty.h"
#include "link/text_link.h"

/* The board, in the application's hands. */
struct bus_pty_ops {
    void *ctx;
    /* Begins a cycle (never BUS_WHO). NULL: it is under way, bus_pty_done() or bus_pty_failed() comes later, not from
     * inside; else the code word of the rejection. */
    const char *(*submit)(void *ctx, const struct bus_request *r, int64_t t_ns);
    const char *board;                                /* "psd1" */
    unsigned addresses;                               /* from 0 */
    const char *(*name)(void *ctx, unsigned address); /* of what is there; NULL: nothing */
};

struct bus_pty {
    struct text_link io; /* first: the master */
    struct pty pty;
    struct bus_pty_ops ops;
    struct bus_request request; /* under way */
    bool busy;
    bool orphan; /* its client has left: another one gets no answer to it */
};

/* 0, or -errno. The struct must not move afterwards. name: symbolic link, may be NULL; kept by pointer. */
int bus_pty_open(struct bus_pty *p, struct links *links, const struct bus_pty_ops *ops, const char *name);
void bus_pty_close(struct bus_pty *p); /* a cycle under way is no longer waited for: done and failed do nothing */

/* The cycle under way has ended, carried out or not; the next line is taken. */
void bus_pty_done(struct bus_pty *p, uint16_t data, int64_t t_ns);
void bus_pty_failed(struct bus_pty *p, const char *code, int64_t t_ns);

#endif
