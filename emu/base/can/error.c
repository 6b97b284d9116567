#include "base/can/error.h"

#include "base/can/internal.h"

#include <string.h>

/* Bits: what follows a sender that stops in the middle (6 until the others detect it, flag, delimiter); what bus-off
 * waits for. */
enum { BROKEN_BITS = 6 + 6 + 8, OFF_BITS = 11, OFF_TIMES = 128 };
enum { SENDER_COST = 8, WARNING_FROM = 96, PASSIVE_ABOVE = 127, OFF_ABOVE = 255, REC_AFTER_PASSIVE = 120 };
enum { CLASS_COUNTS = 0x200, BIT_SENT = 0x81, STUFF = 0x04 };
enum { IDEAL_HZ = 1000000 };

int64_t can_nominal_ns(const struct can_bus *b, int64_t bits)
{
    const int64_t hz = b->cfg.bitrate_hz ? b->cfg.bitrate_hz : IDEAL_HZ;
    return bits * NS_PER_S / hz;
}

const struct can_node *can_controller(const struct can_node *n)
{
    return n->of ? n->of : n;
}

static struct can_node *controller_of(struct can_node *n)
{
    return n->of ? n->of : n;
}

bool can_shares(const struct can_node *n, const struct can_node *controller)
{
    return n == controller || n->of == controller;
}

void can_update_degraded(struct can_bus *b)
{
    b->degraded = b->tap || b->suspended || b->phase == CAN_ERROR_FRAME;
    for (const struct can_node *n = b->nodes; n && !b->degraded; n = n->next)
        b->degraded = n->silent || n->tec || n->rec || (n->queued > 0 && n->queue[0].repeat);
    if (!b->degraded) b->repeat = false;
}

/* Error message to one node, with the counters of its own controller. */
static void report_error(struct can_node *n, uint32_t class, uint8_t state, uint8_t what, int64_t t_ns)
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

/* ---- bus-off and recovery ---- */

static void bus_off_recover(void *ctx, int64_t t_ns);

/* Consecutive recessive bits begin at t_ns. */
static void recovery_idle(struct can_node *c, int64_t t_ns)
{
    c->idle_since_ns = t_ns;
    sched_at(c->bus->sched, &c->recovery, t_ns + can_nominal_ns(c->bus, (int64_t)c->recovery_left * OFF_BITS));
}

/* A frame begins. */
static void recovery_busy(struct can_node *c, int64_t t_ns)
{
    const int64_t times = (t_ns - c->idle_since_ns) / can_nominal_ns(c->bus, OFF_BITS);
    c->recovery_left = times < c->recovery_left ? c->recovery_left - (unsigned)times : 0;
    c->idle_since_ns = -1;
    sched_cancel(c->bus->sched, &c->recovery);
}

/* A frame ends: its last bits are one sequence. */
static void recovery_frame_end(struct can_node *c, int64_t t_ns)
{
    if (c->recovery_left > 0) c->recovery_left--;
    recovery_idle(c, t_ns);
}

static void for_each_bus_off(struct can_bus *b, bool idle, void (*call)(struct can_node *c, int64_t t_ns), int64_t t_ns)
{
    for (struct can_node *n = b->nodes; n; n = n->next)
        if (n->error_state == CAN_STATE_BUS_OFF && !n->of && (n->idle_since_ns >= 0) == idle) call(n, t_ns);
}

void can_error_frame_start(struct can_bus *b, int64_t t_ns)
{
    for_each_bus_off(b, true, recovery_busy, t_ns);
}

void can_error_recessive(struct can_bus *b, int64_t t_ns)
{
    for_each_bus_off(b, false, recovery_frame_end, t_ns);
}

static void set_silent(struct can_node *c, bool silent)
{
    for (struct can_node *n = c->bus->nodes; n; n = n->next)
        if (can_shares(n, c)) n->silent = silent;
}

static void enter_bus_off(struct can_node *c, int64_t t_ns)
{
    const enum can_phase phase = c->bus->phase;
    set_silent(c, true);
    sched_ev(&c->recovery, bus_off_recover, c);
    c->recovery_left = OFF_TIMES;
    c->idle_since_ns = -1;
    if (phase != CAN_FRAME && phase != CAN_ERROR_FRAME) recovery_idle(c, t_ns);
}

/* ---- states and counters ---- */

static enum can_state error_state(const struct can_node *c)
{
    if (c->tec > OFF_ABOVE) return CAN_STATE_BUS_OFF;
    if (c->tec > PASSIVE_ABOVE || c->rec > PASSIVE_ABOVE) return CAN_STATE_ERROR_PASSIVE;
    return c->tec >= WARNING_FROM || c->rec >= WARNING_FROM ? CAN_STATE_ERROR_WARNING : CAN_STATE_ERROR_ACTIVE;
}

