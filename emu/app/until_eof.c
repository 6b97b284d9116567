#define _GNU_SOURCE /* read */
#include "app/until_eof.h"

#include <errno.h>
#include <unistd.h>

static void on_readable(struct link *l, int64_t t_ns)
{
    char passed_over[256];
    (void)t_ns;
    const ssize_t n = read(l->fd, passed_over, sizeof passed_over);
    if (n > 0 || (n < 0 && (errno == EINTR || errno == EAGAIN))) return;
    l->gone = true;
    *(bool *)l->ctx = true;
}

void until_eof(struct link *l, struct links *ls, bool *quit)
{
    *l = (struct link){.fd = STDIN_FILENO, .want_read = true, .readable = on_readable, .ctx = quit};
    links_add_last(ls, l);
}
