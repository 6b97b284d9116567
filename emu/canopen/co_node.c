#include "canopen/co_node.h"

#include "base/bits.h"

#include <assert.h>
#include <string.h>

/* Predefined connection set, CiA 301 7.3.3. */
enum {
    ID_NMT = 0x000,
    ID_SYNC = 0x080,
    ID_EMCY = 0x080,
    ID_SDO_ANSWER = 0x580,
    ID_SDO_REQUEST = 0x600,
    ID_HEARTBEAT = 0x700
};
enum { NMT_START = 1, NMT_STOP = 2, NMT_PRE_OPERATIONAL = 128, NMT_RESET_NODE = 129, NMT_RESET_COMM = 130 };
enum { ERROR_REGISTER = 0x1001, ERROR_HISTORY = 0x1003, HEARTBEAT_TIME = 0x1017 };
enum { EMCY_PASSIVE = 0x8120, EMCY_RECOVERED = 0x8140, EMCY_CAN_REGISTER = 0x11 /* generic, communication */ };
enum { TPDO_FIRST = 0x1800, TPDO_LAST = TPDO_FIRST + (int)CO_TPDO_MAX - 1, NS_PER_MS = 1000000, NS_PER_US = 1000 };

bool co_node_send(struct co_node *n, uint32_t id, const uint8_t *data, uint8_t len, int64_t t_ns)
{
    struct can_msg m = {.id = id, .len = len};
    memcpy(m.data, data, len);
    return can_send(n->bus, &n->services, &m, t_ns) == CAN_OK;
}

static void send_frame(struct co_node *n, uint32_t id, const uint8_t *data, uint8_t len, int64_t t_ns)
{
    (void)co_node_send(n, id, data, len, t_ns); /* a full queue is counted there */
}

/* ---- heartbeat ---- */

static void send_heartbeat(struct co_node *n, enum co_state state, int64_t t_ns)
{
    const uint8_t data = (uint8_t)state;
    send_frame(n, (uint32_t)ID_HEARTBEAT + n->cfg.id, &data, 1, t_ns);
}

static void arm_heartbeat(struct co_node *n, int64_t t_ns)
{
    if (n->heartbeat_ms == 0) sched_cancel(n->sched, &n->heartbeat);
    else sched_at(n->sched, &n->heartbeat, t_ns + (int64_t)n->heartbeat_ms * NS_PER_MS);
}

static void heartbeat_due(void *ctx, int64_t t_ns)
{
    struct co_node *n = ctx;
    send_heartbeat(n, n->state, t_ns);
    arm_heartbeat(n, t_ns);
}

/* ---- emergency ---- */

/* Bits of 1001h. */
uint8_t co_node_error_register(const struct co_node *n)
{
    uint8_t reg = 0;
    for (unsigned i = 0; i < CO_ERRORS_MAX; i++) {
        if (n->error[i].code) reg |= n->error[i].reg;
    }
    return reg;
}

static struct co_error *find_error(struct co_node *n, uint16_t code)
{
    for (unsigned i = 0; i < CO_ERRORS_MAX; i++) {
        if (n->error[i].code == code) return &n->error[i];
    }
    return NULL;
}

static void send_emcy(struct co_node *n, uint16_t code, uint8_t source, int64_t t_ns)
{
    if (n->state != CO_OPERATIONAL && n->state != CO_PRE_OPERATIONAL) return;
    uint8_t data[8];
    bits_put_le(data, code, 2);
    data[2] = co_node_error_register(n);
    data[3] = source;
    bits_put_le(&data[4], (uint64_t)(t_ns / NS_PER_US), 4);
    send_frame(n, (uint32_t)ID_EMCY + n->cfg.id, data, sizeof data, t_ns);
}

static void add_history(struct co_node *n, uint16_t code, uint8_t source)
{
    memmove(&n->history[1], &n->history[0], (CO_HISTORY - 1) * sizeof n->history[0]);
    n->history[0] = (uint32_t)source << 16 | code;
    if (n->history_count < CO_HISTORY) n->history_count++;
}

void co_node_error(struct co_node *n, uint16_t code, uint8_t reg, uint8_t source, int64_t t_ns)
{
    assert(code != 0);
    if (find_error(n, code)) return;
    struct co_error *slot = find_error(n, 0);
    if (slot) *slot = (struct co_error){code, reg};
    add_history(n, code, source);
    send_emcy(n, code, source, t_ns);
}

