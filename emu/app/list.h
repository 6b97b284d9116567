/* What psa-emu prints about itself: profiles, scenarios and commands. */
#ifndef PSABENCH_APP_LIST_H
#define PSABENCH_APP_LIST_H

#include "command/args.h"

#include <stdio.h>

/* Two lines a profile of proto/profiles: its numbers, and what tells it apart, the first comment of its file. False with one line in why. */
bool list_profiles(FILE *out, char *why, size_t cap);

/* One line a scenario of proto/scenarios: its name and the first comment of its file. */
bool list_scenarios(FILE *out, char *why, size_t cap);

/* In Markdown: one table of commands; those of both ports; the SCPI headers, common ones first; the kinds of faults, where each
 * can be, which the chips and the controller of each type of board have, and its events. */
void list_table(FILE *out, const struct control_table *const *tables);
void list_commands(FILE *out);
void list_scpi(FILE *out);
void list_faults(FILE *out);

#endif
