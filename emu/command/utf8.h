/* Whether bytes are UTF-8 (Unicode 15, table 3-7: no overlong forms, no surrogates, nothing above U+10FFFF), as JSON must be. */
#ifndef PSABENCH_COMMAND_UTF8_H
#define PSABENCH_COMMAND_UTF8_H

#include <stdbool.h>

bool utf8_valid(const char *text);

/* Puts a question mark in the place of each byte that is in no character: of a text that was cut. */
void utf8_clean(char *text);

#endif
