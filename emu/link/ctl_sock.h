/* Server for JSON lines on a Unix stream socket: the control socket and the truth port.
 *
 * It knows nothing of the commands: a line goes up, a reply comes down, in order. While a reply is due the client's
 * further lines wait, so a command that takes simulated time may be answered later. */
#ifndef PSABENCH_LINK_CTL_SOCK_H
#define PSABENCH_LINK_CTL_SOCK_H

#include "link/listener.h"
#include "link/text_link.h"

#define CTL_LINE_MAX    4096u
#define CTL_CLIENTS_MAX 16u
#define CTL_PATH_MAX    99u /* bytes; until it listens the name of the socket has a process number more */

struct ctl_client;

struct ctl_server {
    struct listener listen; /* first */
    const char *name;       /* for messages: "control socket" */
    struct links *links;
    const char *path;
    uint32_t clients;
    /* A line of a client; ctl_reply() answers it, now or later. line is NULL for one that was too long. */
    void (*line)(void *ctx, struct ctl_client *c, const char *line, int64_t t_ns);
    void (*gone)(void *ctx, struct ctl_client *c); /* forget it: no more replies to it; may be NULL */
    void *ctx;
};

/* The callbacks, ctx and links are filled in by the caller; path is kept by pointer. A socket left behind by a process that
 * has ended is replaced. 0, or -errno: -EADDRINUSE the socket is in use by the process *owner (0: not known), -EEXIST the
 * path is no socket, -ENAMETOOLONG. The path appears when a client can connect. */
int ctl_listen(struct ctl_server *s, const char *path, long *owner);
void ctl_close(struct ctl_server *s); /* and removes the path */

/* Sends one line (without its LF). */
void ctl_reply(struct ctl_client *c, const char *line);

/* A line that is no reply. No run waits until it is taken; a client that is half a megabyte behind loses such lines and gets
 * how many: {"event":"lost","lines":5}. */
void ctl_push(struct ctl_client *c, const char *line);

#endif
