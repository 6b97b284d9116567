/* What the application's one poll loop knows of a link: a descriptor and what to do when it is ready.
 *
 * Links never block and never read a clock: input is stamped with the simulated instant the loop hands in. A turn of the
 * loop is: run what is due, flush every link, poll, deliver input, fire timers, reap. A link is embedded in its adapter's
 * struct, which owns it; one thread. */
#ifndef PSABENCH_LINK_LINK_H
#define PSABENCH_LINK_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LINK_WHO_MAX = 96 };

struct link {
    int fd;            /* -1: not in use */
    bool want_read;    /* false: the loop leaves input in the kernel (back-pressure) */
    bool want_write;   /* true while output waits */
    bool full;         /* output is above its high-water mark: in step and free pace time stands still meanwhile */
    bool linger;       /* at the end of a run the loop waits a while for the peer to hang up first */
    bool is_pty;       /* hangs up while no program has it open: then the loop sets `idle` */
    bool idle;         /* not polled; pty.c ends it when a program opens the port */
    bool gone;         /* to be reaped: release() is the last call */
    bool slow;         /* the loop's: said that time waits for it */
    size_t pending;    /* bytes of output not yet handed to the kernel */
    unsigned timer_ms; /* > 0: timer() is called once, this wall time from now; zeroed by the loop when it takes note */
    void (*readable)(struct link *l, int64_t t_ns);
    void (*flush)(struct link *l, int64_t t_ns); /* every turn and when writable: hand out what waits; may be NULL */
    void (*timer)(struct link *l, int64_t t_ns); /* may be NULL */
    void (*release)(struct link *l);             /* free what the link is in; may be NULL */
    void *ctx;
    char who[LINK_WHO_MAX]; /* in messages: what it is, and which one */
    const char *notice;     /* news for the user, said by the loop: "<who>: <notice>" */
    int64_t timer_due_ns;   /* the loop's: wall time, 0 while none is armed */
    struct link *next;      /* the loop's list */
};

/* In order of service: a control socket comes after the CAN links, so that frames sent before a command arrive before it. */
struct links {
    struct link *first;
};

void links_add_first(struct links *ls, struct link *l);
void links_add_last(struct links *ls, struct link *l);

/* Closes the descriptor; the link is gone. Harmless once more. */
void link_close(struct link *l);

/* Unlinks and releases the links that are gone. */
void links_reap(struct links *ls);

bool links_full(const struct links *ls);
size_t links_pending(const struct links *ls);
bool links_linger(const struct links *ls);

#endif
