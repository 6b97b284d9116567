#include "app/instruments.h"

#include "base/why.h"
#include "fault/scpi.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* ---- sessions */

/* An answer that comes later. */
struct late {
    struct late *next;
    int64_t due_ns;
    size_t n;
    char text[];
};

/* Of one session, with what belongs to it: more than that is lost, as in an interface that is full. */
#define LATE_BYTES_MAX ((size_t)1 << 20)

struct session {
    struct scpi scpi; /* first */
    struct instruments *all;
    struct scpi_peer *peer;
    struct late *late, *latest; /* in order: the first and the last */
    size_t late_bytes;
    struct sched_ev due; /* of the first */
};

static struct fault_scpi faults_of(const struct session *s)
{
    return fault_scpi_of(s->all->control->bench->faults, s->scpi.kind->name);
}

static struct late *take_late(struct session *s)
{
    struct late *l = s->late;
    s->late = l->next;
    s->late_bytes -= sizeof *l + l->n;
    return l;
}

static void on_late(void *ctx, int64_t t_ns)
{
    struct session *s = ctx;
    while (s->late && s->late->due_ns <= t_ns) {
        struct late *l = take_late(s);
        if (!faults_of(s).silent) scpi_port_reply(s->peer, l->text, l->n);
        free(l);
    }
    if (s->late) sched_at(s->all->sched, &s->due, s->late->due_ns);
}

/* After those that are late already. */
static void put_off(struct session *s, const char *text, size_t n, int64_t late_ns)
{
    const size_t bytes = sizeof(struct late) + n;
    struct late *l = s->late_bytes + bytes <= LATE_BYTES_MAX ? malloc(bytes) : NULL;
    if (!l) return;
    *l = (struct late){.due_ns = s->all->sched->now_ns + late_ns, .n = n};
    memcpy(l->text, text, n);
    if (s->late) {
        l->due_ns = ns_later(l->due_ns, s->latest->due_ns);
        s->latest->next = l;
    } else {
        s->late = l;
        sched_at(s->all->sched, &s->due, l->due_ns);
    }
    s->latest = l;
    s->late_bytes += bytes;
}

static void drop_late(struct session *s)
{
    sched_cancel(s->all->sched, &s->due);
    while (s->late) free(take_late(s));
}

static void on_reply(void *ctx, const char *text, size_t n)
{
    struct session *s = ctx;
    char sent[SCPI_OUT_MAX];
    const struct fault_scpi f = faults_of(s);
    if (f.silent) return;
    memcpy(sent, text, n);
    fault_scpi_garble(&f, sent, n);
    if (f.late_ns > 0 || s->late) put_off(s, sent, n, f.late_ns);
    else scpi_port_reply(s->peer, sent, n);
}

static void *on_opened(void *ctx, struct scpi_peer *peer)
{
    const struct instrument *i = ctx;
    struct session *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->all = i->all;
    s->peer = peer;
    s->scpi.kind = i->kind;
    s->scpi.control = i->all->control;
    s->scpi.sched = i->all->sched;
    s->scpi.reply = on_reply;
    s->scpi.ctx = s;
    sched_ev_inner(&s->due, on_late, s);
    scpi_open(&s->scpi);
    s->scpi.next = i->all->sessions;
    i->all->sessions = &s->scpi;
    return s;
}

static void on_closed(void *ctx)
{
    struct session *s = ctx;
    struct scpi **p = &s->all->sessions;
    while (*p != &s->scpi) p = &(*p)->next;
    *p = s->scpi.next;
    scpi_close(&s->scpi);
    drop_late(s);
    free(s);
}

static void on_line(void *ctx, const char *line, size_t len, int64_t t_ns)
{
    struct session *s = ctx;
    if (faults_of(s).silent) return;
    scpi_line(&s->scpi, line, len, t_ns);
    instruments_look(s->all, t_ns);
}

static bool on_busy(const void *ctx)
{
    return scpi_busy(&((const struct session *)ctx)->scpi);
}

void instruments_look(struct instruments *all, int64_t t_ns)
{
    for (struct scpi *s = all->sessions; s; s = s->next) scpi_look(s, t_ns);
}

/* ---- addresses */

static bool open_port(struct instruments *all, const struct scpi_kind *kind, const struct options_scpi *o,
                      unsigned offset, bool many, char *why, size_t cap)
{
    if (all->count == INSTRUMENTS_MAX)
        return why_fail(why, cap, "--scpi %s: expected up to %u addresses", o->arg, INSTRUMENTS_MAX);
    struct instrument *i = calloc(1, sizeof *i);
    if (!i) return why_fail(why, cap, "--scpi %s: out of memory", o->arg);
    i->all = all;
    i->kind = kind;
    i->port = (struct scpi_port){.kind = kind->name,
                                 .links = all->links,
                                 .opened = on_opened,
                                 .line = on_line,
                                 .busy = on_busy,
                                 .closed = on_closed,
                                 .ctx = i};
    if (many && o->link) snprintf(i->link, sizeof i->link, "%s.%s", o->link, kind->name);
    const char *name = many && o->link ? i->link : o->link;
    const uint16_t port = o->port ? (uint16_t)(o->port + offset) : 0;
    const int err = o->pty ? scpi_port_pty(&i->port, name) : scpi_port_tcp(&i->port, port);
    if (!err) {
        all->port[all->count++] = i;
        return true;
    }
    char where[1024];
    snprintf(where, sizeof where, "--scpi %s%s%s", o->arg, many && name ? ": " : "", many && name ? name : "");
    const struct pty pty = i->port.pty;
    free(i);
    return o->pty ? pty_fail(&pty, where, err, &all->refused, why, cap) : why_port(why, cap, where, -err);
}

/* `all` are those that the scenario has, each at an offset of its own whatever else there is. */
static bool open_ports(struct instruments *all, const struct options_scpi *o, char *why, size_t cap)
{
    const bool many = strcmp(o->kind, "all") == 0;
    for (unsigned k = 0; scpi_kinds[k].name; k++) {
        const struct scpi_kind *kind = &scpi_kinds[k];
        const bool wanted = many ? scpi_present(kind, all->control->bench) : strcmp(kind->name, o->kind) == 0;
        if (wanted && !open_port(all, kind, o, many ? k : 0, many, why, cap)) return false;
    }
    return true;
}

bool instruments_check(const struct instruments *all, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->scpi_count; i++) {
        const struct options_scpi *s = &o->scpi[i];
        const struct scpi_kind *kind = scpi_kind(s->kind);
        if (strcmp(s->kind, "all") == 0) continue;
        if (!kind) return why_expected(why, cap, "--scpi", WHY_TEXT(s->arg), "head, table, chamber, supply or all");
        if (!scpi_present(kind, all->control->bench))
            return why_fail(why, cap, "--scpi %s: expected a scenario with a %s", s->arg, kind->name);
    }
    return true;
}

bool instruments_open(struct instruments *all, const struct options *o, char *why, size_t cap)
{
    for (unsigned i = 0; i < o->scpi_count; i++) {
        if (!open_ports(all, &o->scpi[i], why, cap)) return false;
    }
    return true;
}

void instruments_close(struct instruments *all)
{
    for (unsigned k = 0; k < all->count; k++) scpi_port_close(&all->port[k]->port);
}

void instruments_free(struct instruments *all)
{
    for (unsigned k = 0; k < all->count; k++) free(all->port[k]);
    all->count = 0;
}
