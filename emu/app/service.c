#define _GNU_SOURCE /* sigaction */
#include "app/service.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

enum { DRAIN_MS = 5000 };

static volatile sig_atomic_t stop_signal;

static void on_signal(int number)
{
    stop_signal = number;
}

void service_power_up(struct service *s)
{
    bench_power_up(s->bench);
    s->timeline.say = service_say;
    timeline_start(&s->timeline, s->bench, &s->view);
}

static int run_and_drain(struct service *s)
{
    loop_run(&s->loop, &stop_signal);
    if (!stop_signal) loop_drain(&s->loop, DRAIN_MS);
    return stop_signal;
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
    if (!ports_ready(&s->ports, s->o, stdout)) {
        service_say("stdout: the ready lines could not be written");
        s->incomplete = true;
    }
    return run_and_drain(s);
}

static void print_counters(struct service *s)
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
            "; slips: %" PRIu64 " (more than %d ms behind: not caught up)\n",
            pace_hist_us(&p->frames, 0.5), pace_hist_us(&p->frames, 0.99), pace_hist_us(&p->frames, 0.999),
            (double)p->frames.max_ns * 1e-3, p->late, p->slips, PACE_SLIP_NS / 1000000);
    }
    service_print_clients(s);
    logic_print_counters(&s->ports.logic);
    if (s->lcm) service_print_lcm(s);
}

void service_close(struct service *s)
{
    service_end_files(s);
    if (s->loop.started && !s->o->quiet) print_counters(s);
    service_close_lcm(s);
    service_sweep_detached(s, true);
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
    return signal_number == SIGINT ? SERVICE_INT : s->incomplete ? SERVICE_MACHINE : SERVICE_DONE;
}
