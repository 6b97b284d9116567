#include "base/sched.h"

#include <assert.h>
#include <stddef.h>

static bool before(const struct sched_ev *a, const struct sched_ev *b)
{
    return a->due_ns != b->due_ns ? a->due_ns < b->due_ns : a->seq < b->seq;
}

/* Pairing heap: `prev` is the parent for a first child, the left sibling otherwise. */
static struct sched_ev *meld(struct sched_ev *a, struct sched_ev *b)
{
    if (!a) return b;
    if (!b) return a;
    if (before(b, a)) {
        struct sched_ev *t = a;
        a = b;
        b = t;
    }
    b->prev = a;
    b->sibling = a->child;
    if (a->child) a->child->prev = b;
    a->child = b;
    return a;
}

/* Melds a list of siblings in pairs, left to right, then folds the pairs right to left; iterative, so that a long list
 * cannot exhaust the stack. */
static struct sched_ev *meld_siblings(struct sched_ev *first)
{
    struct sched_ev *pairs = NULL;
    while (first) {
        struct sched_ev *a = first;
        struct sched_ev *b = a->sibling;
        first = b ? b->sibling : NULL;
        a->sibling = NULL;
        if (b) b->sibling = NULL;
        struct sched_ev *m = meld(a, b);
        m->sibling = pairs;
        pairs = m;
    }
    struct sched_ev *root = NULL;
    while (pairs) {
        struct sched_ev *next = pairs->sibling;
        pairs->sibling = NULL;
        root = meld(root, pairs);
        pairs = next;
    }
    if (root) root->prev = NULL;
    return root;
}

static void unlink_ev(struct sched *s, struct sched_ev *e)
{
    struct sched_ev *rest = meld_siblings(e->child);
    if (e == s->root) {
        s->root = rest;
    } else {
        if (e->prev->child == e) e->prev->child = e->sibling;
        else e->prev->sibling = e->sibling;
        if (e->sibling) e->sibling->prev = e->prev;
        s->root = meld(s->root, rest);
    }
    e->child = e->sibling = e->prev = NULL;
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
    e->seq = s->seq++;
    e->queued = true;
    s->root = meld(s->root, e);
}

void sched_cancel(struct sched *s, struct sched_ev *e)
{
    if (e->queued) unlink_ev(s, e);
}

int64_t sched_next_ns(const struct sched *s)
{
    return s->root ? s->root->due_ns : SCHED_NEVER;
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
    if (t_ns > s->until_ns || (s->root && s->root->due_ns <= t_ns)) return false;
    if (s->now_ns < t_ns) s->now_ns = t_ns;
    count_at_once(s);
    return true;
}

void sched_run_until(struct sched *s, int64_t until_ns)
{
    s->until_ns = until_ns;
    while (s->root && s->root->due_ns <= until_ns) {
        struct sched_ev *e = s->root;
        unlink_ev(s, e);
        s->now_ns = e->due_ns;
        count_at_once(s);
        e->fn(e->ctx, e->due_ns);
    }
    if (s->now_ns < until_ns) s->now_ns = until_ns;
    s->until_ns = -1;
}
