#include "link/can/socketcand_tcp.h"

#include "link/can/socketcand.h"
#include "link/tcp.h"
#include "link/text_link.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum phase { PHASE_HELLO, PHASE_OPEN, PHASE_HOLD, PHASE_RAW, PHASE_LEAVING };

struct client {
    struct text_link io; /* first */
    struct can_client can;
    struct socketcand_server *server;
    struct can_hub *hub; /* of the bus it has opened; before that the first */
    enum phase phase;
    unsigned held; /* hold periods so far */
    uint64_t lost; /* frames dropped since the last report to the client */
    bool fd_reported;
};

/* The kernel's own buffer is kept small: else it grows to megabytes and hides how far behind a client is. */
enum { OUT_MAX = 4 << 20, OUT_HIGH = 1 << 20, SNDBUF = 256 << 10 };

static int64_t time_stamp(const struct client *c, int64_t t_ns)
{
    return t_ns + c->hub->epoch_ns;
}

static void log_client(const struct client *c, const char *what)
{
    char line[160];
    snprintf(line, sizeof line, "socketcand: client %s: %s", c->can.name[0] ? c->can.name : "(no channel)", what);
    c->hub->say(line);
}

/* Before rawmode a client compares answers for equality: no padding. */
static size_t pad_of(const struct client *c)
{
    return c->phase == PHASE_HOLD || c->phase == PHASE_RAW ? SOCKETCAND_PAD : 0;
}

static void send_answer(struct client *c, const char *text)
{
    text_link_put(&c->io, text, strlen(text));
}

static void send_error(struct client *c, uint32_t class, const char *text, int64_t t_ns)
{
    char msg[2 * SOCKETCAND_MSG_MAX];
    const size_t n = socketcand_error(class, time_stamp(c, t_ns), text, pad_of(c), msg, sizeof msg);
    if (n) text_link_put(&c->io, msg, n);
}

/* ---- bus to client */

static void tell_lost(struct client *c, int64_t t_ns)
{
    char text[80];
    snprintf(text, sizeof text, "%llu frames lost: the client reads too slowly", (unsigned long long)c->lost);
    c->lost = 0;
    send_error(c, SOCKETCAND_LOST, text, t_ns);
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct client *c = ctx;
    char msg[SOCKETCAND_MSG_MAX];
    if (c->phase == PHASE_LEAVING) return;
    if (c->lost && outbuf_pending(&c->io.out) < OUT_HIGH) tell_lost(c, t_ns);
    const size_t n = socketcand_frame(m, time_stamp(c, t_ns), pad_of(c), msg, sizeof msg);
    if (n && !c->lost && text_link_put(&c->io, msg, n)) {
        can_hub_delivered(&c->can);
    } else if (n) {
        if (!c->lost++) log_client(c, "reads too slowly, frames are dropped");
        c->can.dropped++;
    }
}

/* An error frame of the bus, or news of the client's own controller. */
static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct client *c = ctx;
    char text[80];
    if (c->phase == PHASE_LEAVING) return;
    snprintf(text, sizeof text, "%s, TEC %u REC %u", socketcand_error_text(m), m->data[6], m->data[7]);
    send_error(c, SOCKETCAND_ERROR_FLAG | m->id, text, t_ns);
}

static void on_stall(struct can_client *can)
{
    struct client *c = can->node.ctx;
    text_link_stall(&c->io, can->stalled);
}

/* ---- client to bus */

static void release_hold(struct client *c)
{
    if (c->phase != PHASE_HOLD) return;
    c->phase = PHASE_RAW;
    c->io.hold = false;
}

enum { WHY_MAX = 160 };

/* With several buses the channel is the name of one. NULL with what is wrong in why. */
static struct can_hub *find_bus(const struct socketcand_server *s, const char *channel, char why[WHY_MAX])
{
    snprintf(why, WHY_MAX, "channel: expected");
    for (unsigned i = 0; i < s->hubs; i++) {
        if (s->hubs == 1 || strcmp(s->hub[i].name, channel) == 0) return &s->hub[i];
        const size_t at = strlen(why);
        snprintf(why + at, WHY_MAX - at, "%s %s", i ? "," : "", s->hub[i].name);
    }
    return NULL;
}

/* ---- what a client says: each returns NULL, or what is wrong */

static const char *do_open(struct client *c, const struct socketcand_msg *m, char why[WHY_MAX])
{
    if (c->phase != PHASE_HELLO) return "open: a channel is already open";
    struct can_hub *hub = find_bus(c->server, m->channel, why);
    if (!hub) return why;
    c->hub = hub;
    memcpy(c->can.name, m->channel, sizeof c->can.name);
    c->phase = PHASE_OPEN;
    send_answer(c, "< ok >");
    return NULL;
}

static const char *do_rawmode(struct client *c, int64_t t_ns)
{
    if (c->phase == PHASE_HELLO) return "rawmode: expected open CHANNEL first";
    if (c->phase != PHASE_OPEN) return "rawmode: already active";
    send_answer(c, "< ok >");
    c->io.link.flush(&c->io.link, t_ns); /* now, as a segment of its own */
    if (c->phase == PHASE_LEAVING) return NULL;
    c->phase = PHASE_HOLD;
    c->io.hold = true;
    c->io.link.timer_ms = SOCKETCAND_HOLD_MS;
    can_hub_join(c->hub, &c->can);
    log_client(c, "connected");
    return NULL;
}

