/* What the files of readings share. */
#ifndef PSABENCH_TELEMETRY_LCM_BOARD_H
#define PSABENCH_TELEMETRY_LCM_BOARD_H

#include "telemetry/lcm_feed.h"

#include <string.h>

typedef void lcm_take_fn(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns);

/* A message of a board. */
struct lcm_row {
    uint32_t base; /* its identifier at node 0 */
    uint8_t len;
    lcm_take_fn *take;
};

/* Keeps frame `part` of a reading that has several; out of its turn it is dropped with those before it. */
static inline void lcm_reading_keep(struct lcm_unit *u, unsigned part, const struct can_msg *m)
{
    u->parts = part == 0 || u->parts == part ? part + 1 : 0;
    if (u->parts) memcpy(u->part[part], m->data, sizeof u->part[part]);
}

/* The last frame came: whether the `parts` before it are there. A new reading begins. */
static inline bool lcm_reading_complete(struct lcm_unit *u, unsigned parts)
{
    const bool complete = u->parts == parts;
    u->parts = 0;
    return complete;
}

/* The generated structs have char * for a text that they only read. */
static inline char *lcm_text(const char *text)
{
    union {
        const char *read;
        char *generated;
    } u = {.read = text};
    return u.generated;
}

#endif
