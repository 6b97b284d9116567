#define _GNU_SOURCE /* ppoll */
#include "app/loop.h"

#include "bench/bench.h"

#include <poll.h>
#include <stdio.h>
#include <time.h>

#define BUSY_TURNS 32u                 /* consecutive turns with input, then pending signals are taken */
#define SLOW_NS    INT64_C(2000000000) /* wall time; a busy reader has read by then */

/* While all boards sleep nothing comes out that could fill a buffer: simulated time between looks at input is as long as takes
 * about STRIDE_WALL_NS. */
#define STRIDE_MIN_NS  INT64_C(20000000)
#define STRIDE_MAX_NS  NS_PER_S
#define STRIDE_WALL_NS INT64_C(1000000)

/* ---- time */

static void run_stride(struct loop *l, int64_t until_ns)
{
    const int64_t began_ns = pace_clock_ns();
    sched_run_towards(l->sched, ns_earlier(until_ns, l->sched->now_ns + l->stride_ns), until_ns);
    const int64_t took_ns = pace_clock_ns() - began_ns;
    if (took_ns > STRIDE_WALL_NS && l->stride_ns > STRIDE_MIN_NS) l->stride_ns /= 2;
    if (took_ns < STRIDE_WALL_NS / 2 && l->stride_ns < STRIDE_MAX_NS) l->stride_ns *= 2;
}

static void run_slice(struct loop *l, int64_t until_ns)
{
    const int64_t now_ns = l->sched->now_ns;
    const int64_t next_ns = sched_next_ns(l->sched);
    const bool sliced = l->sliced && l->sliced(l->ctx);
    /* Over a stretch without events in one stride. */
    const int64_t from_ns = next_ns > now_ns && !sliced ? next_ns : now_ns;
    const int64_t to_ns = from_ns >= until_ns ? until_ns : ns_earlier(until_ns, from_ns + BENCH_SLICE_NS);
    sched_run_towards(l->sched, to_ns, until_ns);
}

/* Simulated time goes on towards until_ns, as far as it may before input and output are looked at. */
static void run_on(struct loop *l, int64_t until_ns)
{
    if (l->sched->asleep > 0 && l->sched->asleep == l->boards) run_stride(l, until_ns);
    else run_slice(l, until_ns);
    l->moved(l->ctx, l->sched->now_ns);
}

/* Wall pace: everything due by now, instant by instant, so that each one's lateness is known. */
static void run_wall(struct loop *l)
{
    const int64_t target_ns = ns_earlier(pace_target_ns(l->pace, l->sched->now_ns), l->end_ns);
    const int64_t to_ns = ns_earlier(target_ns, l->sched->now_ns + PACE_BATCH_NS);
    for (int64_t due_ns; (due_ns = sched_next_ns(l->sched)) <= to_ns;) {
        sched_run_until(l->sched, due_ns);
        pace_event(l->pace, due_ns, target_ns);
    }
    if (to_ns > l->sched->now_ns) sched_run_until(l->sched, to_ns);
    l->moved(l->ctx, l->sched->now_ns);
}

static void run_step(struct loop *l)
{
    if (l->run == LOOP_ARMED && l->taken(l->ctx, l->after_taken)) l->run = LOOP_RUNNING;
    if (l->run != LOOP_RUNNING || links_full(l->links)) return;
    run_on(l, l->until_ns);
}

static bool step_over(const struct loop *l)
{
    return l->run == LOOP_RUNNING && l->sched->now_ns == l->until_ns && links_pending(l->links) == 0;
}

static void advance_time(struct loop *l)
{
    if (!l->started && (!l->may_start || l->may_start(l->ctx))) {
        l->started = true;
        pace_start(l->pace, l->sched->now_ns);
    }
    if (!l->started) return;
    l->pace->turns++;
    switch (l->pace->kind) {
    case PACE_WALL:
        run_wall(l);
        break;
    case PACE_STEP:
        run_step(l);
        break;
    case PACE_FREE:
        if (!links_full(l->links)) run_on(l, l->end_ns);
        break;
    }
}

/* ---- news of links */

enum { NOTICES_MAX = 1000 }; /* a client that connects in a loop must not fill a log file */

static void say_news(struct loop *l, const struct link *k, const char *what)
{
    char text[256];
    if (l->notices > NOTICES_MAX) return;
    const bool last = l->notices++ == NOTICES_MAX;
    snprintf(text, sizeof text, "%s: %s", last ? "links" : k->who, last ? "further messages are suppressed" : what);
    l->say(text);
}

static void say_notices(struct loop *l)
{
    for (struct link *k = l->links->first; k; k = k->next) {
        if (k->notice) say_news(l, k, k->notice);
        k->notice = NULL;
    }
}

