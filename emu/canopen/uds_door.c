#include "canopen/uds_door.h"

#include <assert.h>
#include <string.h>

/* ISO 15765-4; the block size is ours (E0). */
enum { ID_FUNCTIONAL = 0x7DF, ID_REQUEST = 0x7DF, ID_RESPONSE = 0x7E7, BLOCK_SIZE = 8, ST_MIN = 0 };

/* ---- frames ---- */

static void on_functional(struct uds_door *d, const struct can_msg *m, int64_t t_ns)
{
    size_t n;
    const uint8_t *data = isotp_single(m->data, m->len, &n);
    if (data) uds_request(&d->server, data, n, true, t_ns);
    else d->refused++;
}

static bool on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct uds_door *d = ctx;
    const bool physical = m->id == (uint32_t)ID_REQUEST + d->ecu;
    if (!physical && m->id != ID_FUNCTIONAL) return false;
    if (d->node->state != CO_PRE_OPERATIONAL && d->node->state != CO_OPERATIONAL) return true;
    if (m->flags & (CAN_RTR | CAN_FD)) d->refused++;
    else if (physical) isotp_frame(&d->transport, m->data, m->len, t_ns);
    else on_functional(d, m, t_ns);
    return true;
}

static void on_sent(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct uds_door *d = ctx;
    if (m->id == (uint32_t)ID_RESPONSE + d->ecu) isotp_sent(&d->transport, m->data, m->len, t_ns);
}

static void on_reset(void *ctx)
{
    struct uds_door *d = ctx;
    d->pending = false;
    isotp_reset(&d->transport);
    uds_reset(&d->server);
}

/* ---- transport ---- */

/* A frame that the full queue does not take is never reported as sent: N_As ends its message. */
static void send_frame(void *ctx, const uint8_t frame[8], int64_t t_ns)
{
    struct uds_door *d = ctx;
    (void)co_node_send(d->node, (uint32_t)ID_RESPONSE + d->ecu, frame, 8, t_ns);
}

static void on_begun(void *ctx, int64_t t_ns)
{
    struct uds_door *d = ctx;
    (void)t_ns;
    uds_begun(&d->server);
}

static void on_received(void *ctx, enum isotp_result r, const uint8_t *data, size_t len, int64_t t_ns)
{
    struct uds_door *d = ctx;
    if (r == ISOTP_OK) uds_request(&d->server, data, len, false, t_ns);
    else uds_broken(&d->server, t_ns);
}

static void on_done(void *ctx, enum isotp_result r, int64_t t_ns)
{
    struct uds_door *d = ctx;
    (void)r;
    uds_done(&d->server, t_ns);
}

/* ---- objects ---- */

/* The owner answers to the ticket that the SDO server shows during the access; no access of its own has the same. */
static bool begin_access(struct uds_door *d)
{
    struct co_sdo *s = &d->node->sdo;
    if (s->state == CO_SDO_READING || s->state == CO_SDO_WRITING) return false;
    d->ticket = s->ticket;
    d->pending = true;
    return true;
}

static uint32_t end_access(struct uds_door *d, uint32_t result)
{
    d->node->sdo.ticket++;
    if (result != CO_PENDING) d->pending = false;
    return result;
}

static uint32_t read_object(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct uds_door *d = ctx;
    const struct co_sdo_io *io = &d->node->sdo.io;
    return begin_access(d) ? end_access(d, io->read(io->ctx, e, v, t_ns)) : CO_AB_STATE;
}

static uint32_t write_object(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct uds_door *d = ctx;
    const struct co_sdo_io *io = &d->node->sdo.io;
    return begin_access(d) ? end_access(d, io->write(io->ctx, e, v, t_ns)) : CO_AB_STATE;
}

static bool on_answer(void *ctx, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns)
{
    struct uds_door *d = ctx;
    if (!d->pending || ticket != d->ticket) return false;
    d->pending = false;
    uds_answer(&d->server, abort, v, t_ns);
    return true;
}

/* ---- server ---- */

static bool send_message(void *ctx, const uint8_t *data, size_t len, int64_t t_ns)
{
    struct uds_door *d = ctx;
    return isotp_send(&d->transport, data, len, t_ns);
}

static void reset_ecu(void *ctx, int64_t t_ns)
{
    struct uds_door *d = ctx;
    co_node_reset(d->node, t_ns);
}

static void add_dtc(struct uds_dtc *out, unsigned *n, uint16_t code, uint8_t status)
{
    unsigned i = 0;
    while (i < *n && out[i].code != code) i++;
    if (i == UDS_DTCS_MAX) return;
    if (i == *n) out[(*n)++] = (struct uds_dtc){.code = code};
    out[i].status |= status;
}

/* The error history, latest first, then active errors that have left it. */
static unsigned list_dtcs(void *ctx, struct uds_dtc out[UDS_DTCS_MAX])
{
    const struct co_node *n = ((const struct uds_door *)ctx)->node;
    unsigned count = 0;
    for (unsigned i = 0; i < n->history_count; i++)
        add_dtc(out, &count, (uint16_t)(n->history[i] & 0xFFFF), UDS_DTC_CONFIRMED);
    for (unsigned i = 0; i < CO_ERRORS_MAX; i++)
        if (n->error[i].code) add_dtc(out, &count, n->error[i].code, UDS_DTC_FAILED);
    return count;
}

static void count_losses(void *ctx, uint32_t *failed, uint32_t *ignored)
{
    const struct uds_door *d = ctx;
    *failed = 0;
    for (unsigned i = 0; i < ISOTP_RESULTS; i++) *failed += d->transport.failed[i];
    *ignored = d->transport.ignored + d->refused;
}

void uds_door_init(struct uds_door *d, uint8_t ecu, const struct uds_dids *dids, struct co_node *node)
{
    assert(ecu >= 1 && ecu <= UDS_ECU_MAX);
    memset(d, 0, sizeof *d);
    d->node = node;
    d->ecu = ecu;
    const struct isotp_cfg transport = {d->request, sizeof d->request, BLOCK_SIZE, ST_MIN};
    const struct isotp_io below = {d, send_frame, on_begun, on_received, on_done};
    isotp_init(&d->transport, &transport, &below, node->sched);
    const struct uds_io io = {d, read_object, write_object, send_message, reset_ecu, list_dtcs, count_losses};
    uds_init(&d->server, node->cfg.od, dids, &io, node->sched);
    d->guest = (struct co_guest){d, on_rx, on_sent, on_reset, on_answer};
    co_node_add_guest(node, &d->guest);
}
