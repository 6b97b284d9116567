/* The adapter on a bus without bit rate, its peer a socket of ours: full datagrams both ways, and losses, counted once. */
#define _GNU_SOURCE
#include "link/can/cannelloni_can.h"
#include "link/can/cannelloni_frame.h"

#include "can_rig.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

struct bench {
    struct sched s;
    struct can_bus bus;
    struct can_hub hub;
    struct links links;
    struct cannelloni_can c;
    struct can_node other;
    int fd; /* the peer */
    uint8_t seq;
    unsigned received;
    char said[200];
};

static struct bench bench;

static void on_said(const char *text)
{
    snprintf(bench.said, sizeof bench.said, "%s", text);
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct bench *r = ctx;
    (void)t_ns;
    assert_int_equal(m->id, r->received++); /* in order, none twice */
}

static struct bench *up(uint32_t bitrate_hz)
{
    struct bench *r = &bench;
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){.bitrate_hz = bitrate_hz, .data_bitrate_hz = 5000000}, &r->s);
    r->hub = (struct can_hub){.bus = &r->bus, .links = &r->links, .lossless = true, .say = on_said};
    r->other = (struct can_node){.name = "other", .order = CAN_ORDER_FIFO, .fd = true, .rx = on_frame, .ctx = r};
    can_attach(&r->bus, &r->other);
    r->fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    assert_int_equal(bind(r->fd, (struct sockaddr *)&a, sizeof a), 0);
    assert_int_equal(getsockname(r->fd, (struct sockaddr *)&a, &size), 0);
    const struct cannelloni_ports ports = {.own = 0, .peer = ntohs(a.sin_port)};
    assert_int_equal(cannelloni_can_open(&r->c, &r->hub, ports), 0);
    a.sin_port = htons(r->c.ports.own);
    assert_int_equal(connect(r->fd, (struct sockaddr *)&a, sizeof a), 0);
    return r;
}

static void down(struct bench *r)
{
    cannelloni_can_close(&r->c);
    close(r->fd);
}

static void send_frames(struct bench *r, unsigned first, unsigned count)
{
    uint8_t bytes[DGRAM_CAN_MAX];
    size_t n = CANNELLONI_HEADER;
    for (unsigned i = 0; i < count; i++)
        n += cannelloni_put_frame(&(struct can_msg){.id = first + i, .flags = CAN_RTR}, bytes + n);
    cannelloni_put_header(r->seq++, (uint16_t)count, bytes);
    assert_int_equal(send(r->fd, bytes, n, 0), (ssize_t)n);
}

static void read_all(struct bench *r)
{
    r->c.io.link.readable(&r->c.io.link, r->s.now_ns);
}

static void run(struct bench *r, int64_t for_ns)
{
    sched_run_until(&r->s, r->s.now_ns + for_ns);
}

/* ---- bus to peer */

static void what_waits_fills_datagrams_and_stays_in_order(void **state)
{
    enum { FRAMES = 100, IN_ONE = (1472 - 5) / 70 };
    struct bench *r = up(0);
    struct can_msg m = {.flags = CAN_FD, .len = 64};
    uint8_t bytes[2000], seq;
    unsigned got = 0, count, datagrams = 0;
    (void)state;
    for (; m.id < FRAMES; m.id++) assert_int_equal(can_send(&r->bus, &r->other, &m, 0), CAN_OK);
    run(r, 1);
    r->c.io.link.flush(&r->c.io.link, r->s.now_ns);
    for (ssize_t n; (n = recv(r->fd, bytes, sizeof bytes, 0)) > 0; datagrams++) {
        struct can_msg back;
        assert_true(n <= 1472);
        assert_true(cannelloni_check(bytes, (size_t)n, &seq, &count));
        assert_int_equal(seq, datagrams);
        assert_true(count == IN_ONE || got + count == FRAMES);
        for (size_t at = CANNELLONI_HEADER; at < (size_t)n; got++) {
            at += cannelloni_take_frame(bytes + at, (size_t)n - at, &back);
            assert_int_equal(back.id, got);
        }
    }
    assert_int_equal(got, FRAMES);
    assert_int_equal(datagrams, (FRAMES + IN_ONE - 1) / IN_ONE);
    assert_int_equal(r->c.io.link.pending, 0);
    down(r);
}

