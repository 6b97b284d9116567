/* UDS door of a node: a server (uds.h) behind a transport (isotp.h) on the node's CAN controller, beside its SDO server.
 *
 * Identifiers of ISO 15765-4, 11 bits: 7DFh + ECU physical and 7DFh functional requests, 7E7h + ECU responses; ECU 1 is 7E0h
 * and 7E8h. ECU 5 and 6 would use 7E4h and 7E5h, which CiA 305 reserves. Both servers access the same objects; one access
 * that takes time is under way at once, the other server's is rejected (22h, 08000022h). The door is open in pre-operational
 * and operational, as SDO is. Owned by the caller, never moved after init, one thread, no allocation. */
#ifndef PSABENCH_CANOPEN_UDS_DOOR_H
#define PSABENCH_CANOPEN_UDS_DOOR_H

#include "canopen/co_node.h"
#include "canopen/isotp.h"
#include "canopen/uds.h"

#define UDS_ECU_MAX 4u /* 1..: on one bus */

/* Read-only outside uds_door.c. */
struct uds_door {
    struct co_guest guest;
    struct co_node *node;
    uint8_t ecu;
    struct isotp transport;
    struct uds server;
    bool pending;     /* an access is under way */
    uint32_t ticket;  /* its own */
    uint32_t refused; /* frames to the door that are no classic data frames, or no single frames to all */
    uint8_t request[UDS_REQUEST_MAX];
};

/* Before the node's power-up; the node has been initialised. */
void uds_door_init(struct uds_door *d, uint8_t ecu, const struct uds_dids *dids, struct co_node *node);

#endif
