/* A service is put together: what the commands may do, the sockets, what the loop calls. */
#include "app/service.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* ---- what the commands may do */

static bool do_run(void *ctx, int64_t for_ns, uint64_t after_tx, char *why)
{
    struct service *s = ctx;
    if (s->o->pace != PACE_STEP) {
        snprintf(why, CONTROL_WHY_MAX, "run requires --pace step (current pace: %s)", pace_name(s->o->pace));
        return false;
    }
    if (loop_step(&s->loop, for_ns, after_tx)) return true;
    snprintf(why, CONTROL_WHY_MAX, "another run is in progress");
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

static bool do_endpoints(void *ctx, cJSON *result)
{
    const struct service *s = ctx;
    return cJSON_AddItemToObject(result, "endpoints", ports_endpoints(&s->ports, s->o));
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
                                     .sim = {do_run, do_run_stop, do_pace, do_supply_changed},
                                     .recording = service_recording,
                                     .capture = service_captures,
                                     .clients = service_clients,
                                     .process = {.quit = do_quit,
                                                 .push = do_push,
                                                 .reply = do_reply,
                                                 .snapshot = service_snapshot,
                                                 .fork = service_fork,
                                                 .endpoints = do_endpoints,
                                                 .files = service_describe_files,
                                                 .journal = service_journal}};
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

/* ---- what the loop calls */

static bool may_start(void *ctx)
{
    const struct service *s = ctx;
    return !s->o->wait_client || s->ports.connections > s->connections || logic_has_begun(&s->ports.logic);
}

static void on_moved(void *ctx, int64_t now_ns)
{
    struct service *s = ctx;
    (void)now_ns;
    bench_follow(s->bench);
    journal_moved(&s->journal);
    service_sweep_detached(s, false);
    snapshot_release_lines(&s->observers, s->bench);
    service_follow_capture(s);
    service_check_files(s);
    service_check_journal(s);
}

static void run_done(void *ctx)
{
    struct service *s = ctx;
    const char *reply = s->runner ? control_run_done(&s->control, s->bench->sched.now_ns) : NULL;
    if (s->loop.run != LOOP_IDLE) return; /* the next piece of the same run */
    if (reply) ctl_reply(s->runner, reply);
    s->runner = NULL;
}

/* Lateness of a frame: real time now against the instant its end is on the bus. */
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

/* ---- opening */

static void init_service(struct service *s, struct bench *b, const struct options *o)
{
    memset(s, 0, offsetof(struct service, timeline));
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
    for (unsigned i = 0; i < SCENARIO_BUSES_MAX; i++) s->ports.hub[i].say = service_say;
    s->ports.scpi.control = &s->control;
    s->ports.scpi.sched = &b->sched;
    s->ports.control = (struct ctl_server){.line = on_control_line, .gone = on_control_gone, .ctx = s};
    s->ports.truth = (struct ctl_server){.line = on_truth_line, .ctx = s};
    s->loop = (struct loop){.sched = &b->sched,
                            .pace = &s->pace,
                            .links = &s->ports.links,
                            .boards = b->scenario.unit_count,
                            .end_ns = o->for_ns,
                            .may_start = may_start,
                            .moved = on_moved,
                            .run_done = run_done,
                            .taken = service_taken,
                            .say = service_say,
                            .sliced = service_is_sliced,
                            .ctx = s};
    ports_init(&s->ports, b, o);
    service_follow(s);
}

/* ---- standard input */

static void on_readable(struct link *l, int64_t t_ns)
{
    char passed_over[256];
    (void)t_ns;
    const ssize_t n = read(l->fd, passed_over, sizeof passed_over);
    if (n > 0 || (n < 0 && (errno == EINTR || errno == EAGAIN))) return;
    l->gone = true;
    *(bool *)l->ctx = true;
}

/* --until-eof: a program that starts an emulator keeps the other end of the pipe. However that program ends, killed or
 * crashed, no emulator is left behind. What comes before the end is passed over. */
static void until_eof(struct link *l, struct links *ls, bool *quit)
{
    *l = (struct link){.fd = STDIN_FILENO, .want_read = true, .readable = on_readable, .ctx = quit};
    links_add_last(ls, l);
}

bool service_open(struct service *s, struct bench *b, const struct options *o, const struct service_origin *from,
                  char *why, size_t cap)
{
    init_service(s, b, o);
    s->scenario = from->scenario;
    s->refused =
        (from->snapshot && !service_restore(s, from->snapshot, why, cap)) || !ports_check(&s->ports, b, o, why, cap);
    if (o->until_eof) until_eof(&s->input, &s->ports.links, &s->loop.quit);
    if (s->refused) return false;
    if (ports_open(&s->ports, b, o, why, cap))
        return service_open_truth_log(s, why, cap) && service_open_lcm(s, why, cap);
    s->refused = s->ports.refused || s->ports.scpi.refused;
    return false;
}
