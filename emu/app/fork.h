/* fork(2) of a running emulator: the child has the whole bench in memory and goes on from the same instant.
 *
 * It gives up all that the parent has open: programs on the parent's buses stay the parent's, in the child detached clients send what
 * they had queued. It opens the endpoints it was given, and ends with its own `quit` or SIGTERM, whatever becomes of the
 * parent. Its files are not the parent's: a recording goes on in the parent alone. */
#ifndef PSABENCH_APP_FORK_H
#define PSABENCH_APP_FORK_H

#include "app/service.h"

/* In the parent: adds pid and endpoints to result and returns true, or false with a sentence in why[CONTROL_WHY_MAX]. The
 * child does not return. */
bool fork_service(struct service *s, const struct control_fork *f, cJSON *result, char *why);

#endif
