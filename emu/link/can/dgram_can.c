#define _GNU_SOURCE /* SO_RXQ_OVFL, SOCK_NONBLOCK */
#include "link/can/dgram_can.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { RETRY_MS = 1, RCVBUF = 8 << 20 };

static void log_once(const struct dgram_can *d, bool *reported, const char *what)
{
    char line[160];
    if (*reported) return;
    *reported = true;
    snprintf(line, sizeof line, "%s: %s: %s", d->ops->adapter, d->can.name, what);
    d->hub->say(line);
}

/* ---- bus to peers */

const struct dgram_can_stamped *dgram_can_waiting(const struct dgram_can *d, unsigned i)
{
    return i < d->len ? &d->queue[(d->head + i) % DGRAM_CAN_QUEUE] : NULL;
}

static void refresh_link(struct dgram_can *d)
{
    d->link.pending = d->can.stalled ? 0 : d->len;
    d->link.full = d->link.pending > DGRAM_CAN_QUEUE / 2;
}

static bool keep_frame(struct dgram_can *d, const struct can_msg *m, int64_t t_ns)
{
    const bool room = d->len < DGRAM_CAN_QUEUE;
    if (room) d->queue[(d->head + d->len++) % DGRAM_CAN_QUEUE] = (struct dgram_can_stamped){t_ns, *m};
    refresh_link(d);
    return room;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct dgram_can *d = ctx;
    if (keep_frame(d, m, t_ns)) {
        can_hub_delivered(&d->can);
        return;
    }
    log_once(d, &d->lost_reported, "the kernel does not accept the frames, they are dropped");
    d->can.dropped++;
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    keep_frame(ctx, m, t_ns);
}

static void on_stall(struct can_client *can)
{
    refresh_link(can->node.ctx);
}

/* 0 gone, else errno. */
static int send_datagram(const struct dgram_can *d, const uint8_t *bytes, size_t n)
{
    const int fd = d->out_fd >= 0 ? d->out_fd : d->link.fd;
    const struct sockaddr *to = d->to_size ? (const struct sockaddr *)&d->to : NULL;
    return sendto(fd, bytes, n, MSG_DONTWAIT, to, d->to_size) == (ssize_t)n ? 0 : errno ? errno : EIO;
}

/* There is no route any more: the frames are lost as on an unplugged cable, so that no client waits for them. */
static void note_failure(struct dgram_can *d, int err, unsigned frames)
{
    log_once(d, &d->failed_reported, strerror(err));
    for (unsigned i = 0; i < frames; i++) {
        if (dgram_can_waiting(d, i)->m.flags & CAN_ERROR) continue;
        d->can.delivered--;
        d->can.dropped++;
    }
}

static void send_waiting(struct dgram_can *d)
{
    while (d->len && !d->can.stalled) {
        uint8_t bytes[DGRAM_CAN_MAX];
        size_t n;
        const unsigned frames = d->ops->encode(d, bytes, &n);
        const int err = send_datagram(d, bytes, n);
        if (err == EAGAIN || err == ENOBUFS) {
            d->link.timer_ms = RETRY_MS;
            break;
        }
        if (err) note_failure(d, err, frames);
        else d->failed_reported = false;
        d->datagrams++;
        d->head = (d->head + frames) % DGRAM_CAN_QUEUE;
        d->len -= frames;
    }
    refresh_link(d);
}

/* ---- peers to bus */

void dgram_can_lost(struct dgram_can *d, uint32_t n)
{
    if (!n) return;
    log_once(d, &d->overrun_reported, "datagrams were lost before we read them");
    d->can.overrun += n;
}

static void note_overflow(struct dgram_can *d, struct msghdr *h)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(h); c; c = CMSG_NXTHDR(h, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
        uint32_t total;
        memcpy(&total, CMSG_DATA(c), sizeof total);
        dgram_can_lost(d, total - d->rxq_ovfl);
        d->rxq_ovfl = total;
    }
}

static void refuse(struct dgram_can *d, const char *what)
{
    log_once(d, &d->refused_reported, what);
    d->can.refused++;
}

/* The frames of the present datagram, as many as the bus takes. */
static void take_frames(struct dgram_can *d, int64_t t_ns)
{
    for (; d->in_left && can_hub_room(&d->can); d->in_left--) {
        struct can_msg m;
        if (d->ops->decode(d, &m)) can_hub_send(d->hub, &d->can, &m, t_ns);
        else refuse(d, "what is no CAN frame is refused");
    }
}

static bool may_read(const struct dgram_can *d)
{
    return d->in_left == 0 && can_hub_room(&d->can);
}

/* False: there is none. */
static bool read_datagram(struct dgram_can *d)
{
    struct sockaddr_storage from = {0};
    _Alignas(struct cmsghdr) char control[64];
    struct iovec iov = {.iov_base = d->in, .iov_len = sizeof d->in};
    struct msghdr h = {.msg_name = &from,
                       .msg_namelen = sizeof from,
                       .msg_iov = &iov,
                       .msg_iovlen = 1,
                       .msg_control = control,
                       .msg_controllen = sizeof control};
    const ssize_t n = recvmsg(d->link.fd, &h, MSG_DONTWAIT);
    if (n < 0) return false;
    note_overflow(d, &h);
    d->in_size = (size_t)n;
    d->in_at = d->in_left = 0;
    const char *complaint = d->ops->accept(d, &from);
    if (complaint) refuse(d, complaint);
    return true;
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct dgram_can *d = (struct dgram_can *)l;
    for (unsigned left = CAN_QUEUE_MAX; left && may_read(d); left--) { /* a turn ends under a flood, too */
        if (!read_datagram(d)) break;
        take_frames(d, t_ns);
    }
    l->want_read = may_read(d);
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct dgram_can *d = (struct dgram_can *)l;
    take_frames(d, t_ns);
    l->want_read = may_read(d);
    send_waiting(d);
}

/* ---- opening */

bool dgram_can_port(const char *text, const char **end, uint16_t *port)
{
    char *behind;
    if (*text < '0' || *text > '9') return false;
    const unsigned long n = strtoul(text, &behind, 10);
    if (n == 0 || n > 65535) return false;
    *port = (uint16_t)n;
    *end = behind;
    return true;
}

int dgram_can_socket(int family)
{
    const int on = 1, size = RCVBUF;
    const int fd = socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) < 0) {
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    }
    return fd;
}

void dgram_can_join(struct dgram_can *d, struct can_hub *hub, const struct dgram_can_ops *ops, const char *channel)
{
    d->hub = hub;
    d->ops = ops;
    d->link = (struct link){
        .fd = d->link.fd, .want_read = true, .readable = on_readable, .flush = on_flush, .timer = on_flush};
    snprintf(d->link.who, sizeof d->link.who, "%s %s", ops->adapter, channel);
    d->can.adapter = ops->adapter;
    snprintf(d->can.name, sizeof d->can.name, "%.31s", channel);
    d->can.node = (struct can_node){.order = CAN_ORDER_FIFO, .fd = true, .rx = on_frame, .ctx = d};
    if (ops->error_frames) d->can.node.error = on_error;
    d->can.stall = on_stall;
    can_hub_join(hub, &d->can);
    links_add_first(hub->links, &d->link);
}

void dgram_can_close(struct dgram_can *d)
{
    can_hub_leave(d->hub, &d->can);
    link_close(&d->link);
    if (d->out_fd >= 0) close(d->out_fd);
    d->out_fd = -1;
}
