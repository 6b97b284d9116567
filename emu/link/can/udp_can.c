#define _GNU_SOURCE /* SO_RXQ_OVFL, struct ip_mreqn */
#include "link/can/udp_can.h"

#include "link/can/udp_frame.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { PORT = 43113, RETRY_MS = 1, RCVBUF = 8 << 20 };

static void log_line(const struct udp_can *u, const char *what)
{
    char line[160];
    snprintf(line, sizeof line, "udp: %s: %s", u->can.name, what);
    u->hub->say(line);
}

/* ---- addresses */

static bool is_group(const char *text, uint16_t port, struct sockaddr_storage *out)
{
    struct sockaddr_storage a = {0};
    struct sockaddr_in *v4 = (struct sockaddr_in *)&a;
    struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)&a;
    if (inet_pton(AF_INET, text, &v4->sin_addr) == 1) {
        v4->sin_family = AF_INET;
        v4->sin_port = htons(port);
        if (ntohl(v4->sin_addr.s_addr) >> 24 != 239) return false;
    } else if (inet_pton(AF_INET6, text, &v6->sin6_addr) == 1) {
        v6->sin6_family = AF_INET6;
        v6->sin6_port = htons(port);
        if (v6->sin6_addr.s6_addr[0] != 0xFF) return false;
    } else {
        return false;
    }
    *out = a;
    return true;
}

static bool is_port(const char *text, uint16_t *port)
{
    char *end;
    if (*text < '0' || *text > '9') return false;
    const unsigned long n = strtoul(text, &end, 10);
    *port = (uint16_t)n;
    return *end == '\0' && n > 0 && n <= 65535;
}

bool udp_can_group(const char *text, struct sockaddr_storage *out)
{
    char host[INET6_ADDRSTRLEN] = "";
    uint16_t port = PORT;
    const char *colon = strchr(text, ':');
    const bool brackets = text[0] == '[';
    const char *end = brackets ? strchr(text, ']') : colon && !strchr(colon + 1, ':') ? colon : text + strlen(text);
    const char *begin = text + (brackets ? 1 : 0);
    if (!end || (size_t)(end - begin) >= sizeof host) return false;
    memcpy(host, begin, (size_t)(end - begin));
    if (brackets) end++;
    if (*end && (*end != ':' || !is_port(end + 1, &port))) return false;
    return is_group(host, port, out);
}

static bool same_address(const struct sockaddr_storage *a, const struct sockaddr_storage *b, bool port)
{
    const struct sockaddr_in *a4 = (const void *)a, *b4 = (const void *)b;
    const struct sockaddr_in6 *a6 = (const void *)a, *b6 = (const void *)b;
    if (a->ss_family != b->ss_family) return false;
    if (a->ss_family == AF_INET)
        return a4->sin_addr.s_addr == b4->sin_addr.s_addr && (!port || a4->sin_port == b4->sin_port);
    return memcmp(&a6->sin6_addr, &b6->sin6_addr, sizeof a6->sin6_addr) == 0 &&
           (!port || a6->sin6_port == b6->sin6_port);
}

static socklen_t address_size(const struct sockaddr_storage *a)
{
    return a->ss_family == AF_INET ? sizeof(struct sockaddr_in) : sizeof(struct sockaddr_in6);
}

