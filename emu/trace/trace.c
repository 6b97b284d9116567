#include "trace/trace.h"

#include "trace/group.h"

#include <assert.h>
#include <string.h>

/* Leaves of n reports what really changes. */
static void filter_steps(struct trace *t, struct trace_step *s, uint64_t n)
{
    uint64_t level = t->level;
    for (const struct trace_step *const end = s + n; s < end; s++) {
        const uint64_t lines = s->lines;
        s->lines = (level ^ s->level) & lines;
        level = (level & ~lines) + (s->level & lines); /* two steps long where the xor would be three: it is a chain */
    }
    t->level = level;
}

/* The same for the n oldest of those pending; runs need no look at each step. */
static void filter_due(struct trace *t, struct trace_step *s, unsigned n)
{
    uint64_t at = t->gone;
    unsigned k = 0;
    t->gone += n;
    for (; k < t->runs && t->run[k].at + t->run[k].n <= t->gone; k++) {
        const struct trace_run *r = &t->run[k];
        filter_steps(t, s, r->at - at);
        s += r->at - at;
        at = r->at;
        if (t->level & r->lines) continue; /* with what follows */
        s += r->n;
        at += r->n;
    }
    filter_steps(t, s, t->gone - at);
    k += k < t->runs && t->run[k].at < t->gone; /* only begun */
    t->runs -= k;
    if (k > 0 && t->runs > 0) memmove(t->run, t->run + k, t->runs * sizeof *t->run);
}

/* How many of n steps come up to t_ns. */
static unsigned count_until(const struct trace_step *s, unsigned n, int64_t t_ns)
{
    unsigned from = 0;
    while (from < n) {
        const unsigned middle = from + (n - from) / 2;
        if (s[middle].t_ns <= t_ns) from = middle + 1;
        else n = middle;
    }
    return from;
}

void trace_emit(const struct trace *t, const struct trace_step *s, unsigned n)
{
    for (const struct trace_sink *k = t->sinks; k; k = k->next) k->steps(k->ctx, s, n);
}

static void deliver_until(struct trace *t, int64_t t_ns)
{
    struct trace_step *const due = t->pending + t->first;
    const unsigned n = count_until(due, t->pending_count, t_ns);
    t->pending_count -= n;
    t->first = t->pending_count > 0 ? t->first + n : 0;
    if (t->filter) {
        const uint64_t before = t->level;
        if (n > 0) filter_due(t, due, n);
        t->filter->steps(t->filter->ctx, before, due, n, t_ns);
        return;
    }
    if (n == 0) return;
    filter_due(t, due, n);
    trace_emit(t, due, n);
}

/* What a sink wants, and what that follows from. */
static uint64_t sources_of(const struct trace *t, uint64_t mask)
{
    return mask & t->wires ? mask | t->wired : mask;
}

static void watch_again(struct trace *t)
{
    if (t->group) t->group->changes++;
    t->watched = 0;
    for (const struct trace_sink *s = t->sinks; s; s = s->next) t->watched |= sources_of(t, s->mask);
}

unsigned trace_add(struct trace *t, const char *name, bool level)
{
    assert(t->count < TRACE_SIGNALS_MAX);
    t->name[t->count] = name;
    t->level |= (uint64_t)level << t->count;
    return t->count++;
}

int trace_find(const struct trace *t, const char *name)
{
    for (unsigned i = 0; i < t->count; i++)
        if (strcmp(t->name[i], name) == 0) return (int)i;
    return -1;
}

void trace_wake(struct trace *t)
{
    struct trace_group *g = t->group;
    if (t->room) return;
    t->room = TRACE_PENDING_MAX;
    if (!g) return;
    if (t->done_ns < g->done_ns) t->done_ns = g->done_ns; /* there was nothing to deliver */
    t->next_awake = g->awake;
    g->awake = t;
}

void trace_attach(struct trace *t, struct trace_sink *s)
{
    trace_wake(t);
    if (t->source.wake) t->source.wake(t->source.ctx, sources_of(t, s->mask));
    if (t->filter) deliver_until(t, t->done_ns); /* it sees levels that have moved without a step */
    if (t->standing && !t->filter) t->standing->start(t->standing->ctx);
    struct trace_sink **end = &t->sinks;
    while (*end) {
        assert(*end != s);
        end = &(*end)->next;
    }
    s->next = NULL;
    *end = s;
    watch_again(t);
    s->steps(s->ctx, &(struct trace_step){t->done_ns, TRACE_FIRST(t->count), t->filter ? t->filter->level : t->level},
             1);
}

