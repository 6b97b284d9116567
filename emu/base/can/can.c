#include "base/can/can.h"

#include "base/can/bits.h"
#include "base/can/internal.h"

#include <assert.h>
#include <string.h>

/* ISO 11898-1. Bits: error flags one after the other and delimiter; suspend transmission. */
enum { ERROR_BITS = 12 + 8, SUSPEND_BITS = 8 };

static void end_phase(void *ctx, int64_t t_ns);

void can_bus_init(struct can_bus *b, const struct can_bus_cfg *cfg, struct sched *s)
{
    *b = (struct can_bus){.cfg = *cfg, .sched = s, .phase = CAN_IDLE};
    sched_ev_inner(&b->step, end_phase, b); /* who answers a frame does not sleep while the bus is busy */
}

void can_attach(struct can_bus *b, struct can_node *n)
{
    n->queued = 0;
    n->silent = false;
    n->tec = n->rec = 0;
    n->error_state = CAN_STATE_ERROR_ACTIVE;
    n->bus = b;
    n->next = NULL;
    struct can_node **at = &b->nodes;
    while (*at) at = &(*at)->next;
    *at = n;
}

void can_detach(struct can_bus *b, struct can_node *n)
{
    if (b->next_rx == n) b->next_rx = n->next;
    if (b->sender == n) b->sender = NULL;
    if (b->degraded) can_error_detach(b, n);
    if (b->tap) b->tap->detach(b, n);
    for (struct can_node **at = &b->nodes; *at; at = &(*at)->next) {
        if (*at != n) continue;
        *at = n->next;
        break;
    }
    n->next = NULL;
    n->bus = NULL;
    n->queued = 0;
}

void can_unplug(struct can_bus *b, struct can_node *n, int64_t t_ns)
{
    if (can_is_sending(b, n)) can_interrupt_frame(b, t_ns);
    can_detach(b, n);
}

void can_replace(struct can_bus *b, struct can_node *n, struct can_node *by)
{
    *by = *n;
    for (struct can_node **at = &b->nodes; *at; at = &(*at)->next) {
        if (*at != n) continue;
        *at = by;
        break;
    }
    if (b->next_rx == n) b->next_rx = by;
    if (b->sender == n) b->sender = by;
    if (b->degraded) can_error_replace(b, n, by);
    if (b->tap) b->tap->replace(b, n, by);
    n->next = NULL;
    n->queued = 0;
}

bool can_valid(const struct can_msg *m)
{
    const bool is_fd = m->flags & CAN_FD;
    if (m->flags & CAN_ERROR || m->id > (m->flags & CAN_EXT ? 0x1FFFFFFFu : 0x7FFu)) return false;
    if (!is_fd) return m->len <= 8 && !(m->flags & CAN_BRS);
    if (m->flags & CAN_RTR || m->len > 64) return false;
    return m->len <= 8 || (m->len <= 24 && m->len % 4 == 0) || (m->len >= 32 && m->len % 16 == 0);
}

uint32_t can_arbitration(const struct can_msg *m)
{
    const uint32_t rtr = m->flags & CAN_RTR ? 1u : 0u;
    if (!(m->flags & CAN_EXT)) return m->id << 21 | rtr << 20;
    return (m->id >> 18) << 21 | 3u << 19 | (m->id & 0x3FFFFu) << 1 | rtr; /* SRR and IDE recessive */
}

/* FD frames need a bus with a data phase and a sender with an FD controller. */
static bool fd_possible(const struct can_bus *b, const struct can_node *n)
{
    return b->cfg.data_bitrate_hz != 0 && n->fd;
}

enum can_result can_send(struct can_bus *b, struct can_node *n, const struct can_msg *m, int64_t t_ns)
{
    if (!can_valid(m)) return CAN_BAD;
    if (m->flags & CAN_FD && !fd_possible(b, n)) {
        n->fd_refused++;
        return CAN_NO_FD;
    }
    if (n->queued == CAN_QUEUE_MAX) {
        n->tx_overflow++;
        return CAN_FULL;
    }
    n->queue[n->queued++] = (struct can_waiting){.number = b->number++, .m = *m};
    if (b->phase == CAN_IDLE) {
        b->phase = CAN_ARBITRATION;
        sched_at(b->sched, &b->step, t_ns);
    }
    return CAN_OK;
}

void can_flush(struct can_node *n)
{
    n->queued = 0;
}

unsigned can_room(const struct can_node *n)
{
    return CAN_QUEUE_MAX - n->queued;
}

int64_t can_frame_ns(const struct can_bus_cfg *cfg, const struct can_msg *m)
{
    return can_bits_ns(can_bits_exact(m), cfg);
}

static int64_t ifs_ns(const struct can_bus_cfg *cfg)
{
    return can_bits_ns((struct can_bits){CAN_IFS_BITS, 0}, cfg);
}

/* Frame that the node offers to the bus; among equal identifiers the older one. */
static unsigned pick_offered(const struct can_node *n)
{
    unsigned best = 0;
    for (unsigned i = 1; n->order == CAN_ORDER_PRIORITY && i < n->queued; i++) {
        if (can_arbitration(&n->queue[i].m) < can_arbitration(&n->queue[best].m)) best = i;
    }
    return best;
}

/* An ideal bus keeps the order of sending. */
static bool goes_before(const struct can_bus *b, const struct can_waiting *x, const struct can_waiting *y)
{
    if (b->cfg.bitrate_hz == 0) return x->number < y->number;
    const uint32_t x_id = can_arbitration(&x->m);
    const uint32_t y_id = can_arbitration(&y->m);
    return x_id != y_id ? x_id < y_id : x->number < y->number;
}

