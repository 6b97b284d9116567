#include "base/can_fault.h"

#include "base/can_parts.h"
#include "base/canbits.h"

#include <assert.h>
#include <string.h>

/* ISO 11898-1. Bits: error flags one after the other and delimiter; those that follow a sender that broke off: 6 until the
 * others see it, flag, delimiter; suspend transmission; what bus-off waits for. */
enum { ERROR_BITS = 12 + 8, BROKEN_BITS = 6 + 6 + 8, SUSPEND_BITS = 8, EOF_BITS = 7, OFF_BITS = 11, OFF_TIMES = 128 };
enum { SENDER_COST = 8, PASSIVE_ABOVE = 127, OFF_ABOVE = 255, REC_AFTER_PASSIVE = 120 };
enum { CLASS_COUNTS = 0x200, RX_PASSIVE = 0x10, TX_PASSIVE = 0x20, ACTIVE_AGAIN = 0x40, BIT_SENT = 0x81, STUFF = 0x04 };
enum { IDEAL_HZ = 1000000, HITS_MAX = 16 };

static int64_t bits_ns(const struct can_bus *b, int64_t bits)
{
    const int64_t hz = b->cfg.bitrate_hz ? b->cfg.bitrate_hz : IDEAL_HZ;
    return bits * NS_PER_S / hz;
}

/* ---- controllers ---- */

const struct can_node *can_controller(const struct can_node *n)
{
    return n->of ? n->of : n;
}

static bool shares(const struct can_node *n, const struct can_node *controller)
{
    return n == controller || n->of == controller;
}

static void see_odd(struct can_bus *b)
{
    b->odd = b->faults || b->tired || b->phase == CAN_ERROR_FRAME;
    for (const struct can_node *n = b->nodes; n && !b->odd; n = n->next)
        b->odd = n->silent || n->tec || n->rec || (n->queued > 0 && n->queue[0].repeat);
    if (!b->odd) b->repeat = false;
}

/* To one node, with the counts of its own controller. */
static void tell(struct can_node *n, uint32_t class, uint8_t state, uint8_t what, int64_t t_ns)
{
    if (!n->error) return;
    const struct can_node *c = can_controller(n);
    struct can_msg m = {.id = class | CLASS_COUNTS, .flags = CAN_ERROR, .len = 8};
    m.data[1] = state;
    m.data[2] = what;
    m.data[6] = (uint8_t)(c->tec > OFF_ABOVE ? OFF_ABOVE : c->tec);
    m.data[7] = (uint8_t)(c->rec > OFF_ABOVE ? OFF_ABOVE : c->rec);
    n->error(n->ctx, &m, t_ns);
}

static void come_back(void *ctx, int64_t t_ns);

/* Recessive bits follow on one another from t_ns on. */
static void off_idle(struct can_node *c, int64_t t_ns)
{
    c->off_idle_ns = t_ns;
    sched_at(c->bus->sched, &c->back, t_ns + bits_ns(c->bus, (int64_t)c->off_left * OFF_BITS));
}

/* A frame begins. */
static void off_busy(struct can_node *c, int64_t t_ns)
{
    const int64_t times = (t_ns - c->off_idle_ns) / bits_ns(c->bus, OFF_BITS);
    c->off_left = times < c->off_left ? c->off_left - (unsigned)times : 0;
    c->off_idle_ns = -1;
    sched_cancel(c->bus->sched, &c->back);
}

/* Calls for each controller that is off the bus. */
static void each_off(struct can_bus *b, bool idle, void (*what)(struct can_node *c, int64_t t_ns), int64_t t_ns)
{
    for (struct can_node *n = b->nodes; n; n = n->next)
        if (n->now == CAN_BUS_OFF && !n->of && (n->off_idle_ns >= 0) == idle) what(n, t_ns);
}

static void tail_counts(struct can_node *c, int64_t t_ns)
{
    if (c->off_left > 0) c->off_left--;
    off_idle(c, t_ns);
}

void can_odd_recessive(struct can_bus *b, int64_t t_ns)
{
    each_off(b, false, tail_counts, t_ns);
}

static void silence(struct can_node *c, bool silent)
{
    for (struct can_node *n = c->bus->nodes; n; n = n->next)
        if (shares(n, c)) n->silent = silent;
}

static void leave(struct can_node *c, int64_t t_ns)
{
    const enum can_phase phase = c->bus->phase;
    silence(c, true);
    sched_ev(&c->back, come_back, c);
    c->off_left = OFF_TIMES;
    c->off_idle_ns = -1;
    if (phase != CAN_FRAME && phase != CAN_ERROR_FRAME) off_idle(c, t_ns);
}

