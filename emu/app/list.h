/* What psa-emu prints about itself: profiles, scenarios and commands. */
#ifndef PSABENCH_APP_LIST_H
#define PSABENCH_APP_LIST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* Two lines a profile of proto/profiles: its numbers, and what tells it apart, the first comment of its file. False with one line in why. */
bool list_profiles(FILE *out, char *why, size_t cap);

/* One line a scenario of proto/scenarios: its name and the first comment of its file. */
bool list_scenarios(FILE *out, char *why, size_t cap);

/* The command tables in Markdown. */
void list_commands(FILE *out);

#endif
