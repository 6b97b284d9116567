/* The loop sleeps while there is nothing to do, also with a port that no program has open. */
#include "rig.h"

#include "app/loop.h"
#include "link/text_link.h"

#include <fcntl.h>
#include <string.h>
#include <unistd.h>

enum { WAIT_MS = 50, TURNS_MAX = 20 };

struct loop_rig {
    struct text_link io; /* first: a line is handed over with it */
    struct pty pty;
    struct sched sched;
    struct pace pace;
    struct links links;
    struct loop loop;
    struct link counter; /* counts turns; its timer ends the loop */
    unsigned turns, lines;
};

static void on_line(struct text_link *t, enum lines_result result, const char *line, size_t len, int64_t t_ns)
{
    struct loop_rig *r = (struct loop_rig *)t;
    (void)result;
    (void)line;
    (void)len;
    (void)t_ns;
    r->lines++;
    text_link_put(t, "x\n", 2);
}

static void on_turn(struct link *l, int64_t t_ns)
{
    struct loop_rig *r = l->ctx;
    (void)t_ns;
    r->turns++;
}

static void on_timer(struct link *l, int64_t t_ns)
{
    struct loop_rig *r = l->ctx;
    (void)t_ns;
    r->loop.quit = true;
}

static void say(const char *text)
{
    (void)text;
}

static void on_moved_nothing(void *ctx, int64_t now_ns)
{
    (void)ctx;
    (void)now_ns;
}

static void start(struct loop_rig *r)
{
    static const struct text_link_cfg cfg = {
        .who = "port", .end = '\n', .line_max = 80, .out_max = 4096, .out_high = 4096};
    static const struct text_link_ops ops = {.line = on_line};
    memset(r, 0, sizeof *r);
    sched_init(&r->sched);
    pace_init(&r->pace, PACE_STEP);
    assert_int_equal(text_link_open_pty(&r->io, &r->pty, &cfg, &ops, &r->links, NULL), 0);
    r->counter = (struct link){.fd = -1, .flush = on_turn, .timer = on_timer, .ctx = r};
    links_add_last(&r->links, &r->counter);
    r->loop = (struct loop){
        .sched = &r->sched, .pace = &r->pace, .links = &r->links, .end_ns = SCHED_NEVER, .say = say, .ctx = r};
}

/* Turns of the loop within WAIT_MS. */
static unsigned turns(struct loop_rig *r)
{
    static const volatile sig_atomic_t stop = 0;
    r->turns = 0;
    r->loop.quit = false;
    r->counter.timer_ms = WAIT_MS;
    loop_run(&r->loop, &stop);
    return r->turns;
}

static int client(const struct loop_rig *r)
{
    const int fd = open(r->pty.path, O_RDWR | O_NOCTTY | O_NONBLOCK);
    assert_true(fd >= 0);
    return fd;
}

static void a_port_that_no_program_has_open_costs_nothing(void **state)
{
    static struct loop_rig r;
    (void)state;
    start(&r);
    assert_in_range(turns(&r), 1, TURNS_MAX);
    const int fd = client(&r);
    assert_in_range(turns(&r), 1, TURNS_MAX);
    close(fd);
    assert_in_range(turns(&r), 1, TURNS_MAX);
    text_link_free(&r.io);
}

static void each_client_is_heard_and_answered(void **state)
{
    static struct loop_rig r;
    char got[16];
    (void)state;
    start(&r);
    for (unsigned i = 1; i <= 3; i++) {
        turns(&r);
        const int fd = client(&r);
        assert_int_equal(write(fd, "a\nb\n", 4), 4);
        turns(&r);
        assert_int_equal(r.lines, 2 * i);
        assert_int_equal(read(fd, got, sizeof got), 4);
        close(fd);
    }
    text_link_free(&r.io);
}

