#include "canopen/uds.h"

#include "base/bits.h"

#include <assert.h>
#include <string.h>

enum {
    SESSION_CONTROL = 0x10,
    ECU_RESET = 0x11,
    CLEAR_DTC = 0x14,
    READ_DTC = 0x19,
    READ_DID = 0x22,
    WRITE_DID = 0x2E,
    TESTER_PRESENT = 0x3E,
    POSITIVE = 0x40, /* added to the service */
    NEGATIVE = 0x7F
};
enum { SUPPRESS = 0x80, HARD_RESET = 1, DTC_COUNT = 1, DTC_LIST = 2, DTC_FORMAT = 1 /* ISO 14229-1 */ };
enum { DID_SESSION = 0xF186, DID_COUNTERS = 0xFD00, ERROR_HISTORY = 0x1003 };
enum { OK = 0, LATER = 0x100 }; /* beside the negative response codes */

static uint16_t get_be16(const uint8_t *p)
{
    return (uint16_t)bits_get_be(p, 2);
}

static void put_byte(struct uds *u, unsigned byte)
{
    assert(u->size < sizeof u->response);
    u->response[u->size++] = (uint8_t)byte;
}

static void put_be16(struct uds *u, unsigned v)
{
    put_byte(u, v >> 8);
    put_byte(u, v);
}

/* ---- responses ---- */

static void complete_request(struct uds *u, int64_t t_ns)
{
    const bool reset = u->reset_due;
    u->state = UDS_IDLE;
    u->reset_due = false;
    if (reset) u->io.reset(u->io.ctx, t_ns);
    else if (u->session != UDS_SESSION_DEFAULT) sched_at(u->sched, &u->s3, t_ns + UDS_S3_NS);
}

static void transmit_response(struct uds *u, int64_t t_ns)
{
    u->state = UDS_ANSWERING;
    u->waiting = !u->io.send(u->io.ctx, u->response, u->size, t_ns);
}

/* A server that a functional request does not concern is silent (server response rules). */
static bool is_silent(const struct uds *u, unsigned result)
{
    if (u->pending_sent) return false;
    if (result == OK) return u->suppress;
    return u->functional && (result == UDS_NRC_NO_SERVICE || result == UDS_NRC_NO_SUB_FUNCTION ||
                             result == UDS_NRC_OUT_OF_RANGE || result == UDS_NRC_NOT_IN_SESSION);
}

static void finish_request(struct uds *u, unsigned result, int64_t t_ns)
{
    if (result == LATER) return;
    sched_cancel(u->sched, &u->p2);
    u->entry = NULL;
    if (result != OK) {
        u->negatives++;
        u->size = 0;
        put_byte(u, NEGATIVE);
        put_byte(u, u->request[0]);
        put_byte(u, result);
    }
    if (is_silent(u, result)) complete_request(u, t_ns);
    else transmit_response(u, t_ns);
}

/* A negative response beside the one that will come; lost while the transport is busy. */
static void send_notice(struct uds *u, uint8_t service, uint8_t nrc, int64_t t_ns)
{
    u->notice[0] = NEGATIVE;
    u->notice[1] = service;
    u->notice[2] = nrc;
    (void)u->io.send(u->io.ctx, u->notice, sizeof u->notice, t_ns);
}

static void p2_due(void *ctx, int64_t t_ns)
{
    struct uds *u = ctx;
    if (u->pending_sent) {
        finish_request(u, UDS_NRC_GENERAL, t_ns);
        return;
    }
    u->pending_sent = true;
    send_notice(u, u->request[0], UDS_NRC_PENDING, t_ns);
    sched_at(u->sched, &u->p2, t_ns + UDS_ACCESS_NS - UDS_P2_NS);
}

static void s3_due(void *ctx, int64_t t_ns)
{
    struct uds *u = ctx;
    (void)t_ns;
    u->s3_timeouts++;
    u->session = UDS_SESSION_DEFAULT;
}

void uds_done(struct uds *u, int64_t t_ns)
{
    if (u->state != UDS_ANSWERING) return; /* that was a notice */
    if (u->waiting) transmit_response(u, t_ns);
    else complete_request(u, t_ns);
}

