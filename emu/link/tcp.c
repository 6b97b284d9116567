#define _GNU_SOURCE /* SOCK_NONBLOCK */
#include "link/tcp.h"

#include "link/listener.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

int tcp_listen(uint16_t *port)
{
    const int on = 1;
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_port = htons(*port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof a;
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) return -errno;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(fd, (struct sockaddr *)&a, len) < 0 || listen(fd, LISTENER_BACKLOG) < 0 ||
        getsockname(fd, (struct sockaddr *)&a, &len) < 0) {
        const int err = errno;
        close(fd);
        return -err;
    }
    *port = ntohs(a.sin_port);
    return fd;
}

void tcp_even_segments(int fd)
{
    const int bytes = 32764; /* even with and without the 12 bytes of time stamps; the loopback's own, 65483, is odd */
    setsockopt(fd, IPPROTO_TCP, TCP_MAXSEG, &bytes, sizeof bytes);
}

void tcp_no_delay(int fd)
{
    const int on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

uint16_t tcp_peer_port(int fd)
{
    struct sockaddr_in peer = {0};
    socklen_t len = sizeof peer;
    return getpeername(fd, (struct sockaddr *)&peer, &len) < 0 ? 0 : ntohs(peer.sin_port);
}

void tcp_quick_ack(int fd)
{
    const int on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
}

/* One row of /proc/net/tcp: "sl: LOCAL:PORT REMOTE:PORT ST TX:RX ...", addresses in network order as hexadecimal words. */
static bool row_unread(const char *row, const struct sockaddr_in *peer, const struct sockaddr_in *own, long *unread)
{
    uint32_t local, remote;
    unsigned local_port, remote_port, state;
    unsigned long tx, rx;
    if (sscanf(row, " %*u: %8x:%4x %8x:%4x %2x %8lx:%8lx", &local, &local_port, &remote, &remote_port, &state, &tx,
               &rx) != 7) {
        return false;
    }
    *unread = (long)rx;
    return local == peer->sin_addr.s_addr && local_port == ntohs(peer->sin_port) && remote == own->sin_addr.s_addr &&
           remote_port == ntohs(own->sin_port);
}

long tcp_peer_unread(int fd)
{
    struct sockaddr_in own = {0}, peer = {0};
    socklen_t own_len = sizeof own, peer_len = sizeof peer;
    if (getsockname(fd, (struct sockaddr *)&own, &own_len) < 0) return -1;
    if (getpeername(fd, (struct sockaddr *)&peer, &peer_len) < 0) return -1;
    FILE *f = fopen("/proc/net/tcp", "re");
    if (!f) return -1;
    char row[256];
    long unread = -1, found = -1;
    while (found < 0 && fgets(row, sizeof row, f)) {
        if (row_unread(row, &peer, &own, &unread)) found = unread;
    }
    fclose(f);
    return found;
}
