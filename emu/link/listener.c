#define _GNU_SOURCE /* accept4 */
#include "link/listener.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

enum { REST_MS = 1000 }; /* without even the spare descriptor: until the next look */

static int open_spare(void)
{
    return open("/dev/null", O_RDONLY | O_CLOEXEC);
}

static void turn_away(struct listener *l)
{
    if (!l->exhausted) l->link.notice = "no file descriptor is left (ulimit -n): connections are refused";
    l->exhausted = true;
    if (l->spare < 0) l->spare = open_spare();
    if (l->spare >= 0) {
        close(l->spare);
        const int fd = accept4(l->link.fd, NULL, NULL, SOCK_CLOEXEC);
        if (fd >= 0) close(fd);
        l->spare = open_spare();
        if (fd >= 0) return;
    }
    l->link.want_read = false;
    l->link.timer_ms = REST_MS;
}

static void on_timer(struct link *l, int64_t t_ns)
{
    (void)t_ns;
    l->want_read = true;
}

static void on_readable(struct link *link, int64_t t_ns)
{
    struct listener *l = (struct listener *)link;
    const int fd = accept4(link->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) turn_away(l);
        return;
    }
    l->exhausted = false;
    l->came(l, fd, t_ns);
}

void listener_open(struct listener *l, int fd, const char *who, void (*came)(struct listener *l, int fd, int64_t t_ns))
{
    l->link = (struct link){.fd = fd, .want_read = true, .readable = on_readable, .timer = on_timer};
    snprintf(l->link.who, sizeof l->link.who, "%s", who);
    l->came = came;
    l->spare = open_spare();
    l->exhausted = false;
}

void listener_close(struct listener *l)
{
    if (l->link.fd < 0) return;
    link_close(&l->link);
    if (l->spare >= 0) close(l->spare);
    l->spare = -1;
}