static enum can_state state_of(const struct can_node *c)
{
    if (c->tec > OFF_ABOVE) return CAN_BUS_OFF;
    return c->tec > PASSIVE_ABOVE || c->rec > PASSIVE_ABOVE ? CAN_PASSIVE : CAN_ACTIVE;
}

static uint8_t state_bits(const struct can_node *c)
{
    if (c->now == CAN_ACTIVE) return ACTIVE_AGAIN;
    return (uint8_t)((c->tec > PASSIVE_ABOVE ? TX_PASSIVE : 0) | (c->rec > PASSIVE_ABOVE ? RX_PASSIVE : 0));
}

/* After a change of its counts. */
static void judge(struct can_node *c, int64_t t_ns)
{
    const enum can_state was = c->now;
    const uint32_t class = was == CAN_BUS_OFF ? CAN_CLASS_RESTARTED : CAN_CLASS_CONTROLLER;
    c->now = state_of(c);
    if (c->now == was) return;
    if (c->now == CAN_BUS_OFF) leave(c, t_ns);
    for (struct can_node *n = c->bus->nodes; n; n = n->next) {
        if (!shares(n, c)) continue;
        if (c->now == CAN_BUS_OFF) tell(n, CAN_CLASS_BUS_OFF, 0, 0, t_ns);
        else tell(n, class, state_bits(c), 0, t_ns);
        if (n->state) n->state(n->ctx, c->now, t_ns);
    }
}

static void come_back(void *ctx, int64_t t_ns)
{
    struct can_node *c = ctx;
    struct can_bus *b = c->bus;
    c->tec = c->rec = 0;
    silence(c, false);
    judge(c, t_ns);
    see_odd(b);
    if (b->phase != CAN_IDLE) return;
    b->phase = CAN_ARBITRATION; /* for what has waited */
    sched_at(b->sched, &b->step, t_ns);
}

/* Of all controllers but the sender's, which may be NULL. */
static void count_receivers(struct can_bus *b, const struct can_node *sender, bool passed, int64_t t_ns)
{
    for (struct can_node *n = b->nodes; n; n = n->next) {
        if (n->of || n->silent || (sender && n == can_controller(sender))) continue;
        if (!passed) n->rec++;
        else if (n->rec > PASSIVE_ABOVE) n->rec = REC_AFTER_PASSIVE;
        else if (n->rec > 0) n->rec--;
        judge(n, t_ns);
    }
}

static struct can_node *controller_of(struct can_node *n)
{
    return n->of ? n->of : n;
}

static void count_sender(struct can_bus *b, struct can_node *sender, bool passed, int64_t t_ns)
{
    struct can_node *c = controller_of(sender);
    if (c->now == CAN_BUS_OFF) return;
    if (!passed) c->tec = (uint16_t)(c->tec + SENDER_COST);
    else if (c->tec > 0) c->tec--;
    judge(c, t_ns);
    if (c->now == CAN_PASSIVE) b->tired = c;
}

/* ---- frames on the wire ---- */

bool can_odd_wait(struct can_bus *b, struct can_node **n, unsigned *slot, int64_t t_ns)
{
    struct can_node *tired = b->tired;
    b->tired = NULL;
    if (!tired || !*n || !shares(*n, tired)) return false;
    silence(tired, true);
    *n = can_winner(b, slot);
    silence(tired, false);
    if (*n) return false;
    b->phase = CAN_ARBITRATION;
    sched_at(b->sched, &b->step, t_ns + bits_ns(b, SUSPEND_BITS));
    return true;
}

static bool roll(struct can_fault *f)
{
    if (f->limit && f->hits >= f->limit) return false;
    return f->probability >= 1.0 || rng_uniform(&f->rng) < f->probability;
}

static bool concerns(const struct can_bus *b, const struct can_fault *f)
{
    if (f->from && (!b->sender || can_controller(b->sender) != can_controller(f->from))) return false;
    if (f->to && (f->to == b->sender || f->to->bus != b)) return false;
    return ((b->wire.id ^ f->id) & f->mask) == 0;
}

static void break_off(struct can_bus *b, int64_t end_ns)
{
    b->phase = CAN_ERROR_FRAME;
    b->odd = true;
    sched_at(b->sched, &b->step, end_ns);
}

/* The error comes an eighth to seven eighths into the frame (E0); what is destroyed stays first in its queue. */
bool can_odd_start(struct can_bus *b, unsigned slot, int64_t t_ns)
{
    b->repeat = b->sender->queue[slot].repeat;
    each_off(b, true, off_busy, t_ns);
    for (struct can_fault *f = b->faults; f && b->cfg.bitrate_hz; f = f->next) {
        if (f->kind != CAN_FAULT_ERROR || !concerns(b, f) || !roll(f)) continue;
        f->hits++;
        const int64_t frame_ns = can_frame_ns(&b->cfg, &b->wire) - bits_ns(b, EOF_BITS + CAN_IFS_BITS);
        const int64_t error_ns = frame_ns * (int64_t)(1 + rng_u64(&f->rng) % 7) / 8;
        break_off(b, t_ns + error_ns + bits_ns(b, ERROR_BITS));
        return true;
    }
    return false;
}

