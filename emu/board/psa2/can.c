#include "board/psa2/board.h"

#include <string.h>

enum { SOURCE_ACCEL_PORT = 1, SOURCE_TEMP_PORT = 2 };
enum { NS_PER_TICK = 4000, NS_PER_US = 1000, AXES = 3 };

static const double volt_per_lsb = 10.0 / 8388608.0; /* nominal, at the load */

static struct psa2_can *can_of(struct board_node *n)
{
    return (struct psa2_can *)n;
}

static struct psa2_can_info info_of(const struct psa2_can *c)
{
    struct psa2_can_info info = {0};
    c->port.info(c->port.ctx, &info);
    return info;
}

/* ---- whether the bus can carry the stream ---- */

/* fDATA = fCLK / (16384 >> DR) in the FIR modes (sources 1.8); other modes and DR 5..7 the board rejects. */
static int64_t config0_period_ns(uint32_t fclk_hz, uint8_t config0)
{
    const unsigned dr = config0 >> 3 & 7u;
    if (dr > 4 || (config0 & 3u) < 2 || fclk_hz == 0) return 0;
    return (INT64_C(16384) >> dr) * NS_PER_S / fclk_hz;
}

/* EMCY and object 2031h follow these settings: set where they do not fit, cleared where they do. */
static bool check_stream(struct psa2_can *c, const struct psa2_can_settings *set, int64_t period_ns, int64_t t_ns)
{
    char why[BOARD_NODE_TEXT];
    if (psa2_form_fits(&c->node.bus->cfg, set, period_ns, why)) {
        board_node_accept_stream(&c->node, t_ns);
        return true;
    }
    board_node_reject_stream(&c->node, why, t_ns);
    return false;
}

/* The present settings at the present data period: the stream flows or stops. While nothing changes, the last rejection of a
 * setting stays readable. */
static void recheck_stream(struct psa2_can *c, int64_t t_ns)
{
    char why[BOARD_NODE_TEXT];
    const int64_t period_ns = info_of(c).period_ns;
    const bool fitted = c->node.fits;
    c->checked_period_ns = period_ns;
    c->node.fits = psa2_form_fits(&c->node.bus->cfg, &c->set, period_ns, why);
    if (!c->node.fits || !fitted) (void)check_stream(c, &c->set, period_ns, t_ns);
}

/* Discards a block that is partly filled and selects the TPDOs of the present form. */
static void restart_stream(struct board_node *n)
{
    struct psa2_can *c = can_of(n);
    c->block.samples = 0;
    c->sync_armed = false;
    co_pdo_select(&n->node, psa2_form_tpdos(c->set.form));
}

/* ---- the controller's serial port ---- */

/* Abort codes of sources can 3.3. */
static const uint32_t aborts[] = {
    [PSA2_OK] = CO_OK,
    [PSA2_NO_SUCH_REG] = CO_AB_NO_SUB,
    [PSA2_READ_ONLY] = CO_AB_READ_ONLY,
    [PSA2_BAD_VALUE] = CO_AB_VALUE,
    [PSA2_BUSY] = CO_AB_STATE,
    [PSA2_TIMEOUT] = CO_AB_TRANSFER,
};

static void port_fault(struct psa2_can *c, enum psa2_group group, bool active, int64_t t_ns)
{
    const uint16_t code = group == PSA2_ACCEL ? PSA2_EMCY_ACCEL_PORT : PSA2_EMCY_TEMP_PORT;
    board_node_condition(&c->node, code, group == PSA2_ACCEL ? SOURCE_ACCEL_PORT : SOURCE_TEMP_PORT, active, t_ns);
}

static void request_done(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    c->request_busy = false;
    /* A reset of the node has given the request up, and the board says time-out: that is no fault. */
    const bool given_up = c->node.node.state == CO_INITIALISING;
    if (!given_up && (result == PSA2_OK || result == PSA2_TIMEOUT))
        port_fault(c, r->group, result == PSA2_TIMEOUT, t_ns);
    const struct co_value v = {.number = r->answer[c->request_axis]};
    co_node_answer(&c->node.node, c->ticket, aborts[result], &v, t_ns);
    if (result == PSA2_OK && r->op != PSA2_READ_REG) recheck_stream(c, t_ns);
}

static uint32_t submit_request(struct psa2_can *c, enum psa2_group group, enum psa2_op op, uint8_t addr, uint8_t value,
                               unsigned axis, int64_t t_ns)
{
    if (c->request_busy) return CO_AB_STATE; /* of a client that has given up; the board still has it */
    c->request =
        (struct psa2_request){.group = group, .op = op, .addr = addr, .value = value, .done = request_done, .ctx = c};
    c->request_axis = (uint8_t)axis;
    c->ticket = c->node.node.sdo.ticket;
    c->request_busy = true;
    const enum psa2_result result = c->port.submit(c->port.ctx, &c->request, t_ns);
    if (result == PSA2_OK) return CO_PENDING;
    c->request_busy = false;
    return aborts[result];
}

