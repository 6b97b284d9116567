#include "base/sched.h"

#include <assert.h>
#include <stddef.h>

/* The queue is a list in order. A board has a dozen events, near ones (edges) and far ones (timeout), so the place of a
 * new one is looked for from both ends at once: cheaper than a heap up to hundreds of events. Behind its equals: the order
 * of scheduling. */
static void insert_event(struct sched *s, struct sched_ev *e)
{
    struct sched_ev *after = s->last;
    struct sched_ev *before = s->first;
    while (before && before->due_ns <= e->due_ns && after->due_ns > e->due_ns) {
        before = before->next;
        after = after->prev;
    }
    if (before && before->due_ns > e->due_ns) after = before->prev;
    else if (after) before = after->next;
    e->prev = after;
    e->next = before;
    *(after ? &after->next : &s->first) = e;
    *(before ? &before->prev : &s->last) = e;
    e->queued = true;
}

static void take_out(struct sched *s, struct sched_ev *e)
{
    *(e->prev ? &e->prev->next : &s->first) = e->next;
    *(e->next ? &e->next->prev : &s->last) = e->prev;
    e->queued = false;
}

void sched_init(struct sched *s)
{
    *s = (struct sched){.until_ns = -1};
}

void sched_ev(struct sched_ev *e, sched_fn *fn, void *ctx)
{
    *e = (struct sched_ev){.fn = fn, .ctx = ctx};
}

void sched_at(struct sched *s, struct sched_ev *e, int64_t t_ns)
{
    assert(e->fn);
    sched_cancel(s, e);
    e->due_ns = t_ns < s->now_ns ? s->now_ns : t_ns;
    insert_event(s, e);
}

void sched_cancel(struct sched *s, struct sched_ev *e)
{
    if (e->queued) take_out(s, e);
}

int64_t sched_next_ns(const struct sched *s)
{
    return s->first ? s->first->due_ns : SCHED_NEVER;
}

static void count_at_once(struct sched *s)
{
    if (s->now_ns != s->at_once_ns) {
        s->at_once_ns = s->now_ns;
        s->at_once = 0;
    }
    s->at_once++;
    assert(s->at_once <= SCHED_AT_ONCE_MAX);
}

bool sched_go_on(struct sched *s, int64_t t_ns)
{
    if (t_ns > s->until_ns || (s->first && s->first->due_ns <= t_ns)) return false;
    if (s->now_ns < t_ns) s->now_ns = t_ns;
    count_at_once(s);
    return true;
}

void sched_run_until(struct sched *s, int64_t until_ns)
{
    s->until_ns = until_ns;
    while (s->first && s->first->due_ns <= s->until_ns) {
        struct sched_ev *e = s->first;
        take_out(s, e);
        s->now_ns = e->due_ns;
        count_at_once(s);
        e->fn(e->ctx, e->due_ns);
    }
    if (s->now_ns < s->until_ns) s->now_ns = s->until_ns;
    s->until_ns = -1;
}

void sched_stop(struct sched *s)
{
    if (s->until_ns > s->now_ns) s->until_ns = s->now_ns;
}
