/* Errors of commands: a code for programs, a line for people. */
#ifndef PSABENCH_COMMAND_ERROR_H
#define PSABENCH_COMMAND_ERROR_H

#include "base/why.h"
#include "command/command.h"

/* Writes down the error and returns false. */
__attribute__((format(printf, 3, 4))) bool control_reject_in(struct control_error *r, const char *code,
                                                             const char *format, ...);

/* The same with a line of why_expected(). */
__attribute__((format(printf, 5, 6))) bool control_expected(struct control_error *r, const char *code,
                                                            const char *where, const char *got, const char *expected,
                                                            ...);

#endif
