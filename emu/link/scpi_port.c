#define _GNU_SOURCE /* accept4 */
#include "link/scpi_port.h"

#include "link/tcp.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct scpi_peer {
    struct text_link io; /* first */
    struct scpi_port *port;
    void *session;
};

enum { OUT_MAX = 1 << 20 };

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    const struct scpi_peer *p = (struct scpi_peer *)t;
    p->port->line(p->session, r == LINES_LINE ? line : NULL, len, t_ns);
}

static bool on_ready(struct text_link *t)
{
    const struct scpi_peer *p = (struct scpi_peer *)t;
    return !p->port->busy(p->session);
}

void scpi_port_reply(struct scpi_peer *p, const char *text, size_t n)
{
    text_link_put(&p->io, text, n);
    text_link_put(&p->io, "\n", 1);
}

static bool open_session(struct scpi_peer *p)
{
    p->session = p->port->opened(p->port->ctx, p);
    return p->session != NULL;
}

static void close_session(struct scpi_peer *p)
{
    if (p->session) p->port->closed(p->session);
    p->session = NULL;
}

/* ---- TCP */

static void on_closed(struct text_link *t, int64_t t_ns)
{
    struct scpi_peer *p = (struct scpi_peer *)t;
    (void)t_ns;
    p->port->clients--;
    close_session(p);
    t->link.gone = true;
}

static void on_release(struct link *l)
{
    struct scpi_peer *p = (struct scpi_peer *)l;
    close_session(p);
    text_link_free(&p->io);
    free(p);
}

/* One line after the other: what is asked in one packet need not wait for the acknowledgement of the packet before. */
static void on_read(struct text_link *t)
{
    const int on = 1;
    setsockopt(t->link.fd, IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
}

static struct scpi_peer *peer_new(struct scpi_port *port, int fd, const struct text_link_ops *ops)
{
    const struct text_link_cfg cfg = {
        .fd = fd, .end = '\n', .line_max = SCPI_PORT_LINE_MAX, .out_max = OUT_MAX, .out_high = OUT_MAX};
    struct scpi_peer *p = calloc(1, sizeof *p);
    if (!p || !text_link_init(&p->io, &cfg, ops)) {
        free(p);
        return NULL;
    }
    p->port = port;
    p->io.link.release = on_release;
    if (open_session(p)) return p;
    p->io.link.fd = -1; /* the caller's */
    text_link_free(&p->io);
    free(p);
    return NULL;
}

static const struct text_link_ops tcp_ops = {on_line, on_ready, on_read, on_closed};

static void on_connection(struct link *l, int64_t t_ns)
{
    struct scpi_port *port = (struct scpi_port *)l;
    const int on = 1;
    (void)t_ns;
    const int fd = accept4(l->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) return;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    struct scpi_peer *p = port->clients < SCPI_PORT_CLIENTS_MAX ? peer_new(port, fd, &tcp_ops) : NULL;
    if (!p) {
        close(fd);
        return;
    }
    port->clients++;
    links_add_first(port->links, &p->io.link);
}

int scpi_port_tcp(struct scpi_port *p, uint16_t port)
{
    p->pty = (struct pty){.master = -1, .slave = -1, .watch.fd = -1};
    const int fd = tcp_listen(&port);
    if (fd < 0) return fd;
    p->port = port;
    p->listen = (struct link){.fd = fd, .want_read = true, .readable = on_connection};
    links_add_first(p->links, &p->listen);
    return 0;
}

/* ---- pseudo-terminal */

/* No program has it open. */
static void on_pty_flush(struct link *l, int64_t t_ns)
{
    struct scpi_peer *p = (struct scpi_peer *)l;
    if (!p->port->pty.openers) text_link_forget_output(&p->io);
    text_link_flush(l, t_ns);
}

/* A new client gets a session of its own. The last bytes of the previous client are still executed in the old one. */
static void on_opened(void *ctx, bool open, int64_t t_ns)
{
    struct scpi_port *port = ctx;
    (void)t_ns;
    if (!open) return;
    void *old = port->terminal->session;
    if (open_session(port->terminal)) port->closed(old);
    else port->terminal->session = old;
    text_link_forget(&port->terminal->io);
    pty_discard(&port->pty);
}

static const struct text_link_ops pty_ops = {on_line, on_ready, NULL, NULL};

int scpi_port_pty(struct scpi_port *p, const char *name)
{
    p->listen = (struct link){.fd = -1};
    const int err = pty_open(&p->pty, name);
    if (err) return err;
    p->terminal = peer_new(p, p->pty.master, &pty_ops);
    if (!p->terminal) {
        pty_close(&p->pty);
        return -ENOMEM;
    }
    p->pty.master = -1; /* the peer's now */
    p->pty.opened = on_opened;
    p->pty.ctx = p;
    p->terminal->io.link.flush = on_pty_flush;
    links_add_first(p->links, &p->terminal->io.link);
    links_add_first(p->links, &p->pty.watch);
    return 0;
}

void scpi_port_close(struct scpi_port *p)
{
    if (p->listen.fd >= 0) close(p->listen.fd);
    p->listen.fd = -1;
    p->listen.gone = true;
    if (p->terminal) p->terminal->io.link.gone = true;
    if (p->terminal) pty_close(&p->pty);
    p->terminal = NULL;
}
