/* Address of an instrument: a TCP port on 127.0.0.1 for several clients, or a pseudo-terminal for one.
 *
 * It knows nothing of SCPI: a line goes up, answers come down, each a line of LF. Every client has a session that the owner
 * makes; while it is busy the client's further lines wait. Ports are served before control sockets, so that what an
 * instrument was reported before a `run` is done before it. */
#ifndef PSABENCH_LINK_SCPI_PORT_H
#define PSABENCH_LINK_SCPI_PORT_H

#include "link/listener.h"
#include "link/pty.h"
#include "link/text_link.h"

#define SCPI_PORT_LINE_MAX    4096u
#define SCPI_PORT_CLIENTS_MAX 16u

struct scpi_peer;

struct scpi_port {
    struct listener listen; /* first: TCP; fd -1 of a pty */
    const char *kind;       /* for messages */
    struct links *links;
    struct pty pty;
    struct scpi_peer *terminal; /* who sits at the pty */
    uint32_t clients;
    uint16_t port; /* as bound */
    /* A client has come: its session, NULL without memory. */
    void *(*opened)(void *ctx, struct scpi_peer *p);
    /* A line of len bytes without its LF; line is NULL for one that was too long. */
    void (*line)(void *session, const char *line, size_t len, int64_t t_ns);
    bool (*busy)(const void *session);
    void (*closed)(void *session); /* the session is over and freed */
    void *ctx;
};

/* The callbacks, ctx and links are filled in by the caller. port 0: a free one. 0, or -errno: -EADDRINUSE. The struct must not
 * move afterwards. */
int scpi_port_tcp(struct scpi_port *p, uint16_t port);

/* name: symbolic link, may be NULL; kept by pointer. 0, or -errno as pty_open(). */
int scpi_port_pty(struct scpi_port *p, const char *name);

/* Clients are the loop's: marked as gone and released by links_reap(). */
void scpi_port_close(struct scpi_port *p);

/* An answer without its LF. */
void scpi_port_reply(struct scpi_peer *p, const char *text, size_t n);

#endif
