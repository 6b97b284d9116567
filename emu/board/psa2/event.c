#include "board/psa2/event.h"

#include <stddef.h>
#include <string.h>

const char *const psa2_events[PSA2_EVENTS] = {
    [PSA2_EV_RES] = "RES",           [PSA2_EV_SETUP_DONE] = "SETUP_DONE", [PSA2_EV_SYNC_A] = "SYNC_A",
    [PSA2_EV_SYNC_T] = "SYNC_T",     [PSA2_EV_DRD_A] = "DRD_A",           [PSA2_EV_DRD_T] = "DRD_T",
    [PSA2_EV_INT_FALL] = "INT_FALL", [PSA2_EV_INT_RISE] = "INT_RISE",     [PSA2_EV_POWER_DOWN] = "POWER_DOWN",
    [PSA2_EV_POWER_UP] = "POWER_UP",
};

const char *psa2_event_name(enum psa2_event e)
{
    return (unsigned)e < PSA2_EVENTS ? psa2_events[e] : NULL;
}

int psa2_event_find(const char *name)
{
    for (unsigned i = 0; i < PSA2_EVENTS; i++)
        if (strcmp(psa2_events[i], name) == 0) return (int)i;
    return -1;
}