/* A run of step pace is over when its output has been taken. */
static bool waits_for_rest(const struct loop *l)
{
    return l->run == LOOP_RUNNING && l->sched->now_ns == l->until_ns && links_pending(l->links) > 0;
}

static bool waits_for_reader(const struct loop *l)
{
    const bool moving = l->started && (l->pace->kind == PACE_FREE || l->run == LOOP_RUNNING);
    return moving && l->pace->kind != PACE_WALL && (links_full(l->links) || waits_for_rest(l));
}

/* Reports each reader once, after time has waited SLOW_NS for it. */
static void watch_readers(struct loop *l)
{
    if (!waits_for_reader(l)) {
        l->full_since_ns = 0;
        return;
    }
    const int64_t clock_ns = pace_clock_ns();
    if (!l->full_since_ns) l->full_since_ns = clock_ns;
    if (clock_ns - l->full_since_ns < SLOW_NS) return;
    for (struct link *k = l->links->first; k; k = k->next) {
        if (!(k->full || (k->pending && waits_for_rest(l))) || k->gone || k->slow) continue;
        k->slow = true;
        say_news(l, k, "does not read; simulated time waits for it");
    }
}

/* ---- waiting */

/* How long ppoll may sleep, real ns: 0 not at all, SCHED_NEVER until something happens. */
static int64_t timeout_ns(const struct loop *l)
{
    int64_t wait_ns = SCHED_NEVER;
    const int64_t clock_ns = pace_clock_ns();
    for (const struct link *k = l->links->first; k; k = k->next) {
        if (k->timer_due_ns) wait_ns = ns_earlier(wait_ns, k->timer_due_ns - clock_ns);
    }
    if (l->started && l->pace->kind == PACE_WALL) {
        const int64_t due_ns = ns_earlier(sched_next_ns(l->sched), l->end_ns);
        const int64_t at_ns = l->sched->now_ns + PACE_QUANTUM_NS;
        const int64_t rested_ns = l->sched->now_ns + PACE_REST_NS; /* or the sleep would count as falling behind */
        wait_ns = ns_earlier(wait_ns, l->pace->origin_ns + ns_earlier(ns_later(due_ns, at_ns), rested_ns) - clock_ns);
    }
    if (l->full_since_ns && clock_ns - l->full_since_ns < SLOW_NS)
        wait_ns = ns_earlier(wait_ns, l->full_since_ns + SLOW_NS - clock_ns);
    const bool running = l->started && (l->pace->kind == PACE_FREE || l->run == LOOP_RUNNING);
    if (running && !links_full(l->links) && (l->pace->kind == PACE_FREE || l->sched->now_ns < l->until_ns)) return 0;
    if (l->run == LOOP_ARMED && l->taken(l->ctx, l->after_taken)) return 0;
    return wait_ns > 0 ? wait_ns : 0;
}

/* Input and timers of the links polled; p[i] belongs to the i-th link of the list at the time of the poll. */
static void serve_polled(struct loop *l, struct link **polled, const struct pollfd *p, unsigned n)
{
    const int64_t t_ns = l->sched->now_ns;
    for (unsigned i = 0; i < n; i++) {
        struct link *k = polled[i];
        const short input = POLLIN | POLLHUP | POLLERR;
        const bool left = k->is_pty && k->want_read && (p[i].revents & (POLLIN | POLLHUP)) == POLLHUP;
        if (left) k->idle = true;
        else if (!k->gone && k->fd >= 0 && k->want_read && p[i].revents & input) k->readable(k, t_ns);
        if (!k->gone && k->fd >= 0 && p[i].revents & (POLLOUT | POLLERR) && k->flush) k->flush(k, t_ns);
    }
}

static void arm_timers(struct loop *l)
{
    for (struct link *k = l->links->first; k; k = k->next) {
        if (!k->timer_ms) continue;
        k->timer_due_ns = pace_clock_ns() + (int64_t)k->timer_ms * 1000000;
        k->timer_ms = 0;
    }
}

static void serve_timers(struct loop *l)
{
    const int64_t clock_ns = pace_clock_ns();
    for (struct link *k = l->links->first; k; k = k->next) {
        if (!k->timer_due_ns || k->timer_due_ns > clock_ns || k->gone) continue;
        k->timer_due_ns = 0;
        k->timer(k, l->sched->now_ns);
    }
}

static unsigned collect_fds(const struct loop *l, struct link **polled, struct pollfd *p)
{
    unsigned n = 0;
    for (struct link *k = l->links->first; k && n < LOOP_LINKS_MAX; k = k->next) {
        const short events = (short)((k->want_read ? POLLIN : 0) | (k->want_write ? POLLOUT : 0));
        polled[n] = k;
        /* An idle descriptor is left out: a hang-up would be reported without end. */
        p[n++] = (struct pollfd){.fd = events && !k->gone && !k->idle ? k->fd : -1, .events = events};
    }
    return n;
}

