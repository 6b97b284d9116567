/* Who has a pseudo-terminal open: the kernel tells of comings and goings, and some time after a going it is asked. */
#include "rig.h"

#include "link/pty.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

enum { NEWS_MS = 10000 };

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
    while (poll(&watch, 1, 0) == 1) { /* IN_IGNORED of the watch that was taken off */
        news(&r);
        assert_int_equal(r.p.watch.timer_ms, 0);
    }
    assert_int_equal(r.came, r.left);
    const int fd = client(&r);
    news(&r);
    assert_int_equal(r.p.openers, 1);
    close(fd);
    pty_close(&r.p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_who_opens_again_at_once_is_seen),
        cmocka_unit_test(two_who_close_at_once_have_both_left),
        cmocka_unit_test(of_two_who_came_at_once_one_is_left),
        cmocka_unit_test(asking_makes_no_news),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
