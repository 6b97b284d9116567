/* Data identifiers of UDS for objects of a dictionary. Windows: DID = did + 40h * (index - first) + sub-index; names: the
 * identification that ISO 14229-1:2013, table C.1, gives a number of its own. Both tables: proto/uds.yaml. Pure. */
#ifndef PSABENCH_CANOPEN_UDS_DID_H
#define PSABENCH_CANOPEN_UDS_DID_H

#include "canopen/co_od.h"

#define UDS_DID_SUBS 64u /* identifiers an index */

struct uds_window {
    uint16_t did, index; /* of the first object */
    uint16_t count;      /* objects */
};

struct uds_named {
    uint16_t did, index;
    uint8_t sub;
};

struct uds_dids {
    const struct uds_window *window;
    unsigned windows;
    const struct uds_named *named;
    unsigned names;
};

/* The entry, or NULL: no identifier, or this dictionary has no such object. */
const struct co_entry *uds_did_entry(const struct uds_dids *d, const struct co_od *od, uint16_t did);

#endif
