#include "link/text_link.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void refresh_link(struct text_link *t)
{
    t->link.pending = t->stall ? 0 : outbuf_pending(&t->out);
    t->link.full = t->link.pending > t->out_high;
    t->link.want_write = t->link.pending > 0 && !t->hold;
    t->link.want_read = t->in_pos == t->in_len && !t->eof;
}

static void end_link(struct text_link *t, int64_t t_ns)
{
    if (t->ended) return;
    t->ended = true;
    if (t->ops->closed) t->ops->closed(t, t_ns);
}

/* What it has sent is dropped: nothing of it is obeyed. */
static void hang_up(struct text_link *t)
{
    t->link.notice = "HTTP or TLS, as a web browser sends it: connection closed";
    t->in_pos = t->in_len = 0;
    t->eof = true;
}

/* Hands over lines until there are no more or the owner takes no more. */
static void take_lines(struct text_link *t, int64_t t_ns)
{
    if (t->taking) return;
    t->taking = true;
    while (t->in_pos < t->in_len && !t->ended && (!t->ops->ready || t->ops->ready(t))) {
        size_t used;
        const enum lines_result r = lines_feed(&t->lines, t->in + t->in_pos, t->in_len - t->in_pos, &used);
        t->in_pos += used;
        if (r == LINES_LINE && !t->pty && http_line(t->lines.buf, t->lines.len)) hang_up(t);
        else if (r != LINES_MORE) t->ops->line(t, r, t->lines.buf, t->lines.len, t_ns);
    }
    t->taking = false;
    if (t->in_pos == t->in_len && t->eof) end_link(t, t_ns);
}

/* No protocol of ours begins like HTTP or TLS. A pty is not looked at: no page reaches it. */
static bool is_browser(struct text_link *t)
{
    if (t->pty || t->first_len == sizeof t->first) return false;
    const size_t room = sizeof t->first - t->first_len;
    const size_t n = t->in_len < room ? t->in_len : room;
    memcpy(t->first + t->first_len, t->in, n);
    t->first_len += n;
    return http_begins(t->first, t->first_len);
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct text_link *t = (struct text_link *)l;
    if (t->in_pos < t->in_len || t->eof) return;
    if (t->pty) pty_take_news(t->pty, t_ns);
    const ssize_t n = read(l->fd, t->in, sizeof t->in);
    if (n < 0 && (errno == EAGAIN || errno == EINTR || t->pty)) return; /* a pty that no program has open */
    if (t->ops->was_read) t->ops->was_read(l->fd);
    t->in_pos = 0;
    t->in_len = n > 0 ? (size_t)n : 0;
    t->eof = n <= 0;
    if (is_browser(t)) hang_up(t);
    take_lines(t, t_ns);
    refresh_link(t);
}

void text_link_flush(struct link *l, int64_t t_ns)
{
    struct text_link *t = (struct text_link *)l;
    if (t->ended) return;
    if (t->pty && !t->pty->openers) outbuf_clear(&t->out);
    if (t->in_pos < t->in_len) take_lines(t, t_ns);
    if (!t->hold && !t->stall && outbuf_pending(&t->out) && outbuf_flush(&t->out, l->fd) < 0) {
        outbuf_clear(&t->out); /* the peer is gone; its input is still processed */
        t->eof = !t->pty;
        if (t->eof && t->in_pos == t->in_len) end_link(t, t_ns);
    }
    refresh_link(t);
}

static bool init_link(struct text_link *t, const struct text_link_cfg *cfg, const struct text_link_ops *ops)
{
    *t = (struct text_link){.ops = ops, .out_high = cfg->out_high};
    char *line = malloc(cfg->line_max + 1);
    if (!line) return false;
    if (!outbuf_init(&t->out, cfg->out_max)) {
        free(line);
        return false;
    }
    lines_init(&t->lines, line, cfg->line_max + 1, cfg->end);
    t->link = (struct link){.fd = cfg->fd, .want_read = true, .readable = on_readable, .flush = text_link_flush};
    snprintf(t->link.who, sizeof t->link.who, "%s", cfg->who);
    return true;
}

static void release_link(struct link *l)
{
    text_link_free((struct text_link *)l);
    free(l);
}

void *text_link_new(size_t size, const struct text_link_cfg *cfg, const struct text_link_ops *ops)
{
    struct text_link *t = calloc(1, size);
    if (!t || !init_link(t, cfg, ops)) {
        free(t);
        return NULL;
    }
    t->link.release = release_link;
    return t;
}

static void on_opened(void *ctx, bool open, int64_t t_ns)
{
    struct text_link *t = ctx;
    (void)t_ns;
    if (t->ops->opened) t->ops->opened(t, open);
    if (!open) return;
    lines_reset(&t->lines);
    t->in_pos = t->in_len = 0;
    outbuf_clear(&t->out);
    refresh_link(t);
}

int text_link_open_pty(struct text_link *t, struct pty *p, const struct text_link_cfg *cfg,
                       const struct text_link_ops *ops, struct links *links, const char *name)
{
    const int err = pty_open(p, name);
    if (err) return err;
    if (!init_link(t, cfg, ops)) {
        pty_close(p);
        return -ENOMEM;
    }
    t->pty = p;
    snprintf(t->link.who, sizeof t->link.who, "%s %s", cfg->who, p->path);
    t->link.fd = p->master;
    p->master = -1; /* the link's now */
    t->link.is_pty = true;
    p->port = &t->link;
    p->opened = on_opened;
    p->ctx = t;
    links_add_first(links, &t->link);
    links_add_first(links, &p->watch);
    return 0;
}

void text_link_free(struct text_link *t)
{
    link_close(&t->link);
    if (t->pty) pty_close(t->pty);
    free(t->lines.buf);
    t->lines.buf = NULL;
    outbuf_free(&t->out);
}

bool text_link_put(struct text_link *t, const char *text, size_t n)
{
    const bool fits = outbuf_put(&t->out, text, n);
    refresh_link(t);
    return fits;
}

void text_link_stall(struct text_link *t, bool on)
{
    t->stall = on;
    refresh_link(t);
}
