#define _GNU_SOURCE /* SO_RXQ_OVFL, struct ifreq */
#include "link/can/socketcan.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { RETRY_MS = 1, DOWN_RETRY_MS = 200, RCVBUF = 8 << 20 };

static void log_line(const struct socketcan *s, const char *what)
{
    char line[128];
    snprintf(line, sizeof line, "socketcan: %s: %s", s->can.name, what);
    s->hub->say(line);
}

/* ---- our frame and the kernel's */

static struct canfd_frame to_kernel(const struct can_msg *m)
{
    struct canfd_frame f = {.can_id = m->id, .len = m->len};
    if (m->flags & CAN_EXT) f.can_id |= CAN_EFF_FLAG;
    if (m->flags & CAN_RTR) f.can_id |= CAN_RTR_FLAG;
    if (m->flags & CAN_ERROR) f.can_id |= CAN_ERR_FLAG;
    if (m->flags & CAN_BRS) f.flags |= CANFD_BRS;
    if (!(m->flags & CAN_RTR)) memcpy(f.data, m->data, m->len);
    return f;
}

static struct can_msg from_kernel(const struct canfd_frame *f, bool fd)
{
    struct can_msg m = {.len = f->len};
    m.flags = fd ? CAN_FD : 0;
    if (fd && f->flags & CANFD_BRS) m.flags |= CAN_BRS;
    if (f->can_id & CAN_EFF_FLAG) m.flags |= CAN_EXT;
    if (f->can_id & CAN_RTR_FLAG) m.flags |= CAN_RTR;
    if (f->can_id & CAN_ERR_FLAG) m.flags |= CAN_ERROR;
    m.id = f->can_id & (f->can_id & CAN_EFF_FLAG ? CAN_EFF_MASK : CAN_SFF_MASK);
    if (m.len <= (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) memcpy(m.data, f->data, m.len);
    return m;
}

/* ---- bus to kernel */

static void refresh_link(struct socketcan *s)
{
    s->link.pending = s->can.stalled ? 0 : s->len;
    s->link.full = s->link.pending > SOCKETCAN_QUEUE / 2;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct socketcan *s = ctx;
    (void)t_ns;
    if (s->len < SOCKETCAN_QUEUE) {
        s->queue[(s->head + s->len++) % SOCKETCAN_QUEUE] = *m;
        can_hub_delivered(&s->can);
    } else {
        if (!s->lost_reported) log_line(s, "the interface does not accept the frames, they are dropped");
        s->lost_reported = true;
        s->can.dropped++;
    }
    refresh_link(s);
}

/* Only to an interface that cannot take it for a frame to send. */
static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct socketcan *s = ctx;
    (void)t_ns;
    if (s->virtual && s->len < SOCKETCAN_QUEUE) s->queue[(s->head + s->len++) % SOCKETCAN_QUEUE] = *m;
    refresh_link(s);
}

static void on_stall(struct can_client *can)
{
    refresh_link(can->node.ctx);
}

/* One frame to the kernel. 0 gone, else errno. */
static int write_one(struct socketcan *s, const struct can_msg *m)
{
    const struct canfd_frame f = to_kernel(m);
    const size_t size = m->flags & CAN_FD ? CANFD_MTU : CAN_MTU;
    return write(s->link.fd, &f, size) == (ssize_t)size ? 0 : errno ? errno : EIO;
}

static void pop_frame(struct socketcan *s)
{
    s->head = (s->head + 1) % SOCKETCAN_QUEUE;
    s->len--;
}

/* The interface is down, or rejects the frame: it is lost as on an unplugged cable, so that no client waits for it. */
static void drop_frame(struct socketcan *s, int err)
{
    if (!s->down_reported) log_line(s, strerror(err));
    s->down_reported = true;
    if (!(s->queue[s->head].flags & CAN_ERROR)) {
        s->can.delivered--;
        s->can.dropped++;
    }
    pop_frame(s);
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct socketcan *s = (struct socketcan *)l;
    (void)t_ns;
    l->want_write = false;
    l->want_read = can_hub_room(&s->can);
    while (s->len && !s->can.stalled) {
        const int err = write_one(s, &s->queue[s->head]);
        if (err == EAGAIN) l->want_write = true;
        if (err == ENOBUFS) l->timer_ms = RETRY_MS; /* a full transmit queue does not signal POLLOUT */
        if (err == EAGAIN || err == ENOBUFS) break;
        if (err) {
            drop_frame(s, err);
            continue;
        }
        s->down_reported = false;
        pop_frame(s);
    }
    refresh_link(s);
}

