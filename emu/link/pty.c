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

/* Wall time from a going to the question whether a client is left: by then the kernel has taken note of it. */
enum { ASK_MS = 37 };

/* Flushes what the slave has not read, and sets it up; by the master, since an open of the slave would look like a client. */
static int set_flushed(int master, const struct termios *tio)
{
    tcflush(master, TCOFLUSH); /* what the line discipline has not taken */
    return tcsetattr(master, TCSAFLUSH, tio) < 0 ? -errno : 0;
}

/* The settings stay. Those that a client makes between the two calls, some microseconds, are lost. */
static void flush_slave(int master)
{
    struct termios tio;
    if (tcgetattr(master, &tio) == 0) set_flushed(master, &tio);
}

static int make_raw(int master)
{
    struct termios tio;
    if (tcgetattr(master, &tio) < 0) return -errno;
    cfmakeraw(&tio);
    return set_flushed(master, &tio);
}

static bool in_use(const struct pty *p)
{
    struct pollfd master = {.fd = p->line};
    return poll(&master, 1, 0) < 1 || !(master.revents & POLLHUP);
}

static void set_openers(struct pty *p, int openers, int64_t t_ns)
{
    const bool was = p->openers > 0;
    p->openers = openers;
    if (openers == 0) flush_slave(p->line); /* what the last one has not read is not for the next */
    if (was != (openers > 0)) p->opened(p->ctx, openers > 0, t_ns);
}

/* The kernel merges equal events that follow each other, so two programs that close at once look like one: the count
 * keeps the order of coming and going, and some time after a going the kernel is asked. */
static void on_watch(struct link *l, int64_t t_ns)
{
    struct pty *p = (struct pty *)l;
    _Alignas(struct inotify_event) char buf[4096];
    const ssize_t n = read(l->fd, buf, sizeof buf);
    for (ssize_t at = 0; at < n;) {
        const struct inotify_event *e = (const struct inotify_event *)(const void *)(buf + at);
        at += (ssize_t)(sizeof *e + e->len);
        if (e->mask & IN_OPEN) {
            if (p->port) p->port->idle = false;
            set_openers(p, p->openers + 1, t_ns);
        } else if (e->mask & (IN_CLOSE_WRITE | IN_CLOSE_NOWRITE)) {
            l->timer_ms = ASK_MS;
            if (p->openers > 0) set_openers(p, p->openers - 1, t_ns);
        }
    }
}

void pty_take_news(struct pty *p, int64_t t_ns)
{
    if (p->watch.fd >= 0) on_watch(&p->watch, t_ns);
}

/* A client that the kernel knows and we do not has come this very moment, and its event is on the way; or it came together
 * with another, as one event. The second question tells. */
static void on_ask(struct link *l, int64_t t_ns)
{
    struct pty *p = (struct pty *)l;
    on_watch(l, t_ns);
    const bool used = in_use(p), unknown = used && p->openers == 0;
    if (!used) {
        set_openers(p, 0, t_ns);
        make_raw(p->line); /* the next client does not inherit the last one's settings */
    }
    if (unknown && p->doubted) set_openers(p, 1, t_ns);
    else if (unknown) l->timer_ms = ASK_MS;
    p->doubted = unknown && !p->doubted;
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
    own_port_lock(p->master, p->path);
    p->slave = open(p->path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    return p->slave < 0 ? -errno : make_raw(p->master);
}

/* Watches who opens the slave; not fatal where inotify is not to be had. Closing ours makes the master hang up. */
static void watch_opens(struct pty *p)
{
    static const uint32_t events = IN_OPEN | IN_CLOSE_WRITE | IN_CLOSE_NOWRITE;
    p->watch = (struct link){
        .fd = inotify_init1(IN_NONBLOCK | IN_CLOEXEC), .want_read = true, .readable = on_watch, .timer = on_ask};
    snprintf(p->watch.who, sizeof p->watch.who, "pty %s", p->path);
    if (p->watch.fd >= 0) {
        close(p->slave);
        p->slave = -1;
        if (inotify_add_watch(p->watch.fd, p->path, events) >= 0) return;
        close(p->watch.fd);
        p->watch.fd = -1;
        p->slave = open(p->path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    }
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

bool pty_fail(const struct pty *p, const char *where, int err, bool *user, char *why, size_t cap)
{
    *user = err != -EBUSY && !why_machine(-err);
    if (err == -EEXIST) return why_expected(why, cap, where, "another file", "a new name or a symbolic link to a pty");
    if (err != -EBUSY) return why_unwritable(why, cap, where, -err);
    return why_fail(why, cap, "%s: expected a link that no other process serves, got one of pid %ld", where, p->owner);
}

bool pty_fail_option(const char *option, const char *arg, struct pty_error e, char *why, size_t cap)
{
    char where[1024];
    snprintf(where, sizeof where, "%s%s", option, arg);
    return pty_fail(e.pty, where, e.err, e.user, why, cap);
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
