#define _GNU_SOURCE /* sigaction */
#include "app/service.h"

#include "app/endpoints.h"
#include "app/fork.h"
#include "app/until_eof.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

enum { DRAIN_MS = 5000 };

static volatile sig_atomic_t stop_signal;

static void on_signal(int number)
{
    stop_signal = number;
}

static void say(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "psa-emu: %s\n", text);
}

/* ---- what the commands may do */

static void tell_vcd_error(struct service *s, const char *what_now)
{
    const int err = vcd_error(&s->bench->vcd);
    if (!err) return;
    fprintf(stderr, "psa-emu: VCD file %s: %s; %s\n", s->vcd_path, strerror(err), what_now);
    s->vcd_failed = true;
}

static bool do_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    struct service *s = ctx;
    if (s->o->pace != PACE_STEP) {
        snprintf(why, CONTROL_WHY_MAX, "time moves by itself in %s pace; --pace step is wanted", pace_name(s->o->pace));
        return false;
    }
    if (loop_step(&s->loop, for_ns, after_tx)) return true;
    snprintf(why, CONTROL_WHY_MAX, "another run is under way");
    return false;
}

static void do_run_stop(void *ctx)
{
    loop_stop_step(&((struct service *)ctx)->loop);
}

static void do_push(void *ctx, void *client, const char *line)
{
    (void)ctx;
    ctl_push(client, line);
}

static void do_reply(void *ctx, void *client, const char *line)
{
    (void)ctx;
    ctl_reply(client, line);
}

static void do_quit(void *ctx)
{
    ((struct service *)ctx)->loop.quit = true;
}

static bool do_fork(void *ctx, const struct control_fork *f, cJSON *result, char *why)
{
    return fork_service(ctx, f, result, why);
}

static bool do_endpoints(void *ctx, cJSON *result)
{
    const struct service *s = ctx;
    return endpoints_tell(&s->ports, s->o, result);
}

static bool do_vcd_flush(void *ctx, char *why)
{
    struct service *s = ctx;
    if (s->bench->recording) vcd_flush(&s->bench->vcd);
    else snprintf(why, CONTROL_WHY_MAX, "nothing is being recorded; --vcd FILE or vcd.start is wanted");
    return s->bench->recording;
}

static bool do_vcd_start(void *ctx, const char *path, unsigned unit, char *why)
{
    struct service *s = ctx;
    if (s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "a recording goes on already; vcd.stop ends it");
        return false;
    }
    FILE *file = fopen(path, "wbe");
    if (!file) {
        snprintf(why, CONTROL_WHY_MAX, "%.200s: %s", path, strerror(errno));
        return false;
    }
    s->ports.vcd = file;
    snprintf(s->vcd_path, sizeof s->vcd_path, "%s", path);
    return bench_record(s->bench, unit, file, s->o->vcd_unit_ns);
}

static bool do_vcd_stop(void *ctx, char *why)
{
    struct service *s = ctx;
    if (!s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "nothing is being recorded");
        return false;
    }
    bench_record_end(s->bench);
    tell_vcd_error(s, "the recording is not complete");
    fclose(s->ports.vcd);
    s->ports.vcd = NULL;
    return true;
}

/* The client of any bus that came next after `came`; NULL: the last. */
static const struct can_client *client_after(const struct ports *p, uint32_t came)
{
    const struct can_client *next = NULL;
    for (unsigned i = 0; i < p->hubs; i++) {
        for (const struct can_client *c = p->hub[i].clients; c; c = c->next)
            if (c->came > came && (!next || c->came < next->came)) next = c;
    }
    return next;
}

static uint64_t do_can_rx(void *ctx)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    const struct can_client *c = client_after(p, 0);
    while (c && c->leaving) c = client_after(p, c->came);
    return c ? c->delivered : 0;
}

static void put_client(const struct can_client *c, struct control_client *out)
{
    *out = (struct control_client){.adapter = c->adapter,
                                   .name = c->name,
                                   .came = c->came,
                                   .place = c->place,
                                   .delivered = c->delivered,
                                   .taken = c->taken,
                                   .dropped = c->dropped,
                                   .overrun = c->overrun,
                                   .refused = c->refused};
}

/* The i-th in order of coming. */
static const struct can_client *client_at(const struct service *s, unsigned i)
{
    const struct can_client *c = client_after(&s->ports, 0);
    while (c && i--) c = client_after(&s->ports, c->came);
    return c;
}

