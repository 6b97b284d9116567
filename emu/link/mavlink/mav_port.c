#define _GNU_SOURCE /* SOCK_NONBLOCK */
#include "link/mavlink/mav_port.h"

#include "link/outbuf.h"
#include "link/tcp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

enum { OUT_MAX = 1 << 20, OUT_HIGH = 1 << 16, DATAGRAMS = 32, DATAGRAM_MAX = 2048 };

struct mav_peer {
    struct link link; /* first; of a UDP peer in no loop */
    struct mav_port *port;
    struct mav_parser parser;
    struct outbuf out;        /* of a stream */
    struct sockaddr_in where; /* of UDP */
    uint64_t heard;           /* its latest message */
    bool present;             /* it gets messages */
    bool loss_told;
};

/* ---- peers */

static struct mav_peer *add_peer(struct mav_port *p)
{
    unsigned i = 0;
    while (i < MAV_PEERS_MAX && p->peer[i]) i++;
    struct mav_peer *e = i < MAV_PEERS_MAX ? calloc(1, sizeof *e) : NULL;
    if (!e) return NULL;
    e->port = p;
    e->present = true;
    e->link.fd = -1;
    p->peer[i] = e;
    p->station.peers++;
    return e;
}

static void set_present(struct mav_peer *e, bool present)
{
    if (e->present == present) return;
    e->present = present;
    e->port->station.peers += present ? 1u : -1u;
}

static void free_peer(struct mav_peer *e)
{
    struct mav_port *p = e->port;
    set_present(e, false);
    for (unsigned i = 0; i < MAV_PEERS_MAX; i++)
        if (p->peer[i] == e) p->peer[i] = NULL;
    outbuf_free(&e->out);
    free(e);
}

static void take_bytes(struct mav_peer *e, const uint8_t *bytes, size_t n, int64_t t_ns)
{
    struct mav_station *s = &e->port->station;
    mavlink_message_t m;
    const uint32_t malformed = e->parser.malformed;
    for (size_t i = 0; i < n; i++) {
        if (!mav_parse(&e->parser, bytes[i], &m)) continue;
        e->heard = ++e->port->heard;
        s->received++;
        mav_station_message(s, &m, t_ns);
    }
    s->malformed += e->parser.malformed - malformed;
}

static void count_loss(struct mav_peer *e)
{
    struct mav_port *p = e->port;
    struct link *where = e->link.fd >= 0 ? &e->link : &p->udp;
    p->station.lost = ++p->lost;
    if (!e->loss_told) where->notice = "reads too slowly, messages are lost";
    e->loss_told = true;
}

/* ---- streams: TCP and pty */

static void refresh_link(struct mav_peer *e)
{
    e->link.pending = outbuf_pending(&e->out);
    e->link.want_write = e->link.pending > 0;
    e->link.full = e->port->lossless && e->link.pending > OUT_HIGH;
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct mav_peer *e = (struct mav_peer *)l;
    if (e->port->kind == MAV_PTY) mav_station_turn(&e->port->station, t_ns);
    if (outbuf_pending(&e->out) && outbuf_flush(&e->out, l->fd) < 0 && e->port->kind == MAV_TCP) {
        set_present(e, false);
        link_close(l);
        return;
    }
    refresh_link(e);
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct mav_peer *e = (struct mav_peer *)l;
    uint8_t bytes[4096];
    const ssize_t n = read(l->fd, bytes, sizeof bytes);
    if (n > 0) take_bytes(e, bytes, (size_t)n, t_ns);
    const bool over = n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR);
    if (!over || e->port->kind != MAV_TCP) return;
    set_present(e, false);
    link_close(l);
}

static void on_release(struct link *l)
{
    link_close(l);
    free_peer((struct mav_peer *)l);
}

/* fd is the peer's from here on. NULL: no room or no memory. */
static struct mav_peer *add_stream(struct mav_port *p, int fd)
{
    struct mav_peer *e = add_peer(p);
    if (!e) return NULL;
    if (!outbuf_init(&e->out, OUT_MAX)) {
        free_peer(e);
        return NULL;
    }
    e->link =
        (struct link){.fd = fd, .want_read = true, .readable = on_readable, .flush = on_flush, .release = on_release};
    return e;
}

static void on_connection(struct listener *l, int fd, int64_t t_ns)
{
    struct mav_port *p = (struct mav_port *)l;
    struct mav_peer *e = add_stream(p, fd);
    (void)t_ns;
    if (!e) {
        l->link.notice = "too many clients: connection closed";
        close(fd);
        return;
    }
    tcp_no_delay(fd);
    snprintf(e->link.who, sizeof e->link.who, "mavlink tcp:%u, client 127.0.0.1:%u", p->port, tcp_peer_port(fd));
    links_add_first(p->links, &e->link);
}

/* Also without clients: what the last one asked for comes to its end. */
static void on_listener_turn(struct link *l, int64_t t_ns)
{
    mav_station_turn(&((struct mav_port *)l)->station, t_ns);
}

static int open_tcp(struct mav_port *p)
{
    char who[LINK_WHO_MAX];
    const int fd = tcp_listen(&p->port);
    if (fd < 0) return fd;
    snprintf(who, sizeof who, "mavlink tcp:%u", p->port);
    listener_open(&p->listen, fd, who, on_connection);
    p->listen.link.flush = on_listener_turn;
    links_add_first(p->links, &p->listen.link);
    return 0;
}

static void on_opened(void *ctx, bool open, int64_t t_ns)
{
    struct mav_peer *e = ctx;
    (void)t_ns;
    outbuf_clear(&e->out);
    e->parser = (struct mav_parser){.received = e->parser.received, .malformed = e->parser.malformed};
    e->loss_told = false;
    set_present(e, open);
    refresh_link(e);
}

