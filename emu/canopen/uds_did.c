#include "canopen/uds_did.h"

const struct co_entry *uds_did_entry(const struct uds_dids *d, const struct co_od *od, uint16_t did)
{
    uint32_t abort = CO_OK;
    for (const struct uds_named *n = d->named; n < d->named + d->names; n++)
        if (n->did == did) return co_find(od, n->index, n->sub, &abort);
    for (const struct uds_window *w = d->window; w < d->window + d->windows; w++) {
        const unsigned at = (unsigned)did - w->did; /* before the window: beyond it */
        if (at >= w->count * UDS_DID_SUBS) continue;
        return co_find(od, (uint16_t)(w->index + at / UDS_DID_SUBS), (uint8_t)(at % UDS_DID_SUBS), &abort);
    }
    return NULL;
}
