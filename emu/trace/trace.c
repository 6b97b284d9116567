#include "trace/trace.h"

#include <assert.h>
#include <string.h>

/* Of n reports keeps, in place, what really changes; returns how many are left. */
static unsigned filter(struct trace *t, struct trace_step *s, unsigned n)
{
    uint32_t level = t->level;
    struct trace_step *kept = s;
    for (const struct trace_step *const end = s + n; s < end; s++) {
        const uint32_t changed = (level ^ s->level) & s->lines;
        if (!changed) continue;
        level ^= changed;
        *kept++ = (struct trace_step){s->t_ns, changed, level};
    }
    t->level = level;
    return (unsigned)(kept - (s - n));
}

static void deliver_until(struct trace *t, int64_t t_ns)
{
    struct trace_step *const due = t->pending + t->first;
    unsigned n = 0;
    while (n < t->pending_count && due[n].t_ns <= t_ns) n++;
    t->pending_count -= n;
    t->first = t->pending_count > 0 ? t->first + n : 0;
    const unsigned kept = filter(t, due, n);
    if (kept == 0) return;
    for (const struct trace_sink *s = t->sinks; s; s = s->next) s->steps(s->ctx, due, kept);
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
    s->steps(s->ctx, &(struct trace_step){t->done_ns, (uint32_t)((UINT64_C(1) << t->count) - 1), t->level}, 1);
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

/* Room for n more reports at the end: what waits moves down when the end of the array is reached. */
static bool make_room(struct trace *t, unsigned n)
{
    if (t->first + t->pending_count + n <= TRACE_PENDING_MAX) return true;
    memmove(t->pending, t->pending + t->first, t->pending_count * sizeof *t->pending);
    t->first = 0;
    return t->pending_count + n <= TRACE_PENDING_MAX;
}

/* Reports are nearly in order: an insertion sort. */
static void insert(struct trace *t, const struct trace_step *s)
{
    struct trace_step *const first = t->pending + t->first;
    struct trace_step *at = first + t->pending_count++;
    for (; at > first && at[-1].t_ns > s->t_ns; at--) at[0] = at[-1];
    *at = *s;
}

void trace_steps(struct trace *t, const struct trace_step *s, unsigned n)
{
    if (n == 0 || !make_room(t, n)) {
        t->dropped += n;
        return;
    }
    const unsigned end = t->first + t->pending_count;
    if (s->t_ns >= t->done_ns && (t->pending_count == 0 || t->pending[end - 1].t_ns <= s->t_ns)) {
        memcpy(t->pending + end, s, n * sizeof *s);
        t->pending_count += n;
        return;
    }
    for (; n > 0; n--, s++) {
        const bool late = s->t_ns < t->done_ns;
        t->late += late;
        insert(t, &(struct trace_step){late ? t->done_ns : s->t_ns, s->lines, s->level});
    }
}

void trace_set(struct trace *t, unsigned sig, bool level, int64_t t_ns)
{
    const uint32_t bit = UINT32_C(1) << sig;
    if (!(t->watched & bit) && t->pending_count == 0) t->level = level ? t->level | bit : t->level & ~bit;
    else trace_steps(t, &(struct trace_step){t_ns, bit, level ? bit : 0}, 1);
}

void trace_each(const struct trace_step *s, unsigned n, uint32_t mask, trace_change_fn *change, void *ctx)
{
    for (; n > 0; n--, s++)
        for (uint32_t left = s->lines & mask; left; left &= left - 1) {
            const unsigned sig = (unsigned)__builtin_ctz(left);
            change(ctx, sig, (s->level >> sig & 1) != 0, s->t_ns);
        }
}

void trace_advance(struct trace *t, int64_t t_ns)
{
    deliver_until(t, t_ns);
    if (t_ns <= t->done_ns) return;
    t->done_ns = t_ns;
    for (const struct trace_sink *s = t->sinks; s; s = s->next)
        if (s->advance) s->advance(s->ctx, t_ns);
}
