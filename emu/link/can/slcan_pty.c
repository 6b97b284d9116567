#include "link/can/slcan_pty.h"

#include "base/hex.h"
#include "link/can/slcan.h"

#include <stdio.h>
#include <string.h>

enum { OUT_MAX = 4 << 20, OUT_HIGH = 1 << 18 };

static const uint32_t bitrate_hz[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};

static void send_reply(struct slcan_pty *s, const char *text)
{
    text_link_put(&s->io, text, strlen(text));
}

static void log_line(const struct slcan_pty *s, const char *text)
{
    s->hub->say(text);
}

/* ---- bus to client */

/* Time stamp of the Lawicel protocol: ms within the minute, four digits before CR. */
static size_t put_stamp(const struct slcan_pty *s, int64_t t_ns, char *p)
{
    if (!s->stamps) return 0;
    hex_put(p, (uint32_t)((t_ns + s->hub->epoch_ns) / 1000000 % 60000), 4);
    return 4;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct slcan_pty *s = ctx;
    char line[SLCAN_LINE_MAX];
    size_t n = slcan_encode(m, line, sizeof line - 5);
    if (!n || s->closing) return;
    n += put_stamp(s, t_ns, line + n);
    line[n++] = '\r';
    if (text_link_put(&s->io, line, n)) {
        can_hub_delivered(&s->can);
        return;
    }
    s->can.dropped++;
    s->status |= SLCAN_STATUS_RX_FULL | SLCAN_STATUS_OVERRUN;
    if (!s->lost_reported) log_line(s, "slcan: the client reads too slowly, frames are dropped");
    s->lost_reported = true;
}

static void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct slcan_pty *s = ctx;
    (void)t_ns;
    s->status |= slcan_error_status(m);
}

static void on_stall(struct can_client *can)
{
    struct slcan_pty *s = can->node.ctx;
    text_link_stall(&s->io, can->stalled);
}

/* ---- commands: true is acknowledged with CR, false rejected with BEL */

static bool cmd_open(struct slcan_pty *s, const char *arg)
{
    if (*arg) return false;
    s->listen_only = false;
    if (s->open) return true; /* python-can opens twice when it sets the bit rate */
    s->open = true;
    s->closing = s->can.leaving = s->lost_reported = false;
    s->status = 0;
    if (s->can.up) can_hub_restart(s->hub, &s->can);
    else can_hub_join(s->hub, &s->can);
    return true;
}

static bool cmd_listen(struct slcan_pty *s, const char *arg)
{
    if (!cmd_open(s, arg)) return false;
    s->listen_only = true;
    return true;
}

/* A client that sent and closed: its frames still go out, then it leaves the bus (on_flush), also when it closes again. */
static bool cmd_close(struct slcan_pty *s, const char *arg)
{
    if (*arg) return false;
    if (s->open) s->closing = s->can.leaving = true;
    s->open = false;
    return true;
}

/* A bus of another bit rate would answer with error frames only: reject, so that the client notices. */
static bool cmd_bitrate(struct slcan_pty *s, const char *arg)
{
    if (arg[0] < '0' || arg[0] > '8' || arg[1]) return false;
    const uint32_t bus_hz = s->hub->bus->cfg.bitrate_hz;
    return bus_hz == 0 || bitrate_hz[arg[0] - '0'] == bus_hz;
}

static bool cmd_data_bitrate(struct slcan_pty *s, const char *arg)
{
    if (arg[0] < '0' || arg[0] > '8' || arg[1]) return false;
    const struct can_bus_cfg *bus = &s->hub->bus->cfg;
    return bus->bitrate_hz == 0 || (uint32_t)(arg[0] - '0') * 1000000 == bus->data_bitrate_hz;
}

static bool cmd_status(struct slcan_pty *s, const char *arg)
{
    if (*arg || !s->open) return false;
    char text[4] = {'F', '0', '0', '\0'};
    hex_put(text + 1, s->status, 2);
    send_reply(s, text);
    s->status = 0;
    return true;
}

