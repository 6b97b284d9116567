#include "scenario/profile.h"

#include "base/why.h"

#include <stdio.h>
#include <string.h>

enum { WHY = 512 };

static bool set_element(struct yaml_file *f, const struct yaml_node *node, const struct field *d, unsigned index,
                        void *profile)
{
    char why[WHY];
    const char *text = yaml_scalar(node);
    if (!text) return yaml_file_expected(f, node, d->key, "one value of up to %u characters", YAML_FILE_TEXT);
    if (field_set(d, profile, index, text, why, sizeof why)) return true;
    /* The setter names the key itself; the line is ours to add. */
    return yaml_file_fail(f, node, NULL, "%s", why);
}

/* One value for every element. */
static bool set_each(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *profile)
{
    for (unsigned i = 0; i < d->count; i++)
        if (!set_element(f, node, d, i, profile)) return false;
    return true;
}

bool profile_yaml_value(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *profile)
{
    unsigned index = 0;
    if (!field_is_list(d)) return set_element(f, node, d, 0, profile);
    if (d->type == FIELD_EACH && node->kind == YAML_SCALAR) return set_each(f, node, d, profile);
    if (node->kind != YAML_SEQUENCE) return yaml_file_expected(f, node, d->key, "a list (%s)", d->what);
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!set_element(f, i->value, d, index++, profile)) return false;
    if (d->count && index != d->count)
        return yaml_file_fail(f, node, d->key, "expected %u elements, got %u", d->count, index);
    return index > 0 || yaml_file_fail(f, node, d->key, "expected at least one element, got none");
}

/* Node of the key that a sentence of the check begins with, or the mapping: so that the message has its line. */
static const struct yaml_node *find_blamed(const struct yaml_node *mapping, const char *sentence)
{
    const size_t len = strcspn(sentence, " :=,");
    for (const struct yaml_item *i = mapping->first; i; i = i->next) {
        const char *key = yaml_scalar(i->key);
        if (key && strlen(key) == len && strncmp(key, sentence, len) == 0) return i->key;
    }
    return mapping;
}

bool profile_yaml_check(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                        const void *profile)
{
    char why[WHY];
    if (type->profile_check(profile, why, sizeof why)) return true;
    return yaml_file_fail(f, find_blamed(mapping, why), NULL, "%s", why);
}

const struct board_name *profile_yaml_board(struct yaml_file *f, const struct yaml_node *mapping)
{
    char known[160] = "";
    const struct yaml_node *node = yaml_get(mapping, "board");
    const char *name = node ? yaml_scalar(node) : board_names[0].name;
    const struct board_name *found = name ? board_name_find(name) : NULL;
    for (const struct board_name *n = board_names; !found && n->name; n++) {
        const size_t at = strlen(known);
        snprintf(known + at, sizeof known - at, "%s%s", !at ? "" : n[1].name ? ", " : " or ", n->name);
    }
    if (!found) (void)yaml_file_expected(f, node, "board", "%s", known);
    return found;
}

bool profile_yaml_load(const char *path, const struct board_name **board, union board_profile_store *p, char *why,
                       size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_open(&f, path, why, cap)) return false;
    *board = profile_yaml_board(&f, f.root);
    bool ok = *board != NULL;
    if (ok) {
        const struct board_type *type = (*board)->type;
        fields_default(type->fields, p);
        ok = yaml_load_by(&f, f.root, "", type->fields, p, profile_yaml_value, "board") &&
             profile_yaml_check(&f, f.root, type, p);
    }
    yaml_file_close(&f);
    return ok;
}
