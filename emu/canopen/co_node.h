/* CANopen-shaped node (CiA 301): NMT slave, boot-up and heartbeat, EMCY producer, SYNC consumer, SDO server, TPDOs.
 *
 * The node answers the communication objects itself (1001h, 1003h, 1017h, 1800h.., and every const entry) and passes the
 * rest to its owner. Identifiers follow the predefined connection set. On the bus it is two stations: services send by
 * priority, PDOs in order, so that the halves of a sample keep their order. Absent: RPDO, SDO client and block
 * transfer, TIME, LSS, node guarding, heartbeat consumer, SYNC producer and counter, PDO mapping by the host, RTR.
 * Owned by the caller, never moved after init, one thread, no allocation. */
#ifndef PSABENCH_CANOPEN_CO_NODE_H
#define PSABENCH_CANOPEN_CO_NODE_H

#include "base/can/can.h"
#include "base/sched.h"
#include "canopen/co_od.h"
#include "canopen/co_pdo.h"
#include "canopen/co_sdo.h"

#define CO_HISTORY    8u /* entries of 1003h */
#define CO_ERRORS_MAX 8u /* errors that may be active at once */

enum co_state { /* as the heartbeat says it */
                CO_INITIALISING = 0,
                CO_STOPPED = 4,
                CO_OPERATIONAL = 5,
                CO_PRE_OPERATIONAL = 127
};

enum co_event {
    CO_EV_STATE,      /* entered a state: see node->state */
    CO_EV_RESET_NODE, /* application to its defaults; communication follows */
    CO_EV_RESET_COMM
};

struct co_node_cfg {
    const char *name; /* kept by pointer */
    uint8_t id;       /* 1..127 */
    const struct co_od *od;
    unsigned tpdos; /* 1800h .. */
};

struct co_node_io {
    void *ctx;
    /* As in co_sdo_io: entries that the node does not answer itself. */
    uint32_t (*read)(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns);
    uint32_t (*write)(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
    void (*event)(void *ctx, enum co_event ev, int64_t t_ns);
    void (*sync)(void *ctx, int64_t t_ns); /* SYNC received in pre-operational or operational */
    /* A classic data frame of another node (a PDO), in any NMT state. May be NULL. */
    void (*rx_other)(void *ctx, const struct can_msg *m, int64_t t_ns);
};

/* A second protocol on the node's controller (uds_door.h). The functions may not be NULL. */
struct co_guest {
    void *ctx;
    bool (*rx)(void *ctx, const struct can_msg *m, int64_t t_ns);   /* base frames; true: its own, not the node's */
    void (*sent)(void *ctx, const struct can_msg *m, int64_t t_ns); /* a frame of the services has been on the bus */
    void (*reset)(void *ctx);                                       /* as the SDO server's: reset, stopped, unpowered */
    /* Result of an access, as co_sdo_answer(); true: its own ticket. */
    bool (*answer)(void *ctx, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns);
};

struct co_error {
    uint16_t code; /* 0: free */
    uint8_t reg;   /* bits of 1001h */
};

/* Read-only outside canopen. */
struct co_node {
    struct co_node_cfg cfg;
    struct co_node_io io;
    struct can_bus *bus;
    struct sched *sched;
    struct can_node services, stream;
    enum co_state state;
    struct co_sdo sdo;
    const struct co_guest *guest; /* NULL: none */
    struct co_pdo pdo[CO_TPDO_MAX];
    uint16_t heartbeat_ms;
    struct sched_ev heartbeat;
    struct co_error error[CO_ERRORS_MAX];
    uint32_t history[CO_HISTORY]; /* latest first */
    unsigned history_count;
    bool was_off; /* the controller has been off the bus */
    uint32_t syncs, malformed, pdo_inhibited;
    uint32_t pdo_lost; /* due at a SYNC, but the backlog was full */
};

void co_node_init(struct co_node *n, const struct co_node_cfg *cfg, const struct co_node_io *io, struct can_bus *bus,
                  struct sched *sched);

/* Attaches to the bus, sends boot-up, enters pre-operational. */
void co_node_power_up(struct co_node *n, int64_t t_ns);
void co_node_power_down(struct co_node *n);

/* Before power-up; kept by pointer. Without one nothing is asked at a frame. */
void co_node_add_guest(struct co_node *n, const struct co_guest *g);

/* A classic frame among the services. False: counted by the bus as not sent. */
bool co_node_send(struct co_node *n, uint32_t id, const uint8_t *data, uint8_t len, int64_t t_ns);

/* As the NMT command reset node. */
void co_node_reset(struct co_node *n, int64_t t_ns);

/* Result of an access that took time, with the ticket sdo.ticket had when it began: to the SDO server or the guest. */
void co_node_answer(struct co_node *n, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns);

/* An error begins: 1001h, 1003h, EMCY (not in stopped) with five bytes source and time in us. An active error is not
 * reported again. */
void co_node_error(struct co_node *n, uint16_t code, uint8_t reg, uint8_t source, int64_t t_ns);

uint8_t co_node_error_register(const struct co_node *n); /* object 1001h; 0: no error is active */

/* The error ends, if it was active; the last one to end sends EMCY 0000h. */
void co_node_error_end(struct co_node *n, uint16_t code, int64_t t_ns);

#endif
