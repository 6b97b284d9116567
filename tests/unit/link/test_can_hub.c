/* What a client of the bus sees of its faults: error frames in words, a program that does not read. */
#define _POSIX_C_SOURCE 200809L
#include "base/can/fault.h"
#include "base/rng.h"
#include "link/can/socketcand.h"
#include "link/can/socketcand_tcp.h"
#include "link/text_link.h"

#include "rig.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { TIMEOUT_MS = 20000 };

struct bench {
    struct sched s;
    struct can_bus bus;
    struct can_hub hub;
    struct links links;
    struct socketcand_server server;
    struct can_node other; /* somebody else on the bus */
    int fd;                /* of the client's program */
};

static struct bench bench;

static void say(const char *text)
{
    (void)text;
}

static bool readable(int fd)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, TIMEOUT_MS) == 1;
}

/* What the program reads; waits for it. */
static void read_text(int fd, char *text, size_t cap)
{
    assert_true(readable(fd));
    const ssize_t n = read(fd, text, cap - 1);
    assert_true(n > 0);
    text[n] = '\0';
}

static bool silent(int fd)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, 0) == 0;
}

/* The program says something, the emulator takes it. */
static void say_to(struct bench *r, const char *text)
{
    struct link *l = r->links.first; /* the latest */
    assert_int_equal(write(r->fd, text, strlen(text)), (ssize_t)strlen(text));
    assert_true(readable(l->fd));
    l->readable(l, r->s.now_ns);
    l->flush(l, r->s.now_ns);
}

static void turn(struct bench *r)
{
    struct link *l = r->links.first;
    l->flush(l, r->s.now_ns);
}

static struct can_client *client(struct bench *r)
{
    assert_non_null(r->hub.clients);
    return r->hub.clients;
}