/* Its last bytes are read though it has gone, and no one is answered. */
static void who_writes_and_closes_is_heard(void **state)
{
    static struct loop_rig r;
    char got[16];
    (void)state;
    start(&r);
    int fd = client(&r);
    assert_int_equal(write(fd, "a\nb\n", 4), 4);
    close(fd);
    turns(&r);
    assert_int_equal(r.lines, 2);
    fd = client(&r);
    turns(&r);
    assert_int_equal(read(fd, got, sizeof got), -1);
    close(fd);
    text_link_free(&r.io);
}

/* ---- strides */

enum { TICK_NS = 100000, RUN_NS = 200000000, AWAKE_NS = 190000000 };

struct stride_rig {
    struct sched sched;
    struct pace pace;
    struct links links;
    struct loop loop;
    struct sched_ev tick;
    int64_t moved_ns, longest_ns;
};

/* A board that is asleep and has its own events. */
static void on_tick(void *ctx, int64_t t_ns)
{
    struct stride_rig *r = ctx;
    r->sched.asleep = t_ns < AWAKE_NS;
    sched_at(&r->sched, &r->tick, t_ns + TICK_NS);
}

static void on_moved(void *ctx, int64_t now_ns)
{
    struct stride_rig *r = ctx;
    if (now_ns - r->moved_ns > r->longest_ns) r->longest_ns = now_ns - r->moved_ns;
    r->moved_ns = now_ns;
}

/* The longest time without a look at input and output, one of so many boards asleep. */
static int64_t longest_stride_ns(unsigned boards)
{
    static const volatile sig_atomic_t stop = 0;
    struct stride_rig r = {.moved_ns = 0};
    sched_init(&r.sched);
    pace_init(&r.pace, PACE_FREE);
    r.loop = (struct loop){.sched = &r.sched,
                           .pace = &r.pace,
                           .links = &r.links,
                           .boards = boards,
                           .end_ns = RUN_NS,
                           .moved = on_moved,
                           .say = say,
                           .ctx = &r};
    sched_ev_inner(&r.tick, on_tick, &r);
    sched_at(&r.sched, &r.tick, 0);
    loop_run(&r.loop, &stop);
    assert_int_equal(r.sched.now_ns, RUN_NS);
    return r.longest_ns;
}

/* What a board that is awake sends has to fit into buffers until the next look. */
static void time_strides_only_while_all_boards_sleep(void **state)
{
    (void)state;
    assert_true(longest_stride_ns(2) <= 1000000 + TICK_NS);
    assert_true(longest_stride_ns(1) >= 20000000);
}

/* ---- wall pace */

enum { IDLE_MS = 600 };
_Static_assert(IDLE_MS *INT64_C(1000000) > PACE_SLIP_NS + PACE_REST_NS / 2,
               "longer than what counts as falling behind");

/* The sleep is no falling behind: nothing is late, and time is where it should be. */
static void in_wall_pace_time_goes_on_while_nothing_happens(void **state)
{
    static const volatile sig_atomic_t stop = 0;
    static struct loop_rig r;
    (void)state;
    sched_init(&r.sched);
    pace_init(&r.pace, PACE_WALL);
    r.counter = (struct link){.fd = -1, .flush = on_turn, .timer = on_timer, .timer_ms = IDLE_MS, .ctx = &r};
    links_add_last(&r.links, &r.counter);
    r.loop = (struct loop){.sched = &r.sched,
                           .pace = &r.pace,
                           .links = &r.links,
                           .end_ns = SCHED_NEVER,
                           .moved = on_moved_nothing,
                           .say = say,
                           .ctx = &r};
    loop_run(&r.loop, &stop);
    assert_int_equal(r.pace.slips, 0);
    assert_true(r.sched.now_ns >= PACE_SLIP_NS - PACE_REST_NS);
    assert_in_range(r.turns, 1, IDLE_MS * INT64_C(1000000) / PACE_BATCH_NS + TURNS_MAX); /* it catches up in batches */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_port_that_no_program_has_open_costs_nothing),
        cmocka_unit_test(each_client_is_heard_and_answered),
        cmocka_unit_test(who_writes_and_closes_is_heard),
        cmocka_unit_test(time_strides_only_while_all_boards_sleep),
        cmocka_unit_test(in_wall_pace_time_goes_on_while_nothing_happens),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
