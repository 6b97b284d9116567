#include "link/can/can_log.h"

#include "base/can/text.h"
#include "link/own_file.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

enum { STAMP = 20, LINE_MAX_BYTES = STAMP + 48 + CAN_TEXT_MAX }; /* "(0000000001.234567) " */

/* ---- text ---- */

static void put_digits(char *out, uint64_t v, unsigned digits)
{
    for (unsigned i = digits; i-- > 0; v /= 10) out[i] = (char)('0' + v % 10);
}

static char *put_stamp(char *at, int64_t t_ns)
{
    const uint64_t us = t_ns > 0 ? (uint64_t)t_ns / 1000 : 0; /* as socketcand has it */
    *at = '(';
    put_digits(at + 1, us / 1000000, 10);
    at[11] = '.';
    put_digits(at + 12, us % 1000000, 6);
    at[18] = ')';
    at[19] = ' ';
    return at + STAMP;
}

/* The lines that came before the error are stored, without what there is of the next one. */
static void end_whole(struct can_log *l, size_t written)
{
    for (size_t i = 0; i < written; i++) l->stored += l->text[i] == '\n';
    (void)own_file_cut(l->fd);
}

int can_log_flush(struct can_log *l)
{
    if (l->error) return -l->error;
    for (size_t at = 0; at < l->len && !l->error;) {
        const ssize_t n = write(l->fd, l->text + at, l->len - at);
        if (n > 0) at += (size_t)n;
        else if (n < 0 && errno != EINTR) l->error = errno;
        if (l->error) end_whole(l, at);
    }
    if (!l->error) l->stored = l->frames;
    l->len = 0;
    return -l->error;
}

void can_log_look(struct can_log *l)
{
    if (l->error || !own_file_gone(l->fd, l->path)) return;
    (void)can_log_flush(l);
    l->error = ESTALE;
    if (own_file_removed(l->fd)) l->stored = 0;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct can_log *l = ctx;
    if (l->error) return;
    if (l->len + LINE_MAX_BYTES > sizeof l->text) can_log_flush(l);
    char *at = put_stamp(l->text + l->len, t_ns + l->epoch_ns);
    for (const char *c = l->channel; *c; c++) *at++ = *c;
    *at++ = ' ';
    at += can_text_put(m, at);
    *at++ = '\n';
    l->len = (size_t)(at - l->text);
    l->frames++;
}

/* ---- file ---- */

int can_log_open(struct can_log *l, struct can_bus *bus, const char *channel, const char *path, int64_t epoch_ns,
                 long *owner)
{
    memset(l, 0, offsetof(struct can_log, text));
    l->channel = channel && *channel ? channel : "can0";
    l->path = path;
    l->epoch_ns = epoch_ns;
    l->fd = own_file_open(path, owner);
    if (l->fd < 0) return l->fd;
    l->node = (struct can_node){.name = "log", .fd = true, .rx = on_frame, .error = on_frame, .ctx = l};
    can_attach(bus, &l->node);
    return 0;
}

void can_log_close(struct can_log *l)
{
    if (l->fd < 0) return;
    can_log_flush(l);
    can_detach(l->node.bus, &l->node);
    close(l->fd);
    l->fd = -1;
}
