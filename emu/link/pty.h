/* A pseudo-terminal that represents a serial port: raw, with a symbolic link to it; counts the programs that have it open.
 * The port is locked (own_file.h): who wants the same link sees that it is served, and by whom.
 *
 * We do not keep the slave open: the master's hang-up then says that no client has. A client that comes or goes is seen at
 * the slave's node; where that cannot be watched, one client is assumed and the slave is kept open. */
#ifndef PSABENCH_LINK_PTY_H
#define PSABENCH_LINK_PTY_H

#include "link/link.h"

#include <stdbool.h>

struct pty {
    struct link
        watch; /* first: inotify on the slave's node; served before the master, so that news of a client precede its
                          bytes */
    int master, slave; /* slave: -1 while clients can be watched */
    int line;          /* descriptor of the master; the port's link owns it */
    bool doubted;      /* asked once, and the kernel knows of a client that we do not */
    struct link *port; /* the link that reads the master; set by its owner */
    char path[64];     /* /dev/pts/N */
    const char *name;  /* symbolic link to it, or NULL */
    long owner;        /* after -EBUSY: process whose port the link leads to */
    int openers;       /* clients that have the slave open */
    void (*opened)(void *ctx, bool open, int64_t t_ns); /* first client came, last one left */
    void *ctx;
};

/* Opens the pair; the caller adds the watch to the loop's links. name: symbolic link to make (an old link to a pty is
 * that no process serves is replaced; one that a process serves is rejected with -EBUSY, anything else with -EEXIST); may be
 * NULL. 0, or -errno with nothing left behind. */
int pty_open(struct pty *p, const char *name);

/* One line for -errno of pty_open(), which begins with `where` ("--line port"). False. */
bool pty_fail(const struct pty *p, const char *where, int err, bool *user, char *why, size_t cap);

/* An error of a pty, and whether it lies with the name that was given. */
struct pty_error {
    const struct pty *pty;
    int err;
    bool *user;
};

/* The same for an option and its argument. */
bool pty_fail_option(const char *option, const char *arg, struct pty_error e, char *why, size_t cap);

/* Clients that have come or gone by now. Before the master is read: who writes has opened the slave before, but a poll that saw
 * his bytes may have looked at the watch just before he came. */
void pty_take_news(struct pty *p, int64_t t_ns);

void pty_close(struct pty *p); /* and removes the link */

#endif
