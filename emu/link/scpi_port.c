#include "link/scpi_port.h"

#include "link/tcp.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

static const struct text_link_ops tcp_ops = {
    .line = on_line, .ready = on_ready, .was_read = tcp_quick_ack, .closed = on_closed};

static struct text_link_cfg link_cfg(const char *who, int fd)
{
    return (struct text_link_cfg){
        .who = who, .fd = fd, .end = '\n', .line_max = SCPI_PORT_LINE_MAX, .out_max = OUT_MAX, .out_high = OUT_MAX};
}

static struct scpi_peer *peer_new(struct scpi_port *port, int fd)
{
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "scpi %s, client 127.0.0.1:%u", port->kind, tcp_peer_port(fd));
    const struct text_link_cfg cfg = link_cfg(who, fd);
    struct scpi_peer *p = text_link_new(sizeof *p, &cfg, &tcp_ops);
    if (!p) return NULL;
    p->port = port;
    p->io.link.release = on_release;
    if (open_session(p)) return p;
    p->io.link.fd = -1; /* the caller's */
    on_release(&p->io.link);
    return NULL;
}

static void on_connection(struct listener *l, int fd, int64_t t_ns)
{
    struct scpi_port *port = (struct scpi_port *)l;
    (void)t_ns;
    tcp_no_delay(fd);
    struct scpi_peer *p = port->clients < SCPI_PORT_CLIENTS_MAX ? peer_new(port, fd) : NULL;
    if (!p) {
        l->link.notice = "too many clients: connection closed"; /* SCPI has no word for it */
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
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "scpi %s, port %u", p->kind, port);
    listener_open(&p->listen, fd, who, on_connection);
    links_add_first(p->links, &p->listen.link);
    return 0;
}

/* ---- pseudo-terminal */

/* A new client gets a session of its own. The last bytes of the previous client are still executed in the old one. */
static void on_opened(struct text_link *t, bool open)
{
    struct scpi_peer *p = (struct scpi_peer *)t;
    void *old = p->session;
    if (!open) return;
    if (open_session(p)) p->port->closed(old);
    else p->session = old;
}

static const struct text_link_ops pty_ops = {.line = on_line, .ready = on_ready, .opened = on_opened};

int scpi_port_pty(struct scpi_port *p, const char *name)
{
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "scpi %s", p->kind);
    const struct text_link_cfg cfg = link_cfg(who, -1);
    struct scpi_peer *t = calloc(1, sizeof *t);
    p->listen = (struct listener){.link.fd = -1, .spare = -1};
    if (t) t->port = p;
    int err = t && open_session(t) ? 0 : -ENOMEM;
    if (!err) err = text_link_open_pty(&t->io, &p->pty, &cfg, &pty_ops, p->links, name);
    if (err) {
        if (t) close_session(t);
        free(t);
        return err;
    }
    t->io.link.release = on_release;
    p->terminal = t;
    return 0;
}

void scpi_port_close(struct scpi_port *p)
{
    listener_close(&p->listen);
    if (p->terminal) p->terminal->io.link.gone = true;
    if (p->terminal) pty_close(&p->pty);
    p->terminal = NULL;
}
