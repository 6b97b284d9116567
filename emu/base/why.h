/* Why something failed: one line for the user. */
#ifndef PSABENCH_BASE_WHY_H
#define PSABENCH_BASE_WHY_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>

/* Writes the line and returns false. */
__attribute__((format(printf, 3, 4))) bool why_fail(char *why, size_t cap, const char *format, ...);

/* The form of all errors about an input, `<where>: expected <what>, got <got>`; got NULL: without the last part. False. */
__attribute__((format(printf, 5, 6))) bool why_expected(char *why, size_t cap, const char *where, const char *got,
                                                        const char *expected, ...);
bool why_vexpected(char *why, size_t cap, const char *where, const char *got, const char *expected, va_list ap);

/* What there is at a path or a port, by an error of errno: "no such file"; any other error in the system's words. */
const char *why_found(int err);

/* Whether an error of a file lies with the machine (no space, descriptors or memory; a failing disk) or else with the path
 * that the user gave. */
bool why_machine(int err);

/* A file, a socket or a link that could not be made, a port that could not be listened at. False. */
bool why_unwritable(char *why, size_t cap, const char *where, int err);
bool why_port(char *why, size_t cap, const char *where, int err);

/* What was got: a text in quotes, cut where it is long; a number. They live as long as the block they are in. */
#define WHY_TEXT(text) why_text((char[WHY_TEXT_MAX]){0}, (text))
#define WHY_REAL(x)    why_real((char[WHY_REAL_MAX]){0}, (x))

enum { WHY_TEXT_MAX = 88, WHY_REAL_MAX = 32 };
const char *why_text(char out[WHY_TEXT_MAX], const char *text);
const char *why_real(char out[WHY_REAL_MAX], double x);

/* Appends a word to a list with commas. */
void why_list_add(char *list, size_t cap, const char *word);

#endif