static bool do_client(void *ctx, unsigned i, struct control_client *out)
{
    const struct can_client *c = client_at(ctx, i);
    if (c) put_client(c, out);
    return c != NULL;
}

static struct can_node *do_client_node(void *ctx, uint32_t place)
{
    const struct service *s = ctx;
    const struct can_client *c = client_after(&s->ports, 0);
    while (c && c->place != place) c = client_after(&s->ports, c->came);
    return c ? &((struct can_client *)c)->node : NULL;
}

static bool do_stall(void *ctx, const struct can_node *node, bool on)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    for (unsigned i = 0; i < p->hubs; i++) {
        for (struct can_client *c = p->hub[i].clients; c; c = c->next) {
            if (&c->node != node) continue;
            can_hub_stall(c, on);
            return true;
        }
    }
    return false;
}

static void sum_gone(const struct ports *p, struct control_client *out)
{
    struct can_client sum = {.adapter = NULL};
    for (unsigned i = 0; i < p->hubs; i++) {
        const struct can_client *gone = &p->hub[i].gone;
        sum.delivered += gone->delivered;
        sum.taken += gone->taken;
        sum.dropped += gone->dropped;
        sum.overrun += gone->overrun;
        sum.refused += gone->refused;
    }
    put_client(&sum, out);
}

static void do_gone(void *ctx, struct control_client *out)
{
    sum_gone(&((struct service *)ctx)->ports, out);
}

static void do_pace(void *ctx, struct control_pace *out)
{
    const struct pace *p = &((struct service *)ctx)->pace;
    const struct pace_hist *e = &p->events, *f = &p->frames;
    *out = (struct control_pace){.name = pace_name(p->kind),
                                 .by_step = p->kind == PACE_STEP,
                                 .turns = p->turns,
                                 .late = p->late,
                                 .slips = p->slips,
                                 .p50_us = pace_hist_us(e, 0.5),
                                 .p99_us = pace_hist_us(e, 0.99),
                                 .p999_us = pace_hist_us(e, 0.999),
                                 .max_us = (double)e->max_ns * 1e-3,
                                 .frames = f->total,
                                 .frame_p50_us = pace_hist_us(f, 0.5),
                                 .frame_p99_us = pace_hist_us(f, 0.99),
                                 .frame_p999_us = pace_hist_us(f, 0.999),
                                 .frame_max_us = (double)f->max_ns * 1e-3};
}

static void do_supply_changed(void *ctx, int64_t t_ns)
{
    bench_supply_changed(((struct service *)ctx)->bench, t_ns);
}

static void make_view(struct service *s)
{
    struct bench *b = s->bench;
    s->view = (struct control_bench){.ctx = s,
                                     .run = do_run,
                                     .run_stop = do_run_stop,
                                     .push = do_push,
                                     .reply = do_reply,
                                     .supply_changed = do_supply_changed,
                                     .quit = do_quit,
                                     .snapshot = service_snapshot,
                                     .fork = do_fork,
                                     .endpoints = do_endpoints,
                                     .journal = service_journal,
                                     .vcd_flush = do_vcd_flush,
                                     .vcd_start = do_vcd_start,
                                     .vcd_stop = do_vcd_stop,
                                     .can_rx = do_can_rx,
                                     .client = do_client,
                                     .client_node = do_client_node,
                                     .stall = do_stall,
                                     .gone = do_gone,
                                     .pace = do_pace};
    bench_view(b, &s->view);
    s->view.faults = &s->faults;
    fault_init(&s->faults, &s->view, &b->sched);
    s->faults.changed = control_fault_changed;
    s->faults.ctx = &s->control;
}

/* ---- the two sockets */

static void on_control_line(void *ctx, struct ctl_client *c, const char *line, int64_t t_ns)
{
    struct service *s = ctx;
    s->control.client = c;
    const char *reply = control_line(&s->control, line, t_ns);
    instruments_look(&s->ports.scpi, t_ns);
    if (reply) ctl_reply(c, reply);
    else if (s->control.waiting) s->runner = c;
}

static void on_control_gone(void *ctx, struct ctl_client *c)
{
    struct service *s = ctx;
    control_gone(&s->control, c);
    control_cycles_forget(&s->control, c);
    if (s->runner != c) return;
    s->runner = NULL;
    control_run_forget(&s->control);
    loop_cancel_step(&s->loop);
}

