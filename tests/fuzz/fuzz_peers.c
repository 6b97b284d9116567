/* Programs that connect, send any bytes in pieces of any size, read or not, and vanish: socketcand clients, a program at the
 * slcan port, control clients. Lines wait while a reply is due, messages to clients are whole, and in the end no one is left. */
#define _GNU_SOURCE /* SOCK_NONBLOCK */
#include "fuzz.h"

#include "link/can/can_hub.h"
#include "link/can/slcan_pty.h"
#include "link/can/socketcand_tcp.h"
#include "link/ctl_sock.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { PEERS_MAX = 4, LINKS_MAX = 32, STEPS_MAX = 200, TURNS_MAX = 100 };
enum kind { SOCKETCAND, CONTROL, SLCAN, KINDS };

struct peer {
    int fd; /* -1: none */
    enum kind kind;
    bool inside; /* socketcand: between < and > of what was read so far */
};

struct world {
    struct sched s;
    struct can_bus bus;
    struct can_node host; /* the board's stand-in */
    struct links links;
    struct can_hub hub;
    struct socketcand_server socketcand;
    struct ctl_server control;
    struct slcan_pty slcan;
    struct peer peer[PEERS_MAX];
    struct ctl_client *due[CTL_CLIENTS_MAX + 1]; /* whose replies are */
    uint32_t frames;
};

/* ---- what the adapters call ---- */

static void say(const char *text)
{
    assert(text[0] && !strchr(text, '\n'));
}

static void on_line(void *ctx, struct ctl_client *c, const char *line, int64_t t_ns)
{
    struct world *w = ctx;
    unsigned at = 0;
    assert(t_ns == w->s.now_ns && (!line || (strlen(line) <= CTL_LINE_MAX && !strchr(line, '\n'))));
    for (; w->due[at]; at++) assert(w->due[at] != c);
    assert(at < CTL_CLIENTS_MAX);
    w->due[at] = c;
}

static void forget(struct world *w, const struct ctl_client *c)
{
    unsigned at = 0, to = 0;
    for (; w->due[at]; at++)
        if (w->due[at] != c) w->due[to++] = w->due[at];
    w->due[to] = NULL;
}

static void on_gone(void *ctx, struct ctl_client *c)
{
    forget(ctx, c);
}

/* ---- one turn of a loop ---- */

static void turn(struct world *w)
{
    struct link *polled[LINKS_MAX];
    struct pollfd p[LINKS_MAX];
    nfds_t n = 0;
    for (struct link *k = w->links.first; k; k = k->next)
        if (k->flush && !k->gone) k->flush(k, w->s.now_ns);
    for (struct link *k = w->links.first; k && n < LINKS_MAX; k = k->next) {
        const short events = (short)((k->want_read ? POLLIN : 0) | (k->want_write ? POLLOUT : 0));
        polled[n] = k;
        p[n++] = (struct pollfd){.fd = events && !k->gone ? k->fd : -1, .events = events};
    }
    assert(poll(p, n, 0) >= 0);
    for (nfds_t i = 0; i < n; i++) {
        struct link *k = polled[i];
        if (!k->gone && k->fd >= 0 && k->want_read && p[i].revents & (POLLIN | POLLHUP | POLLERR))
            k->readable(k, w->s.now_ns);
        if (!k->gone && k->fd >= 0 && p[i].revents & (POLLOUT | POLLERR) && k->flush) k->flush(k, w->s.now_ns);
    }
    links_reap(&w->links);
    for (const struct can_client *c = w->hub.clients; c; c = c->next) assert(c->up && c->node.queued <= CAN_QUEUE_MAX);
}

/* ---- peers ---- */

static int connected(int fd, const void *address, socklen_t len)
{
    if (fd < 0 || connect(fd, address, len) < 0) abort();
    if (fcntl(fd, F_SETFL, O_NONBLOCK) < 0) abort();
    return fd;
}