static void flush_all(struct loop *l)
{
    for (struct link *k = l->links->first; k; k = k->next) {
        if (k->flush && !k->gone) k->flush(k, l->sched->now_ns);
    }
}

/* At full speed with no one to hear, the kernel is only asked now and then, for signals. */
static bool may_skip_poll(struct loop *l)
{
    enum { TURNS = 64 };
    return !l->links->first && l->started && l->pace->kind == PACE_FREE && l->pace->turns % TURNS != 0;
}

/* ppoll() does not deliver a pending signal while a descriptor is ready, so a peer that floods us blocks signals. Without
 * descriptors it delivers them. */
static void take_signals(const sigset_t *unblocked)
{
    const struct timespec none = {0};
    (void)ppoll(NULL, 0, &none, unblocked);
}

/* Clients and the counters at the end see boards as if every conversion had been computed. */
static void settle_boards(struct loop *l)
{
    if (l->sched->asleep == 0) return;
    sched_settle(l->sched);
    l->moved(l->ctx, l->sched->now_ns);
}

static void wait_and_serve(struct loop *l, const sigset_t *unblocked)
{
    struct link *polled[LOOP_LINKS_MAX];
    struct pollfd p[LOOP_LINKS_MAX];
    if (may_skip_poll(l)) return;
    arm_timers(l);
    const unsigned n = collect_fds(l, polled, p);
    const int64_t ns = timeout_ns(l);
    const struct timespec t = {.tv_sec = (time_t)(ns / 1000000000), .tv_nsec = (long)(ns % 1000000000)};
    const int ready = ppoll(p, n, ns == SCHED_NEVER ? NULL : &t, unblocked);
    l->busy_turns = ready > 0 ? l->busy_turns + 1 : 0;
    if (l->busy_turns % BUSY_TURNS == BUSY_TURNS - 1) take_signals(unblocked);
    /* Input is stamped with the simulated time of its arrival: first bring the simulation there. */
    if (ready > 0 && l->started && l->pace->kind == PACE_WALL) run_wall(l);
    if (ready > 0) settle_boards(l);
    if (ready > 0) serve_polled(l, polled, p, n);
    serve_timers(l);
    say_notices(l);
    links_reap(l->links);
}

/* ---- */

bool loop_step(struct loop *l, int64_t for_ns, uint64_t after_taken)
{
    if (l->run != LOOP_IDLE) return false;
    l->run = LOOP_ARMED;
    l->until_ns = ns_earlier(l->sched->now_ns + for_ns, l->end_ns);
    l->after_taken = after_taken;
    return true;
}

void loop_stop_step(struct loop *l)
{
    if (l->run != LOOP_RUNNING) return;
    sched_stop(l->sched);
    l->until_ns = l->sched->now_ns;
}

void loop_cancel_step(struct loop *l)
{
    l->run = LOOP_IDLE;
}

/* At the end, and no client waits for an answer. */
static bool is_over(const struct loop *l)
{
    return l->sched->now_ns >= l->end_ns && l->run != LOOP_RUNNING;
}

void loop_run(struct loop *l, const volatile sig_atomic_t *stop)
{
    sigset_t open;
    sigprocmask(SIG_SETMASK, NULL, &open);
    sigdelset(&open, SIGINT);
    sigdelset(&open, SIGTERM);
    l->stride_ns = STRIDE_MIN_NS;
    while (!l->quit && !*stop && !is_over(l)) {
        const bool armed = l->run == LOOP_ARMED;
        if (!armed) advance_time(l);
        flush_all(l);
        watch_readers(l);
        if (step_over(l)) {
            l->run = LOOP_IDLE;
            l->run_done(l->ctx);
            flush_all(l);
        }
        if (is_over(l)) break;
        wait_and_serve(l, &open);
        if (armed) advance_time(l);
    }
    settle_boards(l);
}

void loop_drain(struct loop *l, int timeout_ms)
{
    int64_t progress_ns = pace_clock_ns();
    size_t last = links_pending(l->links);
    while ((last > 0 || links_linger(l->links)) && pace_clock_ns() - progress_ns < (int64_t)timeout_ms * 1000000) {
        struct link *polled[LOOP_LINKS_MAX];
        struct pollfd p[LOOP_LINKS_MAX];
        arm_timers(l);
        const unsigned n = collect_fds(l, polled, p);
        if (poll(p, n, 10) > 0) serve_polled(l, polled, p, n);
        serve_timers(l);
        flush_all(l);
        say_notices(l);
        links_reap(l->links);
        const size_t now = links_pending(l->links);
        if (now != last) progress_ns = pace_clock_ns();
        last = now;
    }
}
