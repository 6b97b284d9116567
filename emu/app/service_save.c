/* The journal, snapshots, and the state that the child of a fork takes over. */
#include "app/service.h"

#include "base/why.h"

#include <inttypes.h>
#include <string.h>

void service_journal(void *ctx, const struct control_command *row, const cJSON *args, bool done, int64_t t_ns)
{
    struct service *s = ctx;
    (void)t_ns; /* the journal asks the scheduler */
    journal_command(&s->journal, row, args, done);
}

bool service_snapshot(void *ctx, const char *path, cJSON *result, char *why)
{
    struct service *s = ctx;
    if (!snapshot_write(path, &s->journal, s->scenario, why, CONTROL_WHY_MAX)) return false;
    cJSON_AddStringToObject(result, "path", path);
    cJSON_AddNumberToObject(result, "journal_bytes", (double)s->journal.len);
    return true;
}

void service_follow(struct service *s)
{
    journal_init(&s->journal, s->bench);
    for (unsigned i = 0; i < s->ports.hubs; i++) journal_follow(&s->journal, &s->ports.hub[i], i);
}

void service_check_journal(struct service *s)
{
    char news[JOURNAL_NEWS_MAX];
    if (journal_news(&s->journal, s->bench->sched.now_ns, news)) service_say(news);
}

bool service_restore(struct service *s, const struct snapshot *from, char *why, size_t cap)
{
    struct snapshot_world w = {.bench = s->bench,
                               .journal = &s->journal,
                               .buses = s->ports.hubs,
                               .control = &s->control,
                               .observers = &s->observers};
    char what[640];
    for (unsigned i = 0; i < w.buses; i++) w.hub[i] = &s->ports.hub[i];
    service_power_up(s);
    s->powered = true;
    if (!snapshot_replay(from, &w, what, sizeof what)) return why_fail(why, cap, "%s: %s", s->o->restore, what);
    s->connections = s->ports.connections;
    if (s->loop.end_ns < SCHED_NEVER) s->loop.end_ns += s->bench->sched.now_ns;
    return true;
}

/* ---- in the child of a fork */

void service_abandon(struct service *s)
{
    struct bench *b = s->bench;
    for (unsigned i = 0; i < s->ports.hubs; i++) can_hub_detach_all(&s->ports.hub[i]);
    snapshot_observe_lines(&s->observers, b);
    for (unsigned i = 0; i < CONTROL_SUBS_MAX; i++) {
        if (s->control.watch.sub[i].control) control_gone(&s->control, s->control.watch.sub[i].client);
    }
    if (b->recording) vcd_close(&b->vcd, b->sched.now_ns);
    b->recording = false;
    truth_log_close(&s->truth_log);
    service_abandon_capture(s);
    service_close_lcm(s);
    s->runner = NULL;
    control_cycles_forget(&s->control, NULL);
    control_run_forget(&s->control);
    loop_cancel_step(&s->loop);
    ports_abandon(&s->ports);
}

bool service_reopen(struct service *s, const struct options *o, char *why, size_t cap)
{
    s->o = o;
    return ports_check(&s->ports, s->bench, o, why, cap) && ports_open(&s->ports, s->bench, o, why, cap);
}
