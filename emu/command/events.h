/* Names of the events of boards: each type has its own list (board_type.events). */
#ifndef PSABENCH_COMMAND_EVENTS_H
#define PSABENCH_COMMAND_EVENTS_H

#include "command/command.h"

/* The i-th name that any type of board has, each once; NULL past the last. */
const char *control_event(unsigned i);

/* Number among the events of the unit's board; false with the error, which lists that board's events. */
bool control_event_find(const struct control_bench *b, unsigned unit, const char *arg, const char *name,
                        unsigned *event, struct control_error *why);

#endif
