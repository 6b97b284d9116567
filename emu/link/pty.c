#define _GNU_SOURCE /* ptsname_r, inotify */
#include "link/pty.h"

#include "base/why.h"
#include "link/own_file.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <termios.h>
#include <unistd.h>

/* Wall time from a going to the question who is left. Whoever opens the port again at once comes meanwhile, and his coming
 * is seen: while the kernel is asked, no one's is. */
enum { ASK_MS = 37 };

static int open_slave(const char *path)
{
    const int fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (fd >= 0) own_port_lock(fd);
    return fd;
}

static int make_raw(int fd)
{
    struct termios tio;
    if (tcgetattr(fd, &tio) < 0) return -errno;
    cfmakeraw(&tio);
    return tcsetattr(fd, TCSANOW, &tio) < 0 ? -errno : 0;
}

static void start_watch(struct pty *p)
{
    p->watch_id = inotify_add_watch(p->watch.fd, p->path, IN_OPEN | IN_CLOSE_WRITE | IN_CLOSE_NOWRITE);
}

/* Whether a program has the slave open. Without our own descriptor the kernel reports a hang-up when none has. */
static bool in_use(struct pty *p)
{
    struct pollfd master = {.fd = p->line};
    inotify_rm_watch(p->watch.fd, p->watch_id); /* our own open and close are not a client's */
    close(p->slave);
    const bool used = poll(&master, 1, 0) < 1 || !(master.revents & POLLHUP);
    p->slave = open_slave(p->path);
    if (!used) make_raw(p->slave); /* the last one to close takes the settings along */
    start_watch(p);
    return used;
}

static void set_openers(struct pty *p, int openers, int64_t t_ns)
{
    const bool was = p->openers > 0;
    p->openers = openers;
    if (openers == 0) pty_discard(p); /* what the last one has not read is not for the next */
    if (was != (openers > 0)) p->opened(p->ctx, openers > 0, t_ns);
}

/* The kernel merges equal events that follow each other, so two programs that close at once look like one: the count
 * keeps the order of coming and going, and some time after a going the kernel is asked. */
static void on_watch(struct link *l, int64_t t_ns)
{
    struct pty *p = (struct pty *)l;
    _Alignas(struct inotify_event) char buf[4096];
    const ssize_t n = read(l->fd, buf, sizeof buf);
    bool closed = false;
    for (ssize_t at = 0; at < n;) {
        const struct inotify_event *e = (const struct inotify_event *)(const void *)(buf + at);
        at += (ssize_t)(sizeof *e + e->len);
        if (e->mask & IN_OPEN) set_openers(p, p->openers + 1, t_ns);
        if (!(e->mask & (IN_CLOSE_WRITE | IN_CLOSE_NOWRITE))) continue;
        closed = true;
        if (p->openers > 0) set_openers(p, p->openers - 1, t_ns);
    }
    if (closed) l->timer_ms = ASK_MS;
}

static void on_ask(struct link *l, int64_t t_ns)
{
    struct pty *p = (struct pty *)l;
    set_openers(p, !in_use(p) ? 0 : p->openers ? p->openers : 1, t_ns);
}

/* Where a symbolic link points, "" for anything else. */
static void points_to(const char *name, char *path, size_t cap)
{
    const ssize_t n = readlink(name, path, cap - 1);
    path[n > 0 ? n : 0] = '\0';
}

/* A link to a pty that no process serves is stale; anything else belongs to another program. The kernel reuses the number of
 * a closed pty, so only the lock shows whether the port is served. */
static int make_name(struct pty *p, const char *name)
{
    char old[64];
    points_to(name, old, sizeof old);
    const bool ours = strncmp(old, "/dev/pts/", 9) == 0;
    if (ours && strcmp(old, p->path) != 0) p->owner = own_port_owner(old);
    if (p->owner) return -EBUSY;
    if (ours) unlink(name);
    return symlink(p->path, name) < 0 ? -errno : 0;
}

static int open_pair(struct pty *p)
{
    p->master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    if (p->master < 0) return -errno;
    if (grantpt(p->master) < 0 || unlockpt(p->master) < 0) return -errno;
    p->line = p->master;
    const int err = ptsname_r(p->master, p->path, sizeof p->path);
    if (err) return -err;
    p->slave = open_slave(p->path);
    return p->slave < 0 ? -errno : make_raw(p->slave);
}

/* Watches who opens the slave; not fatal where inotify is not to be had. */
static void watch_opens(struct pty *p)
{
    p->watch = (struct link){
        .fd = inotify_init1(IN_NONBLOCK | IN_CLOEXEC), .want_read = true, .readable = on_watch, .timer = on_ask};
    if (p->watch.fd >= 0) start_watch(p);
    if (p->watch.fd >= 0 && p->watch_id < 0) {
        close(p->watch.fd);
        p->watch.fd = -1;
    }
    snprintf(p->watch.who, sizeof p->watch.who, "pty %s", p->path);
    if (p->watch.fd >= 0) return;
    p->watch.notice = "no inotify instance is left (fs.inotify.max_user_instances): one client is assumed to be there";
    p->openers = 1;
}

int pty_open(struct pty *p, const char *name)
{
    *p = (struct pty){.master = -1, .slave = -1, .watch.fd = -1};
    int err = open_pair(p);
    if (!err && name) err = make_name(p, name);
    if (err) {
        pty_close(p);
        return err;
    }
    p->name = name;
    watch_opens(p);
    return 0;
}

bool pty_fail(const struct pty *p, const char *where, int err, char *why, size_t cap)
{
    static const char expected[] = "expected a new name or a symbolic link to a pty, got another file";
    if (err != -EBUSY) return why_fail(why, cap, "%s: %s", where, err == -EEXIST ? expected : strerror(-err));
    return why_fail(why, cap, "%s: expected a link that no other process serves, got one of pid %ld", where, p->owner);
}

void pty_discard(struct pty *p)
{
    tcflush(p->slave, TCIFLUSH);
}

void pty_close(struct pty *p)
{
    char now[64];
    if (p->name) points_to(p->name, now, sizeof now);
    if (p->name && strcmp(now, p->path) == 0) unlink(p->name); /* another emulator may have taken it over */
    if (p->watch.fd >= 0) close(p->watch.fd);
    if (p->slave >= 0) close(p->slave);
    if (p->master >= 0) close(p->master);
    p->watch.fd = p->slave = p->master = -1;
    p->name = NULL;
    p->watch.gone = true;
}
