#define _GNU_SOURCE /* struct ucred, SOCK_NONBLOCK */
#include "link/ctl_sock.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

struct ctl_client {
    struct text_link io; /* first */
    struct ctl_server *server;
    bool due;      /* a reply is */
    bool pushed;   /* lines that are no replies wait: no client waits for those */
    uint64_t lost; /* of them, since the last report to the client */
};

enum { OUT_MAX = 16 << 20, PUSH_HIGH = 1 << 19 }; /* several of the longest replies */

static const char no_text[] = "\xFF"; /* for a line with a NUL in it: what is behind that would be dropped unseen */

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    struct ctl_client *c = (struct ctl_client *)t;
    if (r == LINES_LINE && strspn(line, " \t\r") == len) return;
    c->due = true;
    if (r == LINES_LINE && memchr(line, '\0', len)) line = no_text;
    c->server->line(c->server->ctx, c, r == LINES_LINE ? line : NULL, t_ns);
}

static bool on_ready(struct text_link *t)
{
    return !((struct ctl_client *)t)->due;
}

static void on_closed(struct text_link *t, int64_t t_ns)
{
    struct ctl_client *c = (struct ctl_client *)t;
    (void)t_ns;
    c->server->clients--;
    if (c->server->gone) c->server->gone(c->server->ctx, c);
    t->link.gone = true;
}

static const struct text_link_ops ops = {.line = on_line, .ready = on_ready, .closed = on_closed};

void ctl_reply(struct ctl_client *c, const char *line)
{
    c->due = false;
    text_link_put(&c->io, line, strlen(line));
    text_link_put(&c->io, "\n", 1);
}

/* Time stands still for a client that is slow to take its replies, not for one that is slow to take the news. */
static void let_run(struct ctl_client *c)
{
    if (!c->pushed) return;
    c->io.link.pending = 0;
    c->io.link.full = false;
}

void ctl_push(struct ctl_client *c, const char *line)
{
    char lost[64];
    if (outbuf_pending(&c->io.out) > PUSH_HIGH) {
        c->lost++;
        return;
    }
    c->pushed = true;
    const int n = c->lost ? snprintf(lost, sizeof lost, "{\"event\":\"lost\",\"lines\":%" PRIu64 "}\n", c->lost) : 0;
    text_link_put(&c->io, lost, (size_t)n);
    c->lost = 0;
    text_link_put(&c->io, line, strlen(line));
    text_link_put(&c->io, "\n", 1);
    let_run(c);
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct ctl_client *c = (struct ctl_client *)l;
    text_link_flush(l, t_ns);
    if (!outbuf_pending(&c->io.out)) c->pushed = false;
    let_run(c);
}

/* Process at the other end, 0: not known. */
static long peer_pid(int fd)
{
    struct ucred peer = {0};
    socklen_t len = sizeof peer;
    return getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &len) < 0 ? 0 : peer.pid;
}

static void turn_away(struct ctl_server *s, int fd)
{
    char reply[160];
    const int n = snprintf(reply, sizeof reply,
                           "{\"id\":null,\"ok\":false,\"error\":{\"code\":\"state\",\"text\":\"%s: expected up to %u "
                           "clients, got one more\"}}\n",
                           s->name, CTL_CLIENTS_MAX);
    s->listen.link.notice = "too many clients: connection closed";
    (void)!write(fd, reply, (size_t)n);
    shutdown(fd, SHUT_WR); /* with input unread, close() alone would reset it, and the reply be lost */
    close(fd);
}

static void on_connection(struct listener *l, int fd, int64_t t_ns)
{
    struct ctl_server *s = (struct ctl_server *)l;
    char who[LINK_WHO_MAX];
    (void)t_ns;
    snprintf(who, sizeof who, "%s, client of pid %ld", s->name, peer_pid(fd));
    const struct text_link_cfg cfg = {
        .who = who, .fd = fd, .end = '\n', .line_max = CTL_LINE_MAX, .out_max = OUT_MAX, .out_high = OUT_MAX};
    struct ctl_client *c = s->clients < CTL_CLIENTS_MAX ? text_link_new(sizeof *c, &cfg, &ops) : NULL;
    if (!c) {
        turn_away(s, fd);
        return;
    }
    c->server = s;
    c->io.link.flush = on_flush;
    s->clients++;
    links_add_last(s->links, &c->io.link);
}

/* A socket without a server behind it is stale. 0 when the path may be used. */
static int clear_path(const struct sockaddr_un *a, long *owner)
{
    struct stat st;
    if (lstat(a->sun_path, &st) < 0) return 0;
    if (!S_ISSOCK(st.st_mode)) return -EEXIST;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) return -errno;
    const bool connected = connect(fd, (const struct sockaddr *)a, sizeof *a) == 0;
    const bool alive = connected || errno == EAGAIN; /* its backlog is full */
    *owner = connected ? peer_pid(fd) : 0;
    close(fd);
    if (alive) return -EADDRINUSE;
    unlink(a->sun_path);
    return 0;
}

/* A socket that listens, with the name path from then on: who sees the path can connect. */
static int listen_as(const char *path, int fd)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    struct stat left;
    snprintf(a.sun_path, sizeof a.sun_path, "%s.%ld", path, (long)getpid());
    if (lstat(a.sun_path, &left) == 0 && S_ISSOCK(left.st_mode)) unlink(a.sun_path); /* its process was killed here */
    if (bind(fd, (struct sockaddr *)&a, sizeof a) < 0) return -errno;
    const bool named = listen(fd, LISTENER_BACKLOG) == 0 && link(a.sun_path, path) == 0;
    const int err = named ? 0 : -errno;
    unlink(a.sun_path);
    return err == -EEXIST ? -EADDRINUSE : err; /* another process took the path just now */
}

int ctl_listen(struct ctl_server *s, const char *path, long *owner)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    if (strlen(path) > CTL_PATH_MAX) return -ENAMETOOLONG;
    strcpy(a.sun_path, path);
    int err = clear_path(&a, owner);
    if (err) return err;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) return -errno;
    err = listen_as(path, fd);
    if (err) {
        close(fd);
        return err;
    }
    s->path = path;
    listener_open(&s->listen, fd, s->name, on_connection);
    links_add_last(s->links, &s->listen.link);
    return 0;
}

void ctl_close(struct ctl_server *s)
{
    if (s->listen.link.fd < 0) return;
    unlink(s->path); /* first: who sees the path can connect */
    listener_close(&s->listen);
}
