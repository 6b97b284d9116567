#include "link/logic/beagle_tcp.h"

#include "link/tcp.h"
#include "link/text_link.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OUT_MAX = 2 * sizeof((struct beagle_server *)0)->chunk, NEWS_MAX = 160 };

struct beagle_peer {
    struct text_link io; /* first */
    struct beagle_server *server;
    struct beagle_peer *next;
    struct beagle_settings settings;
    void *capture; /* NULL: none runs */
    bool told;     /* the first hole was reported */
    void (*read_lines)(struct link *l, int64_t t_ns);
    char news[NEWS_MAX];
};

/* ---- captures */

/* The first hole at once, all of them when the capture has ended. */
static void report_hole(struct beagle_peer *p, const struct beagle_progress *g)
{
    if (p->told || !g->holes) return;
    p->told = true;
    snprintf(p->news, sizeof p->news,
             "reads too slowly: samples are lost in buffers of %" PRIu32 " bytes, first after %" PRIu64,
             p->settings.buffer_bytes, g->kept);
    p->io.link.notice = p->news;
}

static void report_end(struct beagle_peer *p, const struct beagle_progress *g)
{
    if (!g->holes) return;
    snprintf(p->news, sizeof p->news,
             "end of a capture: lost %" PRIu64 " samples in %" PRIu64 " places, delivered %" PRIu64, g->dropped,
             g->holes, g->kept);
    p->io.link.notice = p->news;
}

static void add_progress(struct beagle_totals *t, const struct beagle_progress *g)
{
    t->samples += g->kept;
    t->lost += g->dropped;
    t->holes += g->holes;
}

static void end_capture(struct beagle_peer *p)
{
    struct beagle_progress g;
    if (!p->capture) return;
    p->server->source.look(p->capture, &g);
    add_progress(&p->server->ended, &g);
    report_end(p, &g);
    p->server->source.stop(p->capture);
    p->capture = NULL;
}

static void begin_capture(struct beagle_peer *p)
{
    const struct beagle_settings *s = &p->settings;
    const unsigned bytes = s->unit == BEAGLE_8_BITS ? 1 : 2;
    const struct beagle_request request = {.hz = s->hz, .bytes = bytes, .block = s->buffer_bytes / bytes};
    p->capture = p->server->source.start(p->server->source.ctx, &request);
    p->told = false;
    if (p->capture) {
        struct beagle_progress g;
        p->server->source.look(p->capture, &g);
        p->server->ended.captures++;
        p->io.link.linger = true; /* libsigrok 0.5.2 reads on without end when it meets the end of the stream first */
        p->server->ended.first_ns = g.first_ns;
        return;
    }
    p->io.link.notice = "out of memory for a capture: connection closed";
    p->io.link.gone = true;
}

/* What the kernel has not got yet is not sent any more: the client reads on until there is silence. */
static void close_capture(struct beagle_peer *p)
{
    end_capture(p);
    outbuf_clear(&p->io.out);
}

/* ---- lines */

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    struct beagle_peer *p = (struct beagle_peer *)t;
    char answer[BEAGLE_ANSWER_MAX];
    size_t n = 0;
    struct beagle_settings s = p->settings;
    const enum beagle_action action = beagle_text_line(&s, r == LINES_LINE ? line : NULL, len, answer, &n);
    (void)t_ns;
    if (p->capture && action != BEAGLE_CLOSE) {
        p->server->ended.rejected++;
        return;
    }
    p->settings = s;
    p->server->ended.rejected += action == BEAGLE_REJECTED;
    if (n) text_link_put(t, answer, n);
    if (action == BEAGLE_GET) begin_capture(p);
    if (action == BEAGLE_CLOSE) close_capture(p);
}

/* ---- output */

static void refresh_link(struct beagle_peer *p)
{
    struct beagle_progress g = {0};
    if (!p->capture) return;
    p->server->source.look(p->capture, &g);
    const size_t high = p->server->source.high;
    p->io.link.pending = outbuf_pending(&p->io.out) + g.waiting;
    p->io.link.full = high && g.waiting > high;
    report_hole(p, &g);
}

