#include "base/can/fault.h"

#include "base/can/internal.h"

#include <assert.h>

/* Bits of a frame that an error cannot hit any more. */
enum { EOF_BITS = 7 + 3, HITS_MAX = 16 };

static bool is_hit(struct can_fault *f)
{
    if (f->limit && f->hits >= f->limit) return false;
    return f->probability >= 1.0 || rng_uniform(&f->rng) < f->probability;
}

static bool matches_wire(const struct can_bus *b, const struct can_fault *f)
{
    if (f->from && (!b->sender || can_controller(b->sender) != can_controller(f->from))) return false;
    if (f->to && (f->to == b->sender || f->to->bus != b)) return false;
    return ((b->wire.id ^ f->id) & f->mask) == 0;
}

/* The error comes an eighth to seven eighths into the frame. */
static int64_t error_after_ns(struct can_bus *b)
{
    for (struct can_fault *f = b->faults; f; f = f->next) {
        if (f->kind != CAN_FAULT_ERROR || !matches_wire(b, f) || !is_hit(f)) continue;
        f->hits++;
        const int64_t frame_ns = can_frame_ns(&b->cfg, &b->wire) - can_nominal_ns(b, EOF_BITS);
        return frame_ns * (int64_t)(1 + rng_u64(&f->rng) % 7) / 8;
    }
    return -1;
}

/* ---- frames on their way ---- */

struct hit {
    struct can_fault *f;
    unsigned bit; /* of the data: inverted */
};

static struct can_held *oldest_held(struct can_bus *b, const struct can_fault *f)
{
    struct can_held *best = NULL;
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++)
        if (h->by == f && (!best || h->number < best->number)) best = h;
    return best;
}

static void release_held(struct can_bus *b, struct can_held *h, int64_t t_ns)
{
    const struct can_held own = *h;
    h->by->held--;
    h->by = NULL;
    if (!own.to) can_deliver_all(b, &own.m, own.from, t_ns);
    else if (!own.to->silent) can_deliver(own.to, &own.m, t_ns);
}

static void arm_release(struct can_fault *f)
{
    const struct can_held *h = f->held > 0 && f->delay_ns > 0 ? oldest_held(f->bus, f) : NULL;
    if (h) sched_at(f->bus->sched, &f->due, h->due_ns);
    else sched_cancel(f->bus->sched, &f->due);
}

static void release_due(void *ctx, int64_t t_ns)
{
    struct can_fault *f = ctx;
    for (struct can_held *h; (h = oldest_held(f->bus, f)) && h->due_ns <= t_ns;) release_held(f->bus, h, t_ns);
    arm_release(f);
}

static void hold_frame(struct can_bus *b, struct can_fault *f, const struct can_msg *m, int64_t t_ns)
{
    struct can_held *h = b->held;
    while (h < b->held + CAN_HELD_MAX && h->by) h++;
    if (h == b->held + CAN_HELD_MAX) {
        f->lost++;
        return;
    }
    *h = (struct can_held){.by = f, .from = b->sender, .to = f->to, .number = b->held_number++, .m = *m};
    h->due_ns = t_ns + f->delay_ns;
    f->held++;
    if (!f->due.queued) arm_release(f);
}

/* Which faults affect the frame that has just ended. A REORDER that holds one lets this one pass. */
static unsigned select_hits(struct can_bus *b, struct hit *hit)
{
    unsigned n = 0;
    for (struct can_fault *f = b->faults; f && n < HITS_MAX; f = f->next) {
        if (f->kind == CAN_FAULT_ERROR || !matches_wire(b, f)) continue;
        if (f->kind == CAN_FAULT_DUPLICATE && b->repeat) continue;
        if (f->kind == CAN_FAULT_ALTER && (b->wire.len == 0 || b->wire.flags & CAN_RTR)) continue;
        if ((f->kind == CAN_FAULT_REORDER && f->held > 0) || !is_hit(f)) continue;
        f->hits++;
        hit[n] = (struct hit){.f = f};
        if (f->kind == CAN_FAULT_ALTER) hit[n].bit = (unsigned)(rng_u64(&f->rng) % (8u * b->wire.len));
        n++;
    }
    return n;
}

