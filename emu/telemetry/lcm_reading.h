/* Readings of the boards out of their frames: one message type a board. */
#ifndef PSABENCH_TELEMETRY_LCM_READING_H
#define PSABENCH_TELEMETRY_LCM_READING_H

#include "telemetry/lcm_feed.h"

/* How frames of a board are read, by its name ("psa2"); NULL: this board has no type in proto/lcm. */
const struct lcm_board *lcm_board_of(const char *name);

/* What begins the channels of its readings: "PSABENCH_PSA2_". */
const char *lcm_board_channel(const struct lcm_board *b);

/* A data frame with an 11-bit identifier of the unit's node: publishes the reading that it completes. */
void lcm_reading_take(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns);

#endif
