/* Why something was refused: one line for the user. What, where, what would be right. */
#ifndef PSABENCH_BASE_WHY_H
#define PSABENCH_BASE_WHY_H

#include <stdbool.h>
#include <stddef.h>

/* Writes the line and returns false. */
__attribute__((format(printf, 3, 4))) bool why_fail(char *why, size_t cap, const char *format, ...);

#endif
