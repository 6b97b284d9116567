#include "base/sched.h"

#include <assert.h>
#include <stddef.h>

/* The queue is a list in order, and a heap of what comes after it once there is much. A board has a dozen events, near ones
 * (edges) and far ones (timeout), so the place of a new one is looked for from both ends at once: cheaper than a heap. Where
 * that would take NEAR_STEPS, the end of the list goes to the heap; it comes back when the list is empty. So a place never
 * costs more, and a board alone has no heap.
 *
 * What is due before far_ns is in the list, all else in the heap: equal events are always in one of the two. */
enum { NEAR_STEPS = 16, FETCH = 16 };

/* What a board alone never needs is not part of its functions, which then save nothing on the stack for it. */
#define RARE __attribute__((noinline))

/* Into the list between two neighbours; NULL: there is none. */
static inline void link_near(struct sched *s, struct sched_ev *e, struct sched_ev *after, struct sched_ev *before)
{
    e->prev = after;
    e->next = before;
    *(after ? &after->next : &s->first) = e;
    *(before ? &before->prev : &s->last) = e;
    e->queued = SCHED_NEAR;
}

/* ---- the heap
 *
 * M. L. Fredman, R. Sedgewick, D. D. Sleator, R. E. Tarjan, "The pairing heap: a new form of self-adjusting heap",
 * Algorithmica 1 (1986): put in constant time, take in O(log n) amortised. */

static bool comes_before(const struct sched_ev *a, const struct sched_ev *b)
{
    return a->due_ns != b->due_ns ? a->due_ns < b->due_ns : a->number < b->number;
}

/* Two heaps to one: the later root becomes the first child of the earlier one. `prev` of a first child is its parent. */
static struct sched_ev *meld_heaps(struct sched_ev *a, struct sched_ev *b)
{
    struct sched_ev *const top = comes_before(a, b) ? a : b;
    struct sched_ev *const sub = top == a ? b : a;
    sub->next = top->child;
    if (sub->next) sub->next->prev = sub;
    sub->prev = top;
    top->child = sub;
    return top;
}

/* Siblings to one heap: in pairs from the first to the last, then all pairs from the last to the first. */
static struct sched_ev *merge_siblings(struct sched_ev *first)
{
    struct sched_ev *pairs = NULL, *all = NULL;
    while (first) {
        struct sched_ev *a = first, *const b = a->next;
        first = b ? b->next : NULL;
        if (b) a = meld_heaps(a, b);
        a->next = pairs;
        pairs = a;
    }
    while (pairs) {
        struct sched_ev *const a = pairs;
        pairs = a->next;
        all = all ? meld_heaps(all, a) : a;
    }
    if (all) all->next = all->prev = NULL;
    return all;
}

RARE static void put_far(struct sched *s, struct sched_ev *e)
{
    e->queued = SCHED_FAR;
    e->number = s->number++;
    e->child = e->next = e->prev = NULL;
    s->far = s->far ? meld_heaps(s->far, e) : e;
}

RARE static void take_far(struct sched *s, struct sched_ev *e)
{
    struct sched_ev *const below = merge_siblings(e->child);
    e->queued = SCHED_IDLE;
    if (e == s->far) {
        s->far = below;
        return;
    }
    *(e->prev->child == e ? &e->prev->child : &e->prev->next) = e->next;
    if (e->next) e->next->prev = e->prev;
    if (below) s->far = meld_heaps(s->far, below);
}

/* ---- between the two */

/* The list from `from` on goes to the heap, its equals before it too; e, due before them, is armed. */
RARE static void cut_list(struct sched *s, struct sched_ev *from, struct sched_ev *e)
{
    while (from->prev->due_ns == from->due_ns) from = from->prev;
    s->far_ns = from->due_ns;
    s->last = from->prev;
    s->last->next = NULL;
    for (struct sched_ev *next; from; from = next) {
        next = from->next;
        put_far(s, from);
    }
    sched_at(s, e, e->due_ns);
}

/* The list is empty: the first of the heap follow, with all their equals. False: there are none. */
RARE static bool fetch_list(struct sched *s)
{
    for (unsigned n = 0; s->far && (n < FETCH || s->far->due_ns == s->last->due_ns); n++) {
        struct sched_ev *const e = s->far;
        take_far(s, e);
        link_near(s, e, s->last, NULL);
    }
    s->far_ns = s->far ? s->far->due_ns : SCHED_NEVER;
    return s->first != NULL;
}

RARE static void rearm_far(struct sched *s, struct sched_ev *e, int64_t t_ns)
{
    take_far(s, e);
    sched_at(s, e, t_ns);
}

/* ---- */