static void pulse_done(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    (void)r;
    (void)t_ns;
    struct psa2_can *c = ctx;
    c->pulse_busy = false;
    if (result != PSA2_OK) c->syncs_missed++;
}

static void pulse_sync_pin(struct psa2_can *c, int64_t t_ns)
{
    c->pulse = (struct psa2_request){.group = PSA2_ACCEL, .op = PSA2_PULSE_SYNC, .done = pulse_done, .ctx = c};
    c->pulse_busy = c->port.submit(c->port.ctx, &c->pulse, t_ns) == PSA2_OK;
    if (!c->pulse_busy) c->syncs_missed++;
}

/* ---- settings ---- */

static void restore_settings(struct board_node *n)
{
    struct psa2_can *c = can_of(n);
    c->set = (struct psa2_can_settings){
        .form = (uint8_t)board_node_default(n, PSA2_OD_FRAME_FORM, 0),
        .sample_mode = (uint8_t)board_node_default(n, PSA2_OD_SAMPLE_MODE, 0),
        .nth = (uint16_t)board_node_default(n, PSA2_OD_SAMPLE_NTH, 0),
        .sync_pin = board_node_default(n, PSA2_OD_SYNC_PIN, 0) != 0.0,
    };
    for (unsigned i = 0; i < AXES; i++) {
        c->set.zero_v[i] = (float)board_node_default(n, PSA2_OD_ZERO_V, (uint8_t)(i + 1));
        c->set.scale_v_per_g[i] = (float)board_node_default(n, PSA2_OD_SCALE_V_PER_G, (uint8_t)(i + 1));
    }
}

/* Form, sample mode, N: a setting of the stream holds only if the bus can carry what it asks for. */
static uint32_t write_stream(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct psa2_can *c = can_of(n);
    const int64_t period_ns = info_of(c).period_ns;
    struct psa2_can_settings set = c->set;
    if (e->index == PSA2_OD_FRAME_FORM) set.form = (uint8_t)v->number;
    if (e->index == PSA2_OD_SAMPLE_MODE) set.sample_mode = (uint8_t)v->number;
    if (e->index == PSA2_OD_SAMPLE_NTH) set.nth = (uint16_t)v->number;
    if (!check_stream(c, &set, period_ns, t_ns)) return CO_AB_STATE;
    c->set = set;
    c->checked_period_ns = period_ns;
    n->fits = true;
    restart_stream(n);
    return CO_OK;
}

static double read_settings(const struct board_node *n, const struct co_entry *e)
{
    const struct psa2_can_settings *set = &((const struct psa2_can *)n)->set;
    if (e->index == PSA2_OD_FRAME_FORM) return set->form;
    if (e->index == PSA2_OD_SAMPLE_MODE) return set->sample_mode;
    if (e->index == PSA2_OD_SAMPLE_NTH) return set->nth;
    if (e->index == PSA2_OD_SYNC_PIN) return set->sync_pin;
    if (e->index == PSA2_OD_ZERO_V) return (double)set->zero_v[e->sub - 1];
    return (double)set->scale_v_per_g[e->sub - 1];
}

static uint32_t write_plain(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct psa2_can_settings *set = &can_of(n)->set;
    (void)t_ns;
    if (e->index == PSA2_OD_SYNC_PIN) set->sync_pin = v->number != 0.0;
    else if (e->index == PSA2_OD_ZERO_V) set->zero_v[e->sub - 1] = (float)v->number;
    else set->scale_v_per_g[e->sub - 1] = (float)v->number;
    return CO_OK;
}

/* ---- registers and opcodes ---- */

/* Whose registers an object is; the sub-index is the address plus one. */
static unsigned axis_of(uint16_t index)
{
    return index == PSA2_OD_REG_Y ? 1 : index == PSA2_OD_REG_Z ? 2 : 0;
}

static enum psa2_group group_of(const struct co_entry *e)
{
    if (e->index == PSA2_OD_OPCODE) return e->sub == 1 ? PSA2_ACCEL : PSA2_TEMP;
    return e->index == PSA2_OD_REG_T ? PSA2_TEMP : PSA2_ACCEL;
}

static uint32_t read_register(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct psa2_can *c = can_of(n);
    (void)v;
    return submit_request(c, group_of(e), PSA2_READ_REG, (uint8_t)(e->sub - 1), 0, axis_of(e->index), t_ns);
}