static int open_terminal(struct mav_port *p, const char *name)
{
    const int err = pty_open(&p->pty, name);
    if (err) return err;
    struct mav_peer *e = add_stream(p, p->pty.master);
    if (!e) {
        pty_close(&p->pty);
        return -ENOMEM;
    }
    p->pty.master = -1; /* the link's now */
    e->link.is_pty = true;
    p->pty.port = &e->link;
    p->pty.opened = on_opened;
    p->pty.ctx = e;
    set_present(e, p->pty.openers > 0);
    snprintf(e->link.who, sizeof e->link.who, "mavlink %s", p->pty.path);
    links_add_first(p->links, &e->link);
    links_add_first(p->links, &p->pty.watch);
    return 0;
}

/* ---- UDP */

static struct mav_peer *find_peer(const struct mav_port *p, const struct sockaddr_in *from)
{
    for (unsigned i = 0; i < MAV_PEERS_MAX; i++) {
        struct mav_peer *e = p->peer[i];
        if (e && e->where.sin_port == from->sin_port && e->where.sin_addr.s_addr == from->sin_addr.s_addr) return e;
    }
    return NULL;
}

/* A new peer where others may come; the one that was silent longest makes room. */
static struct mav_peer *admit_peer(struct mav_port *p, const struct sockaddr_in *from)
{
    struct mav_peer *e = add_peer(p);
    if (!e) {
        for (unsigned i = 0; i < MAV_PEERS_MAX; i++)
            if (p->peer[i] && (!e || p->peer[i]->heard < e->heard)) e = p->peer[i];
        if (!e) return NULL; /* no memory */
        e->parser = (struct mav_parser){0};
        e->loss_told = false;
    }
    e->where = *from;
    e->heard = p->heard;
    return e;
}

static void on_datagram(struct link *l, int64_t t_ns)
{
    struct mav_port *p = l->ctx;
    for (unsigned k = 0; k < DATAGRAMS; k++) {
        uint8_t bytes[DATAGRAM_MAX];
        struct sockaddr_in from = {0};
        socklen_t len = sizeof from;
        const ssize_t n = recvfrom(l->fd, bytes, sizeof bytes, MSG_DONTWAIT, (struct sockaddr *)&from, &len);
        if (n < 0) return;
        struct mav_peer *e = find_peer(p, &from);
        if (!e && p->kind == MAV_UDP_IN) e = admit_peer(p, &from);
        if (e) take_bytes(e, bytes, (size_t)n, t_ns);
        else p->strangers++;
    }
}

static void on_udp_turn(struct link *l, int64_t t_ns)
{
    mav_station_turn(&((struct mav_port *)l->ctx)->station, t_ns);
}

static int bind_udp(uint16_t *port)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_port = htons(*port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof a;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) return -errno;
    if (bind(fd, (struct sockaddr *)&a, len) == 0 && getsockname(fd, (struct sockaddr *)&a, &len) == 0) {
        *port = ntohs(a.sin_port);
        return fd;
    }
    const int err = errno;
    close(fd);
    return -err;
}

static int open_udp(struct mav_port *p)
{
    const bool in = p->kind == MAV_UDP_IN;
    uint16_t own = in ? p->port : 0;
    const int fd = bind_udp(&own);
    if (fd < 0) return fd;
    if (in) p->port = own;
    p->udp = (struct link){.fd = fd, .want_read = true, .readable = on_datagram, .flush = on_udp_turn, .ctx = p};
    snprintf(p->udp.who, sizeof p->udp.who, "mavlink %s:%u", in ? "udpin" : "udp", p->port);
    struct mav_peer *e = in ? NULL : add_peer(p);
    if (!in && !e) {
        link_close(&p->udp);
        return -ENOMEM;
    }
    if (e)
        e->where = (struct sockaddr_in){
            .sin_family = AF_INET, .sin_port = htons(p->port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    links_add_first(p->links, &p->udp);
    return 0;
}

static void send_datagram(struct mav_peer *e, const uint8_t *frame, size_t n)
{
    const struct sockaddr *to = (const struct sockaddr *)&e->where;
    if (sendto(e->port->udp.fd, frame, n, MSG_DONTWAIT, to, sizeof e->where) >= 0) return;
    if (errno != ECONNREFUSED) count_loss(e); /* no program listens there yet */
}

/* ---- */

void mav_port_send(void *port, const uint8_t *frame, size_t n)
{
    struct mav_port *p = port;
    for (unsigned i = 0; i < MAV_PEERS_MAX; i++) {
        struct mav_peer *e = p->peer[i];
        if (!e || !e->present || e->link.gone) continue;
        if (e->link.fd < 0) send_datagram(e, frame, n);
        else if (!outbuf_put(&e->out, frame, n)) count_loss(e);
        if (e->link.fd >= 0) refresh_link(e);
    }
}

int mav_port_open(struct mav_port *p, const char *name)
{
    p->listen.link.fd = p->udp.fd = -1;
    p->listen.spare = -1;
    p->pty = (struct pty){.master = -1, .slave = -1, .watch.fd = -1};
    if (p->kind == MAV_PTY) return open_terminal(p, name);
    return p->kind == MAV_TCP ? open_tcp(p) : open_udp(p);
}

void mav_port_close(struct mav_port *p)
{
    mav_station_close(&p->station);
    listener_close(&p->listen);
    if (p->udp.fd >= 0) link_close(&p->udp);
    for (unsigned i = 0; i < MAV_PEERS_MAX; i++) {
        struct mav_peer *e = p->peer[i];
        if (e && e->link.fd < 0 && !e->link.release) free_peer(e); /* UDP: in no loop */
        else if (e) e->link.gone = true;
    }
    if (p->kind == MAV_PTY) pty_close(&p->pty);
}
