#define _GNU_SOURCE
#include "link/can/cannelloni_can.h"

#include "link/can/cannelloni_frame.h"

#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { PORT = 20000, PEER_PORT = 20001 }; /* cannelloni's own default is 20000 at both ends */

bool cannelloni_can_ports(const char *text, struct cannelloni_ports *out)
{
    struct cannelloni_ports p = {PORT, PEER_PORT};
    const char *end = text;
    if (strcmp(text, "0") == 0 || strncmp(text, "0:", 2) == 0) {
        p.own = 0;
        end++;
    } else if (*text && !dgram_can_port(text, &end, &p.own)) {
        return false;
    }
    if (*end && (*end != ':' || !dgram_can_port(end + 1, &end, &p.peer))) return false;
    if (*end || p.own == p.peer) return false;
    *out = p;
    return true;
}

/* ---- codec */

static unsigned encode_waiting(const struct dgram_can *d, uint8_t out[DGRAM_CAN_MAX], size_t *size)
{
    const struct dgram_can_stamped *s;
    unsigned count = 0;
    size_t n = CANNELLONI_HEADER;
    while (n + CANNELLONI_FRAME_MAX <= DGRAM_CAN_MAX && (s = dgram_can_waiting(d, count))) {
        n += cannelloni_put_frame(&s->m, out + n);
        count++;
    }
    cannelloni_put_header((uint8_t)d->datagrams, (uint16_t)count, out);
    *size = n;
    return count;
}

/* seq_no shows losses on any way, up to 127 in a row, the kernel's counter those in our socket: the larger number has both.
 * A peer that starts begins at 0. */
static void note_gap(struct cannelloni_can *c, uint8_t seq)
{
    const uint8_t gap = (uint8_t)(seq - c->next_seq);
    const uint32_t counted = c->io.rxq_ovfl - c->counted;
    if (c->heard && seq != 0 && gap < 128 && gap > counted) dgram_can_lost(&c->io, gap - counted);
    c->next_seq = (uint8_t)(seq + 1);
    c->counted = c->io.rxq_ovfl;
    c->heard = true;
}

static const char *accept_datagram(struct dgram_can *d, const struct sockaddr_storage *from)
{
    struct cannelloni_can *c = (struct cannelloni_can *)d;
    const struct sockaddr_in *a = (const void *)from;
    uint8_t seq;
    if (a->sin_addr.s_addr != htonl(INADDR_LOOPBACK)) return "a datagram that is not from 127.0.0.1 is refused";
    if (d->in_size > DGRAM_CAN_MAX || !cannelloni_check(d->in, d->in_size, &seq, &d->in_left)) {
        return "a datagram that is not in cannelloni's format 2 is refused";
    }
    note_gap(c, seq);
    d->in_at = CANNELLONI_HEADER;
    return NULL;
}

static bool decode_next(struct dgram_can *d, struct can_msg *m)
{
    d->in_at += cannelloni_take_frame(d->in + d->in_at, d->in_size - d->in_at, m);
    return can_valid(m);
}

static const struct dgram_can_ops cannelloni_ops = {
    .adapter = "cannelloni", .encode = encode_waiting, .accept = accept_datagram, .decode = decode_next};

/* ---- opening */

static bool bind_port(int fd, uint16_t *port)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons(*port)};
    socklen_t size = sizeof a;
    if (bind(fd, (const struct sockaddr *)&a, size) < 0 || getsockname(fd, (struct sockaddr *)&a, &size) < 0)
        return false;
    *port = ntohs(a.sin_port);
    return true;
}

int cannelloni_can_open(struct cannelloni_can *c, struct can_hub *hub, struct cannelloni_ports ports)
{
    char name[32];
    const int fd = dgram_can_socket(AF_INET);
    *c = (struct cannelloni_can){.io = {.link.fd = fd, .out_fd = -1}, .ports = ports};
    if (fd < 0 || !bind_port(fd, &c->ports.own)) {
        const int err = errno;
        if (fd >= 0) close(fd);
        return -err;
    }
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons(ports.peer)};
    memcpy(&c->io.to, &to, sizeof to);
    c->io.to_size = sizeof to;
    snprintf(name, sizeof name, "%u:%u", c->ports.own, c->ports.peer);
    dgram_can_join(&c->io, hub, &cannelloni_ops, name);
    return 0;
}

void cannelloni_can_close(struct cannelloni_can *c)
{
    dgram_can_close(&c->io);
}