static uint32_t write_register(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct psa2_can *c = can_of(n);
    const uint8_t addr = (uint8_t)(e->sub - 1);
    const uint8_t value = (uint8_t)v->number;
    const enum psa2_group group = group_of(e);
    if (group == PSA2_ACCEL && addr == ADS1282_CONFIG0) {
        const int64_t period_ns = config0_period_ns(info_of(c).fclk_hz, value);
        if (period_ns > 0 && !check_stream(c, &c->set, period_ns, t_ns)) return CO_AB_STATE;
    }
    return submit_request(c, group, PSA2_WRITE_REG, addr, value, 0, t_ns);
}

static uint32_t write_opcode(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct psa2_can *c = can_of(n);
    return submit_request(c, group_of(e), PSA2_OPCODE, 0, (uint8_t)v->number, 0, t_ns);
}

/* ---- counters and identity ---- */

/* Sub-indices in order; TEC, REC and state (5..7) stay 0: no errors on the wire are modelled. */
static uint32_t read_counter(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    const struct psa2_can *c = can_of(n);
    enum { LOAD = 4 };
    const struct psa2_counters k = info_of(c).counters;
    const uint32_t value[] = {0,
                              k.frames,
                              k.overruns,
                              n->dropped + n->node.pdo_lost,
                              0,
                              0,
                              0,
                              0,
                              k.int_late,
                              k.timeouts,
                              n->node.pdo_inhibited,
                              n->node.syncs,
                              c->syncs_missed,
                              n->node.sdo.aborts,
                              n->node.malformed + n->node.sdo.malformed};
    if (e->sub >= sizeof value / sizeof value[0]) return CO_AB_NO_SUB;
    v->number = e->sub == LOAD ? (double)board_node_load(n, t_ns) : (double)value[e->sub];
    return CO_OK;
}

static double read_unit(const struct board_node *n, const struct co_entry *e)
{
    const struct psa2_can_info info = info_of((const struct psa2_can *)n);
    return e->index == PSA2_OD_IDENTITY ? (double)info.serial : (double)info.word_bits;
}

/* ---- latest sample ---- */

static double accel_g(const struct psa2_can *c, unsigned axis)
{
    const double v = c->latest.code[axis] * volt_per_lsb;
    return (v - (double)c->set.zero_v[axis]) / (double)c->set.scale_v_per_g[axis];
}

/* In the order of proto/psabench.yaml. */
static double frame_head(const struct psa2_frame *f, uint8_t sub)
{
    const double value[] = {0.0,
                            (uint16_t)f->seq,
                            (uint8_t)((f->status & 0x0F) | f->temp_channel << 4),
                            (uint16_t)((uint64_t)f->t_sample_ns / NS_PER_TICK),
                            (int16_t)f->temp_code,
                            (uint32_t)((uint64_t)f->t_sample_ns / NS_PER_US)};
    return value[sub];
}

static double read_latest(const struct board_node *n, const struct co_entry *e)
{
    const struct psa2_can *c = (const struct psa2_can *)n;
    const struct psa2_frame *f = &c->latest;
    const unsigned axis = (unsigned)e->sub - 1;
    if (e->index == PSA2_OD_CODES) return axis < AXES ? f->code[axis] : (int16_t)f->temp_code;
    if (e->index == PSA2_OD_RAW_WORDS) return (int32_t)f->raw[axis];
    if (e->index == PSA2_OD_FRAME_HEAD) return frame_head(f, e->sub);
    return accel_g(c, axis) * (e->index == PSA2_OD_ACCEL_UG ? 1e6 : 1.0);
}

/* ---- which function answers for an object ---- */

static const struct board_object objects[] = {
    {PSA2_OD_IDENTITY, .value = read_unit},
    {PSA2_OD_REG_X, .read = read_register, .write = write_register},
    {PSA2_OD_REG_Y, .read = read_register, .write = write_register},
    {PSA2_OD_REG_Z, .read = read_register, .write = write_register},
    {PSA2_OD_REG_T, .read = read_register, .write = write_register},
    {PSA2_OD_OPCODE, .write = write_opcode},
    {PSA2_OD_FRAME_FORM, .value = read_settings, .write = write_stream},
    {PSA2_OD_WORD_BITS, .value = read_unit},
    {PSA2_OD_SAMPLE_MODE, .value = read_settings, .write = write_stream},
    {PSA2_OD_SAMPLE_NTH, .value = read_settings, .write = write_stream},
    {PSA2_OD_SYNC_PIN, .value = read_settings, .write = write_plain},
    {PSA2_OD_COUNTERS, .read = read_counter},
    {PSA2_OD_CODES, .value = read_latest},
    {PSA2_OD_RAW_WORDS, .value = read_latest},
    {PSA2_OD_FRAME_HEAD, .value = read_latest},
    {PSA2_OD_ZERO_V, .value = read_settings, .write = write_plain},
    {PSA2_OD_SCALE_V_PER_G, .value = read_settings, .write = write_plain},
    {PSA2_OD_ACCEL_G, .value = read_latest},
    {PSA2_OD_ACCEL_UG, .value = read_latest},
};

