/* One struct per device of generated const tables, from proto/<device>.yaml. Pure. */
#ifndef PSABENCH_CANOPEN_CO_DEVICE_H
#define PSABENCH_CANOPEN_CO_DEVICE_H

#include "canopen/co_od.h"

struct co_device {
    const struct co_od *od;
    unsigned tpdos;
    const uint8_t *tpdo_len; /* bytes of each, classic frames */
    unsigned tpdo_off;       /* bit k: TPDO k + 1 is not sent until the host switches it on */
    const char *const *counters;
    unsigned counter_count;
    uint8_t counter_sub; /* sub-index of the first of them in 2030h; the others follow */
};

#endif
