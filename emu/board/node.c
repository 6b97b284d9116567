#include "board/node.h"

#include "base/can/bits.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

/* Objects of proto/unit.yaml and of every device; a test holds the numbers against the generated tables. */
enum {
    IDENTITY = 0x1018,
    BUS = 0x2002,
    COUNTERS = 0x2030,
    REFUSAL = 0x2031,
    REMARK = 0x2040,
    STROBE_NS = 0x2051,
};
enum { CAN_OVERRUN = 0x8110, STREAM_REFUSED = 0xFF03, SOURCE_STREAM = 3, REG_COMM = 0x11, REG_DEVICE = 0x81 };

double board_node_default(const struct board_node *n, uint16_t index, uint8_t sub)
{
    return co_default_number(n->type->device->od, index, sub, 0);
}

/* ---- bus cycles ---- */

static const uint32_t aborts[] = {
    [BOARD_CYCLE_OK] = CO_OK,
    [BOARD_CYCLE_NO_ADDRESS] = CO_AB_NO_SUB,
    [BOARD_CYCLE_READ_ONLY] = CO_AB_READ_ONLY,
    [BOARD_CYCLE_WRITE_ONLY] = CO_AB_WRITE_ONLY,
    [BOARD_CYCLE_NOT_READY] = CO_AB_STATE,
    [BOARD_CYCLE_TOO_SHORT] = CO_AB_VALUE,
    [BOARD_CYCLE_BUSY] = CO_AB_STATE,
    [BOARD_CYCLE_BAD_VALUE] = CO_AB_VALUE,
    [BOARD_CYCLE_TAKEN] = CO_AB_STATE,
    [BOARD_CYCLE_OFF] = CO_AB_STATE,
};

void board_node_reject(struct board_node *n, const char *why)
{
    (void)snprintf(n->refusal, sizeof n->refusal, "refused: %s", why);
}

uint32_t board_node_abort_of(enum board_cycle_result r)
{
    assert((size_t)r < sizeof aborts / sizeof aborts[0]);
    return aborts[r];
}

static void record_rejection(struct board_node *n, const struct board_cycle *c, enum board_cycle_result r)
{
    char why[BOARD_CYCLE_WHY_MAX];
    board_cycle_why(n->cfg.type->bus, n->board, c, r, why);
    board_node_reject(n, why);
    n->cycles_refused++;
}

/* Here OFF means that the cycle was cut. */
static void cycle_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct board_node *n = ctx;
    n->cycle_busy = false;
    if (r == BOARD_CYCLE_OK) n->cycles++;
    else record_rejection(n, c, r);
    const uint32_t abort = r == BOARD_CYCLE_OFF ? CO_AB_TRANSFER : board_node_abort_of(r);
    const struct co_value v = {.number = c->data};
    co_node_answer(&n->node, n->ticket, abort, &v, t_ns);
}

static uint32_t submit_cycle(struct board_node *n, bool write, uint8_t address, uint16_t data, int64_t t_ns)
{
    struct board_cycle c = {
        .write = write, .address = address, .data = data, .strobe_ns = n->strobe_ns, .done = cycle_done, .ctx = n};
    enum board_cycle_result r = BOARD_CYCLE_BUSY; /* of a client that has given up; the board still has it */
    if (!n->cycle_busy) {
        n->cycle = c;
        n->ticket = n->node.sdo.ticket;
        n->cycle_busy = true;
        r = n->cfg.type->bus->submit(n->board, &n->cycle, t_ns);
        if (r == BOARD_CYCLE_OK) return CO_PENDING;
        n->cycle_busy = false;
    }
    record_rejection(n, &c, r);
    return board_node_abort_of(r);
}

static uint32_t read_bus(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)v;
    return submit_cycle(n, false, (uint8_t)(e->sub - 1), 0, t_ns);
}

static uint32_t write_bus(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    return submit_cycle(n, true, (uint8_t)(e->sub - 1), (uint16_t)v->number, t_ns);
}

static double read_strobe(const struct board_node *n, const struct co_entry *e)
{
    (void)e;
    return n->strobe_ns;
}