static int join(struct world *w, enum kind kind)
{
    if (kind == SLCAN) return open(w->slcan.pty.path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (kind == SOCKETCAND) {
        const struct sockaddr_in a = {
            .sin_family = AF_INET, .sin_port = htons(w->socketcand.port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        return connected(socket(AF_INET, SOCK_STREAM, 0), &a, sizeof a);
    }
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    (void)snprintf(a.sun_path, sizeof a.sun_path, "%s", w->control.path);
    return connected(socket(AF_UNIX, SOCK_STREAM, 0), &a, sizeof a);
}

/* A TCP connection is reset: thousands a second would wait for their time to be over. */
static void leave(struct peer *p)
{
    const struct linger reset = {.l_onoff = 1};
    if (p->fd < 0) return;
    if (p->kind == SOCKETCAND) (void)setsockopt(p->fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    (void)close(p->fd);
    p->fd = -1;
}

static void op_join(struct world *w, struct peer *p, struct script *s)
{
    const uint8_t b = script_byte(s);
    leave(p);
    *p = (struct peer){.kind = (enum kind)(b % KINDS), .fd = -1};
    p->fd = join(w, p->kind);
    turn(w);
}

static void op_leave(struct world *w, struct peer *p, struct script *s)
{
    if (script_byte(s) & 1 && p->fd >= 0 && p->kind != SLCAN) (void)shutdown(p->fd, SHUT_WR);
    else leave(p);
    turn(w);
}

static void op_send(struct world *w, struct peer *p, struct script *s)
{
    static const char *const words[] = {
        "< open can0 >",
        "< rawmode >",
        "< send 123 2 1 2 >",
        "< echo >",
        "< send 605 8 40 8 10 0 0 0 0 0 >",
        "O\r",
        "S8\r",
        "t12321122\r",
        "Z1\r",
        "C\r",
        "F\r",
        "{\"id\":1,\"cmd\":\"time\"}\n",
        "V\r",
        "D12345678811\r",
    };
    char bytes[64];
    const uint8_t b = script_byte(s);
    size_t n = 0;
    if (b & 128)
        for (n = 0; n < (b & 63u); n++) bytes[n] = (char)script_byte(s);
    else n = (size_t)snprintf(bytes, sizeof bytes, "%s", words[b % (sizeof words / sizeof *words)]);
    if (p->fd >= 0 && n) (void)!write(p->fd, bytes, n);
    if (b & 64) turn(w);
}

/* What a socketcand client gets is messages, each from < to >. */
static void op_read(struct world *w, struct peer *p, struct script *s)
{
    static char got[65536];
    (void)w;
    const size_t cap = 1 + (size_t)script_byte(s) * 257;
    const ssize_t n = p->fd >= 0 ? read(p->fd, got, cap < sizeof got ? cap : sizeof got) : 0;
    for (ssize_t i = 0; i < n && p->kind == SOCKETCAND; i++) {
        assert(p->inside ? got[i] != '<' : got[i] == '<');
        p->inside = got[i] != '>';
    }
}

static void op_time(struct world *w, struct peer *p, struct script *s)
{
    (void)p;
    sched_run_until(&w->s, w->s.now_ns + script_span_ns(s));
    turn(w);
}

static void op_stream(struct world *w, struct peer *p, struct script *s)
{
    const uint8_t b = script_byte(s);
    (void)p;
    for (unsigned i = 0; i < (b & 127u); i++) {
        struct can_msg m = {.id = 0x185, .len = b & 128 ? 64 : 8, .flags = b & 128 ? CAN_FD | CAN_BRS : 0};
        memcpy(m.data, &w->frames, sizeof w->frames);
        w->frames++;
        if (can_send(&w->bus, &w->host, &m, w->s.now_ns) != CAN_OK) break;
    }
    sched_run_until(&w->s, w->s.now_ns + 1000000);
}

static void op_reply(struct world *w, struct peer *p, struct script *s)
{
    (void)p;
    (void)s;
    struct ctl_client *c = w->due[0];
    if (!c) return;
    forget(w, c);
    ctl_reply(c, "{\"ok\":true}");
}

static void op_timers(struct world *w, struct peer *p, struct script *s)
{
    (void)p;
    (void)s;
    for (struct link *k = w->links.first; k; k = k->next) {
        if (!k->timer_ms || k->gone) continue;
        k->timer_ms = 0;
        k->timer(k, w->s.now_ns);
    }
}

/* ---- beginning and end ---- */

static char control_dir[] = P_tmpdir "/fuzz_peers.XXXXXX", control_path[sizeof control_dir + 16];

static void remove_control(void)
{
    (void)unlink(control_path);
    (void)rmdir(control_dir);
}

/* A port in a folder of this process alone, gone with it. */
static void listen_for_control(struct world *w)
{
    if (!mkdtemp(control_dir)) abort();
    (void)snprintf(control_path, sizeof control_path, "%s/control", control_dir);
    (void)atexit(remove_control);
    long owner = 0;
    if (ctl_listen(&w->control, control_path, &owner)) abort();
}

/* Once: to open and close the port's watch takes the kernel 10 ms. The ports stay, those who use them come and go. */
static void open_ports(struct world *w)
{
    (void)signal(SIGPIPE, SIG_IGN); /* as the application does */
    sched_init(&w->s);
    can_bus_init(&w->bus, &(struct can_bus_cfg){1000000, 0}, &w->s);
    w->host = (struct can_node){.name = "host", .fd = true, .order = CAN_ORDER_FIFO};
    can_attach(&w->bus, &w->host);
    w->hub = (struct can_hub){.bus = &w->bus, .links = &w->links, .say = say};
    w->control =
        (struct ctl_server){.links = &w->links, .name = "control socket", .line = on_line, .gone = on_gone, .ctx = w};
    if (socketcand_listen(&w->socketcand, &w->hub, 1, 0)) abort();
    if (slcan_pty_open(&w->slcan, &w->hub, NULL)) abort();
    listen_for_control(w);
    for (unsigned i = 0; i < PEERS_MAX; i++) w->peer[i].fd = -1;
}

static void begin(struct world *w, uint8_t choice)
{
    static const struct can_bus_cfg bus[] = {{1000000, 5000000}, {0, 0}, {125000, 0}, {1000000, 0}};
    if (!w->hub.bus) open_ports(w);
    w->bus.cfg = bus[choice & 3]; /* nothing is on it */
    w->hub.lossless = choice & 4;
}

/* All go; what they had sent still goes out, then no one is left. */
static void finish(struct world *w)
{
    for (unsigned i = 0; i < PEERS_MAX; i++) leave(&w->peer[i]);
    for (unsigned i = 0; i < TURNS_MAX && (w->hub.clients || w->socketcand.clients || w->control.clients); i++) {
        while (w->due[0]) op_reply(w, NULL, NULL);
        op_timers(w, NULL, NULL);
        sched_run_until(&w->s, w->s.now_ns + NS_PER_S);
        turn(w);
    }
    assert(!w->hub.clients && w->socketcand.clients == 0 && w->control.clients == 0);
    assert(w->hub.taken == w->hub.gone.taken);
    sched_run_until(&w->s, w->s.now_ns + NS_PER_S); /* the bus is idle */
    assert(w->host.queued == 0);
    turn(w);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const ops[])(struct world * w, struct peer * p, struct script * s) = {
        op_send, op_join, op_read, op_time, op_stream, op_reply, op_timers, op_leave,
    };
    static struct world w;
    struct script s = script_of(data, size);
    begin(&w, script_byte(&s));
    for (unsigned i = 0; i < STEPS_MAX && script_more(&s); i++) {
        const uint8_t b = script_byte(&s);
        ops[b & 7](&w, &w.peer[b >> 3 & (PEERS_MAX - 1)], &s);
    }
    finish(&w);
    return 0;
}
