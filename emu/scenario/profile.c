#include "scenario/profile.h"

#include "base/why.h"

#include <stdio.h>
#include <string.h>

enum { WHY = 512, FIELDS_MAX = 256 };

/* A mapping under way. */
struct fill {
    const struct board_type *type;
    void *profile;
    bool seen[FIELDS_MAX];
};

static bool set_field(struct yaml_file *f, const struct yaml_node *node, const char *key, unsigned index,
                      const struct fill *fill)
{
    char why[WHY];
    const struct board_type *t = fill->type;
    const char *text = yaml_scalar(node);
    if (!text) return yaml_file_expected(f, node, key, "one value of up to %u characters", YAML_FILE_TEXT);
    if (board_field_set(t->fields, t->field_count, fill->profile, key, index, text, why, sizeof why)) return true;
    /* The setter names the key itself; the line is ours to add. */
    return yaml_file_fail(f, node, NULL, "%s", why);
}

static bool set_sequence(struct yaml_file *f, const struct yaml_node *node, const struct board_field *field,
                         const struct fill *fill)
{
    unsigned index = 0;
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!set_field(f, i->value, field->key, index++, fill)) return false;
    if (field->count && index != field->count)
        return yaml_file_fail(f, node, field->key, "expected %u elements, got %u", field->count, index);
    return index > 0 || yaml_file_fail(f, node, field->key, "expected at least one element, got none");
}

static const char *key_at(const void *ctx, size_t i)
{
    const struct board_type *t = ctx;
    return i < t->field_count ? t->fields[i].key : NULL;
}

static bool load_pair(struct yaml_file *f, const struct yaml_item *pair, struct fill *fill)
{
    const char *key = yaml_scalar(pair->key);
    if (!key) return yaml_file_expected(f, pair->key, NULL, "a key of one word");
    const struct board_field *field = board_field_find(fill->type->fields, fill->type->field_count, key);
    if (!field) return yaml_fail_unknown(f, pair->key, key_at, fill->type);
    bool *seen = &fill->seen[field - fill->type->fields];
    if (*seen) return yaml_file_fail(f, pair->key, key, "expected the key once, got it twice");
    *seen = true;
    if (!board_field_is_list(field)) return set_field(f, pair->value, key, 0, fill);
    if (pair->value->kind != YAML_SEQUENCE) return yaml_file_expected(f, pair->value, key, "a list (%s)", field->what);
    return set_sequence(f, pair->value, field, fill);
}

/* Of a file, whose key `board` is not the profile's; of a mapping in a scenario, if not. */
static bool load_fields(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                        void *profile, bool file)
{
    struct fill fill = {.type = type, .profile = profile};
    if (mapping->kind != YAML_MAPPING) return yaml_file_expected(f, mapping, NULL, "a mapping `key: value`");
    for (const struct yaml_item *i = mapping->first; i; i = i->next) {
        const char *key = yaml_scalar(i->key);
        if (file && key && strcmp(key, "board") == 0) continue;
        if (!load_pair(f, i, &fill)) return false;
    }
    return true;
}

bool profile_yaml_fields(struct yaml_file *f, const struct yaml_node *mapping, const struct board_type *type,
                         void *profile)
{
    return load_fields(f, mapping, type, profile, false);
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

void profile_yaml_boards(char *known, size_t cap)
{
    known[0] = '\0';
    for (const struct board_name *n = board_names; n->name; n++) {
        const size_t at = strlen(known);
        snprintf(known + at, cap - at, "%s%s", !at ? "" : n[1].name ? ", " : " or ", n->name);
    }
}

/* The board that a file names; NULL with its line in why. */
static const struct board_name *find_board(struct yaml_file *f)
{
    char known[160];
    const struct yaml_node *node = f->root->kind == YAML_MAPPING ? yaml_get(f->root, "board") : NULL;
    const char *name = node ? yaml_scalar(node) : board_names[0].name;
    const struct board_name *found = name ? board_name_find(name) : NULL;
    profile_yaml_boards(known, sizeof known);
    if (!found) (void)yaml_file_expected(f, node, "board", "%s", known);
    return found;
}

bool profile_yaml_load(const char *path, const struct board_name **board, union board_profile_store *p, char *why,
                       size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_open(&f, path, why, cap)) return false;
    *board = find_board(&f);
    bool ok = *board != NULL;
    if (ok) {
        const struct board_type *type = (*board)->type;
        memset(p, 0, sizeof *p);
        type->profile_default(p);
        ok = load_fields(&f, f.root, type, p, true) && profile_yaml_check(&f, f.root, type, p);
    }
    yaml_file_close(&f);
    return ok;
}

/* ---- the way back */

struct yaml_field profile_yaml_field(const struct board_field *d)
{
    static const enum yaml_type types[] = {
        [BOARD_FIELD_STRING] = YAML_TEXT, [BOARD_FIELD_UINT] = YAML_U32,      [BOARD_FIELD_REAL] = YAML_REAL,
        [BOARD_FIELD_BOOL] = YAML_BOOL,   [BOARD_FIELD_CHOICE] = YAML_CHOICE, [BOARD_FIELD_REALS] = YAML_REALS,
        [BOARD_FIELD_LIST] = YAML_CUSTOM};
    return (struct yaml_field){.key = d->key,
                               .type = types[d->type],
                               .offset = d->offset,
                               .min = d->min,
                               .max = d->max,
                               .what = d->what,
                               .choices = d->choices,
                               .count = d->count};
}

cJSON *profile_dump_field(const struct board_field *d, const void *profile)
{
    char text[128];
    const struct yaml_field row = profile_yaml_field(d);
    if (d->type != BOARD_FIELD_LIST) return yaml_dump_value(&row, profile);
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; d->text(profile, i, text, sizeof text); i++)
        cJSON_AddItemToArray(list, cJSON_CreateString(text));
    return list;
}

cJSON *profile_dump(const struct board_type *type, const void *profile)
{
    cJSON *j = cJSON_CreateObject();
    for (unsigned i = 0; i < type->field_count; i++)
        cJSON_AddItemToObject(j, type->fields[i].key, profile_dump_field(&type->fields[i], profile));
    return j;
}