void trace_detach(struct trace *t, struct trace_sink *s)
{
    struct trace_sink **at = &t->sinks;
    while (*at && *at != s) at = &(*at)->next;
    if (*at) *at = s->next;
    s->next = NULL;
    watch_again(t);
    if (!t->sinks) deliver_until(t, INT64_MAX); /* no sinks: the levels stay right for the next one */
}

uint64_t trace_known(const struct trace *t, int64_t t_ns)
{
    if (t->filter) return t->filter->level;
    uint64_t level = t->level;
    for (const struct trace_step *s = t->pending + t->first, *end = s + t->pending_count; s < end && s->t_ns <= t_ns;
         s++)
        level = trace_after(level, s);
    return level;
}

static void make_room(struct trace *t, unsigned n)
{
    trace_wake(t);
    if (t->first + t->pending_count + n <= TRACE_PENDING_MAX) return;
    memmove(t->pending, t->pending + t->first, t->pending_count * sizeof *t->pending);
    t->first = 0;
}

struct trace_step *trace_room(struct trace *t, unsigned n)
{
    if (t->first + t->pending_count + n > t->room) make_room(t, n);
    if (t->pending_count + n <= TRACE_PENDING_MAX) return t->pending + t->first + t->pending_count;
    t->dropped += n;
    return NULL;
}

/* Reports are nearly in order: an insertion sort that ends with the first new step that comes after all old ones. */
void trace_commit(struct trace *t, unsigned n)
{
    struct trace_step *const first = t->pending + t->first;
    struct trace_step *s = first + t->pending_count;
    const int64_t last_ns = s > first ? s[-1].t_ns : t->done_ns;
    t->pending_count += n;
    for (const struct trace_step *const end = s + n; s < end && s->t_ns < last_ns; s++) {
        struct trace_step e = *s, *at = s;
        t->late += e.t_ns < t->done_ns;
        if (e.t_ns < t->done_ns) e.t_ns = t->done_ns;
        for (; at > first && at[-1].t_ns > e.t_ns; at--) at[0] = at[-1];
        *at = e;
        const uint64_t place = t->gone + (uint64_t)(at - first);
        while (t->runs > 0 && t->run[t->runs - 1].at + t->run[t->runs - 1].n > place) t->runs--;
    }
}

void trace_commit_run(struct trace *t, unsigned n, uint64_t lines)
{
    const struct trace_step *const s = t->pending + t->first + t->pending_count;
    const bool in_order = n > 0 && s->t_ns >= (t->pending_count > 0 ? s[-1].t_ns : t->done_ns);
    const struct trace_run run = {t->gone + t->pending_count, n, lines};
    trace_commit(t, n);
    if (in_order && t->runs < TRACE_RUNS_MAX) t->run[t->runs++] = run;
}

void trace_steps(struct trace *t, const struct trace_step *s, unsigned n)
{
    struct trace_step *room = trace_room(t, n);
    if (!room) return;
    for (unsigned i = 0; i < n; i++) room[i] = s[i];
    trace_commit(t, n);
}

void trace_each(const struct trace_step *s, unsigned n, uint64_t mask, trace_change_fn *change, void *ctx)
{
    for (; n > 0; n--, s++)
        for (uint64_t left = s->lines & mask; left; left &= left - 1) {
            const unsigned sig = (unsigned)__builtin_ctzll(left);
            change(ctx, sig, (s->level >> sig & 1) != 0, s->t_ns);
        }
}

static void advance_sinks(struct trace *t, int64_t t_ns)
{
    deliver_until(t, t_ns);
    if (t_ns <= t->done_ns) return;
    t->done_ns = t_ns;
    for (const struct trace_sink *s = t->sinks; s; s = s->next)
        if (s->advance) s->advance(s->ctx, t_ns);
}

void trace_advance(struct trace *t, int64_t t_ns)
{
    if (t->source.report && t_ns > t->done_ns)
        for (int64_t known_ns; (known_ns = t->source.report(t->source.ctx, t_ns)) < t_ns;) advance_sinks(t, known_ns);
    advance_sinks(t, t_ns);
}

/* A source that reports may have more to say than its sinks asked for: once awake, it stays. */
static bool may_sleep(const struct trace *t)
{
    return !t->sinks && !t->filter && t->pending_count == 0 && !t->source.report;
}

void trace_advance_group(struct trace_group *g, int64_t t_ns)
{
    if (t_ns > g->done_ns) g->done_ns = t_ns;
    for (struct trace **at = &g->awake; *at;) {
        struct trace *t = *at;
        trace_advance(t, t_ns);
        if (*at == t && may_sleep(t)) { /* a sink may have woken others */
            *at = t->next_awake;
            t->room = 0;
        } else at = &t->next_awake;
    }
}
