#include "link/line/line_pty.h"

#include <stdio.h>
#include <unistd.h>

static void refresh_link(struct line_pty *p)
{
    const size_t waiting = p->sampling ? p->source.waiting(p->source.ctx) : 0;
    p->link.pending = p->len - p->pos + waiting;
    p->link.full = p->source.high && waiting > p->source.high;
    p->link.want_write = p->pos < p->len;
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct line_pty *p = (struct line_pty *)l;
    (void)t_ns;
    while (p->sampling) {
        if (p->pos == p->len) {
            p->pos = 0;
            p->len = p->source.take(p->source.ctx, p->buf, sizeof p->buf);
        }
        if (!p->len) break;
        const ssize_t n = write(l->fd, p->buf + p->pos, p->len - p->pos);
        if (n <= 0) break; /* full: POLLOUT tells when to go on */
        p->pos += (size_t)n;
    }
    refresh_link(p);
}

/* What a reader types means nothing here. */
static void on_readable(struct link *l, int64_t t_ns)
{
    char ignored[256];
    (void)t_ns;
    (void)!read(l->fd, ignored, sizeof ignored);
}

static void on_opened(void *ctx, bool open, int64_t t_ns)
{
    struct line_pty *p = ctx;
    if (p->sampling) p->source.stop(p->source.ctx);
    p->pos = p->len = 0;
    p->sampling = open && p->source.start(p->source.ctx, t_ns);
    refresh_link(p);
}

int line_pty_open(struct line_pty *p, struct links *links, const struct line_source *source, const char *name)
{
    const int err = pty_open(&p->pty, name);
    if (err) return err;
    p->source = *source;
    p->sampling = false;
    p->pos = p->len = 0;
    p->link = (struct link){
        .fd = p->pty.master, .is_pty = true, .want_read = true, .readable = on_readable, .flush = on_flush};
    snprintf(p->link.who, sizeof p->link.who, "line port %s", p->pty.path);
    p->pty.port = &p->link;
    p->pty.opened = on_opened;
    p->pty.ctx = p;
    links_add_first(links, &p->link);
    links_add_first(links, &p->pty.watch);
    if (p->pty.openers) on_opened(p, true, 0); /* no inotify: a reader is assumed */
    return 0;
}

void line_pty_close(struct line_pty *p)
{
    if (p->sampling) p->source.stop(p->source.ctx);
    p->sampling = false;
    p->link.gone = true;
    pty_close(&p->pty);
}
