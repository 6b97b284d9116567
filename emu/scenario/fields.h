/* Keys of a mapping as a table: from one table come the loader, the dump that gives the same bench again, the default
 * values and the reference in docs/scenarios.md.
 *
 * A row says where its value lies in the section's struct. A section may contain sections; a row without a key puts the
 * rows of another table beside its own. */
#ifndef PSABENCH_SCENARIO_FIELDS_H
#define PSABENCH_SCENARIO_FIELDS_H

#include "board/field.h"
#include "scenario/find.h"
#include "scenario/yaml_file.h"

#include <cjson/cJSON.h>

/* i-th row with a key; *offset is where its section's struct begins. NULL past the last. */
const struct field *yaml_row(const struct fields *t, size_t i, size_t *offset);

/* One value by its row; section is the struct that its offset counts from. */
typedef bool yaml_value_fn(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *section);
yaml_value_fn yaml_load_value;

/* A mapping: every key must be in the table and come once; keys that do not come keep their value. name is put before
 * the key in messages; "" for the outermost mapping. */
bool yaml_load(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct fields *t,
               void *section);

/* The same with a value function of one's own, and without a key that is read elsewhere (NULL: all are read). */
bool yaml_load_by(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct fields *t,
                  void *section, yaml_value_fn *load_value, const char *except);

/* Adds every key with its value. */
void yaml_dump(const struct fields *t, const void *section, cJSON *to);

/* The row's value; NULL for one that has none of its own. */
cJSON *yaml_dump_value(const struct field *d, const void *section);

/* Path of proto/FOLDER/NAME.yaml as find_proto() has it, for a value in f; the error has its line. */
bool yaml_find_proto(struct yaml_file *f, const struct yaml_node *node, const char *key, const char *folder,
                     const char *name, char path[FIND_PATH_MAX]);

/* A mapping or sequence as JSON, for arguments that somebody else checks: plain scalars that are numbers, true, false
 * or null become such. NULL, with the error in why, when it is deeper or longer than arguments may be. */
cJSON *yaml_json(struct yaml_file *f, const struct yaml_node *node);

/* "s" of turn_s, "" of a key without a unit. */
const char *yaml_unit(const char *key);

#endif