static const char *do_message(struct client *c, const char *line, size_t len, int64_t t_ns, char why[WHY_MAX])
{
    struct socketcand_msg m;
    const enum socketcand_err err = socketcand_decode(line, len, &m);
    release_hold(c); /* it speaks, so it has read its < ok > */
    if (err) return socketcand_strerror(err);
    if (m.verb == SOCKETCAND_OPEN) return do_open(c, &m, why);
    if (m.verb == SOCKETCAND_RAWMODE) return do_rawmode(c, t_ns);
    if (m.verb == SOCKETCAND_SEND && !c->can.up) return "send: expected open CHANNEL and rawmode first";
    if (m.verb == SOCKETCAND_SEND) can_hub_send(c->hub, &c->can, &m.frame, t_ns);
    else send_answer(c, "< echo >");
    return NULL;
}

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    struct client *c = (struct client *)t;
    char why[WHY_MAX];
    const char *error = r == LINES_OVERLONG ? "message: expected at most 200 characters from bracket to bracket"
                                            : do_message(c, line, len, t_ns, why);
    if (!error) return;
    c->can.refused++;
    send_error(c, SOCKETCAND_REFUSED, error, t_ns);
}

static bool on_ready(struct text_link *t)
{
    return can_hub_room(&((struct client *)t)->can);
}

/* ---- coming and going */

static void begin_leaving(struct client *c)
{
    if (c->can.up) {
        if (c->can.node.queued) return; /* frames of a client that sent and left still go out */
        log_client(c, "gone");
        can_hub_leave(c->hub, &c->can);
    }
    c->server->clients--;
    c->io.link.gone = true;
}

static void on_closed(struct text_link *t, int64_t t_ns)
{
    struct client *c = (struct client *)t;
    (void)t_ns;
    c->phase = PHASE_LEAVING;
    c->can.leaving = true;
    t->link.want_read = t->link.want_write = t->link.full = false;
    t->link.pending = 0;
    close(t->link.fd);
    t->link.fd = -1;
    begin_leaving(c);
}

static void on_flush(struct link *l, int64_t t_ns)
{
    struct client *c = (struct client *)l;
    if (c->phase == PHASE_LEAVING) {
        if (!l->gone) begin_leaving(c);
        return;
    }
    if (c->can.node.fd_refused && !c->fd_reported && c->phase == PHASE_RAW) {
        c->fd_reported = true;
        send_error(c, SOCKETCAND_REFUSED, "the bus has FD frames, which socketcand does not support", t_ns);
    }
    text_link_flush(l, t_ns);
}

/* After < ok > to rawmode: frames may flow once the client has read it. */
static void on_timer(struct link *l, int64_t t_ns)
{
    struct client *c = (struct client *)l;
    if (c->phase != PHASE_HOLD) return;
    if (tcp_peer_unread(l->fd) > 0 && ++c->held < SOCKETCAND_HOLD_MAX) {
        l->timer_ms = SOCKETCAND_HOLD_MS;
        return;
    }
    release_hold(c);
    on_flush(l, t_ns);
}

static void on_release(struct link *l)
{
    struct client *c = (struct client *)l;
    can_hub_leave(c->hub, &c->can);
    text_link_free(&c->io);
    free(c);
}

static const struct text_link_ops client_ops = {
    .line = on_line, .ready = on_ready, .was_read = tcp_quick_ack, .closed = on_closed};

static struct client *client_new(struct socketcand_server *s, int fd)
{
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "socketcand client 127.0.0.1:%u", tcp_peer_port(fd));
    const struct text_link_cfg cfg = {
        .who = who, .fd = fd, .end = '>', .line_max = SOCKETCAND_MSG_MAX, .out_max = OUT_MAX, .out_high = OUT_HIGH};
    struct client *c = text_link_new(sizeof *c, &cfg, &client_ops);
    if (!c) return NULL;
    c->server = s;
    c->hub = s->hub;
    c->io.link.flush = on_flush;
    c->io.link.timer = on_timer;
    c->io.link.release = on_release;
    c->can.adapter = "socketcand";
    c->can.node = (struct can_node){.order = CAN_ORDER_FIFO, .rx = on_frame, .error = on_error, .ctx = c};
    c->can.stall = on_stall;
    return c;
}

static void on_connection(struct listener *l, int fd, int64_t t_ns)
{
    struct socketcand_server *s = (struct socketcand_server *)l;
    const int size = SNDBUF;
    tcp_no_delay(fd);
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    struct client *c = s->clients < SOCKETCAND_CLIENTS_MAX ? client_new(s, fd) : NULL;
    if (!c) {
        static const char full[] = "< error 20000008 0.000000 too many clients >";
        l->link.notice = "too many clients: connection closed";
        (void)!write(fd, full, sizeof full - 1);
        shutdown(fd, SHUT_WR);
        close(fd);
        return;
    }
    s->clients++;
    links_add_first(s->hub->links, &c->io.link);
    send_answer(c, "< hi >");
    c->io.link.flush(&c->io.link, t_ns);
}

int socketcand_listen(struct socketcand_server *s, struct can_hub *hub, unsigned hubs, uint16_t port)
{
    const int fd = tcp_listen(&port);
    if (fd < 0) return fd;
    *s = (struct socketcand_server){.hub = hub, .hubs = hubs, .port = port};
    char who[LINK_WHO_MAX];
    snprintf(who, sizeof who, "socketcand, port %u", port);
    listener_open(&s->listen, fd, who, on_connection);
    links_add_first(hub->links, &s->listen.link);
    return 0;
}

void socketcand_close(struct socketcand_server *s)
{
    listener_close(&s->listen);
}
