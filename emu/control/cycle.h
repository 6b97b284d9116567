/* Cycles on the parallel bus of a board that commands have begun: their results, and the replies to who waits for them. */
#ifndef PSABENCH_CONTROL_CYCLE_H
#define PSABENCH_CONTROL_CYCLE_H

#include "control/control.h"

struct control_cycle *control_cycle_free(struct control *c); /* NULL: all are under way */

/* For board_cycle.done; ctx is the control_cycle: whoever waits for it is answered. */
void control_cycle_done(void *ctx, struct board_cycle *cycle, enum board_cycle_result r, int64_t t_ns);

/* The error of a cycle that the board rejects or that failed. */
enum control_outcome control_cycle_reject(struct control *c, const struct control_cycle *k, enum board_cycle_result r);

/* The reply to a cycle that is over, or was given up; its place is free then if it is over. Takes over id. */
const char *control_cycle_reply(struct control *c, struct control_cycle *k, cJSON *id, int64_t t_ns);

#endif
