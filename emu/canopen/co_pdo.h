/* Transmit PDOs of a node: COB-ID, validity, transmission type, inhibit time (1800h..; CiA 301, 7.2.2 and 7.5.2.35).
 *
 * The content is the owner's. A PDO is sent if the owner has selected it and the host has not switched it off: bit 31 of
 * the COB-ID shows both. Types 254 and 255: each time content is offered, unless the inhibit time has not elapsed
 * (counted, and not sent later: the next content is a new sample). Types 0 and 1..240: the latest content at SYNC. */
#ifndef PSABENCH_CANOPEN_CO_PDO_H
#define PSABENCH_CANOPEN_CO_PDO_H

#include "base/can/can.h"
#include "canopen/co_od.h"

#define CO_TPDO_MAX    9u
#define CO_PDO_BACKLOG 16u /* frames that may wait for the bus */

struct co_node;

struct co_pdo {
    uint16_t cob;
    bool off;      /* by the host */
    bool selected; /* by the owner */
    uint8_t type;
    uint16_t inhibit_100us;
    int64_t next_ns;       /* not before */
    uint8_t syncs;         /* since it was sent */
    bool fresh;            /* latest has not been sent */
    struct can_msg latest; /* len 0 and not fresh: nothing yet */
};

enum co_pdo_result { CO_PDO_SENT, CO_PDO_HELD, CO_PDO_INHIBITED, CO_PDO_OFF, CO_PDO_FULL };

/* To the defaults of the object dictionary; selection stays. */
void co_pdo_reset(struct co_node *n);

/* Selects the TPDOs of the application: bit k is TPDO k + 1. */
void co_pdo_select(struct co_node *n, unsigned mask);

/* As the host does by bit 31 of the COB-ID: those of the mask, from now to the next reset. */
void co_pdo_switch_off(struct co_node *n, unsigned mask);

/* Whether TPDO k would be sent each time content is offered, inhibit time aside. */
bool co_pdo_flows(const struct co_node *n, unsigned k);

/* New content of TPDO k in m->data, len and flags; the identifier is filled in. Sent in state operational only. */
enum co_pdo_result co_pdo_offer(struct co_node *n, unsigned k, struct can_msg *m, int64_t t_ns);

/* Whether `frames` more fit into the backlog. */
bool co_pdo_room(const struct co_node *n, unsigned frames);

void co_pdo_sync(struct co_node *n, int64_t t_ns);

/* Objects 1800h..: CO_AB_NO_OBJECT for others. */
uint32_t co_pdo_read(const struct co_node *n, const struct co_entry *e, struct co_value *v);
uint32_t co_pdo_write(struct co_node *n, const struct co_entry *e, const struct co_value *v);

#endif