static uint32_t write_strobe(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    (void)t_ns;
    n->strobe_ns = (uint32_t)v->number;
    return CO_OK;
}

/* ---- counters and identity ---- */

static const struct board_part *controller_part(const struct board_node *n)
{
    return &n->cfg.type->parts[0];
}

static const struct board_counter *counter_named(const struct board_node *n, const char *name)
{
    const struct board_part *p = controller_part(n);
    for (unsigned i = 0; i < p->counter_count; i++) {
        if (strcmp(p->counters[i].name, name) == 0) return &p->counters[i];
    }
    return NULL;
}

static uint32_t board_counter_value(const struct board_node *n, unsigned i)
{
    const struct board_counter *c = counter_named(n, n->type->device->counters[i]);
    uint32_t value = 0;
    memcpy(&value, (const char *)n->board + controller_part(n)->offset + c->offset, sizeof value);
    return value;
}

static uint8_t at_most_255(unsigned n)
{
    return (uint8_t)(n < 255 ? n : 255);
}

int64_t board_node_load(struct board_node *n, int64_t t_ns)
{
    const int64_t from_ns = n->load_from_ns, was_ns = n->load_busy_ns;
    n->load_from_ns = t_ns;
    n->load_busy_ns = can_busy_ns(n->bus, t_ns);
    return t_ns > from_ns ? (n->load_busy_ns - was_ns) * 1000 / (t_ns - from_ns) : 0;
}

/* The first sub-indices of 2030h, in the order of proto/unit.yaml. */
static uint32_t read_counter(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    enum { LOAD = 3 };
    const struct co_device *d = n->type->device;
    const uint32_t value[] = {0,
                              n->readings,
                              n->dropped + n->node.pdo_lost,
                              0,
                              at_most_255(n->node.services.tec),
                              at_most_255(n->node.services.rec),
                              n->node.pdo_inhibited,
                              n->node.syncs,
                              n->node.sdo.aborts,
                              n->node.malformed + n->node.sdo.malformed,
                              n->cycles,
                              n->cycles_refused};
    assert(d->counter_sub == sizeof value / sizeof value[0]);
    if (e->sub >= d->counter_sub) v->number = board_counter_value(n, (unsigned)e->sub - d->counter_sub);
    else v->number = e->sub == LOAD ? (double)board_node_load(n, t_ns) : value[e->sub];
    return CO_OK;
}

static double read_serial(const struct board_node *n, const struct co_entry *e)
{
    (void)e;
    return ((const struct board *)n->board)->cfg.serial;
}

/* ---- whether the bus can carry the stream ---- */

bool board_node_load_fits(const struct can_bus_cfg *bus, const char *what, unsigned frames, int64_t need_ns,
                          int64_t have_ns, char why[BOARD_NODE_TEXT])
{
    if (have_ns <= 0 || need_ns <= have_ns) return true;
    (void)snprintf(why, BOARD_NODE_TEXT,
                   "refused: %s is %u frame%s, at worst %.3f us at %lu bit/s, and due every %.3f us (%.0f /s): "
                   "%.1f %% of the bus",
                   what, frames, frames > 1 ? "s" : "", 1e-3 * (double)need_ns, (unsigned long)bus->bitrate_hz,
                   1e-3 * (double)have_ns, 1e9 / (double)have_ns, 100.0 * (double)need_ns / (double)have_ns);
    return false;
}

/* Bit k: TPDO k + 1 goes with each reading; those that wait for SYNC have the host's pace. */
static unsigned flowing_tpdos(const struct board_node *n)
{
    unsigned mask = 0;
    for (unsigned k = 0; k < n->type->device->tpdos; k++) mask |= (unsigned)co_pdo_flows(&n->node, k) << k;
    return mask;
}

static bool stream_fits(const struct board_node *n, unsigned tpdos, int64_t period_ns, char why[BOARD_NODE_TEXT])
{
    int64_t need_ns = 0;
    unsigned frames = 0;
    for (unsigned k = 0; k < n->type->device->tpdos; k++) {
        if (!(tpdos >> k & 1u)) continue;
        frames++;
        need_ns += can_bits_ns(can_bits_worst(0, n->type->device->tpdo_len[k]), &n->bus->cfg);
    }
    return board_node_load_fits(&n->bus->cfg, "a reading", frames, need_ns, period_ns, why);
}

