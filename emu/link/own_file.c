#define _GNU_SOURCE /* O_CLOEXEC, flock, fdopen */
#include "link/own_file.h"

#include "base/why.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

/* One row of /proc/locks, proc(5): "1: FLOCK  ADVISORY  WRITE 708 00:13:26 0 EOF": kind, pid, device, inode, first byte. */
struct lock {
    char kind[8];
    long pid;
    unsigned major, minor;
    unsigned long inode;
    long first;
};

static bool read_lock(const char *row, struct lock *l)
{
    return sscanf(row, "%*u: %7s %*s %*s %ld %x:%x:%lu %ld", l->kind, &l->pid, &l->major, &l->minor, &l->inode,
                  &l->first) == 6;
}

/* Some file systems (btrfs, overlay) show another device than stat() does: then the inode alone must do, for a message. */
static long owner_of(const struct stat *st, const char *kind, long first, bool by_device)
{
    char row[256];
    struct lock l;
    long found = 0;
    FILE *locks = fopen("/proc/locks", "re");
    while (locks && !found && fgets(row, sizeof row, locks)) {
        if (!read_lock(row, &l) || strcmp(l.kind, kind) != 0 || l.inode != st->st_ino || l.pid <= 0) continue;
        if (l.first != first) continue;
        if (!by_device || (l.major == major(st->st_dev) && l.minor == minor(st->st_dev))) found = l.pid;
    }
    if (locks) fclose(locks);
    return found;
}

static bool port_number(const char *path, unsigned *number)
{
    return sscanf(path, "/dev/pts/%u", number) == 1;
}

void own_port_lock(int master, const char *path)
{
    unsigned number;
    if (!port_number(path, &number)) return;
    struct flock byte = {.l_type = F_WRLCK, .l_whence = SEEK_SET, .l_start = number, .l_len = 1};
    (void)fcntl(master, F_SETLK, &byte);
}

long own_port_owner(const char *path)
{
    struct stat st;
    unsigned number;
    return port_number(path, &number) && stat("/dev/ptmx", &st) == 0 ? owner_of(&st, "POSIX", number, true) : 0;
}

/* Where locks are not to be had (some network file systems), the file is written without. */
static int take_over(int fd, long *owner)
{
    struct stat st;
    if (fstat(fd, &st) < 0) return -errno;
    if (!S_ISREG(st.st_mode)) return 0;
    if (flock(fd, LOCK_EX | LOCK_NB) < 0 && errno == EWOULDBLOCK) {
        *owner = owner_of(&st, "FLOCK", 0, true);
        if (!*owner) *owner = owner_of(&st, "FLOCK", 0, false);
        return -EBUSY;
    }
    return ftruncate(fd, 0) < 0 ? -errno : 0;
}

int own_file_open(const char *path, long *owner)
{
    struct stat st;
    const bool special =
        stat(path, &st) == 0 && !S_ISREG(st.st_mode); /* a device, a pipe: has its other end elsewhere */
    int fd = special ? -1 : open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (special || (fd < 0 && errno == EACCES)) fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0) return -errno;
    const int err = take_over(fd, owner);
    if (!err) return fd;
    close(fd);
    return err;
}

bool own_file_gone(int fd, const char *path)
{
    struct stat ours, now;
    if (fstat(fd, &ours) < 0 || !S_ISREG(ours.st_mode)) return false;
    return stat(path, &now) < 0 ? errno == ENOENT : now.st_ino != ours.st_ino || now.st_dev != ours.st_dev;
}

off_t own_file_cut(int fd)
{
    char tail[4096];
    struct stat st;
    if (fstat(fd, &st) < 0 || !S_ISREG(st.st_mode)) return 0;
    for (off_t end = st.st_size; end > 0;) {
        const off_t from = end > (off_t)sizeof tail ? end - (off_t)sizeof tail : 0;
        const ssize_t n = pread(fd, tail, (size_t)(end - from), from);
        if (n <= 0) return 0;
        const char *lf = memrchr(tail, '\n', (size_t)n);
        end = lf ? from + (lf - tail) + 1 : from;
        if (lf) return ftruncate(fd, end) < 0 ? 0 : end;
    }
    (void)!ftruncate(fd, 0);
    return 0;
}

bool own_file_removed(int fd)
{
    struct stat st;
    return fstat(fd, &st) == 0 && st.st_nlink == 0;
}

const char *own_file_strerror(int error)
{
    static char text[128];
    if (error == ESTALE) return "moved, removed or replaced while it was written";
    if (why_machine(error)) return strerror(error);
    snprintf(text, sizeof text, "expected a path that can be written, got %s",
             error == ENOENT ? "no such folder" : why_found(error));
    return text;
}

bool own_file_fail(const char *where, const char *path, int err, long owner, bool *user, char *why, size_t cap)
{
    *user = !why_machine(-err);
    if (err != -EBUSY) return why_fail(why, cap, "%s%.800s: %s", where, path, own_file_strerror(-err));
    char got[48] = "another process";
    if (owner == getpid()) snprintf(got, sizeof got, "this process, as another option");
    else if (owner) snprintf(got, sizeof got, "pid %ld", owner);
    return why_fail(why, cap, "%s%.800s: expected a file that no other process writes, got one of %s", where, path,
                    got);
}

FILE *own_file_output(const char *where, const char *path, bool *user, char *why, size_t cap)
{
    long owner = 0;
    const int fd = own_file_open(path, &owner);
    FILE *out = fd < 0 ? NULL : fdopen(fd, "wb");
    if (out) setvbuf(out, NULL, _IONBF, 0);
    else own_file_fail(where, path, fd < 0 ? fd : -errno, owner, user, why, cap);
    if (!out && fd >= 0) close(fd);
    return out;
}