/* Samples are taken as the kernel takes them: what it does not take waits in the ring, which has its own bound. */
static void on_flush(struct link *l, int64_t t_ns)
{
    struct beagle_peer *p = (struct beagle_peer *)l;
    struct beagle_server *s = p->server;
    text_link_flush(l, t_ns);
    while (p->capture && !outbuf_pending(&p->io.out)) {
        const size_t n = s->source.take(p->capture, s->chunk, sizeof s->chunk);
        if (n == 0) break;
        text_link_put(&p->io, (const char *)s->chunk, n);
        text_link_flush(l, t_ns);
    }
    refresh_link(p);
}

static void on_readable(struct link *l, int64_t t_ns)
{
    struct beagle_peer *p = (struct beagle_peer *)l;
    p->read_lines(l, t_ns);
    refresh_link(p);
}

/* ---- clients */

static void forget_peer(struct beagle_peer *p)
{
    struct beagle_peer **at = &p->server->peers;
    while (*at && *at != p) at = &(*at)->next;
    if (!*at) return;
    *at = p->next;
    p->server->clients--;
}

static void on_closed(struct text_link *t, int64_t t_ns)
{
    (void)t_ns;
    end_capture((struct beagle_peer *)t);
    t->link.gone = true;
}

static void on_release(struct link *l)
{
    struct beagle_peer *p = (struct beagle_peer *)l;
    end_capture(p);
    forget_peer(p);
    text_link_free(&p->io);
    free(p);
}

static const struct text_link_ops ops = {.line = on_line, .was_read = tcp_quick_ack, .closed = on_closed};

static struct beagle_peer *make_peer(struct beagle_server *s, int fd)
{
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "logic analyser, client 127.0.0.1:%u", tcp_peer_port(fd));
    const struct text_link_cfg cfg = {
        .who = who, .fd = fd, .end = '\n', .line_max = BEAGLE_LINE_MAX + 2, .out_max = OUT_MAX, .out_high = OUT_MAX};
    struct beagle_peer *p = text_link_new(sizeof *p, &cfg, &ops);
    if (!p) return NULL;
    p->server = s;
    p->settings = beagle_settings();
    p->read_lines = p->io.link.readable;
    p->io.link.readable = on_readable;
    p->io.link.flush = on_flush;
    p->io.link.release = on_release;
    return p;
}

static void on_connection(struct listener *l, int fd, int64_t t_ns)
{
    struct beagle_server *s = (struct beagle_server *)l;
    (void)t_ns;
    tcp_no_delay(fd);
    struct beagle_peer *p = s->clients < BEAGLE_CLIENTS_MAX ? make_peer(s, fd) : NULL;
    if (!p) {
        l->link.notice = "too many clients: connection closed";
        close(fd);
        return;
    }
    p->next = s->peers;
    s->peers = p;
    s->clients++;
    links_add_first(s->links, &p->io.link);
}

int beagle_open(struct beagle_server *s, struct links *links, const struct beagle_source *source, uint16_t port)
{
    char who[LINK_WHO_MAX];
    const int fd = tcp_listen(&port);
    if (fd < 0) return fd;
    tcp_even_segments(fd);
    s->links = links;
    s->source = *source;
    s->peers = NULL;
    s->clients = 0;
    s->port = port;
    s->ended = (struct beagle_totals){0};
    snprintf(who, sizeof who, "logic analyser, port %u", port);
    listener_open(&s->listen, fd, who, on_connection);
    links_add_first(links, &s->listen.link);
    return 0;
}

void beagle_close(struct beagle_server *s)
{
    listener_close(&s->listen);
    for (struct beagle_peer *p = s->peers; p; p = p->next) {
        end_capture(p);
        p->io.link.gone = true;
    }
}

struct beagle_totals beagle_totals(const struct beagle_server *s)
{
    struct beagle_totals t = s->ended;
    struct beagle_progress g;
    for (const struct beagle_peer *p = s->peers; p; p = p->next) {
        if (!p->capture) continue;
        s->source.look(p->capture, &g);
        add_progress(&t, &g);
        t.running++;
    }
    return t;
}

bool beagle_is_sampling(const struct beagle_server *s)
{
    for (const struct beagle_peer *p = s->peers; p; p = p->next)
        if (p->capture) return true;
    return false;
}