/* ---- texts ---- */

static uint32_t read_text(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    char present[BOARD_NODE_TEXT];
    const char *text = e->index == REFUSAL ? n->refusal : n->remark;
    if (e->index == REFUSAL && !stream_fits(n, n->fit_tpdos, n->fit_period_ns, present)) text = present;
    v->len = (uint16_t)strlen(text);
    memcpy(v->text, text, (size_t)v->len + 1);
    return CO_OK;
}

static uint32_t write_remark(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    (void)t_ns;
    const size_t len = v->len < BOARD_NODE_REMARK ? v->len : BOARD_NODE_REMARK;
    memcpy(n->remark, v->text, len);
    n->remark[len] = '\0';
    return CO_OK;
}

/* ---- which function answers for an object ---- */

static const struct board_object common[] = {
    {IDENTITY, .value = read_serial},
    {BUS, .read = read_bus, .write = write_bus},
    {COUNTERS, .read = read_counter},
    {REFUSAL, .read = read_text},
    {REMARK, .read = read_text, .write = write_remark},
    {STROBE_NS, .value = read_strobe, .write = write_strobe},
};

static const struct board_object *find_object(const struct board_object *objects, size_t count, uint16_t index)
{
    for (size_t i = 0; i < count; i++) {
        if (objects[i].index == index) return &objects[i];
    }
    return NULL;
}

/* The board's own come first: it may answer for a common object itself. */
static const struct board_object *find_handler(const struct board_node *n, uint16_t index)
{
    const struct board_object *own = find_object(n->type->objects, n->type->object_count, index);
    return own ? own : find_object(common, sizeof common / sizeof common[0], index);
}

static uint32_t on_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct board_node *n = ctx;
    const struct board_object *o = find_handler(n, e->index);
    if (!o || !o->value) return o && o->read ? o->read(n, e, v, t_ns) : CO_AB_NO_OBJECT;
    v->number = o->value(n, e);
    return CO_OK;
}

static uint32_t on_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct board_node *n = ctx;
    const struct board_object *o = find_handler(n, e->index);
    return o && o->write ? o->write(n, e, v, t_ns) : CO_AB_NO_OBJECT;
}

/* ---- stream ---- */

/* Reports only changes. */
static void check_stream(struct board_node *n, int64_t t_ns)
{
    char why[BOARD_NODE_TEXT];
    if (!n->type->period_ns) return;
    const int64_t period_ns = n->type->period_ns(n->board);
    const unsigned tpdos = flowing_tpdos(n);
    if (period_ns == n->fit_period_ns && tpdos == n->fit_tpdos) return;
    const bool fitted = n->fits;
    n->fit_period_ns = period_ns;
    n->fit_tpdos = tpdos;
    n->fits = stream_fits(n, tpdos, period_ns, why);
    if (n->fits) {
        co_node_error_end(&n->node, STREAM_REFUSED, t_ns);
        return;
    }
    if (fitted && n->cfg.refused) n->cfg.refused(n->cfg.ctx, n->cfg.name, why);
    co_node_error(&n->node, STREAM_REFUSED, REG_DEVICE, SOURCE_STREAM, t_ns);
}

static void drop_reading(struct board_node *n, int64_t t_ns)
{
    n->dropped++;
    n->drop_ns = t_ns;
    co_node_error(&n->node, CAN_OVERRUN, REG_COMM, SOURCE_STREAM, t_ns);
}

void board_node_stream(struct board_node *n, unsigned first, struct can_msg *m, unsigned frames, int64_t t_ns)
{
    n->readings++;
    if (n->node.state != CO_OPERATIONAL) return;
    check_stream(n, t_ns);
    if (!n->fits) {
        n->dropped++;
        return;
    }
    if (!co_pdo_room(&n->node, frames)) { /* a reading is sent whole or not at all */
        drop_reading(n, t_ns);
        return;
    }
    for (unsigned i = 0; i < frames; i++) (void)co_pdo_offer(&n->node, first + i, &m[i], t_ns);
    if (t_ns - n->drop_ns >= BOARD_NODE_CALM_NS) co_node_error_end(&n->node, CAN_OVERRUN, t_ns);
}