/* Whether the address is one of this machine: a socket can be bound to no other. */
static bool bind_works(const struct sockaddr_storage *from)
{
    struct sockaddr_storage a = *from;
    ((struct sockaddr_in *)&a)->sin_port = 0; /* sin6_port is at the same place */
    const int fd = socket(a.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return false;
    const bool works = bind(fd, (const struct sockaddr *)&a, address_size(&a)) == 0;
    close(fd);
    return works;
}

static bool is_local(struct udp_can *u, const struct sockaddr_storage *from)
{
    if (same_address(from, &u->self, false)) return true;
    if (!same_address(from, &u->asked, false)) {
        u->asked = *from;
        u->asked_local = bind_works(from);
    }
    return u->asked_local;
}

/* ---- bus to group */

static void refresh_link(struct udp_can *u)
{
    u->link.pending = u->can.stalled ? 0 : u->len;
    u->link.full = u->link.pending > UDP_CAN_QUEUE / 2;
}

static bool keep_frame(struct udp_can *u, const struct can_msg *m, int64_t t_ns)
{
    const bool room = u->len < UDP_CAN_QUEUE;
    if (room) u->queue[(u->head + u->len++) % UDP_CAN_QUEUE] = (struct udp_can_stamped){t_ns, *m};
    refresh_link(u);
    return room;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct udp_can *u = ctx;
    if (keep_frame(u, m, t_ns)) {
        can_hub_delivered(&u->can);
        return;
    }
    if (!u->lost_reported) log_line(u, "the kernel does not accept the frames, they are dropped");
    u->lost_reported = true;
    u->can.dropped++;
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    keep_frame(ctx, m, t_ns);
}

static void on_stall(struct can_client *can)
{
    refresh_link(can->node.ctx);
}

/* One frame to the kernel. 0 gone, else errno. */
static int write_one(const struct udp_can *u, const struct udp_can_stamped *s)
{
    uint8_t bytes[UDP_FRAME_MAX];
    const size_t n = udp_frame_encode(&s->m, (double)(s->t_ns + u->hub->epoch_ns) * 1e-9, u->hub->name, bytes);
    return send(u->out_fd, bytes, n, MSG_DONTWAIT) == (ssize_t)n ? 0 : errno ? errno : EIO;
}

/* There is no route any more: the frame is lost as on an unplugged cable, so that no client waits for it. */
static void note_failure(struct udp_can *u, int err, bool error_frame)
{
    if (!u->failed_reported) log_line(u, strerror(err));
    u->failed_reported = true;
    if (error_frame) return;
    u->can.delivered--;
    u->can.dropped++;
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct udp_can *u = (struct udp_can *)l;
    (void)t_ns;
    l->want_read = can_hub_room(&u->can);
    while (u->len && !u->can.stalled) {
        const struct udp_can_stamped *s = &u->queue[u->head];
        const int err = write_one(u, s);
        if (err == EAGAIN || err == ENOBUFS) {
            l->timer_ms = RETRY_MS;
            break;
        }
        if (err) note_failure(u, err, s->m.flags & CAN_ERROR);
        else u->failed_reported = false;
        u->head = (u->head + 1) % UDP_CAN_QUEUE;
        u->len--;
    }
    refresh_link(u);
}

/* ---- group to bus */

static void note_overflow(struct udp_can *u, struct msghdr *h)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(h); c; c = CMSG_NXTHDR(h, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
        uint32_t total;
        memcpy(&total, CMSG_DATA(c), sizeof total);
        if (total == u->rxq_ovfl) continue;
        if (!u->can.overrun) log_line(u, "the kernel lost datagrams before we read them");
        u->can.overrun += total - u->rxq_ovfl;
        u->rxq_ovfl = total;
    }
}

static void refuse_datagram(struct udp_can *u, const char *what)
{
    if (!u->refused_reported) log_line(u, what);
    u->refused_reported = true;
    u->can.refused++;
}

static void take_datagram(struct udp_can *u, const struct sockaddr_storage *from, const uint8_t *bytes, size_t n,
                          int64_t t_ns)
{
    struct can_msg m;
    if (same_address(from, &u->self, true)) return; /* our own */
    if (!is_local(u, from)) refuse_datagram(u, "a datagram of another machine is refused");
    else if (!udp_frame_decode(bytes, n, &m)) refuse_datagram(u, "a datagram that is no CAN frame is refused");
    else can_hub_send(u->hub, &u->can, &m, t_ns);
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct udp_can *u = (struct udp_can *)l;
    for (unsigned left = CAN_QUEUE_MAX; left && can_hub_room(&u->can); left--) { /* a turn ends under a flood, too */
        uint8_t bytes[UDP_FRAME_MAX + 1];
        struct sockaddr_storage from = {0};
        _Alignas(struct cmsghdr) char control[64];
        struct iovec iov = {.iov_base = bytes, .iov_len = sizeof bytes};
        struct msghdr h = {.msg_name = &from,
                           .msg_namelen = sizeof from,
                           .msg_iov = &iov,
                           .msg_iovlen = 1,
                           .msg_control = control,
                           .msg_controllen = sizeof control};
        const ssize_t n = recvmsg(l->fd, &h, MSG_DONTWAIT);
        if (n < 0) break;
        note_overflow(u, &h);
        take_datagram(u, &from, bytes, (size_t)n, t_ns);
    }
    l->want_read = can_hub_room(&u->can);
}

