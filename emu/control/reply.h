/* Errors of handlers, and replies as a line of JSON. */
#ifndef PSABENCH_CONTROL_REPLY_H
#define PSABENCH_CONTROL_REPLY_H

#include "control/control.h"

/* For handlers: remembers why; returns CONTROL_REFUSED. */
__attribute__((format(printf, 3, 4))) enum control_outcome control_reject(struct control *c, const char *code,
                                                                          const char *format, ...);

/* The reply, valid until the next one; takes over id and result (NULL: empty). Not ok: the error in c. */
const char *control_reply(struct control *c, cJSON *id, bool ok, cJSON *result, int64_t t_ns);

#endif
