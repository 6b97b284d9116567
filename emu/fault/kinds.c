/* The tables of kinds of faults, one of each layer: a new table is named here, a new kind is a row of its layer's file. */
#include "fault/internal.h"

#include <string.h>

const struct fault_table *const fault_tables[] = {&fault_sensor,     &fault_analog,   &fault_chip,
                                                  &fault_controller, &fault_line,     &fault_link,
                                                  &fault_supply,     &fault_platform, NULL};

const struct fault_kind *fault_kind(unsigned i)
{
    for (unsigned t = 0; fault_tables[t]; t++) {
        if (i < fault_tables[t]->count) return &fault_tables[t]->kind[i];
        i -= fault_tables[t]->count;
    }
    return NULL;
}

const struct fault_kind *fault_kind_find(const char *name)
{
    const struct fault_kind *k;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (strcmp(k->name, name) == 0) return k;
    }
    return NULL;
}
