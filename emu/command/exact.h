/* Numbers in JSON that read back as the very same double.
 *
 * cJSON prints 15 digits where they differ from the value by no more than a unit in the last place; a journal, or a scenario
 * that is to give the same bytes again, needs that unit. */
#ifndef PSABENCH_COMMAND_EXACT_H
#define PSABENCH_COMMAND_EXACT_H

#include <cjson/cJSON.h>
#include <stddef.h>

#define EXACT_MAX 32u

/* The shortest of 15 to 17 digits that read back as x; "null" for what JSON cannot say (infinities, NaN). */
void exact_number(double x, char out[EXACT_MAX]);

/* The tree as one line of JSON; its numbers become raw text, so it is good for nothing but printing and deleting afterwards.
 * The caller free()s the line; NULL: no memory. */
char *exact_line(cJSON *tree);

#endif