void co_node_error_end(struct co_node *n, uint16_t code, int64_t t_ns)
{
    struct co_error *e = code ? find_error(n, code) : NULL;
    if (!e) return;
    *e = (struct co_error){0};
    if (co_node_error_register(n) == 0) send_emcy(n, 0, 0, t_ns);
}

/* CiA 301, table 26, which has no code for error warning: error-passive ends there. In bus-off the messages wait in the
 * controller's queue. */
static void controller_state(void *ctx, enum can_state s, int64_t t_ns)
{
    struct co_node *n = ctx;
    if (s == CAN_STATE_ERROR_PASSIVE) co_node_error(n, EMCY_PASSIVE, EMCY_CAN_REGISTER, 3, t_ns);
    if (s == CAN_STATE_BUS_OFF) n->was_off = true;
    if (s > CAN_STATE_ERROR_WARNING) return;
    if (n->was_off) co_node_error(n, EMCY_RECOVERED, EMCY_CAN_REGISTER, 3, t_ns);
    n->was_off = false;
    co_node_error_end(n, EMCY_PASSIVE, t_ns);
    co_node_error_end(n, EMCY_RECOVERED, t_ns);
}

/* ---- objects ---- */

static uint32_t read_history(const struct co_node *n, uint8_t sub, struct co_value *v)
{
    if (sub == 0) v->number = n->history_count;
    else v->number = sub <= n->history_count ? (double)n->history[sub - 1] : 0.0;
    return CO_OK;
}

static uint32_t read_object(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct co_node *n = ctx;
    co_default(e, n->cfg.id, v);
    if (e->access == CO_CONST) return CO_OK;
    if (e->index >= TPDO_FIRST && e->index <= TPDO_LAST) return co_pdo_read(n, e, v);
    switch (e->index) {
    case ERROR_REGISTER:
        v->number = co_node_error_register(n);
        return CO_OK;
    case ERROR_HISTORY:
        return read_history(n, e->sub, v);
    case HEARTBEAT_TIME:
        v->number = n->heartbeat_ms;
        return CO_OK;
    default:
        return n->io.read(n->io.ctx, e, v, t_ns);
    }
}

static uint32_t write_object(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct co_node *n = ctx;
    if (e->index >= TPDO_FIRST && e->index <= TPDO_LAST) return co_pdo_write(n, e, v);
    switch (e->index) {
    case ERROR_HISTORY:
        n->history_count = 0;
        return CO_OK; /* the table's limits allow only 0 */
    case HEARTBEAT_TIME:
        n->heartbeat_ms = (uint16_t)v->number;
        arm_heartbeat(n, t_ns);
        return CO_OK;
    default:
        return n->io.write(n->io.ctx, e, v, t_ns);
    }
}

static void send_sdo(void *ctx, const uint8_t frame[8], int64_t t_ns)
{
    struct co_node *n = ctx;
    send_frame(n, (uint32_t)ID_SDO_ANSWER + n->cfg.id, frame, 8, t_ns);
}

void co_node_answer(struct co_node *n, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns)
{
    if (n->guest && n->guest->answer(n->guest->ctx, ticket, abort, v, t_ns)) return;
    co_sdo_answer(&n->sdo, ticket, abort, v, t_ns);
}

/* ---- network management ---- */

static void reset_servers(struct co_node *n)
{
    co_sdo_reset(&n->sdo);
    if (n->guest) n->guest->reset(n->guest->ctx);
}

static void enter_state(struct co_node *n, enum co_state state, int64_t t_ns)
{
    if (n->state == state) return;
    if (state == CO_STOPPED) reset_servers(n);
    if (state != CO_OPERATIONAL) can_flush(&n->stream);
    n->state = state;
    n->io.event(n->io.ctx, CO_EV_STATE, t_ns);
}

static void reset_communication(struct co_node *n)
{
    n->heartbeat_ms = (uint16_t)co_default_number(n->cfg.od, HEARTBEAT_TIME, 0, n->cfg.id);
    n->history_count = 0;
    memset(n->error, 0, sizeof n->error);
    reset_servers(n);
    can_flush(&n->services);
    can_flush(&n->stream);
    co_pdo_reset(n);
}

/* As the NMT command; reset node resets the application through io.event first. */
static void reset_node(struct co_node *n, enum co_event what, int64_t t_ns)
{
    n->state = CO_INITIALISING;
    reset_communication(n);
    n->io.event(n->io.ctx, what, t_ns);
    send_heartbeat(n, CO_INITIALISING, t_ns); /* boot-up */
    arm_heartbeat(n, t_ns);
    enter_state(n, CO_PRE_OPERATIONAL, t_ns);
}