static void on_truth_line(void *ctx, struct ctl_client *c, const char *line, int64_t t_ns)
{
    struct service *s = ctx;
    ctl_reply(c, control_line(&s->truth, line, t_ns));
}

static void on_truth_gone(void *ctx, struct ctl_client *c)
{
    (void)ctx;
    (void)c;
}

/* ---- what the loop calls */

static bool may_start(void *ctx)
{
    const struct service *s = ctx;
    return !s->o->wait_client || s->ports.comings > s->comings;
}

static void moved(void *ctx, int64_t now_ns)
{
    struct service *s = ctx;
    (void)now_ns;
    bench_follow(s->bench);
    journal_moved(&s->journal);
    service_sweep(s, false);
    snapshot_let_go(&s->ears, s->bench);
    if (s->bench->recording) tell_vcd_error(s, "the recording ends here, the run goes on");
}

static void run_done(void *ctx)
{
    struct service *s = ctx;
    if (s->runner) ctl_reply(s->runner, control_run_done(&s->control, s->bench->sched.now_ns));
    s->runner = NULL;
}

/* A client that has sent more than its queue holds can only be heard on when time moves. */
static bool taken(void *ctx, uint64_t count)
{
    const struct ports *p = &((struct service *)ctx)->ports;
    uint64_t sum = 0;
    bool room = true;
    for (unsigned i = 0; i < p->hubs; i++) {
        sum += p->hub[i].taken;
        for (const struct can_client *c = p->hub[i].clients; c; c = c->next) room &= c->leaving || can_hub_room(c);
    }
    return sum >= count || !room;
}

/* Lateness of a frame: real time now against the instant its end stands on the bus. */
static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct service *s = ctx;
    (void)m;
    if (s->pace.kind == PACE_WALL) pace_hist_add(&s->pace.frames, pace_clock_ns() - s->pace.origin_ns - t_ns);
}

static void on_refused(void *ctx, const char *unit, const char *why)
{
    (void)ctx;
    fprintf(stderr, "psa-emu: unit %s: %s\n", unit, why);
}

static void on_cycle(void *ctx, unsigned unit, const struct board_cycle *c)
{
    journal_cycle(&((struct service *)ctx)->journal, unit, c);
}

/* ---- life */

static void init(struct service *s, struct bench *b, const struct options *o)
{
    memset(s, 0, sizeof *s);
    s->o = o;
    s->bench = b;
    b->on_frame = on_frame;
    b->on_cycle = on_cycle;
    b->on_refused = on_refused;
    b->ctx = s;
    pace_init(&s->pace, o->pace);
    make_view(s);
    snprintf(s->vcd_path, sizeof s->vcd_path, "%s", o->vcd ? o->vcd : "");
    control_init(&s->control, control_tables, &s->view);
    control_init(&s->truth, control_truth_tables, &s->view);
    for (unsigned i = 0; i < SCENARIO_BUSES_MAX; i++) s->ports.hub[i].say = say;
    s->ports.scpi.control = &s->control;
    s->ports.scpi.sched = &b->sched;
    s->ports.control = (struct ctl_server){.line = on_control_line, .gone = on_control_gone, .ctx = s};
    s->ports.truth = (struct ctl_server){.line = on_truth_line, .gone = on_truth_gone, .ctx = s};
    s->loop = (struct loop){.sched = &b->sched,
                            .pace = &s->pace,
                            .links = &s->ports.links,
                            .end_ns = o->for_ns,
                            .may_start = may_start,
                            .moved = moved,
                            .run_done = run_done,
                            .taken = taken,
                            .ctx = s};
    ports_init(&s->ports, b, o);
    service_follow(s);
}

static bool open_truth_log(struct service *s, char *why, size_t cap)
{
    if (!s->o->truth_log) return true;
    FILE *out = fopen(s->o->truth_log, "wbe");
    if (out) truth_log_open(&s->truth_log, out, s->o->truth_every_ns, &s->truth, &s->bench->sched);
    else snprintf(why, cap, "--truth-log %s: %s", s->o->truth_log, strerror(errno));
    return out != NULL;
}

