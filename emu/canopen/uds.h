/* UDS server (ISO 14229-1:2013) on the objects of a node: sessions, reset, data by identifier, trouble codes.
 *
 * Messages in and out; the transport is the owner's (uds_door.h). Objects are accessed as the SDO server does it: rights and
 * limits of the entry, then the owner's functions; an abort code becomes a negative response code. One request at a time.
 * Data are the object's bytes as over SDO, least significant first; identifiers and times of the protocol most significant
 * first. Absent: security access, routines, transfer, periodic data, input/output control, communication control, events.
 * Any bytes may arrive. Owned by the caller, one thread, no allocation. */
#ifndef PSABENCH_CANOPEN_UDS_H
#define PSABENCH_CANOPEN_UDS_H

#include "base/sched.h"
#include "canopen/co_sdo.h"
#include "canopen/uds_did.h"

#define UDS_REQUEST_MAX  512u
#define UDS_READ_MAX     8u /* identifiers of one ReadDataByIdentifier */
#define UDS_RESPONSE_MAX (1u + UDS_READ_MAX * (2u + CO_SDO_BUFFER))
#define UDS_DTCS_MAX     16u
#define UDS_P2_NS        (50 * INT64_C(1000000)) /* P2 server: then responsePending; ISO 14229-2 */
#define UDS_P2_STAR_NS   (5 * NS_PER_S)          /* P2* server: as announced */
#define UDS_S3_NS        (5 * NS_PER_S)          /* S3 server; ISO 14229-2 */
#define UDS_ACCESS_NS    CO_SDO_TIMEOUT_NS       /* for an access of the owner, as over SDO; then generalReject */

/* Annex A.1 */
enum uds_nrc {
    UDS_NRC_GENERAL = 0x10,
    UDS_NRC_NO_SERVICE = 0x11,
    UDS_NRC_NO_SUB_FUNCTION = 0x12,
    UDS_NRC_LENGTH = 0x13,
    UDS_NRC_BUSY = 0x21,
    UDS_NRC_CONDITIONS = 0x22,
    UDS_NRC_OUT_OF_RANGE = 0x31,
    UDS_NRC_PENDING = 0x78,
    UDS_NRC_NOT_IN_SESSION = 0x7F
};

enum uds_session { UDS_SESSION_DEFAULT = 1, UDS_SESSION_EXTENDED = 3 };

enum { UDS_DTC_FAILED = 0x01, UDS_DTC_CONFIRMED = 0x08 }; /* statusOfDTC, D.2 */
struct uds_dtc {
    uint16_t code; /* of the EMCY; the low byte of the trouble code is 0 */
    uint8_t status;
};

struct uds_io {
    void *ctx;
    /* As in co_sdo_io; CO_PENDING: uds_answer() follows. */
    uint32_t (*read)(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns);
    uint32_t (*write)(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
    bool (*send)(void *ctx, const uint8_t *data, size_t len, int64_t t_ns); /* false: busy; else uds_done() follows */
    void (*reset)(void *ctx, int64_t t_ns);                                 /* of the node, which calls uds_reset() */
    unsigned (*dtcs)(void *ctx, struct uds_dtc out[UDS_DTCS_MAX]);
    void (*losses)(void *ctx, uint32_t *failed, uint32_t *ignored); /* of the transport: messages, frames */
};

enum uds_state { UDS_IDLE, UDS_WORKING, UDS_ANSWERING };

/* Read-only outside uds.c. */
struct uds {
    const struct co_od *od;
    const struct uds_dids *dids;
    struct uds_io io;
    struct sched *sched;
    enum uds_state state;
    enum uds_session session;
    struct sched_ev s3, p2;
    bool functional;   /* the request was for all servers */
    bool suppress;     /* no positive response */
    bool pending_sent; /* responsePending: a final response is owed */
    bool waiting;      /* the response waits for the transport */
    bool reset_due;    /* when the response is out */
    uint8_t request[UDS_REQUEST_MAX], response[UDS_RESPONSE_MAX], notice[3];
    size_t len, size; /* of request and response */
    size_t at;        /* next identifier of a read */
    uint16_t did;     /* of the access under way */
    const struct co_entry *entry;
    struct co_value value;
    uint32_t requests, negatives, busy, s3_timeouts;
};

void uds_init(struct uds *u, const struct co_od *od, const struct uds_dids *dids, const struct uds_io *io,
              struct sched *sched);

/* To the default session; drops the request under way without a response. Counters stay. */
void uds_reset(struct uds *u);

void uds_begun(struct uds *u);                /* a request has begun to come */
void uds_broken(struct uds *u, int64_t t_ns); /* and will not be complete */
void uds_request(struct uds *u, const uint8_t *data, size_t len, bool functional,
                 int64_t t_ns);             /* 1..UDS_REQUEST_MAX */
void uds_done(struct uds *u, int64_t t_ns); /* what was sent is out or lost */

/* Result of the pending access: CO_OK or an abort code; v (of a read) is copied. */
void uds_answer(struct uds *u, uint32_t abort, const struct co_value *v, int64_t t_ns);

#endif