void co_node_reset(struct co_node *n, int64_t t_ns)
{
    reset_node(n, CO_EV_RESET_NODE, t_ns);
}

static void on_nmt(struct co_node *n, const struct can_msg *m, int64_t t_ns)
{
    if (m->len != 2) {
        n->malformed++;
        return;
    }
    if (m->data[1] != 0 && m->data[1] != n->cfg.id) return;
    const unsigned command = m->data[0];
    if (command == NMT_START) enter_state(n, CO_OPERATIONAL, t_ns);
    else if (command == NMT_STOP) enter_state(n, CO_STOPPED, t_ns);
    else if (command == NMT_PRE_OPERATIONAL) enter_state(n, CO_PRE_OPERATIONAL, t_ns);
    else if (command == NMT_RESET_NODE) reset_node(n, CO_EV_RESET_NODE, t_ns);
    else if (command == NMT_RESET_COMM) reset_node(n, CO_EV_RESET_COMM, t_ns);
    else n->malformed++;
}

static void on_sync(struct co_node *n, const struct can_msg *m, int64_t t_ns)
{
    if (m->len > 1) {
        n->malformed++;
        return;
    }
    n->syncs++;
    n->io.sync(n->io.ctx, t_ns);
    co_pdo_sync(n, t_ns);
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct co_node *n = ctx;
    if (m->flags & CAN_EXT || n->state == CO_INITIALISING) return;
    const bool talks = n->state != CO_STOPPED;
    const bool is_sdo = m->id == (uint32_t)ID_SDO_REQUEST + n->cfg.id;
    if (m->id != ID_NMT && m->id != ID_SYNC && !is_sdo) {
        if (n->io.rx_other && !(m->flags & (CAN_RTR | CAN_FD))) n->io.rx_other(n->io.ctx, m, t_ns);
        return;
    }
    if (m->flags & (CAN_RTR | CAN_FD)) {
        n->malformed++;
        return;
    }
    if (m->id == ID_NMT) on_nmt(n, m, t_ns);
    else if (talks && is_sdo) co_sdo_request(&n->sdo, m->data, m->len, t_ns);
    else if (talks) on_sync(n, m, t_ns);
}

/* ---- guest ---- */

static void on_frame_with_guest(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct co_node *n = ctx;
    if (!(m->flags & CAN_EXT) && n->guest->rx(n->guest->ctx, m, t_ns)) return;
    on_frame(n, m, t_ns);
}

static void on_sent_with_guest(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct co_node *n = ctx;
    n->guest->sent(n->guest->ctx, m, t_ns);
}

void co_node_add_guest(struct co_node *n, const struct co_guest *g)
{
    n->guest = g;
    n->services.rx = on_frame_with_guest;
    n->services.sent = on_sent_with_guest;
}

/* ---- life ---- */

void co_node_init(struct co_node *n, const struct co_node_cfg *cfg, const struct co_node_io *io, struct can_bus *bus,
                  struct sched *sched)
{
    assert(cfg->id >= 1 && cfg->id <= 127 && cfg->tpdos <= CO_TPDO_MAX);
    memset(n, 0, sizeof *n);
    n->cfg = *cfg;
    n->io = *io;
    n->bus = bus;
    n->sched = sched;
    sched_ev_inner(&n->heartbeat, heartbeat_due, n);
    const struct co_sdo_io sdo = {n, read_object, write_object, send_sdo};
    co_sdo_init(&n->sdo, cfg->od, &sdo, sched);
    n->services =
        (struct can_node){.name = cfg->name, .order = CAN_ORDER_PRIORITY, .fd = true, .rx = on_frame, .ctx = n};
    n->services.state = controller_state;
    n->stream = (struct can_node){.name = cfg->name, .order = CAN_ORDER_FIFO, .fd = true, .of = &n->services, .ctx = n};
}

void co_node_power_up(struct co_node *n, int64_t t_ns)
{
    can_attach(n->bus, &n->services);
    can_attach(n->bus, &n->stream);
    reset_node(n, CO_EV_RESET_COMM, t_ns);
}

void co_node_power_down(struct co_node *n)
{
    reset_servers(n);
    sched_cancel(n->sched, &n->heartbeat);
    can_unplug(n->bus, &n->services, n->sched->now_ns);
    can_detach(n->bus, &n->stream); /* of the same controller */
    n->state = CO_INITIALISING;
}