/* Of an arbitration now, among all nodes but those of one controller, or NULL. */
static struct can_node *arbitration_winner(const struct can_bus *b, const struct can_node *without, unsigned *slot)
{
    struct can_node *best = NULL;
    for (struct can_node *n = b->nodes; n; n = n->next) {
        if (n->queued == 0 || n->silent || (without && can_shares(n, without))) continue;
        const unsigned i = b->cfg.bitrate_hz ? pick_offered(n) : 0;
        if (best && !goes_before(b, &n->queue[i], &best->queue[*slot])) continue;
        best = n;
        *slot = i;
    }
    return best;
}

/* An error-passive sender gives way: true when the bus waits for the end of its suspension. */
static bool suspend_tx(struct can_bus *b, struct can_node **n, unsigned *slot, int64_t t_ns)
{
    const struct can_node *suspended = can_suspended(b, *n);
    if (!suspended) return false;
    *n = arbitration_winner(b, suspended, slot);
    if (*n) return false;
    b->phase = CAN_ARBITRATION;
    sched_at(b->sched, &b->step, t_ns + can_nominal_ns(b, SUSPEND_BITS));
    return true;
}

/* The frame on the wire begins: true when an error will destroy it; it stays first in its queue. */
static bool start_degraded(struct can_bus *b, const struct can_waiting *w, int64_t t_ns)
{
    b->repeat = w->repeat;
    can_error_frame_start(b, t_ns);
    const int64_t error_ns = b->tap && b->cfg.bitrate_hz ? b->tap->error_after_ns(b) : -1;
    if (error_ns < 0) return false;
    can_start_error_frame(b, t_ns + error_ns + can_nominal_ns(b, ERROR_BITS));
    return true;
}

static void arbitrate_bus(struct can_bus *b, int64_t t_ns)
{
    unsigned slot = 0;
    struct can_node *n = arbitration_winner(b, NULL, &slot);
    if (b->degraded && suspend_tx(b, &n, &slot, t_ns)) return;
    b->phase = n ? CAN_FRAME : CAN_IDLE;
    if (!n) return;
    b->sender = n;
    b->wire = n->queue[slot].m;
    b->start_ns = t_ns;
    if (b->degraded && start_degraded(b, &n->queue[slot], t_ns)) return;
    n->queued--;
    memmove(&n->queue[slot], &n->queue[slot + 1], (n->queued - slot) * sizeof n->queue[0]);
    sched_at(b->sched, &b->step, t_ns + can_frame_ns(&b->cfg, &b->wire) - ifs_ns(&b->cfg));
}

void can_deliver(struct can_node *n, const struct can_msg *m, int64_t t_ns)
{
    if (m->flags & CAN_FD && !n->fd) {
        n->fd_refused++;
        return;
    }
    n->rx_frames++;
    if (n->rx) n->rx(n->ctx, m, t_ns);
}

/* A callback may attach and detach nodes, its own included: the cursor lives in the bus, where can_detach() sees it. */
void can_deliver_all(struct can_bus *b, const struct can_msg *m, const struct can_node *sender, int64_t t_ns)
{
    b->next_rx = b->nodes;
    while (b->next_rx) {
        struct can_node *n = b->next_rx;
        b->next_rx = n->next;
        if (n != sender && !n->silent) can_deliver(n, m, t_ns);
    }
}

static void start_ifs(struct can_bus *b, int64_t t_ns)
{
    b->phase = CAN_IFS;
    sched_at(b->sched, &b->step, t_ns + ifs_ns(&b->cfg));
}

static void end_of_frame(struct can_bus *b, int64_t t_ns)
{
    struct can_node *sender = b->sender;
    const bool degraded = b->degraded;
    b->frames++;
    start_ifs(b, t_ns);
    if (degraded) can_error_frame_passed(b, sender, t_ns);
    if (sender && !b->repeat) {
        sender->tx_frames++;
        if (sender->sent) sender->sent(sender->ctx, &b->wire, t_ns);
    }
    if (degraded && b->tap) b->tap->deliver(b, t_ns);
    else can_deliver_all(b, &b->wire, b->sender, t_ns);
    b->sender = NULL;
    if (degraded) can_update_degraded(b);
}

static void end_of_error_frame(struct can_bus *b, int64_t t_ns)
{
    b->error_frames++;
    start_ifs(b, t_ns);
    can_error_frame_destroyed(b, t_ns);
    b->sender = NULL;
    can_update_degraded(b);
}

static void end_phase(void *ctx, int64_t t_ns)
{
    struct can_bus *b = ctx;
    assert(b->phase != CAN_IDLE);
    if (b->phase == CAN_FRAME) {
        end_of_frame(b, t_ns);
        return;
    }
    if (b->phase == CAN_ERROR_FRAME) {
        end_of_error_frame(b, t_ns);
        return;
    }
    if (b->phase == CAN_IFS) b->busy_ns += t_ns - b->start_ns;
    if (b->degraded && b->phase == CAN_IFS) can_error_recessive(b, t_ns);
    arbitrate_bus(b, t_ns);
}

int64_t can_busy_ns(const struct can_bus *b, int64_t t_ns)
{
    const bool in_use = b->phase == CAN_FRAME || b->phase == CAN_ERROR_FRAME || b->phase == CAN_IFS;
    return b->busy_ns + (in_use ? t_ns - b->start_ns : 0);
}