/* ---- objects ---- */

static unsigned nrc_of(uint32_t abort)
{
    static const struct {
        uint32_t abort;
        uint8_t nrc;
    } row[] = {
        {CO_AB_WRITE_ONLY, UDS_NRC_OUT_OF_RANGE}, {CO_AB_READ_ONLY, UDS_NRC_OUT_OF_RANGE},
        {CO_AB_NO_OBJECT, UDS_NRC_OUT_OF_RANGE},  {CO_AB_NO_SUB, UDS_NRC_OUT_OF_RANGE},
        {CO_AB_VALUE, UDS_NRC_OUT_OF_RANGE},      {CO_AB_LENGTH, UDS_NRC_LENGTH},
        {CO_AB_TOO_LONG, UDS_NRC_LENGTH},         {CO_AB_TOO_SHORT, UDS_NRC_LENGTH},
        {CO_AB_STATE, UDS_NRC_CONDITIONS},
    };
    if (abort == CO_OK) return OK;
    if (abort == CO_PENDING) return LATER;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        if (row[i].abort == abort) return row[i].nrc;
    return UDS_NRC_GENERAL;
}

static void put_value(struct uds *u, const struct co_value *v)
{
    put_be16(u, u->did);
    u->size += co_encode(u->entry, v, &u->response[u->size], CO_SDO_BUFFER);
}

static void put_counters(struct uds *u)
{
    uint32_t value[6] = {u->requests, u->negatives, u->busy, u->s3_timeouts};
    u->io.losses(u->io.ctx, &value[4], &value[5]);
    put_be16(u, DID_COUNTERS);
    for (unsigned i = 0; i < sizeof value / sizeof value[0]; i++, u->size += 4)
        bits_put_le(&u->response[u->size], value[i], 4);
}

static unsigned read_entry(struct uds *u, int64_t t_ns)
{
    u->entry = uds_did_entry(u->dids, u->od, u->did);
    if (!u->entry) return UDS_NRC_OUT_OF_RANGE;
    u->value = (struct co_value){0};
    uint32_t abort = co_may_read(u->entry);
    if (abort == CO_OK) abort = u->io.read(u->io.ctx, u->entry, &u->value, t_ns);
    if (abort == CO_OK) put_value(u, &u->value);
    return nrc_of(abort);
}

static unsigned read_identifier(struct uds *u, int64_t t_ns)
{
    if (u->did == DID_COUNTERS) {
        put_counters(u);
        return OK;
    }
    if (u->did != DID_SESSION) return read_entry(u, t_ns);
    put_be16(u, DID_SESSION);
    put_byte(u, u->session);
    return OK;
}

/* 10.2: identifiers that there are not are left out, unless there is none. */
static unsigned read_rest(struct uds *u, int64_t t_ns)
{
    while (u->at < u->len) {
        u->did = get_be16(&u->request[u->at]);
        u->at += 2;
        const unsigned r = read_identifier(u, t_ns);
        if (r != OK && r != UDS_NRC_OUT_OF_RANGE) return r;
    }
    return u->size > 1 ? OK : UDS_NRC_OUT_OF_RANGE;
}

static unsigned put_written_did(struct uds *u)
{
    put_be16(u, u->did);
    return OK;
}

static void resume_request(struct uds *u, uint32_t abort, const struct co_value *v, int64_t t_ns)
{
    unsigned r = nrc_of(abort);
    if (u->request[0] == WRITE_DID) {
        if (r == OK) (void)put_written_did(u);
    } else {
        if (r == OK) put_value(u, v);
        if (r == OK || r == UDS_NRC_OUT_OF_RANGE) r = read_rest(u, t_ns);
    }
    finish_request(u, r, t_ns);
}

void uds_answer(struct uds *u, uint32_t abort, const struct co_value *v, int64_t t_ns)
{
    if (u->state == UDS_WORKING && u->entry) resume_request(u, abort, v, t_ns);
}

/* ---- services ---- */

