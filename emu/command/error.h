/* Errors of commands: a code for programs, a line for people. */
#ifndef PSABENCH_COMMAND_ERROR_H
#define PSABENCH_COMMAND_ERROR_H

#include "command/command.h"

/* Writes down the error and returns false. */
__attribute__((format(printf, 3, 4))) bool control_refuse_in(struct control_refusal *r, const char *code,
                                                             const char *format, ...);

/* Appends a word to a list with commas. */
void control_list_add(char *list, size_t cap, const char *word);

#endif
