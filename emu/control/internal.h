/* What the files of control/ share: errors of handlers, replies as a line of JSON, cycles on the bus of a board. */
#ifndef PSABENCH_CONTROL_INTERNAL_H
#define PSABENCH_CONTROL_INTERNAL_H

#include "command/error.h"
#include "control/control.h"

/* For handlers: notes the error for the reply; gives CONTROL_REJECTED. */
#define control_reject(c, code, ...)                                                                                   \
    ((void)control_reject_in(&(c)->error, (code), __VA_ARGS__), (enum control_outcome)CONTROL_REJECTED)

/* The same where the bench has written why. */
static inline enum control_outcome control_failed(struct control *c, const char *code)
{
    c->error.code = code;
    return CONTROL_REJECTED;
}

/* The reply, valid until the next one; takes over id and result (NULL: empty). Not ok: the error in c. */
const char *control_reply(struct control *c, cJSON *id, bool ok, cJSON *result, int64_t t_ns);

/* ---- cycles that commands have begun: their results, and the replies to who waits for them */

struct control_cycle *control_cycle_free(struct control *c); /* NULL: all are under way */

/* For board_cycle.done; ctx is the control_cycle: whoever waits for it is answered. */
void control_cycle_done(void *ctx, struct board_cycle *cycle, enum board_cycle_result r, int64_t t_ns);

/* The error of a cycle that the board rejects or that failed. */
enum control_outcome control_cycle_reject(struct control *c, const struct control_cycle *k, enum board_cycle_result r);

/* The reply to a cycle that is over, or was given up; its place is free then if it is over. Takes over id. */
const char *control_cycle_reply(struct control *c, struct control_cycle *k, cJSON *id, int64_t t_ns);

#endif