static unsigned control_session(struct uds *u, int64_t t_ns)
{
    (void)t_ns;
    enum { P2_PER_NS = 1000000, P2_STAR_PER_NS = 10000000 };
    u->session = (enum uds_session)(u->request[1] & ~SUPPRESS);
    put_byte(u, u->session);
    put_be16(u, UDS_P2_NS / P2_PER_NS);
    put_be16(u, UDS_P2_STAR_NS / P2_STAR_PER_NS);
    return OK;
}

static unsigned reset_ecu(struct uds *u, int64_t t_ns)
{
    (void)t_ns;
    u->reset_due = true;
    put_byte(u, HARD_RESET);
    return OK;
}

static unsigned tester_present(struct uds *u, int64_t t_ns)
{
    (void)t_ns;
    put_byte(u, 0);
    return OK;
}

/* The error history, 1003h, as a host clears it; group: all. */
static unsigned clear_dtcs(struct uds *u, int64_t t_ns)
{
    uint32_t abort = CO_OK;
    const struct co_entry *e = co_find(u->od, ERROR_HISTORY, 0, &abort);
    if (u->request[1] != 0xFF || get_be16(&u->request[2]) != 0xFFFF) return UDS_NRC_OUT_OF_RANGE;
    if (e) abort = u->io.write(u->io.ctx, e, &(struct co_value){.number = 0}, t_ns);
    return nrc_of(abort);
}

static unsigned read_dtcs(struct uds *u, int64_t t_ns)
{
    (void)t_ns;
    struct uds_dtc dtc[UDS_DTCS_MAX];
    const unsigned all = u->io.dtcs(u->io.ctx, dtc);
    const bool list = (u->request[1] & ~SUPPRESS) == DTC_LIST;
    unsigned count = 0;
    put_byte(u, list ? DTC_LIST : DTC_COUNT);
    put_byte(u, UDS_DTC_FAILED | UDS_DTC_CONFIRMED); /* availability mask */
    for (unsigned i = 0; i < all; i++) {
        if (!(dtc[i].status & u->request[2])) continue;
        count++;
        if (!list) continue;
        put_be16(u, dtc[i].code);
        put_byte(u, 0);
        put_byte(u, dtc[i].status);
    }
    if (list) return OK;
    put_byte(u, DTC_FORMAT);
    put_be16(u, count);
    return OK;
}

static unsigned read_dids(struct uds *u, int64_t t_ns)
{
    if (u->len % 2 == 0) return UDS_NRC_LENGTH;
    u->at = 1;
    return read_rest(u, t_ns);
}

static unsigned write_did(struct uds *u, int64_t t_ns)
{
    enum { HEAD = 3 };
    u->did = get_be16(&u->request[1]);
    u->entry = uds_did_entry(u->dids, u->od, u->did);
    if (!u->entry) return UDS_NRC_OUT_OF_RANGE;
    u->value = (struct co_value){0};
    uint32_t abort = co_may_write(u->entry);
    if (abort == CO_OK) abort = co_decode(u->entry, &u->request[HEAD], u->len - HEAD, &u->value);
    if (abort == CO_OK) abort = u->io.write(u->io.ctx, u->entry, &u->value, t_ns);
    return abort == CO_OK ? put_written_did(u) : nrc_of(abort);
}

enum { IN_DEFAULT = 1 << UDS_SESSION_DEFAULT, IN_EXTENDED = 1 << UDS_SESSION_EXTENDED };

struct service {
    uint8_t sid;
    uint8_t sessions;
    uint16_t min, max; /* bytes of the request */
    const char *subs;  /* sub-functions, each a character; NULL: the service has none */
    uint8_t sub_count;
    unsigned (*run)(struct uds *u, int64_t t_ns); /* OK, LATER or a negative response code */
};

