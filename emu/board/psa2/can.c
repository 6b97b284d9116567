#include "board/psa2/can.h"

#include "board/psa2/can_internal.h"

#include <string.h>

struct psa2_can_info psa2_can_info(const struct psa2_can *c)
{
    struct psa2_can_info info = {0};
    c->port.info(c->port.ctx, &info);
    return info;
}

/* ---- the controller's serial port ---- */

/* Abort codes of sources can 3.3. */
static uint32_t abort_of(enum psa2_result result)
{
    switch (result) {
    case PSA2_OK:
        return CO_OK;
    case PSA2_NO_SUCH_REG:
        return CO_AB_NO_SUB;
    case PSA2_READ_ONLY:
        return CO_AB_READ_ONLY;
    case PSA2_BAD_VALUE:
        return CO_AB_VALUE;
    case PSA2_BUSY:
        return CO_AB_STATE;
    case PSA2_TIMEOUT:
        return CO_AB_TRANSFER;
    }
    return CO_AB_GENERAL;
}

static void port_fault(struct psa2_can *c, enum psa2_group group, bool active, int64_t t_ns)
{
    const uint16_t code = group == PSA2_ACCEL ? PSA2_EMCY_ACCEL_PORT : PSA2_EMCY_TEMP_PORT;
    if (active) co_node_error(&c->node, code, 0x81, group == PSA2_ACCEL ? 1 : 2, t_ns);
    else co_node_error_end(&c->node, code, t_ns);
}

static void request_done(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    c->request_busy = false;
    /* A reset of the node has given the request up, and the board says time-out: that is no fault. */
    const bool given_up = c->node.state == CO_INITIALISING;
    if (!given_up && (result == PSA2_OK || result == PSA2_TIMEOUT))
        port_fault(c, r->group, result == PSA2_TIMEOUT, t_ns);
    const struct co_value v = {.number = r->answer[c->request_axis]};
    co_sdo_answer(&c->node.sdo, c->ticket, abort_of(result), &v, t_ns);
    if (result == PSA2_OK && r->op != PSA2_READ_REG) psa2_can_rejudge(c, t_ns);
}

uint32_t psa2_can_submit(struct psa2_can *c, enum psa2_group group, enum psa2_op op, uint8_t addr, uint8_t value,
                         unsigned axis, int64_t t_ns)
{
    if (c->request_busy) return CO_AB_STATE; /* of a client that has given up; the board still has it */
    c->request =
        (struct psa2_request){.group = group, .op = op, .addr = addr, .value = value, .done = request_done, .ctx = c};
    c->request_axis = (uint8_t)axis;
    c->ticket = c->node.sdo.ticket;
    c->request_busy = true;
    const enum psa2_result result = c->port.submit(c->port.ctx, &c->request, t_ns);
    if (result == PSA2_OK) return CO_PENDING;
    c->request_busy = false;
    return abort_of(result);
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

/* ---- what the node tells ---- */

static void on_sync(void *ctx, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    c->sync_armed = true;
    c->sync_ns = t_ns;
    if (!c->set.sync_pin) return;
    if (c->pulse_busy) c->syncs_missed++;
    else pulse_sync_pin(c, t_ns);
}

static void on_event(void *ctx, enum co_event ev, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    if (ev == CO_EV_RESET_NODE) {
        psa2_can_defaults(c);
        c->refusal[0] = '\0';
        c->port.reset(c->port.ctx, t_ns);
    }
    psa2_can_stream_restart(c);
    if (ev == CO_EV_STATE && c->node.state == CO_OPERATIONAL) psa2_can_rejudge(c, t_ns);
}

void psa2_can_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    if (code == PSA2_FAULT_ACCEL_PORT) port_fault(c, PSA2_ACCEL, true, t_ns);
    else if (code == PSA2_FAULT_TEMP_PORT) port_fault(c, PSA2_TEMP, true, t_ns);
    else if (code != 0) co_node_error(&c->node, code, 0x81, 0, t_ns);
}

/* ---- life ---- */

void psa2_can_init(struct psa2_can *c, const struct board_can_cfg *cfg, const struct psa2_can_port *port,
                   struct can_bus *bus, struct sched *s)
{
    memset(c, 0, sizeof *c);
    c->cfg = *cfg;
    c->port = *port;
    c->bus = bus;
    c->fits = true;
    c->drop_ns = -PSA2_CAN_CALM_NS;
    const struct co_node_cfg node = {.name = cfg->name, .id = cfg->node_id, .od = &psa2_od, .tpdos = PSA2_TPDOS};
    const struct co_node_io io = {c, psa2_can_read, psa2_can_write, on_event, on_sync, NULL};
    co_node_init(&c->node, &node, &io, bus, s);
    psa2_can_defaults(c);
}

void psa2_can_power_up(struct psa2_can *c, int64_t t_ns)
{
    co_node_power_up(&c->node, t_ns);
}

void psa2_can_power_down(struct psa2_can *c)
{
    co_node_power_down(&c->node);
    psa2_can_defaults(c);
    c->refusal[0] = c->remark[0] = '\0';
    c->latest = (struct psa2_frame){0};
    c->checked_period_ns = 0;
    c->fits = true;
    c->drop_ns = -PSA2_CAN_CALM_NS;
}

/* ---- a real board ---- */

static enum psa2_result board_submit(void *ctx, struct psa2_request *r, int64_t t_ns)
{
    return psa2_submit(ctx, r, t_ns);
}

static void board_reset(void *ctx, int64_t t_ns)
{
    psa2_reset(ctx, t_ns);
}

static void board_info(void *ctx, struct psa2_can_info *out)
{
    const struct psa2 *b = ctx;
    out->counters = b->counters;
    out->period_ns = ads1282_period_ns(&b->adc[0]);
    out->fclk_hz = b->profile.fclk_hz;
    out->serial = b->cfg.serial;
    out->word_bits = b->profile.word_bits;
}

struct psa2_can_port psa2_can_port(struct psa2 *b)
{
    return (struct psa2_can_port){b, board_submit, board_reset, board_info};
}