bool service_open(struct service *s, struct bench *b, const struct options *o, const struct service_origin *from,
                  char *why, size_t cap)
{
    init(s, b, o);
    s->scenario = from->scenario;
    s->refused =
        (from->snapshot && !service_restore(s, from->snapshot, why, cap)) || !ports_check(&s->ports, b, o, why, cap);
    if (o->until_eof) until_eof(&s->input, &s->ports.links, &s->loop.quit);
    return !s->refused && ports_open(&s->ports, b, o, why, cap) && open_truth_log(s, why, cap);
}

static int run_and_drain(struct service *s)
{
    loop_run(&s->loop, &stop_signal);
    if (!stop_signal) loop_drain(&s->loop, DRAIN_MS);
    return stop_signal;
}

void service_power_up(struct service *s)
{
    bench_power_up(s->bench);
    s->timeline.say = say;
    timeline_start(&s->timeline, s->bench, &s->view);
}

int service_run(struct service *s)
{
    sigset_t blocked;
    const struct sigaction on_stop = {.sa_handler = on_signal}, ignore = {.sa_handler = SIG_IGN};
    stop_signal = 0;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGINT);
    sigaddset(&blocked, SIGTERM);
    sigprocmask(SIG_BLOCK, &blocked, NULL);
    sigaction(SIGINT, &on_stop, NULL);
    sigaction(SIGTERM, &on_stop, NULL);
    sigaction(SIGPIPE, &ignore, NULL);
    sigaction(SIGCHLD, &ignore, NULL); /* forked benches go their own way */
    if (!s->powered) service_power_up(s);
    ports_ready(&s->ports, s->o, stdout);
    return run_and_drain(s);
}

static void tell_counters(const struct service *s)
{
    uint64_t frames = 0;
    for (unsigned i = 0; i < s->bench->buses; i++) frames += s->bench->bus[i].frames;
    const struct pace *p = &s->pace;
    fprintf(stderr, "psa-emu: %.6f s simulated in %s pace, %" PRIu64 " frames on the bus\n",
            (double)s->bench->sched.now_ns * 1e-9, pace_name(p->kind), frames);
    if (p->kind == PACE_WALL) {
        fprintf(
            stderr,
            "psa-emu: frames late by us: p50 %.0f, p99 %.0f, p99.9 %.0f, max %.0f; events 1 ms late or more: %" PRIu64
            "; slips: %" PRIu64 "\n",
            pace_hist_us(&p->frames, 0.5), pace_hist_us(&p->frames, 0.99), pace_hist_us(&p->frames, 0.999),
            (double)p->frames.max_ns * 1e-3, p->late, p->slips);
    }
    for (const struct can_client *c = client_after(&s->ports, 0); c; c = client_after(&s->ports, c->came)) {
        fprintf(stderr,
                "psa-emu: %s %s: delivered %" PRIu64 ", taken %" PRIu64 ", dropped %" PRIu64 ", overrun %" PRIu64
                ", refused %" PRIu64 "\n",
                c->adapter, c->name, c->delivered, c->taken, c->dropped, c->overrun, c->refused);
    }
    struct control_client gone;
    sum_gone(&s->ports, &gone);
    fprintf(stderr,
            "psa-emu: clients gone: delivered %" PRIu64 ", taken %" PRIu64 ", dropped %" PRIu64 ", refused %" PRIu64
            "\n",
            gone.delivered, gone.taken, gone.dropped, gone.refused);
}

void service_close(struct service *s)
{
    const bool recorded = s->bench->recording;
    bench_finish(s->bench);
    if (recorded) tell_vcd_error(s, "the recording is not complete");
    if (s->loop.started && !s->o->quiet) tell_counters(s);
    if (!truth_log_close(&s->truth_log)) {
        fprintf(stderr, "psa-emu: --truth-log %s: is not complete\n", s->o->truth_log);
        s->vcd_failed = true;
    }
    service_sweep(s, true);
    if (!ports_logs_whole(&s->ports, say)) s->vcd_failed = true;
    ports_close(&s->ports);
    control_run_forget(&s->control);
    journal_free(&s->journal);
}

int service_live(struct service *s)
{
    stop_signal = 0;
    s->loop.quit = false;
    const int signal_number = run_and_drain(s);
    service_close(s);
    return signal_number == SIGINT ? SERVICE_INT : s->vcd_failed ? SERVICE_MACHINE : SERVICE_DONE;
}