static bool cmd_stamps(struct slcan_pty *s, const char *arg)
{
    if ((arg[0] != '0' && arg[0] != '1') || arg[1] || s->open) return false;
    s->stamps = arg[0] == '1';
    return true;
}

static const struct {
    char letter;
    bool (*run)(struct slcan_pty *s, const char *arg);
    const char *answer; /* of a command that does nothing else */
} commands[] = {
    {'O', cmd_open, NULL},         {'L', cmd_listen, NULL}, {'C', cmd_close, NULL},  {'S', cmd_bitrate, NULL},
    {'Y', cmd_data_bitrate, NULL}, {'F', cmd_status, NULL}, {'Z', cmd_stamps, NULL}, {'V', NULL, "V1013"},
    {'v', NULL, "vpsabench"},      {'N', NULL, "NPSAB"},
};

static bool do_command(struct slcan_pty *s, const char *line)
{
    const unsigned rows = sizeof commands / sizeof commands[0];
    unsigned i = 0;
    while (i < rows && commands[i].letter != line[0]) i++;
    if (i == rows || (!commands[i].run && line[1])) return false;
    if (commands[i].run) return commands[i].run(s, line + 1);
    send_reply(s, commands[i].answer);
    return true;
}

static bool do_frame(struct slcan_pty *s, const struct can_msg *m, int64_t t_ns)
{
    if (!s->open || s->listen_only || !can_hub_send(s->hub, &s->can, m, t_ns)) return false;
    send_reply(s, m->flags & CAN_EXT ? "Z" : "z");
    return true;
}

static void on_line(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns)
{
    struct slcan_pty *s = (struct slcan_pty *)t;
    struct can_msg m;
    while (r == LINES_LINE && len && *line == '\n') { /* clients that end a line with CR LF */
        line++;
        len--;
    }
    const enum slcan_err err = r == LINES_LINE ? slcan_decode(line, len, &m) : SLCAN_LONG;
    const bool done = err == SLCAN_OK                                ? do_frame(s, &m, t_ns)
                      : r == LINES_LINE && len == 0                  ? true /* python-can's absent data bit rate */
                      : err == SLCAN_NO_FRAME && strlen(line) == len ? do_command(s, line)
                                                                     : false;
    if (!done) s->can.refused++;
    send_reply(s, done ? "\r" : "\a");
}

static bool on_ready(struct text_link *t)
{
    return can_hub_room(&((struct slcan_pty *)t)->can);
}

/* ---- the port */

static void on_flush(struct link *l, int64_t t_ns)
{
    struct slcan_pty *s = (struct slcan_pty *)l;
    if (!s->pty.openers) {
        if (s->open) cmd_close(s, "");
        s->stamps = false;
    }
    if (s->closing && !s->can.node.queued) {
        s->closing = false;
        can_hub_leave(s->hub, &s->can);
    }
    text_link_flush(l, t_ns);
}

/* The channel is closed by on_flush(), after the last bytes. */
static void on_opened(struct text_link *t, bool open)
{
    log_line((struct slcan_pty *)t, open ? "slcan: port opened" : "slcan: port closed");
}

static const struct text_link_ops ops = {.line = on_line, .ready = on_ready, .opened = on_opened};

int slcan_pty_open(struct slcan_pty *s, struct can_hub *hub, const char *name)
{
    static const struct text_link_cfg cfg = {
        .who = "slcan", .end = '\r', .line_max = SLCAN_LINE_MAX, .out_max = OUT_MAX, .out_high = OUT_HIGH};
    *s = (struct slcan_pty){.hub = hub};
    const int err = text_link_open_pty(&s->io, &s->pty, &cfg, &ops, hub->links, name);
    if (err) return err;
    s->io.link.flush = on_flush;
    s->can.adapter = "slcan";
    snprintf(s->can.name, sizeof s->can.name, "%.31s", s->pty.path);
    s->can.node = (struct can_node){.order = CAN_ORDER_FIFO, .fd = true, .rx = on_frame, .error = on_error, .ctx = s};
    s->can.stall = on_stall;
    return 0;
}

void slcan_pty_close(struct slcan_pty *s)
{
    can_hub_leave(s->hub, &s->can);
    text_link_free(&s->io);
}
