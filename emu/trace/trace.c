#include "trace/trace.h"

#include <assert.h>
#include <string.h>

/* pending[] is a binary heap on (t_ns, order): reporting and delivering an edge costs a few moves, nothing is allocated. */
static bool before(const struct trace_edge *a, const struct trace_edge *b)
{
    if (a->t_ns != b->t_ns) return a->t_ns < b->t_ns;
    return (int32_t)(a->order - b->order) < 0; /* order may wrap; far fewer than 2^31 edges are ever pending */
}

static void heap_push(struct trace *t, const struct trace_edge *e)
{
    unsigned i = t->pending_count++;
    while (i > 0 && before(e, &t->pending[(i - 1) / 2])) {
        t->pending[i] = t->pending[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    t->pending[i] = *e;
}

static struct trace_edge heap_pop(struct trace *t)
{
    const struct trace_edge top = t->pending[0];
    const struct trace_edge last = t->pending[--t->pending_count];
    unsigned i = 0;
    for (unsigned child; (child = 2 * i + 1) < t->pending_count; i = child) {
        if (child + 1 < t->pending_count && before(&t->pending[child + 1], &t->pending[child])) child++;
        if (!before(&t->pending[child], &last)) break;
        t->pending[i] = t->pending[child];
    }
    t->pending[i] = last;
    return top;
}

static void deliver(struct trace *t, const struct trace_edge *e)
{
    const uint32_t bit = UINT32_C(1) << e->sig;
    if (((t->level & bit) != 0) == (e->level != 0)) return;
    t->level ^= bit;
    const int64_t t_ns = e->t_ns < t->done_ns ? t->done_ns : e->t_ns;
    for (const struct trace_sink *s = t->sinks; s; s = s->next)
        if (s->mask & bit) s->change(s->ctx, e->sig, e->level != 0, t_ns);
}

static void deliver_until(struct trace *t, int64_t t_ns)
{
    while (t->pending_count > 0 && t->pending[0].t_ns <= t_ns) {
        const struct trace_edge e = heap_pop(t);
        deliver(t, &e);
    }
}

static void watch_again(struct trace *t)
{
    t->watched = 0;
    for (const struct trace_sink *s = t->sinks; s; s = s->next) t->watched |= s->mask;
}

void trace_init(struct trace *t)
{
    memset(t, 0, sizeof *t);
}

unsigned trace_add(struct trace *t, const char *name, bool level)
{
    assert(t->count < TRACE_SIGNALS_MAX);
    t->name[t->count] = name;
    t->level |= (uint32_t)level << t->count;
    return t->count++;
}

int trace_find(const struct trace *t, const char *name)
{
    for (unsigned i = 0; i < t->count; i++)
        if (strcmp(t->name[i], name) == 0) return (int)i;
    return -1;
}

void trace_attach(struct trace *t, struct trace_sink *s)
{
    struct trace_sink **end = &t->sinks;
    while (*end) {
        assert(*end != s);
        end = &(*end)->next;
    }
    s->next = NULL;
    *end = s;
    watch_again(t);
    for (unsigned i = 0; i < t->count; i++)
        if (s->mask >> i & 1) s->change(s->ctx, i, (t->level >> i & 1) != 0, t->done_ns);
}

void trace_detach(struct trace *t, struct trace_sink *s)
{
    struct trace_sink **at = &t->sinks;
    while (*at && *at != s) at = &(*at)->next;
    if (*at) *at = s->next;
    s->next = NULL;
    watch_again(t);
    if (!t->sinks) deliver_until(t, INT64_MAX); /* to nobody: the levels stay right for the next listener */
}

void trace_set(struct trace *t, unsigned sig, bool level, int64_t t_ns)
{
    const uint32_t bit = UINT32_C(1) << sig;
    if (!(t->watched & bit) && t->pending_count == 0) {
        t->level = level ? t->level | bit : t->level & ~bit;
        return;
    }
    if (t->pending_count == TRACE_PENDING_MAX) {
        t->dropped++;
        return;
    }
    if (t_ns < t->done_ns) t->late++;
    const struct trace_edge e = {.t_ns = t_ns, .order = t->order++, .sig = (uint8_t)sig, .level = level};
    heap_push(t, &e);
}

void trace_advance(struct trace *t, int64_t t_ns)
{
    deliver_until(t, t_ns);
    if (t_ns <= t->done_ns) return;
    t->done_ns = t_ns;
    for (const struct trace_sink *s = t->sinks; s; s = s->next)
        if (s->advance) s->advance(s->ctx, t_ns);
}
