/* ISO 15765-2 transport of one connection: messages of up to 4095 bytes over classic CAN frames, normal addressing.
 *
 * Half duplex: while a message goes out, an incoming one is ignored. One that begins while another comes ends that
 * (9.8.3). The owner puts frames on the bus and reports with isotp_sent() when one has been there; separation
 * time and timeouts run from then, in simulated time. Any bytes may arrive; what is ignored is counted. Clauses are of
 * ISO 15765-2:2016. Not modelled: CAN FD frames, the 32-bit length of a first frame (FC.OVFLW), FC.WAIT of our own. Owned
 * by the caller, one thread, no allocation. */
#ifndef PSABENCH_CANOPEN_ISOTP_H
#define PSABENCH_CANOPEN_ISOTP_H

#include "base/sched.h"

#include <stddef.h>

#define ISOTP_MAX        4095u    /* bytes of a message: 12 bits of length */
#define ISOTP_TIMEOUT_NS NS_PER_S /* N_As, N_Ar, N_Bs, N_Cr: 9.8 */
#define ISOTP_PADDING    0xCCu    /* of the bytes that a frame does not use: 10.4.2 */

enum isotp_result { /* N_Result */
                    ISOTP_OK,
                    ISOTP_TIMEOUT_A, /* a frame was not on the bus within N_As, N_Ar */
                    ISOTP_TIMEOUT_BS,
                    ISOTP_TIMEOUT_CR,
                    ISOTP_WRONG_SN,
                    ISOTP_INVALID_FS,
                    ISOTP_UNEXP_PDU,
                    ISOTP_BUFFER_OVFLW,
                    ISOTP_RESULTS
};

struct isotp_cfg {
    uint8_t *buffer;            /* of incoming messages */
    size_t size;                /* up to ISOTP_MAX; a longer message gets FC.OVFLW */
    uint8_t block_size, st_min; /* as our flow control has them */
};

struct isotp_io {
    void *ctx;
    void (*send)(void *ctx, const uint8_t frame[8], int64_t t_ns);
    void (*begun)(void *ctx, int64_t t_ns); /* a first frame has been accepted */
    /* A message, or why the one that had begun ends (data NULL). The data last until the next frame. */
    void (*received)(void *ctx, enum isotp_result r, const uint8_t *data, size_t len, int64_t t_ns);
    void (*done)(void *ctx, enum isotp_result r,
                 int64_t t_ns); /* with the message of isotp_send(); the last thing done */
};

enum isotp_tx { ISOTP_TX_IDLE, ISOTP_TX_SINGLE, ISOTP_TX_FIRST, ISOTP_TX_FLOW, ISOTP_TX_GAP, ISOTP_TX_CONSECUTIVE };
enum isotp_rx { ISOTP_RX_IDLE, ISOTP_RX_FLOW, ISOTP_RX_CONSECUTIVE };

/* Read-only outside isotp.c. */
struct isotp {
    struct isotp_cfg cfg;
    struct isotp_io io;
    struct sched *sched;
    struct {
        enum isotp_tx state;
        const uint8_t *data;
        size_t size, at;
        uint8_t sn;         /* of the next consecutive frame */
        uint8_t block_left; /* frames until the next flow control; 0: no limit */
        int64_t gap_ns;     /* separation time */
        uint8_t frame[8];   /* last one */
        struct sched_ev timer;
    } tx;
    struct {
        enum isotp_rx state;
        size_t size, at;
        uint8_t sn, block_left;
        struct sched_ev timer;
    } rx;
    uint32_t ignored;               /* frames of no form, or out of place */
    uint32_t failed[ISOTP_RESULTS]; /* messages in either direction, by reason */
};

void isotp_init(struct isotp *p, const struct isotp_cfg *cfg, const struct isotp_io *io, struct sched *sched);

/* Drops what is under way, without a report. Counters stay. */
void isotp_reset(struct isotp *p);

/* The data stay where they are until done. False: one is under way, or the length is not 1 to ISOTP_MAX. */
bool isotp_send(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns);

/* A frame of ours has been on the bus. */
void isotp_sent(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns);

/* Data of a frame from the peer. */
void isotp_frame(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns);

/* Payload of a single frame, the only kind with a functional address; NULL: it is none. Pure. */
const uint8_t *isotp_single(const uint8_t *data, size_t len, size_t *n);

#endif