void can_odd_error(struct can_bus *b, int64_t t_ns)
{
    struct can_node *sender = b->sender;
    b->error_frames++;
    can_start_ifs(b, t_ns);
    if (sender) count_sender(b, sender, false, t_ns);
    count_receivers(b, sender, false, t_ns);
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        const bool own = sender && shares(n, can_controller(sender));
        if (!n->silent || own) tell(n, CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR, 0, own ? BIT_SENT : STUFF, t_ns);
    }
    b->sender = NULL;
    see_odd(b);
}

static bool sends(const struct can_bus *b, const struct can_node *controller)
{
    return b->phase == CAN_FRAME && b->cfg.bitrate_hz && b->sender && shares(b->sender, controller);
}

void can_unplug(struct can_bus *b, struct can_node *n, int64_t t_ns)
{
    if (sends(b, n)) break_off(b, t_ns + bits_ns(b, BROKEN_BITS));
    can_detach(b, n);
}

/* A sender's frame comes first again. */
static void put_back(struct can_bus *b, bool repeat)
{
    struct can_node *n = b->sender;
    if (!n || n->queued == CAN_QUEUE_MAX) return;
    memmove(&n->queue[1], &n->queue[0], n->queued * sizeof n->queue[0]);
    n->queue[0] = (struct can_waiting){.repeat = repeat, .m = b->wire};
    n->queued++;
}

void can_bus_off(struct can_bus *b, struct can_node *n, int64_t t_ns)
{
    struct can_node *c = controller_of(n);
    if (c->now == CAN_BUS_OFF) return;
    b->odd = true;
    if (sends(b, c)) {
        put_back(b, b->repeat);
        break_off(b, t_ns + bits_ns(b, BROKEN_BITS));
    }
    c->tec = OFF_ABOVE + 1;
    judge(c, t_ns);
}

/* ---- frames on their way ---- */

struct hit {
    struct can_fault *f;
    unsigned bit; /* of the data: inverted */
};

static void give_all(struct can_bus *b, const struct can_msg *m, const struct can_node *from, int64_t t_ns)
{
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        if (n != from && !n->silent) can_give(n, m, t_ns);
    }
}

static struct can_held *oldest(struct can_bus *b, const struct can_fault *f)
{
    struct can_held *best = NULL;
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++)
        if (h->by == f && (!best || h->number < best->number)) best = h;
    return best;
}

static void let_go(struct can_bus *b, struct can_held *h, int64_t t_ns)
{
    const struct can_held own = *h;
    h->by->held--;
    h->by = NULL;
    if (!own.to) give_all(b, &own.m, own.from, t_ns);
    else if (!own.to->silent) can_give(own.to, &own.m, t_ns);
}

static void await_oldest(struct can_fault *f)
{
    const struct can_held *h = f->held > 0 && f->delay_ns > 0 ? oldest(f->bus, f) : NULL;
    if (h) sched_at(f->bus->sched, &f->due, h->due_ns);
    else sched_cancel(f->bus->sched, &f->due);
}

static void on_due(void *ctx, int64_t t_ns)
{
    struct can_fault *f = ctx;
    for (struct can_held *h; (h = oldest(f->bus, f)) && h->due_ns <= t_ns;) let_go(f->bus, h, t_ns);
    await_oldest(f);
}

static void hold(struct can_bus *b, struct can_fault *f, const struct can_msg *m, int64_t t_ns)
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
    if (!f->due.queued) await_oldest(f);
}

/* Which faults befall the frame that has just ended. A REORDER that holds one lets this one pass. */
static unsigned pick(struct can_bus *b, struct hit *hit)
{
    unsigned n = 0;
    for (struct can_fault *f = b->faults; f && n < HITS_MAX; f = f->next) {
        if (f->kind == CAN_FAULT_ERROR || !concerns(b, f)) continue;
        if (f->kind == CAN_FAULT_DUPLICATE && b->repeat) continue;
        if (f->kind == CAN_FAULT_ALTER && (b->wire.len == 0 || b->wire.flags & CAN_RTR)) continue;
        if ((f->kind == CAN_FAULT_REORDER && f->held > 0) || !roll(f)) continue;
        f->hits++;
        hit[n] = (struct hit){.f = f};
        if (f->kind == CAN_FAULT_ALTER) hit[n].bit = (unsigned)(rng_u64(&f->rng) % (8u * b->wire.len));
        n++;
    }
    return n;
}

