/* Who has a pseudo-terminal open: the kernel tells of comings and goings, and some time after a going it is asked. */
#include "rig.h"

#include "link/pty.h"
#include "link/text_link.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <termios.h>
#include <unistd.h>

enum { NEWS_MS = 10000, VISITS = 400 };

struct client_rig {
    struct pty p;
    int came, left; /* times that `opened` was reported */
};

static void on_opened(void *ctx, bool open, int64_t t_ns)
{
    struct client_rig *r = ctx;
    (void)t_ns;
    if (open) r->came++;
    else r->left++;
}

static void start(struct client_rig *r)
{
    *r = (struct client_rig){0};
    assert_int_equal(pty_open(&r->p, NULL), 0);
    r->p.opened = on_opened;
    r->p.ctx = r;
    assert_true(r->p.watch.fd >= 0);
}

static int client(const struct client_rig *r)
{
    const int fd = open(r->p.path, O_RDONLY | O_NOCTTY);
    assert_true(fd >= 0);
    return fd;
}

static void news(struct client_rig *r)
{
    struct pollfd watch = {.fd = r->p.watch.fd, .events = POLLIN};
    assert_int_equal(poll(&watch, 1, NEWS_MS), 1);
    r->p.watch.readable(&r->p.watch, 0);
}

/* What the loop does with a timer that is set. */
static void ask(struct client_rig *r)
{
    assert_true(r->p.watch.timer_ms > 0);
    r->p.watch.timer_ms = 0;
    r->p.watch.timer(&r->p.watch, 0);
}

static void one_who_opens_again_at_once_is_seen(void **state)
{
    struct client_rig r;
    (void)state;
    start(&r);
    int fd = client(&r);
    news(&r);
    assert_int_equal(r.came, 1);
    close(fd);
    news(&r);
    assert_int_equal(r.left, 1);
    fd = client(&r); /* before the kernel is asked who is left: then his coming could be missed */
    news(&r);
    assert_int_equal(r.came, 2);
    ask(&r);
    assert_int_equal(r.p.openers, 1);
    assert_int_equal(r.left, 1);
    close(fd);
    pty_close(&r.p);
}

static void two_who_close_at_once_have_both_left(void **state)
{
    struct client_rig r;
    (void)state;
    start(&r);
    const int a = client(&r);
    news(&r);
    const int b = client(&r);
    news(&r);
    close(a);
    close(b);
    news(&r); /* one piece of news for both */
    ask(&r);
    assert_int_equal(r.p.openers, 0);
    assert_int_equal(r.left, 1);
    pty_close(&r.p);
}

static void of_two_who_came_at_once_one_is_left(void **state)
{
    struct client_rig r;
    (void)state;
    start(&r);
    const int a = client(&r), b = client(&r);
    news(&r);
    close(a);
    news(&r);
    ask(&r);
    ask(&r); /* once more: the event of one that has just come would be there by now */
    assert_int_equal(r.p.openers, 1);
    assert_int_equal(r.came, r.left + 1);
    close(b);
    news(&r);
    ask(&r);
    assert_int_equal(r.p.openers, 0);
    assert_int_equal(r.came, r.left);
    pty_close(&r.p);
}

/* What is asked is not taken for somebody's coming and going. */
static void asking_makes_no_news(void **state)
{
    struct client_rig r;
    (void)state;
    start(&r);
    close(client(&r));
    news(&r);
    ask(&r);
    struct pollfd watch = {.fd = r.p.watch.fd, .events = POLLIN};
    assert_int_equal(poll(&watch, 1, 0), 0);
    assert_int_equal(r.came, r.left);
    const int fd = client(&r);
    news(&r);
    assert_int_equal(r.p.openers, 1);
    close(fd);
    pty_close(&r.p);
}

struct lines_rig {
    struct text_link t; /* first: as its operations find it */
    struct pty p;
    unsigned lines;
    int openers; /* at the latest line */
};

static void on_line(struct text_link *t, enum lines_result result, const char *line, size_t len, int64_t t_ns)
{
    struct lines_rig *r = (struct lines_rig *)t;
    (void)result, (void)line, (void)len, (void)t_ns;
    r->lines++;
    r->openers = r->p.openers;
}