/* As this node receives it: whether at all, and if once more. */
static void deliver_hit(struct can_node *n, const struct can_msg *wire, const struct hit *hit, unsigned hits,
                        int64_t t_ns)
{
    struct can_msg m = *wire;
    bool comes = true, twice = false;
    for (unsigned i = 0; i < hits; i++) {
        const struct can_fault *f = hit[i].f;
        if (f->to && f->to != n) continue;
        if (f->kind == CAN_FAULT_ALTER) m.data[hit[i].bit / 8] ^= (uint8_t)(1u << hit[i].bit % 8);
        else if (f->kind == CAN_FAULT_DUPLICATE) twice |= f->to != NULL;
        else comes = false;
    }
    for (int times = comes ? 1 + twice : 0; times > 0; times--) can_deliver(n, &m, t_ns);
}

/* What a REORDER held comes after the frame that it let pass. */
static void release_oldest(struct can_bus *b, const struct can_fault *f, int64_t t_ns)
{
    struct can_held *h = oldest_held(b, f);
    if (h) release_held(b, h, t_ns);
}

static void deliver_wire(struct can_bus *b, int64_t t_ns)
{
    struct hit hit[HITS_MAX];
    struct can_fault *follow[HITS_MAX];
    unsigned follows = 0;
    const struct can_node *sender = b->sender;
    for (struct can_fault *f = b->faults; f && follows < HITS_MAX; f = f->next)
        if (f->kind == CAN_FAULT_REORDER && f->held > 0 && matches_wire(b, f)) follow[follows++] = f;
    const unsigned hits = select_hits(b, hit);
    for (unsigned i = 0; i < hits; i++) {
        if (hit[i].f->kind == CAN_FAULT_DUPLICATE && !hit[i].f->to) can_requeue_wire(b, true);
        if (hit[i].f->kind == CAN_FAULT_DELAY || hit[i].f->kind == CAN_FAULT_REORDER)
            hold_frame(b, hit[i].f, &b->wire, t_ns);
    }
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        if (n != sender && !n->silent) deliver_hit(n, &b->wire, hit, hits, t_ns);
    }
    for (unsigned i = 0; i < follows; i++) release_oldest(b, follow[i], t_ns);
}

static void detach_node(struct can_bus *b, struct can_node *n)
{
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++) {
        if (h->by && h->to == n) {
            h->by->held--;
            h->by = NULL;
        }
        if (h->from == n) h->from = NULL;
    }
}

static void replace_node(struct can_bus *b, struct can_node *n, struct can_node *by)
{
    for (struct can_fault *f = b->faults; f; f = f->next) {
        if (f->from == n) f->from = by;
        if (f->to == n) f->to = by;
    }
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++) {
        if (h->from == n) h->from = by;
        if (h->to == n) h->to = by;
    }
}

static const struct can_tap fault_tap = {error_after_ns, deliver_wire, detach_node, replace_node};

/* ---- for the owner ---- */

void can_fault_add(struct can_bus *b, struct can_fault *f)
{
    assert(!(f->to && f->kind == CAN_FAULT_ERROR) && f->delay_ns >= 0);
    assert(f->kind != CAN_FAULT_DELAY || f->delay_ns > 0);
    f->hits = f->lost = f->held = 0;
    f->bus = b;
    f->next = NULL;
    sched_ev(&f->due, release_due, f);
    struct can_fault **at = &b->faults;
    while (*at) at = &(*at)->next;
    *at = f;
    b->tap = &fault_tap;
    b->degraded = true;
}

void can_fault_remove(struct can_bus *b, struct can_fault *f, int64_t t_ns)
{
    struct can_fault **at = &b->faults;
    while (*at && *at != f) at = &(*at)->next;
    if (!*at) return;
    *at = f->next;
    sched_cancel(b->sched, &f->due);
    for (struct can_held *h; (h = oldest_held(b, f));) release_held(b, h, t_ns);
    if (!b->faults) b->tap = NULL;
    can_update_degraded(b);
}

void can_fault_forget(struct can_bus *b, const struct can_node *n)
{
    for (struct can_fault *f = b->faults; f; f = f->next) {
        if (f->to == n || f->from == n) f->limit = f->hits = f->hits ? f->hits : 1;
        if (f->to == n) f->to = NULL;
        if (f->from == n) f->from = NULL;
    }
}