/* As this node receives it: whether at all, and if once more. */
static void give_hit(struct can_node *n, const struct can_msg *wire, const struct hit *hit, unsigned hits, int64_t t_ns)
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
    for (int times = comes ? 1 + twice : 0; times > 0; times--) can_give(n, &m, t_ns);
}

/* What a REORDER held comes after the frame that it let pass. */
static void let_follow(struct can_bus *b, const struct can_fault *f, int64_t t_ns)
{
    struct can_held *h = oldest(b, f);
    if (h) let_go(b, h, t_ns);
}

static void pass(struct can_bus *b, int64_t t_ns)
{
    struct hit hit[HITS_MAX];
    struct can_fault *follow[HITS_MAX];
    unsigned follows = 0;
    const struct can_node *sender = b->sender;
    for (struct can_fault *f = b->faults; f && follows < HITS_MAX; f = f->next)
        if (f->kind == CAN_FAULT_REORDER && f->held > 0 && concerns(b, f)) follow[follows++] = f;
    const unsigned hits = pick(b, hit);
    for (unsigned i = 0; i < hits; i++) {
        if (hit[i].f->kind == CAN_FAULT_DUPLICATE && !hit[i].f->to) put_back(b, true);
        if (hit[i].f->kind == CAN_FAULT_DELAY || hit[i].f->kind == CAN_FAULT_REORDER) hold(b, hit[i].f, &b->wire, t_ns);
    }
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        if (n != sender && !n->silent) give_hit(n, &b->wire, hit, hits, t_ns);
    }
    for (unsigned i = 0; i < follows; i++) let_follow(b, follow[i], t_ns);
}

void can_odd_end(struct can_bus *b, int64_t t_ns)
{
    struct can_node *sender = b->sender;
    if (sender) count_sender(b, sender, true, t_ns);
    count_receivers(b, sender, true, t_ns);
    if (sender && !b->repeat) {
        sender->tx_frames++;
        if (sender->sent) sender->sent(sender->ctx, &b->wire, t_ns);
    }
    pass(b, t_ns);
    b->sender = NULL;
    see_odd(b);
}

/* ---- for the owner ---- */

void can_fault_add(struct can_bus *b, struct can_fault *f)
{
    assert(!(f->to && f->kind == CAN_FAULT_ERROR) && f->delay_ns >= 0);
    assert(f->kind != CAN_FAULT_DELAY || f->delay_ns > 0);
    f->hits = f->lost = f->held = 0;
    f->bus = b;
    f->next = NULL;
    sched_ev(&f->due, on_due, f);
    struct can_fault **at = &b->faults;
    while (*at) at = &(*at)->next;
    *at = f;
    b->odd = true;
}

void can_fault_remove(struct can_bus *b, struct can_fault *f, int64_t t_ns)
{
    struct can_fault **at = &b->faults;
    while (*at && *at != f) at = &(*at)->next;
    if (!*at) return;
    *at = f->next;
    sched_cancel(b->sched, &f->due);
    for (struct can_held *h; (h = oldest(b, f));) let_go(b, h, t_ns);
    see_odd(b);
}

void can_fault_forget(struct can_bus *b, const struct can_node *n)
{
    for (struct can_fault *f = b->faults; f; f = f->next) {
        if (f->to == n || f->from == n) f->limit = f->hits = f->hits ? f->hits : 1;
        if (f->to == n) f->to = NULL;
        if (f->from == n) f->from = NULL;
    }
}

void can_odd_detach(struct can_bus *b, struct can_node *n)
{
    if (n->now == CAN_BUS_OFF && !n->of) sched_cancel(b->sched, &n->back);
    if (b->tired == n) b->tired = NULL;
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++) {
        if (h->by && h->to == n) {
            h->by->held--;
            h->by = NULL;
        }
        if (h->from == n) h->from = NULL;
    }
}

void can_odd_replace(struct can_bus *b, struct can_node *n, struct can_node *by)
{
    if (n->back.queued) {
        const int64_t due_ns = n->back.due_ns;
        sched_cancel(b->sched, &n->back);
        sched_ev(&by->back, come_back, by);
        sched_at(b->sched, &by->back, due_ns);
    }
    if (b->tired == n) b->tired = by;
    for (struct can_fault *f = b->faults; f; f = f->next) {
        if (f->from == n) f->from = by;
        if (f->to == n) f->to = by;
    }
    for (struct can_held *h = b->held; h < b->held + CAN_HELD_MAX; h++) {
        if (h->from == n) h->from = by;
        if (h->to == n) h->to = by;
    }
}