/* A poll looked at the watch, then he came and wrote, then it looked at the master: his bytes are served first. */
static void who_writes_is_known_before_his_bytes(void **state)
{
    static const struct text_link_cfg cfg = {.who = "port", .end = '\r', .line_max = 16, .out_max = 64, .out_high = 32};
    static const struct text_link_ops ops = {.line = on_line};
    static struct lines_rig r;
    struct links links = {0};
    (void)state;
    assert_int_equal(text_link_open_pty(&r.t, &r.p, &cfg, &ops, &links, NULL), 0);
    const int fd = open(r.p.path, O_RDWR | O_NOCTTY);
    assert_int_equal(write(fd, "O\r", 2), 2);
    struct pollfd master = {.fd = r.t.link.fd, .events = POLLIN};
    assert_int_equal(poll(&master, 1, NEWS_MS), 1);
    r.t.link.readable(&r.t.link, 0);
    assert_int_equal(r.lines, 1);
    assert_int_equal(r.openers, 1);
    close(fd);
    text_link_free(&r.t);
}

struct visitor {
    const char *path;
    atomic_int visits;
    int fd; /* of the last visit, which goes on */
};

static void *visit(void *arg)
{
    struct visitor *v = arg;
    for (int left = VISITS; left > 0; left--) {
        v->fd = open(v->path, O_RDONLY | O_NOCTTY);
        assert_true(v->fd >= 0);
        atomic_fetch_add(&v->visits, 1);
        if (left > 1) close(v->fd);
    }
    return NULL;
}

/* Takes all news, and asks as often as a timer is set, without its wait. */
static void settle(struct client_rig *r)
{
    struct pollfd watch = {.fd = r->p.watch.fd, .events = POLLIN};
    while (poll(&watch, 1, 0) == 1) news(r);
    if (r->p.watch.timer_ms) ask(r);
}

/* A question that closed and opened the slave itself missed who came or went meanwhile. */
static void who_comes_while_the_kernel_is_asked_is_seen(void **state)
{
    struct client_rig r;
    (void)state;
    start(&r);
    for (int i = 0; i < 20; i++) {
        struct visitor v = {.path = r.p.path};
        pthread_t thread;
        assert_int_equal(pthread_create(&thread, NULL, visit, &v), 0);
        while (atomic_load(&v.visits) < VISITS) settle(&r);
        assert_int_equal(pthread_join(thread, NULL), 0);
        do settle(&r);
        while (r.p.watch.timer_ms);
        assert_true(r.p.openers > 0);
        close(v.fd);
        do settle(&r);
        while (r.p.watch.timer_ms);
        assert_int_equal(r.p.openers, 0);
        assert_int_equal(r.came, r.left);
    }
    pty_close(&r.p);
}

static void settings_of(const char *path, struct termios *tio)
{
    const int fd = open(path, O_RDWR | O_NOCTTY);
    assert_int_equal(tcgetattr(fd, tio), 0);
    close(fd);
}

/* cat would echo what it reads, or take a VMIN of 0 for an end of the file. */
static void nobody_inherits_the_settings_of_the_last_client(void **state)
{
    struct client_rig r;
    struct termios first, tio;
    (void)state;
    start(&r);
    settings_of(r.p.path, &first);
    assert_int_equal(first.c_lflag & (ECHO | ICANON), 0);
    const int fd = client(&r);
    tio = first;
    tio.c_lflag |= ECHO | ICANON;
    tio.c_cc[VMIN] = 0;
    assert_int_equal(tcsetattr(fd, TCSANOW, &tio), 0);
    close(fd);
    do settle(&r);
    while (r.p.watch.timer_ms);
    settings_of(r.p.path, &tio);
    assert_int_equal(tio.c_lflag, first.c_lflag);
    assert_int_equal(tio.c_cc[VMIN], 1);
    pty_close(&r.p);
}

static void nobody_reads_what_the_last_client_left(void **state)
{
    struct client_rig r;
    static const char text[8192];
    char got[16];
    (void)state;
    start(&r);
    int fd = client(&r);
    news(&r);
    assert_true(write(r.p.master, text, sizeof text) > 0);
    close(fd);
    news(&r);
    fd = open(r.p.path, O_RDONLY | O_NOCTTY | O_NONBLOCK);
    assert_int_equal(read(fd, got, sizeof got), -1);
    assert_int_equal(errno, EAGAIN);
    close(fd);
    pty_close(&r.p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_who_opens_again_at_once_is_seen),
        cmocka_unit_test(two_who_close_at_once_have_both_left),
        cmocka_unit_test(of_two_who_came_at_once_one_is_left),
        cmocka_unit_test(who_writes_is_known_before_his_bytes),
        cmocka_unit_test(asking_makes_no_news),
        cmocka_unit_test(who_comes_while_the_kernel_is_asked_is_seen),
        cmocka_unit_test(nobody_inherits_the_settings_of_the_last_client),
        cmocka_unit_test(nobody_reads_what_the_last_client_left),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