/* ---- opening */

static void set_buffer(int fd)
{
    const int on = 1, size = RCVBUF;
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) < 0) {
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    }
}

/* Several programs have the port of a group. */
static bool share_port(int fd)
{
    const int on = 1;
    return setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
           setsockopt(fd, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) == 0;
}

static bool join_group(int fd, const struct sockaddr_storage *group)
{
    if (group->ss_family == AF_INET) {
        const struct ip_mreqn m = {.imr_multiaddr = ((const struct sockaddr_in *)group)->sin_addr};
        return setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &m, sizeof m) == 0;
    }
    const struct ipv6_mreq m = {.ipv6mr_multiaddr = ((const struct sockaddr_in6 *)group)->sin6_addr};
    return setsockopt(fd, IPPROTO_IPV6, IPV6_JOIN_GROUP, &m, sizeof m) == 0;
}

static bool stay_here(int fd, int family)
{
    const int hops = 0;
    return family == AF_INET ? setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &hops, sizeof hops) == 0
                             : setsockopt(fd, IPPROTO_IPV6, IPV6_MULTICAST_HOPS, &hops, sizeof hops) == 0;
}

static bool open_in(struct udp_can *u, const struct sockaddr_storage *group)
{
    u->link.fd = socket(group->ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (u->link.fd < 0) return false;
    set_buffer(u->link.fd);
    return share_port(u->link.fd) && bind(u->link.fd, (const struct sockaddr *)group, address_size(group)) == 0 &&
           join_group(u->link.fd, group);
}

/* Connected, so that the kernel says which address our datagrams come from. */
static bool open_out(struct udp_can *u, const struct sockaddr_storage *group)
{
    socklen_t size = sizeof u->self;
    u->out_fd = socket(group->ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    return u->out_fd >= 0 && stay_here(u->out_fd, group->ss_family) &&
           connect(u->out_fd, (const struct sockaddr *)group, address_size(group)) == 0 &&
           getsockname(u->out_fd, (struct sockaddr *)&u->self, &size) == 0;
}

int udp_can_open(struct udp_can *u, struct can_hub *hub, const char *group)
{
    struct sockaddr_storage a;
    if (!udp_can_group(group, &a)) return -EINVAL;
    *u = (struct udp_can){.hub = hub, .link.fd = -1, .out_fd = -1};
    if (!open_in(u, &a) || !open_out(u, &a)) {
        const int err = errno;
        if (u->link.fd >= 0) close(u->link.fd);
        if (u->out_fd >= 0) close(u->out_fd);
        return -err;
    }
    u->link = (struct link){
        .fd = u->link.fd, .want_read = true, .readable = on_readable, .flush = on_flush, .timer = on_flush};
    if (a.ss_family == AF_INET) inet_ntop(AF_INET, &((struct sockaddr_in *)&a)->sin_addr, u->group, sizeof u->group);
    else inet_ntop(AF_INET6, &((struct sockaddr_in6 *)&a)->sin6_addr, u->group, sizeof u->group);
    u->port = ntohs(((struct sockaddr_in *)&a)->sin_port); /* sin6_port is at the same place */
    u->can.adapter = "udp";
    snprintf(u->can.name, sizeof u->can.name, "%.31s", group);
    u->can.node = (struct can_node){.order = CAN_ORDER_FIFO, .fd = true, .rx = on_frame, .error = on_error, .ctx = u};
    u->can.stall = on_stall;
    can_hub_join(hub, &u->can);
    links_add_first(hub->links, &u->link);
    return 0;
}

void udp_can_close(struct udp_can *u)
{
    can_hub_leave(u->hub, &u->can);
    link_close(&u->link);
    if (u->out_fd >= 0) close(u->out_fd);
    u->out_fd = -1;
}
