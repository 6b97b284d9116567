#include "link/line/bus_pty.h"

#include <inttypes.h>
#include <stdio.h>

enum { OUT_MAX = 1 << 20 };

static void put_text(struct bus_pty *p, const char *text, size_t n)
{
    text_link_put(&p->io, text, n);
}

static void reject_request(struct bus_pty *p, const struct bus_request *r, unsigned fields, const char *code,
                           int64_t t_ns)
{
    char text[BUS_TEXT_MAX];
    put_text(p, text, bus_text_refused(r, fields, code, t_ns, text));
}

static void say_who(struct bus_pty *p, int64_t t_ns)
{
    char text[BUS_TEXT_MAX];
    size_t n = (size_t)snprintf(text, sizeof text, "I %.16s", p->ops.board);
    for (unsigned a = 0; a < p->ops.addresses; a++) {
        const char *const name = p->ops.name(p->ops.ctx, a);
        if (name && n + 40 < sizeof text) n += (size_t)snprintf(text + n, sizeof text - n, " %02Xh=%.11s", a, name);
    }
    n += (size_t)snprintf(text + n, sizeof text - n, " t=%" PRId64 "\n", t_ns);
    put_text(p, text, n);
}

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    struct bus_pty *p = (struct bus_pty *)t;
    struct bus_request request = {.op = BUS_READ};
    unsigned fields = 0;
    const enum bus_text_err err = r == LINES_LINE ? bus_text_parse(line, len, &request, &fields) : BUS_TEXT_OVERLONG;
    if (err != BUS_TEXT_OK) {
        reject_request(p, &request, fields, bus_text_code(err), t_ns);
        return;
    }
    if (request.op == BUS_WHO) {
        say_who(p, t_ns);
        return;
    }
    const char *const code = p->ops.submit(p->ops.ctx, &request, t_ns);
    if (code) {
        reject_request(p, &request, fields, code, t_ns);
        return;
    }
    p->request = request;
    p->busy = true;
    p->orphan = false;
}

static bool on_ready(struct text_link *t)
{
    return !((const struct bus_pty *)t)->busy;
}

void bus_pty_done(struct bus_pty *p, uint16_t data, int64_t t_ns)
{
    char text[BUS_TEXT_MAX];
    if (!p->busy) return;
    p->busy = false;
    if (!p->orphan) put_text(p, text, bus_text_done(&p->request, data, t_ns, text));
}

void bus_pty_failed(struct bus_pty *p, const char *code, int64_t t_ns)
{
    if (!p->busy) return;
    p->busy = false;
    if (!p->orphan) reject_request(p, &p->request, 2, code, t_ns);
}

/* A cycle of the program before goes on without an answer. */
static void on_opened(struct text_link *t, bool open)
{
    struct bus_pty *p = (struct bus_pty *)t;
    if (open) p->orphan = p->busy;
}

static const struct text_link_ops text_ops = {.line = on_line, .ready = on_ready, .opened = on_opened};

int bus_pty_open(struct bus_pty *p, struct links *links, const struct bus_pty_ops *ops, const char *name)
{
    static const struct text_link_cfg cfg = {
        .who = "bus port", .end = '\n', .line_max = BUS_TEXT_LINE_MAX + 1, .out_max = OUT_MAX, .out_high = OUT_MAX};
    *p = (struct bus_pty){.ops = *ops};
    return text_link_open_pty(&p->io, &p->pty, &cfg, &text_ops, links, name);
}

void bus_pty_close(struct bus_pty *p)
{
    p->busy = false;
    text_link_free(&p->io);
}
