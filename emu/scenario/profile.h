/* Board profiles from YAML: proto/profiles/NAME.yaml, field by field through field_set(), then checked.
 *
 * A file says of which board it is: `board: psd1`, `board: pik5`; without that key it is a PSA-2. */
#ifndef PSABENCH_SCENARIO_PROFILE_H
#define PSABENCH_SCENARIO_PROFILE_H

#include "scenario/fields.h"
#include "unit/boards.h"

/* The default of the board's type, then what the file says. *board: the file's, of which type *p is; whether it is the one that
 * is expected is the caller's decision, board_name_takes(). False with one line in why: path:line:column: what is wrong, what is
 * known. */
bool profile_yaml_load(const char *path, const struct board_name **board, union board_profile_store *p, char *why,
                       size_t cap);

/* The names of all boards: "psa2, psd1 or pmka". */
void profile_yaml_boards(char *known, size_t cap);

/* The same in two steps, of a mapping in a file that is open: its keys into the profile, and whether a board can run it. */
bool profile_yaml_fields(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                         void *profile);
bool profile_yaml_check(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                        const void *profile);

#endif
