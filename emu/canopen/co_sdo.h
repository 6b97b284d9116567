/* SDO server: expedited and segmented transfer of one object at a time (CiA 301, 7.2.4). No block transfer.
 *
 * The owner answers accesses to entries whose rights have been checked. An access that takes time returns CO_PENDING;
 * the owner keeps the server's ticket and hands in the result with co_sdo_answer(). A client that begins a new
 * transfer in the meantime aborts the old one: its answer is dropped. Any bytes may arrive. Owned by the caller, one
 * thread, no allocation. */
#ifndef PSABENCH_CANOPEN_CO_SDO_H
#define PSABENCH_CANOPEN_CO_SDO_H

#include "base/sched.h"
#include "canopen/co_od.h"

#define CO_SDO_TIMEOUT_NS NS_PER_S /* between segments, and for a pending access: then 05040000h */
#define CO_SDO_BUFFER     (CO_TEXT_MAX + 1u)

struct co_sdo_io {
    void *ctx;
    /* CO_OK with the value filled in, CO_PENDING, or an abort code. */
    uint32_t (*read)(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns);
    uint32_t (*write)(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
    void (*send)(void *ctx, const uint8_t frame[8], int64_t t_ns);
};

enum co_sdo_state { CO_SDO_IDLE, CO_SDO_DOWNLOAD, CO_SDO_UPLOAD, CO_SDO_READING, CO_SDO_WRITING };

/* Read-only outside co_sdo.c. */
struct co_sdo {
    const struct co_od *od;
    struct co_sdo_io io;
    struct sched *sched;
    struct sched_ev timeout;
    enum co_sdo_state state;
    uint32_t ticket; /* of the transfer under way: changes when it is aborted */
    uint16_t index;  /* of the request */
    uint8_t sub;
    const struct co_entry *entry;
    bool toggle;        /* expected next */
    bool expedited;     /* form of the write under way, and of its answer */
    uint16_t size, at;  /* bytes in the buffer, and how many of them have gone up */
    uint32_t announced; /* length given by the client; 0: none */
    uint8_t buffer[CO_SDO_BUFFER];
    struct co_value value; /* scratch of the access under way */
    uint32_t requests, aborts, timeouts, malformed;
};

void co_sdo_init(struct co_sdo *s, const struct co_od *od, const struct co_sdo_io *io, struct sched *sched);

/* Drops the transfer under way without an answer. Counters stay. */
void co_sdo_reset(struct co_sdo *s);

/* Data of a frame to the server. */
void co_sdo_request(struct co_sdo *s, const uint8_t *data, size_t len, int64_t t_ns);

/* Result of a pending access: CO_OK or an abort code; v (of a read, else NULL) is copied. An old ticket is ignored. */
void co_sdo_answer(struct co_sdo *s, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns);

#endif