/* An armed event that is not inner is among the looks, wherever it waits. A bench has few of them at a time. */
static inline void note_look(struct sched *s, struct sched_ev *e)
{
    if (e->inner || e->look_at) return;
    e->look_next = s->looks;
    e->look_at = &s->looks;
    if (s->looks) s->looks->look_at = &e->look_next;
    s->looks = e;
}

static inline void drop_look(struct sched_ev *e)
{
    if (!e->look_at) return;
    *e->look_at = e->look_next;
    if (e->look_next) e->look_next->look_at = e->look_at;
    e->look_at = NULL;
}

/* Behind its equals: the order of scheduling. */
static void insert_event(struct sched *s, struct sched_ev *e)
{
    const int64_t due_ns = e->due_ns;
    struct sched_ev *after = s->last;
    struct sched_ev *before = s->first;
    unsigned left = NEAR_STEPS;
    if (due_ns >= s->far_ns) {
        put_far(s, e);
        return;
    }
    if (!before) {
        link_near(s, e, NULL, NULL);
        return;
    }
    while (before->due_ns <= due_ns && after->due_ns > due_ns) { /* so both have one more on their way */
        before = before->next;
        after = after->prev;
        if (--left == 0) {
            cut_list(s, after->next, e);
            return;
        }
    }
    if (before->due_ns > due_ns) after = before->prev;
    else before = after->next;
    link_near(s, e, after, before);
}

static void take_near(struct sched *s, struct sched_ev *e)
{
    *(e->prev ? &e->prev->next : &s->first) = e->next;
    *(e->next ? &e->next->prev : &s->last) = e->prev;
    e->queued = SCHED_IDLE;
}

/* The same for the first. */
static struct sched_ev *take_first(struct sched *s)
{
    struct sched_ev *const e = s->first;
    s->first = e->next;
    *(e->next ? &e->next->prev : &s->last) = NULL;
    e->queued = SCHED_IDLE;
    return e;
}

void sched_init(struct sched *s)
{
    *s = (struct sched){.until_ns = -1, .far_ns = SCHED_NEVER};
}

void sched_ev(struct sched_ev *e, sched_fn *fn, void *ctx)
{
    *e = (struct sched_ev){.fn = fn, .ctx = ctx};
}

void sched_ev_inner(struct sched_ev *e, sched_fn *fn, void *ctx)
{
    *e = (struct sched_ev){.fn = fn, .ctx = ctx, .inner = true};
}

void sched_at(struct sched *s, struct sched_ev *e, int64_t t_ns)
{
    assert(e->fn);
    if (e->queued) {
        if (e->queued == SCHED_FAR) {
            rearm_far(s, e, t_ns);
            return;
        }
        take_near(s, e);
    }
    e->due_ns = t_ns < s->now_ns ? s->now_ns : t_ns;
    insert_event(s, e);
    note_look(s, e);
}

void sched_cancel(struct sched *s, struct sched_ev *e)
{
    drop_look(e);
    if (e->queued == SCHED_NEAR) take_near(s, e);
    else if (e->queued) take_far(s, e);
}

int64_t sched_next_ns(const struct sched *s)
{
    return s->first ? s->first->due_ns : s->far ? s->far->due_ns : SCHED_NEVER;
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
    if (t_ns > s->until_ns || (s->first ? s->first->due_ns : s->far_ns) <= t_ns) return false;
    if (s->now_ns < t_ns) s->now_ns = t_ns;
    count_at_once(s);
    return true;
}

void sched_run_until(struct sched *s, int64_t until_ns)
{
    s->until_ns = until_ns;
    while ((s->first || fetch_list(s)) && s->first->due_ns <= s->until_ns) {
        struct sched_ev *const e = take_first(s);
        drop_look(e);
        s->now_ns = e->due_ns;
        count_at_once(s);
        e->fn(e->ctx, e->due_ns);
    }
    if (s->now_ns < s->until_ns) s->now_ns = s->until_ns;
    s->until_ns = -1;
}

void sched_run_towards(struct sched *s, int64_t until_ns, int64_t look_ns)
{
    s->look_ns = look_ns;
    sched_run_until(s, until_ns);
    s->look_ns = 0;
}

void sched_settle(struct sched *s)
{
    while (s->asleep > 0 && sched_next_ns(s) != SCHED_NEVER) sched_run_until(s, sched_next_ns(s));
}

int64_t sched_look_ns(const struct sched *s)
{
    if (s->eager || s->any_time > 0 || s->until_ns < s->now_ns) return s->now_ns;
    int64_t look_ns = s->look_ns > s->until_ns ? s->look_ns : s->until_ns;
    for (const struct sched_ev *e = s->looks; e; e = e->look_next) {
        if (e->due_ns < look_ns) look_ns = e->due_ns;
    }
    return look_ns;
}

void sched_stop(struct sched *s)
{
    if (s->until_ns > s->now_ns) s->until_ns = s->now_ns;
}