void board_node_reject_stream(struct board_node *n, const char *why, int64_t t_ns)
{
    if (strcmp(n->refusal, why) != 0) {
        (void)snprintf(n->refusal, sizeof n->refusal, "%s", why);
        if (n->cfg.refused) n->cfg.refused(n->cfg.ctx, n->cfg.name, n->refusal);
    }
    co_node_error(&n->node, STREAM_REFUSED, REG_DEVICE, SOURCE_STREAM, t_ns);
}

void board_node_accept_stream(struct board_node *n, int64_t t_ns)
{
    n->refusal[0] = '\0';
    co_node_error_end(&n->node, STREAM_REFUSED, t_ns);
}

void board_node_condition(struct board_node *n, uint16_t code, uint8_t source, bool active, int64_t t_ns)
{
    if (active) co_node_error(&n->node, code, REG_DEVICE, source, t_ns);
    else co_node_error_end(&n->node, code, t_ns);
}

/* ---- events of the node, life ---- */

static void restore_defaults(struct board_node *n)
{
    n->strobe_ns = (uint32_t)board_node_default(n, STROBE_NS, 0);
    if (n->type->defaults) n->type->defaults(n);
}

/* To be checked: no period is negative. */
static void invalidate_fit(struct board_node *n)
{
    n->fit_period_ns = -1;
    n->fits = true;
}

static void on_event(void *ctx, enum co_event ev, int64_t t_ns)
{
    struct board_node *n = ctx;
    if (ev == CO_EV_RESET_NODE) {
        restore_defaults(n);
        n->cfg.type->reset(n->board, t_ns);
        n->refusal[0] = '\0'; /* drops the reason of a cycle that the reset has cut */
    }
    if (n->type->restart) {
        n->type->restart(n);
    } else if (ev != CO_EV_STATE) {
        co_pdo_select(&n->node, (1u << n->type->device->tpdos) - 1u);
        co_pdo_switch_off(&n->node, n->type->device->tpdo_off);
        invalidate_fit(n);
    }
    if (ev != CO_EV_STATE || n->node.state != CO_OPERATIONAL) return;
    check_stream(n, t_ns);
    if (n->type->started) n->type->started(n, t_ns);
}

static void on_sync(void *ctx, int64_t t_ns)
{
    struct board_node *n = ctx;
    if (n->type->sync) n->type->sync(n, t_ns);
}

static void on_rx_other(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct board_node *n = ctx;
    n->type->rx_other(n, m, t_ns);
}

void board_node_init(struct board_node *n, const struct board_node_type *type, const struct board_can_cfg *cfg,
                     void *board, struct can_bus *bus, struct sched *s)
{
    const struct co_device *d = type->device;
    memset(n, 0, sizeof *n);
    n->type = type;
    n->cfg = *cfg;
    n->board = board;
    n->bus = bus;
    n->drop_ns = -BOARD_NODE_CALM_NS;
    for (unsigned i = 0; i < d->counter_count; i++) assert(counter_named(n, d->counters[i]));
    const struct co_node_cfg node = {.name = cfg->name, .id = cfg->node_id, .od = d->od, .tpdos = d->tpdos};
    const struct co_node_io io = {n, on_read, on_write, on_event, on_sync, type->rx_other ? on_rx_other : NULL};
    co_node_init(&n->node, &node, &io, bus, s);
    invalidate_fit(n);
    restore_defaults(n);
}

void board_node_power_up(void *can, int64_t t_ns)
{
    struct board_node *n = can;
    co_node_power_up(&n->node, t_ns);
}

/* Forgets everything but the counters. */
void board_node_power_down(void *can)
{
    struct board_node *n = can;
    co_node_power_down(&n->node);
    restore_defaults(n);
    n->refusal[0] = n->remark[0] = '\0';
    n->drop_ns = -BOARD_NODE_CALM_NS;
}

struct co_node *board_node_co(void *can)
{
    struct board_node *n = can;
    return &n->node;
}