static struct bench *up(void)
{
    struct bench *r = &bench;
    char text[256];
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){.bitrate_hz = 500000}, &r->s);
    r->hub = (struct can_hub){.bus = &r->bus, .links = &r->links, .lossless = true, .say = say};
    r->other = (struct can_node){.name = "other"};
    can_attach(&r->bus, &r->other);
    assert_int_equal(socketcand_listen(&r->server, &r->hub, 1, 0), 0);
    struct sockaddr_in a = {
        .sin_family = AF_INET, .sin_port = htons(r->server.port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    r->fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(connect(r->fd, (struct sockaddr *)&a, sizeof a), 0);
    assert_true(readable(r->server.listen.link.fd));
    r->server.listen.link.readable(&r->server.listen.link, 0);
    read_text(r->fd, text, sizeof text);
    say_to(r, "< open can0 >");
    read_text(r->fd, text, sizeof text);
    say_to(r, "< rawmode >");
    read_text(r->fd, text, sizeof text);
    assert_string_equal(text, "< ok >");
    say_to(r, "< echo >"); /* it has read its < ok > */
    read_text(r->fd, text, sizeof text);
    return r;
}

static void down(struct bench *r)
{
    close(r->fd);
    while (r->links.first != &r->server.listen.link) {
        struct link *l = r->links.first;
        assert_true(readable(l->fd));
        l->readable(l, r->s.now_ns);
        links_reap(&r->links);
    }
    socketcand_close(&r->server);
    links_reap(&r->links);
}

static void send_other(struct bench *r, uint32_t id)
{
    const struct can_msg m = {.id = id, .len = 1};
    assert_int_equal(can_send(&r->bus, &r->other, &m, r->s.now_ns), CAN_OK);
    sched_run_until(&r->s, r->s.now_ns + 1000000);
}

static void an_error_frame_is_told_in_words_and_class(void **state)
{
    (void)state;
    struct bench *r = up();
    struct can_fault f = {.kind = CAN_FAULT_ERROR, .probability = 1.0, .limit = 1, .rng = rng_stream(1, 1, "fault")};
    char text[512];
    can_fault_add(&r->bus, &f);
    send_other(r, 0x123);
    turn(r);
    read_text(r->fd, text, sizeof text);
    assert_non_null(strstr(text, "< error 20000288 0.000"));
    assert_non_null(strstr(text, "an error frame on the bus, TEC 0 REC 1"));
    assert_non_null(strstr(text, "< frame 123 0.000"));
    assert_true(strstr(text, "< error") < strstr(text, "< frame"));
    assert_int_equal(client(r)->delivered, 1); /* the barrier counts frames only */
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    down(r);
}

static void a_client_reads_the_state_of_its_controller(void **state)
{
    (void)state;
    static const char *const text_of[] = {"this node is in error warning, TEC 0 REC 96",
                                          "this node is error-passive, TEC 0 REC 128"};
    struct bench *r = up();
    struct can_fault f = {.kind = CAN_FAULT_ERROR, .probability = 1.0, .limit = 1, .rng = rng_stream(1, 1, "fault")};
    char text[1024];
    can_fault_add(&r->bus, &f);
    for (unsigned i = 0; i < COUNT(text_of); i++) {
        client(r)->node.rec = (uint16_t)(i ? 127 : 95);
        f.limit = i + 1;
        send_other(r, 0x123);
        turn(r);
        read_text(r->fd, text, sizeof text);
        assert_non_null(strstr(text, "< error 20000204 "));
        assert_non_null(strstr(text, text_of[i]));
        assert_non_null(
            strstr(text, i ? "in error warning, TEC 0 REC 120" : "this node is error-active, TEC 0 REC 95"));
    }
    can_fault_remove(&r->bus, &f, r->s.now_ns);
    down(r);
}

static void a_client_off_the_bus_hears_it_and_comes_back(void **state)
{
    (void)state;
    struct bench *r = up();
    char text[1024];
    can_bus_off(&r->bus, &client(r)->node, r->s.now_ns);
    send_other(r, 0x123);
    turn(r);
    read_text(r->fd, text, sizeof text);
    assert_non_null(strstr(text, "< error 20000240 "));
    assert_null(strstr(text, "< frame 123")); /* deaf */
    sched_run_until(&r->s, r->s.now_ns + 3000000);
    turn(r);
    read_text(r->fd, text, sizeof text);
    assert_non_null(strstr(text, "< error 20000300 "));
    send_other(r, 0x124);
    turn(r);
    read_text(r->fd, text, sizeof text);
    assert_non_null(strstr(text, "< frame 124"));
    down(r);
}

static void a_stalled_client_gets_nothing_and_nobody_waits_for_it(void **state)
{
    (void)state;
    struct bench *r = up();
    char text[512];
    struct can_client *c = client(r);
    can_hub_stall(c, true);
    for (unsigned i = 0; i < 3; i++) send_other(r, 0x100 + i);
    turn(r);
    assert_true(silent(r->fd));
    assert_int_equal(links_pending(&r->links), 0);
    assert_int_equal(c->delivered, 0);
    assert_int_equal(c->kept, 3);
    can_hub_stall(c, false);
    assert_int_equal(c->delivered, 3);
    assert_true(links_pending(&r->links) > 0);
    turn(r);
    read_text(r->fd, text, sizeof text);
    assert_non_null(strstr(text, "< frame 100 "));
    assert_non_null(strstr(text, "< frame 102 "));
    down(r);
}

/* 4 MB of output are kept; time does not stand still for what is more, though the link is lossless. */
static void a_stall_that_lasts_loses_frames_and_counts_them(void **state)
{
    (void)state;
    struct bench *r = up();
    struct can_client *c = client(r);
    can_hub_stall(c, true);
    const struct can_msg m = {.id = 0x100, .len = 1};
    const unsigned sent = (4 << 20) / 64 + 100; /* messages of 64 characters */
    for (unsigned i = 0; i < sent; i++) c->node.rx(c->node.ctx, &m, r->s.now_ns);
    assert_false(links_full(&r->links));
    assert_int_equal(c->kept + c->dropped, sent);
    assert_int_equal(c->dropped, 100);
    can_hub_stall(c, false);
    assert_true(links_full(&r->links));
    down(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_error_frame_is_told_in_words_and_class),
        cmocka_unit_test(a_client_reads_the_state_of_its_controller),
        cmocka_unit_test(a_client_off_the_bus_hears_it_and_comes_back),
        cmocka_unit_test(a_stalled_client_gets_nothing_and_nobody_waits_for_it),
        cmocka_unit_test(a_stall_that_lasts_loses_frames_and_counts_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
