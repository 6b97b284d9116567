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

/* The board that a file or a unit names by its key `board`, psa2 without it; NULL with the error in f, which lists all names. */
const struct board_name *profile_yaml_board(struct yaml_file *f, const struct yaml_node *mapping);

/* The same in two steps, of a mapping in a file that is open: its values by yaml_load_by(), and whether a board can run it. */
yaml_value_fn profile_yaml_value;
bool profile_yaml_check(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                        const void *profile);

#endif