static uint8_t error_state_bits(const struct can_node *c)
{
    if (c->error_state == CAN_STATE_ERROR_ACTIVE) return CAN_CONTROLLER_ACTIVE;
    if (c->error_state == CAN_STATE_ERROR_PASSIVE)
        return (uint8_t)((c->tec > PASSIVE_ABOVE ? CAN_CONTROLLER_TX_PASSIVE : 0) |
                         (c->rec > PASSIVE_ABOVE ? CAN_CONTROLLER_RX_PASSIVE : 0));
    return (uint8_t)((c->tec >= WARNING_FROM ? CAN_CONTROLLER_TX_WARNING : 0) |
                     (c->rec >= WARNING_FROM ? CAN_CONTROLLER_RX_WARNING : 0));
}

/* After a change of the controller's counters. */
static void update_error_state(struct can_node *c, int64_t t_ns)
{
    const enum can_state was = c->error_state;
    const uint32_t class = was == CAN_STATE_BUS_OFF ? CAN_CLASS_RESTARTED : CAN_CLASS_CONTROLLER;
    c->error_state = error_state(c);
    if (c->error_state == was) return;
    if (c->error_state == CAN_STATE_BUS_OFF) enter_bus_off(c, t_ns);
    for (struct can_node *n = c->bus->nodes; n; n = n->next) {
        if (!can_shares(n, c)) continue;
        if (c->error_state == CAN_STATE_BUS_OFF) report_error(n, CAN_CLASS_BUS_OFF, 0, 0, t_ns);
        else report_error(n, class, error_state_bits(c), 0, t_ns);
        if (n->state) n->state(n->ctx, c->error_state, t_ns);
    }
}

static void bus_off_recover(void *ctx, int64_t t_ns)
{
    struct can_node *c = ctx;
    struct can_bus *b = c->bus;
    c->tec = c->rec = 0;
    set_silent(c, false);
    update_error_state(c, t_ns);
    can_update_degraded(b);
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
        update_error_state(n, t_ns);
    }
}

static void count_sender(struct can_bus *b, struct can_node *sender, bool passed, int64_t t_ns)
{
    struct can_node *c = controller_of(sender);
    if (c->error_state == CAN_STATE_BUS_OFF) return;
    if (!passed) c->tec = (uint16_t)(c->tec + SENDER_COST);
    else if (c->tec > 0) c->tec--;
    update_error_state(c, t_ns);
    if (c->error_state == CAN_STATE_ERROR_PASSIVE) b->suspended = c;
}

void can_error_frame_passed(struct can_bus *b, struct can_node *sender, int64_t t_ns)
{
    if (sender) count_sender(b, sender, true, t_ns);
    count_receivers(b, sender, true, t_ns);
}

void can_error_frame_destroyed(struct can_bus *b, int64_t t_ns)
{
    struct can_node *sender = b->sender;
    if (sender) count_sender(b, sender, false, t_ns);
    count_receivers(b, sender, false, t_ns);
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        const bool own = sender && can_shares(n, can_controller(sender));
        if (n->silent && !own) continue;
        report_error(n, CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR, 0, own ? BIT_SENT : STUFF, t_ns);
    }
}

struct can_node *can_suspended(struct can_bus *b, const struct can_node *winner)
{
    struct can_node *c = b->suspended;
    b->suspended = NULL;
    return c && winner && can_shares(winner, c) ? c : NULL;
}

/* ---- frames that break off ---- */

void can_start_error_frame(struct can_bus *b, int64_t end_ns)
{
    b->phase = CAN_ERROR_FRAME;
    b->degraded = true;
    sched_at(b->sched, &b->step, end_ns);
}

void can_interrupt_frame(struct can_bus *b, int64_t t_ns)
{
    can_start_error_frame(b, t_ns + can_nominal_ns(b, BROKEN_BITS));
}

bool can_is_sending(const struct can_bus *b, const struct can_node *controller)
{
    return b->phase == CAN_FRAME && b->cfg.bitrate_hz && b->sender && can_shares(b->sender, controller);
}

void can_requeue_wire(struct can_bus *b, bool repeat)
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
    if (c->error_state == CAN_STATE_BUS_OFF) return;
    b->degraded = true;
    if (can_is_sending(b, c)) {
        can_requeue_wire(b, b->repeat);
        can_interrupt_frame(b, t_ns);
    }
    c->tec = OFF_ABOVE + 1;
    update_error_state(c, t_ns);
}

/* ---- changes of the bus's nodes ---- */

void can_error_detach(struct can_bus *b, struct can_node *n)
{
    if (n->error_state == CAN_STATE_BUS_OFF && !n->of) sched_cancel(b->sched, &n->recovery);
    if (b->suspended == n) b->suspended = NULL;
}

void can_error_replace(struct can_bus *b, struct can_node *n, struct can_node *by)
{
    if (n->recovery.queued) {
        const int64_t due_ns = n->recovery.due_ns;
        sched_cancel(b->sched, &n->recovery);
        sched_ev(&by->recovery, bus_off_recover, by);
        sched_at(b->sched, &by->recovery, due_ns);
    }
    if (b->suspended == n) b->suspended = by;
}
