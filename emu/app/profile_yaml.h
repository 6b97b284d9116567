/* Board profiles from YAML: proto/profiles/NAME.yaml, field by field through psa2_profile_set(), then checked. */
#ifndef PSABENCH_APP_PROFILE_YAML_H
#define PSABENCH_APP_PROFILE_YAML_H

#include "app/yaml_file.h"
#include "board/psa2_profile.h"

#include <cjson/cJSON.h>

/* False with one line in why: file:line:column: key: what is wrong, what would be right. */
bool profile_yaml_load(const char *path, struct psa2_profile *p, char *why, size_t cap);

/* The same fields in a mapping of another file (a scenario that changes a profile), and the check of the whole. */
bool profile_yaml_fields(struct yaml_file *f, const struct yaml_node *mapping, struct psa2_profile *p);
bool profile_yaml_check(struct yaml_file *f, const struct yaml_node *mapping, const struct psa2_profile *p);

/* Every field, as a mapping that profile_yaml_fields() reads. */
cJSON *profile_dump(const struct psa2_profile *p);

/* One field of it. */
cJSON *profile_dump_field(const struct psa2_profile *p, const struct psa2_field *d);

#endif
