/* --lcm: what the bench does, as LCM messages. */
#define _GNU_SOURCE
#include "app/service.h"
#include "base/why.h"
#include "link/own_file.h"
#include "telemetry/lcm_feed.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>

#define LOOK_NS INT64_C(1000000000) /* wall time between two checks that the file is still there */

static void check_file(struct service *s, struct lcm_log *l, bool look)
{
    char stored[96];
    if (look) lcm_log_look(l);
    if (!l->error || s->lcm_reported) return;
    s->lcm_reported = true;
    snprintf(stored, sizeof stored, "stored %" PRIu64 " of %" PRIu64 " messages so far", l->stored, l->events);
    service_report_file("LCM log", l->path, own_file_strerror(l->error), stored);
    s->incomplete = true;
}

/* The network has no memory: messages that liblcm could not send are gone. Said once, counted to the end. */
static void check_network(struct service *s, const struct lcm_udpm *u)
{
    char text[160];
    if (!u->lost || s->lcm_reported) return;
    s->lcm_reported = true;
    snprintf(text, sizeof text, "--lcm %.100s: messages are lost: liblcm cannot send", s->o->lcm);
    service_say(text);
}

static void check_port(struct service *s, bool look)
{
    struct lcm_port *p = &s->lcm->port;
    if (p->url.kind == LCM_FILE) check_file(s, &p->log, look);
    else check_network(s, &p->udpm);
}

/* On the feed's own event: a run without it does not ask. */
static void on_tick(void *ctx)
{
    struct service *s = ctx;
    const int64_t now_ns = pace_clock_ns();
    const bool look = now_ns >= s->lcm_look_ns;
    if (look) s->lcm_look_ns = now_ns + LOOK_NS;
    check_port(s, look);
}

void service_end_lcm(struct service *s)
{
    if (s->lcm->port.url.kind == LCM_FILE) (void)lcm_log_flush(&s->lcm->port.log);
    check_port(s, true);
}

bool service_open_lcm(struct service *s, char *why, size_t cap)
{
    if (!s->o->lcm) return true;
    struct lcm_feed *f = calloc(1, sizeof *f);
    if (!f) return why_fail(why, cap, "--lcm: out of memory");
    if (!lcm_port_open(&f->port, s->o->lcm, &s->refused, why, cap)) {
        free(f);
        return false;
    }
    f->tick = on_tick;
    f->ctx = s;
    s->lcm = f;
    lcm_feed_start(f, &s->view, s->o->epoch_ns, s->o->lcm_truth ? s->o->truth_every_ns : 0);
    return true;
}

void service_describe_lcm(const struct service *s, cJSON *files)
{
    const struct lcm_log *l = &s->lcm->port.log;
    if (s->lcm->port.url.kind != LCM_FILE) return;
    const double bytes = (double)l->size + (double)l->len;
    service_add_file(files, "lcm log", l->path, bytes, l->error ? own_file_strerror(l->error) : NULL);
}

void service_print_lcm(const struct service *s)
{
    const struct lcm_port *p = &s->lcm->port;
    const bool file = p->url.kind == LCM_FILE;
    fprintf(stderr, "psa-emu: LCM %s: %" PRIu64 " messages, %" PRIu64 " lost\n", s->o->lcm,
            file ? p->log.stored : p->udpm.sent, file ? p->log.events - p->log.stored : p->udpm.lost);
}

void service_close_lcm(struct service *s)
{
    if (!s->lcm) return;
    lcm_feed_stop(s->lcm);
    lcm_port_close(&s->lcm->port);
    free(s->lcm);
    s->lcm = NULL;
}
