#define _GNU_SOURCE /* SOCK_NONBLOCK, struct ip_mreqn */
#include "link/can/udp_can.h"

#include "link/can/udp_frame.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <string.h>
#include <unistd.h>

enum { PORT = 43113 };

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
    if (*end && (*end != ':' || !dgram_can_port(end + 1, &end, &port) || *end)) return false;
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

/* ---- codec */

static unsigned encode_first(const struct dgram_can *d, uint8_t out[DGRAM_CAN_MAX], size_t *size)
{
    const struct dgram_can_stamped *s = dgram_can_waiting(d, 0);
    *size = udp_frame_encode(&s->m, (double)(s->t_ns + d->hub->epoch_ns) * 1e-9, d->hub->name, out);
    return 1;
}

static const char *accept_datagram(struct dgram_can *d, const struct sockaddr_storage *from)
{
    struct udp_can *u = (struct udp_can *)d;
    if (same_address(from, &u->self, true)) return NULL; /* our own */
    if (!is_local(u, from)) return "a datagram of another machine is refused";
    d->in_left = 1;
    return NULL;
}

static bool decode_datagram(struct dgram_can *d, struct can_msg *m)
{
    return udp_frame_decode(d->in, d->in_size, m);
}

static const struct dgram_can_ops udp_ops = {.adapter = "udp",
                                             .error_frames = true,
                                             .encode = encode_first,
                                             .accept = accept_datagram,
                                             .decode = decode_datagram};
_Static_assert(UDP_FRAME_MAX <= DGRAM_CAN_MAX, "UDP_FRAME_MAX");

/* ---- opening */

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
    const int fd = u->io.link.fd = dgram_can_socket(group->ss_family);
    return fd >= 0 && share_port(fd) && bind(fd, (const struct sockaddr *)group, address_size(group)) == 0 &&
           join_group(fd, group);
}

/* Connected, so that the kernel says which address our datagrams come from. */
static bool open_out(struct udp_can *u, const struct sockaddr_storage *group)
{
    socklen_t size = sizeof u->self;
    const int fd = u->io.out_fd = socket(group->ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    return fd >= 0 && stay_here(fd, group->ss_family) &&
           connect(fd, (const struct sockaddr *)group, address_size(group)) == 0 &&
           getsockname(fd, (struct sockaddr *)&u->self, &size) == 0;
}

int udp_can_open(struct udp_can *u, struct can_hub *hub, const char *group)
{
    struct sockaddr_storage a;
    if (!udp_can_group(group, &a)) return -EINVAL;
    *u = (struct udp_can){.io = {.link.fd = -1, .out_fd = -1}};
    if (!open_in(u, &a) || !open_out(u, &a)) {
        const int err = errno;
        if (u->io.link.fd >= 0) close(u->io.link.fd);
        if (u->io.out_fd >= 0) close(u->io.out_fd);
        return -err;
    }
    if (a.ss_family == AF_INET) inet_ntop(AF_INET, &((struct sockaddr_in *)&a)->sin_addr, u->group, sizeof u->group);
    else inet_ntop(AF_INET6, &((struct sockaddr_in6 *)&a)->sin6_addr, u->group, sizeof u->group);
    u->port = ntohs(((struct sockaddr_in *)&a)->sin_port); /* sin6_port is at the same place */
    dgram_can_join(&u->io, hub, &udp_ops, group);
    return 0;
}

void udp_can_close(struct udp_can *u)
{
    dgram_can_close(&u->io);
}
