/* What psa-emu prints about itself: profiles, scenarios and commands; as tables for people, or as JSON. */
#ifndef PSABENCH_APP_LIST_H
#define PSABENCH_APP_LIST_H

#include "app/options.h"
#include "fault/fault.h"

#include <stdio.h>

/* The files of a folder of proto. Two lines for each of "profiles": its numbers, and what distinguishes it, the first comment of
 * its file; one for each of "scenarios": its name and the comment. False with one line in why. */
bool list_files(FILE *out, const char *proto_folder, char *why, size_t cap);

/* In Markdown: one table of commands; those of both ports; the SCPI headers, common ones first; the kinds of faults, where each
 * can be, which the chips and the controller of each type of board have, and its events. */
void list_table(FILE *out, const struct control_table *const *tables);
void list_commands(FILE *out);
void list_scpi(FILE *out);
void list_faults(FILE *out);

/* Whether the part of the board has the kind of fault. */
bool list_part_has(const struct board_type *t, const struct board_part *p, const struct fault_kind *k);

/* First sentence of the comment that a file begins with, as far as it is on the first line: what the file is. */
void list_comment(const char *path, char *text, size_t cap);

/* The same as one document: what the action, one of OPTIONS_LIST_*, lists. NULL with one line in why. */
cJSON *list_json(enum options_action action, char *why, size_t cap);

#endif
