/* What psa-emu prints about itself: profiles, scenarios and commands. */
#ifndef PSABENCH_APP_LIST_H
#define PSABENCH_APP_LIST_H

#include "command/args.h"

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

#endif