/* ---- notifications of the node and of the board ---- */

static void on_sync(struct board_node *n, int64_t t_ns)
{
    struct psa2_can *c = can_of(n);
    c->sync_armed = true;
    c->sync_ns = t_ns;
    if (!c->set.sync_pin) return;
    if (c->pulse_busy) c->syncs_missed++;
    else pulse_sync_pin(c, t_ns);
}

static void on_started(struct board_node *n, int64_t t_ns)
{
    recheck_stream(can_of(n), t_ns);
}

static bool is_due(struct psa2_can *c, const struct psa2_frame *f)
{
    if (c->set.sample_mode == PSA2_EVERY_NTH) return f->seq % c->set.nth == 0;
    if (c->set.sample_mode != PSA2_ON_SYNC) return true;
    if (!c->sync_armed || f->t_sample_ns < c->sync_ns) return false;
    c->sync_armed = false;
    return true;
}

void psa2_can_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    struct board_node *n = &c->node;
    struct can_msg m[PSA2_FORM_FRAMES_MAX] = {{0}, {0}};
    c->latest = *f;
    co_node_error_end(&n->node, PSA2_EMCY_ACCEL_PORT, t_ns);
    if (f->status & PSA2_ST_TEMP_NEW) co_node_error_end(&n->node, PSA2_EMCY_TEMP_PORT, t_ns);
    /* A rate that rose by a way of its own, say a RESET opcode, is checked by what it is. */
    if (info_of(c).period_ns != c->checked_period_ns) recheck_stream(c, t_ns);
    if (n->node.state != CO_OPERATIONAL || !is_due(c, f)) return;
    const unsigned frames = n->fits ? psa2_form_pack(c->set.form, &c->block, f, m) : 0;
    if (frames > 0 || !n->fits) board_node_stream(n, psa2_form_first_tpdo(c->set.form), m, frames, t_ns);
}

void psa2_can_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    if (code == PSA2_FAULT_ACCEL_PORT) port_fault(c, PSA2_ACCEL, true, t_ns);
    else if (code == PSA2_FAULT_TEMP_PORT) port_fault(c, PSA2_TEMP, true, t_ns);
    else if (code != 0) board_node_condition(&c->node, code, 0, true, t_ns);
}

/* ---- life ---- */

void psa2_can_init(struct psa2_can *c, const struct board_can_cfg *cfg, const struct psa2_can_port *port,
                   struct can_bus *bus, struct sched *s)
{
    static const struct co_device device = {.od = &psa2_od, .tpdos = PSA2_TPDOS};
    static const struct board_node_type type = {.device = &device,
                                                BOARD_NODE_OBJECTS(objects),
                                                .defaults = restore_settings,
                                                .restart = restart_stream,
                                                .sync = on_sync,
                                                .started = on_started};
    memset(c, 0, sizeof *c);
    c->port = *port;
    board_node_init(&c->node, &type, cfg, port->ctx, bus, s);
}

void psa2_can_power_down(void *can)
{
    struct psa2_can *c = can;
    board_node_power_down(can);
    c->latest = (struct psa2_frame){0};
    c->checked_period_ns = 0;
    c->node.fits = true;
}

/* ---- a real board ---- */

static enum psa2_result board_submit(void *ctx, struct psa2_request *r, int64_t t_ns)
{
    return psa2_submit(ctx, r, t_ns);
}

static void board_info(void *ctx, struct psa2_can_info *out)
{
    const struct psa2 *b = ctx;
    out->counters = b->counters;
    out->period_ns = ads1282_period_ns(&b->adc[0]);
    out->fclk_hz = b->profile.fclk_hz;
    out->serial = b->base.cfg.serial;
    out->word_bits = b->profile.word_bits;
}

struct psa2_can_port psa2_can_port(struct psa2 *b)
{
    return (struct psa2_can_port){b, board_submit, board_info};
}

/* A node that streams nothing, has no error that a frame would end, and on its bus no frame that it might have to answer. */
static bool ignores_frames(void *ctx)
{
    const struct psa2_can *c = ctx;
    return !c->node.bus->step.queued && c->node.node.state != CO_OPERATIONAL &&
           co_node_error_register(&c->node.node) == 0 && info_of(c).period_ns == c->checked_period_ns;
}

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    struct psa2 *b = (struct psa2 *)board;
    const struct psa2_can_port port = psa2_can_port(b);
    psa2_can_init(can, cfg, &port, bus, s);
    b->host =
        (struct psa2_host){.ctx = can, .frame = psa2_can_frame, .fault = psa2_can_fault, .ignores = ignores_frames};
}

const struct board_can psa2_can = {.size = sizeof(struct psa2_can),
                                   .init = init_can,
                                   .power_up = board_node_power_up,
                                   .power_down = psa2_can_power_down,
                                   .node = board_node_co};
