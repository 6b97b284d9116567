/* A listening socket. It keeps one descriptor in reserve. When the process has no other left, it accepts a connection with
 * that one and closes it: the peer is notified at once, and the loop does not spin on a connection that it cannot accept. */
#ifndef PSABENCH_LINK_LISTENER_H
#define PSABENCH_LINK_LISTENER_H

#include "link/link.h"

struct listener {
    struct link link; /* first */
    /* A connection, non-blocking; the owner's from here on. */
    void (*came)(struct listener *l, int fd, int64_t t_ns);
    int spare;
    bool exhausted; /* and this was said */
};

#define LISTENER_BACKLOG 128 /* connections that wait for a turn of the loop */

/* fd listens already; who: for messages, "control socket". The caller adds the link to the loop's. */
void listener_open(struct listener *l, int fd, const char *who, void (*came)(struct listener *l, int fd, int64_t t_ns));

/* Harmless for one that is not open: link.fd -1. */
void listener_close(struct listener *l);

#endif