static void without_a_peer_nothing_is_held_up_or_reported(void **state)
{
    struct bench *r = up(0);
    struct can_msg m = {.flags = CAN_FD, .len = 64};
    (void)state;
    close(r->fd); /* the kernel answers each datagram with "port unreachable" */
    for (; m.id < 100; m.id++) assert_int_equal(can_send(&r->bus, &r->other, &m, 0), CAN_OK);
    run(r, 1);
    r->c.io.link.flush(&r->c.io.link, r->s.now_ns);
    assert_int_equal(r->c.io.can.delivered, 100);
    assert_int_equal(r->c.io.can.dropped, 0);
    assert_int_equal(r->c.io.link.pending, 0);
    assert_string_equal(r->said, "");
    cannelloni_can_close(&r->c);
}

/* ---- peer to bus */

static void frames_without_room_wait_and_the_next_datagram_with_them(void **state)
{
    struct bench *r = up(1000000);
    (void)state;
    send_frames(r, 0, 293);
    send_frames(r, 293, 7);
    read_all(r);
    assert_int_equal(r->c.io.can.taken, CAN_QUEUE_MAX);
    assert_false(r->c.io.link.want_read);
    run(r, 1000000);
    read_all(r); /* asked without need: the rest comes first */
    for (unsigned i = 0; i < 100 && r->received < 300; i++) {
        r->c.io.link.flush(&r->c.io.link, r->s.now_ns);
        if (r->c.io.link.want_read) read_all(r);
        run(r, 1000000);
    }
    assert_int_equal(r->received, 300);
    assert_int_equal(r->c.io.can.refused + r->c.io.can.overrun, 0);
    down(r);
}

/* Fills the socket beyond its buffer; returns how many datagrams did not fit. */
static unsigned overfill(struct bench *r, unsigned count)
{
    const uint64_t taken = r->c.io.can.taken;
    for (unsigned i = 0; i < count; i++) send_frames(r, (unsigned)taken + i, 1);
    read_all(r);
    run(r, 1);
    return count - (unsigned)(r->c.io.can.taken - taken);
}

static void a_datagram_lost_in_the_kernel_is_counted_once_and_others_besides(void **state)
{
    enum { SENT = 60 };
    const int size = 16384;
    struct bench *r = up(0);
    uint64_t lost = 0;
    (void)state;
    r->other.rx = NULL;
    assert_int_equal(setsockopt(r->c.io.link.fd, SOL_SOCKET, SO_RCVBUF, &size, sizeof size), 0);
    for (unsigned k = 0; k < 4; k++) {
        const unsigned here = overfill(r, SENT);
        assert_in_range(here, 1, SENT - 1);
        assert_int_equal(r->c.io.can.overrun, lost); /* the next datagram tells */
        if (k == 1) r->seq += 3;                     /* on the way, too */
        lost += here + (k == 1 ? 3 : 0);
        send_frames(r, 0, 1);
        read_all(r);
        assert_int_equal(r->c.io.can.overrun, lost);
        r->seq += 2; /* on the way alone */
        lost += 2;
        send_frames(r, 0, 1);
        read_all(r);
        assert_int_equal(r->c.io.can.overrun, lost);
    }
    assert_non_null(strstr(r->said, "datagrams were lost"));
    down(r);
}

static void a_frame_that_cannot_be_is_refused_alone_and_said(void **state)
{
    struct bench *r = up(0);
    const struct can_msg m[] = {{.id = 4, .flags = CAN_ERROR, .len = 8}, {.id = 0, .len = 1}};
    uint8_t bytes[100];
    size_t n = CANNELLONI_HEADER;
    (void)state;
    for (unsigned i = 0; i < COUNT(m); i++) n += cannelloni_put_frame(&m[i], bytes + n);
    cannelloni_put_header(0, COUNT(m), bytes);
    assert_int_equal(send(r->fd, bytes, n, 0), (ssize_t)n);
    read_all(r);
    run(r, 1);
    assert_int_equal(r->received, 1);
    assert_int_equal(r->c.io.can.refused, 1);
    assert_non_null(strstr(r->said, "what is no CAN frame is refused"));
    down(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_waits_fills_datagrams_and_stays_in_order),
        cmocka_unit_test(without_a_peer_nothing_is_held_up_or_reported),
        cmocka_unit_test(frames_without_room_wait_and_the_next_datagram_with_them),
        cmocka_unit_test(a_datagram_lost_in_the_kernel_is_counted_once_and_others_besides),
        cmocka_unit_test(a_frame_that_cannot_be_is_refused_alone_and_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