/* ---- kernel to bus */

static void note_overflow(struct socketcan *s, struct msghdr *h)
{
    for (struct cmsghdr *c = CMSG_FIRSTHDR(h); c; c = CMSG_NXTHDR(h, c)) {
        if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_RXQ_OVFL) continue;
        uint32_t total;
        memcpy(&total, CMSG_DATA(c), sizeof total);
        if (total == s->rxq_ovfl) continue;
        if (!s->can.overrun) log_line(s, "the kernel lost frames before we read them");
        s->can.overrun += total - s->rxq_ovfl;
        s->rxq_ovfl = total;
    }
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct socketcan *s = (struct socketcan *)l;
    while (can_hub_room(&s->can)) {
        struct canfd_frame f = {0};
        _Alignas(struct cmsghdr) char control[64];
        struct iovec iov = {.iov_base = &f, .iov_len = sizeof f};
        struct msghdr h = {.msg_iov = &iov, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
        const ssize_t n = recvmsg(l->fd, &h, MSG_DONTWAIT);
        if (n < 0) break; /* also ENETDOWN, once, when the interface goes down */
        note_overflow(s, &h);
        const struct can_msg m = from_kernel(&f, n == CANFD_MTU);
        can_hub_send(s->hub, &s->can, &m, t_ns);
    }
    l->want_read = can_hub_room(&s->can);
}

static void on_timer(struct link *l, int64_t t_ns)
{
    on_flush(l, t_ns);
}

/* ---- opening */

static void set_options(int fd)
{
    const int on = 1, size = RCVBUF;
    setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) < 0) {
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    }
}

/* Whether the interface is up and takes FD frames; 0 or -errno. */
static int look_at(int fd, const char *interface, bool *fd_frames, int *index)
{
    struct ifreq r = {0};
    if (strlen(interface) >= sizeof r.ifr_name) return -ENODEV;
    strcpy(r.ifr_name, interface);
    if (ioctl(fd, SIOCGIFMTU, &r) < 0) return -errno;
    *fd_frames = r.ifr_mtu >= (int)CANFD_MTU;
    if (ioctl(fd, SIOCGIFFLAGS, &r) < 0) return -errno;
    if (!(r.ifr_flags & IFF_UP)) return -ENETDOWN;
    if (ioctl(fd, SIOCGIFINDEX, &r) < 0) return -errno;
    *index = r.ifr_ifindex;
    return 0;
}

int socketcan_open(struct socketcan *s, struct can_hub *hub, const char *interface)
{
    const int fd = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (fd < 0) return -errno;
    struct sockaddr_can a = {.can_family = AF_CAN};
    bool fd_frames = false;
    int err = look_at(fd, interface, &fd_frames, &a.can_ifindex);
    set_options(fd);
    if (!err && bind(fd, (struct sockaddr *)&a, sizeof a) < 0) err = -errno;
    if (err) {
        close(fd);
        return err;
    }
    *s = (struct socketcan){.hub = hub};
    s->link = (struct link){.fd = fd, .want_read = true, .readable = on_readable, .flush = on_flush, .timer = on_timer};
    s->can.adapter = "socketcan";
    strcpy(s->can.name, interface);
    s->can.node =
        (struct can_node){.order = CAN_ORDER_FIFO, .fd = fd_frames, .rx = on_frame, .error = on_error, .ctx = s};
    s->can.stall = on_stall;
    s->virtual = strncmp(interface, "vcan", 4) == 0 || strncmp(interface, "vxcan", 5) == 0;
    can_hub_join(hub, &s->can);
    links_add_first(hub->links, &s->link);
    return 0;
}

void socketcan_close(struct socketcan *s)
{
    can_hub_leave(s->hub, &s->can);
    link_close(&s->link);
}
