/* What the files of readings share. */
#ifndef PSABENCH_TELEMETRY_LCM_BOARD_H
#define PSABENCH_TELEMETRY_LCM_BOARD_H

#include "telemetry/lcm_feed.h"

typedef void lcm_take_fn(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns);

/* A message of a board. */
struct lcm_row {
    uint32_t base; /* its identifier at node 0 */
    uint8_t len;
    lcm_take_fn *take;
};

/* A PSA-2 in its four frame forms: lcm_psa2.c. */
lcm_take_fn lcm_psa2_take_zt, lcm_psa2_take_fast, lcm_psa2_take_frame, lcm_psa2_take_block;

/* Keeps frame `part` of a reading that has several; out of its turn it is dropped with those before it. */
void lcm_reading_keep(struct lcm_unit *u, unsigned part, const struct can_msg *m);

/* The last frame came: whether the `parts` before it are there. A new reading begins. */
bool lcm_reading_complete(struct lcm_unit *u, unsigned parts);

/* The generated structs have char * for a text that they only read. */
char *lcm_text(const char *text);

#endif