static const struct service services[] = {
    {SESSION_CONTROL, IN_DEFAULT | IN_EXTENDED, 2, 2, "\1\3", 2, control_session},
    {ECU_RESET, IN_DEFAULT | IN_EXTENDED, 2, 2, "\1", 1, reset_ecu},
    {CLEAR_DTC, IN_DEFAULT | IN_EXTENDED, 4, 4, NULL, 0, clear_dtcs},
    {READ_DTC, IN_DEFAULT | IN_EXTENDED, 3, 3, "\1\2", 2, read_dtcs},
    {READ_DID, IN_DEFAULT | IN_EXTENDED, 3, 1 + 2 * UDS_READ_MAX, NULL, 0, read_dids},
    {WRITE_DID, IN_EXTENDED, 4, UDS_REQUEST_MAX, NULL, 0, write_did},
    {TESTER_PRESENT, IN_DEFAULT | IN_EXTENDED, 2, 2, "\0", 1, tester_present},
};

static const struct service *find_service(uint8_t sid)
{
    for (const struct service *s = services; s < services + sizeof services / sizeof services[0]; s++)
        if (s->sid == sid) return s;
    return NULL;
}

/* Order of the checks: server response rules. */
static unsigned dispatch_request(struct uds *u, int64_t t_ns)
{
    const struct service *s = find_service(u->request[0]);
    if (!s) return UDS_NRC_NO_SERVICE;
    if (!(s->sessions & 1u << u->session)) return UDS_NRC_NOT_IN_SESSION;
    if (s->subs && u->len < 2) return UDS_NRC_LENGTH;
    if (s->subs && !memchr(s->subs, u->request[1] & ~SUPPRESS, s->sub_count)) return UDS_NRC_NO_SUB_FUNCTION;
    if (u->len < s->min || u->len > s->max) return UDS_NRC_LENGTH;
    u->suppress = s->subs && u->request[1] & SUPPRESS;
    u->size = 0;
    put_byte(u, u->request[0] + POSITIVE);
    return s->run(u, t_ns);
}

/* A request while another is served: TesterPresent without a response has nothing to do. */
static void reject_busy(struct uds *u, const uint8_t *data, size_t len, bool functional, int64_t t_ns)
{
    if (len == 2 && data[0] == TESTER_PRESENT && data[1] == SUPPRESS) return;
    u->busy++;
    if (!functional && u->state == UDS_WORKING) send_notice(u, data[0], UDS_NRC_BUSY, t_ns);
}

void uds_request(struct uds *u, const uint8_t *data, size_t len, bool functional, int64_t t_ns)
{
    assert(len >= 1 && len <= UDS_REQUEST_MAX);
    u->requests++;
    if (u->state != UDS_IDLE) {
        reject_busy(u, data, len, functional, t_ns);
        return;
    }
    sched_cancel(u->sched, &u->s3);
    memcpy(u->request, data, len);
    u->len = len;
    u->functional = functional;
    u->suppress = u->pending_sent = false;
    u->state = UDS_WORKING;
    sched_at(u->sched, &u->p2, t_ns + UDS_P2_NS);
    finish_request(u, dispatch_request(u, t_ns), t_ns);
}

void uds_begun(struct uds *u)
{
    sched_cancel(u->sched, &u->s3);
}

void uds_broken(struct uds *u, int64_t t_ns)
{
    if (u->state == UDS_IDLE && u->session != UDS_SESSION_DEFAULT) sched_at(u->sched, &u->s3, t_ns + UDS_S3_NS);
}

/* ---- life ---- */

void uds_init(struct uds *u, const struct co_od *od, const struct uds_dids *dids, const struct uds_io *io,
              struct sched *sched)
{
    memset(u, 0, sizeof *u);
    u->od = od;
    u->dids = dids;
    u->io = *io;
    u->sched = sched;
    u->session = UDS_SESSION_DEFAULT;
    sched_ev(&u->s3, s3_due, u);
    sched_ev(&u->p2, p2_due, u);
}

void uds_reset(struct uds *u)
{
    sched_cancel(u->sched, &u->s3);
    sched_cancel(u->sched, &u->p2);
    u->state = UDS_IDLE;
    u->session = UDS_SESSION_DEFAULT;
    u->entry = NULL;
    u->waiting = u->reset_due = u->pending_sent = false;
}
