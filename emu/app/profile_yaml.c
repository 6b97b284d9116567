#include "app/profile_yaml.h"

#include "control/exact.h"

#include <stdio.h>
#include <string.h>

enum { WHY = 512 };

static bool set(struct yaml_file *f, const struct yaml_node *node, const char *key, unsigned index,
                struct psa2_profile *p)
{
    char why[WHY];
    const char *text = yaml_scalar(node);
    if (!text) return yaml_file_fail(f, node, key, "one value of up to %u characters is wanted", YAML_FILE_TEXT);
    if (psa2_profile_set(p, key, index, text, why, sizeof why)) return true;
    /* The setter names the key itself; the line is ours to add. */
    return yaml_file_fail(f, node, NULL, "%s", why);
}

static bool set_sequence(struct yaml_file *f, const struct yaml_node *node, const struct psa2_field *field,
                         struct psa2_profile *p)
{
    unsigned index = 0;
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!set(f, i->value, field->key, index++, p)) return false;
    if (field->type == PSA2_FIELD_WORDS && index != PSA2_WORDS)
        return yaml_file_fail(f, node, field->key, "%u elements; %u are wanted", index, PSA2_WORDS);
    return index > 0 || yaml_file_fail(f, node, field->key, "at least one element is wanted");
}

static const struct psa2_field *find(const char *key)
{
    for (unsigned i = 0; i < psa2_field_count; i++)
        if (strcmp(psa2_fields[i].key, key) == 0) return &psa2_fields[i];
    return NULL;
}

static const char *key_at(const void *ctx, size_t i)
{
    (void)ctx;
    return i < psa2_field_count ? psa2_fields[i].key : NULL;
}

static bool fail_unknown(struct yaml_file *f, const struct yaml_node *key_node, const char *key)
{
    char known[400] = "";
    for (size_t i = 0; i < psa2_field_count; i++) {
        const size_t at = strlen(known);
        snprintf(known + at, sizeof known - at, "%s%s", at ? ", " : "", psa2_fields[i].key);
    }
    const char *near = yaml_nearest(key, key_at, NULL);
    return yaml_file_fail(f, key_node, key, "unknown key; %s%s%sknown here: %s", near ? "nearest: " : "",
                          near ? near : "", near ? "; " : "", known);
}

static bool load_pair(struct yaml_file *f, const struct yaml_item *pair, struct psa2_profile *p, uint64_t *seen)
{
    const char *key = yaml_scalar(pair->key);
    if (!key) return yaml_file_fail(f, pair->key, NULL, "a key is one word");
    const struct psa2_field *field = find(key);
    if (!field) return fail_unknown(f, pair->key, key);
    const uint64_t bit = UINT64_C(1) << (field - psa2_fields);
    if (*seen & bit) return yaml_file_fail(f, pair->key, key, "comes twice");
    *seen |= bit;
    const bool list = field->type == PSA2_FIELD_WORDS || field->type == PSA2_FIELD_SETUP;
    if (!list) return set(f, pair->value, key, 0, p);
    if (pair->value->kind != YAML_SEQUENCE)
        return yaml_file_fail(f, pair->value, key, "a sequence is wanted: %s", field->what);
    return set_sequence(f, pair->value, field, p);
}

bool profile_yaml_fields(struct yaml_file *f, const struct yaml_node *mapping, struct psa2_profile *p)
{
    uint64_t seen = 0;
    if (mapping->kind != YAML_MAPPING) return yaml_file_fail(f, mapping, NULL, "a mapping `key: value` is wanted");
    for (const struct yaml_item *i = mapping->first; i; i = i->next)
        if (!load_pair(f, i, p, &seen)) return false;
    return true;
}

/* Node of the key that a sentence of the check begins with, or the mapping: so that the message has its line. */
static const struct yaml_node *blame(const struct yaml_node *mapping, const char *sentence)
{
    const size_t len = strcspn(sentence, " :=,");
    for (const struct yaml_item *i = mapping->first; i; i = i->next) {
        const char *key = yaml_scalar(i->key);
        if (key && strlen(key) == len && strncmp(key, sentence, len) == 0) return i->key;
    }
    return mapping;
}

bool profile_yaml_check(struct yaml_file *f, const struct yaml_node *mapping, const struct psa2_profile *p)
{
    char why[WHY];
    if (psa2_profile_check(p, why, sizeof why)) return true;
    return yaml_file_fail(f, blame(mapping, why), NULL, "%s", why);
}

bool profile_yaml_load(const char *path, struct psa2_profile *p, char *why, size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_open(&f, path, why, cap)) return false;
    *p = psa2_profile_default();
    const bool ok = profile_yaml_fields(&f, f.root, p) && profile_yaml_check(&f, f.root, p);
    yaml_file_close(&f);
    return ok;
}

/* ---- the way back */

static cJSON *words_of(const struct psa2_profile *p)
{
    static const char *const names[] = {
        [PSA2_WORD_X] = "X", [PSA2_WORD_Y] = "Y", [PSA2_WORD_Z] = "Z", [PSA2_WORD_T] = "T"};
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; i < PSA2_WORDS; i++) cJSON_AddItemToArray(list, cJSON_CreateString(names[p->word[i]]));
    return list;
}

/* "DRD_A write_A 41 00 56", as psa2_profile_set() reads it. */
static cJSON *setup_of(const struct psa2_profile *p)
{
    static const char *const on[] = {[PSA2_ON_DRD_A] = "DRD_A", [PSA2_ON_DRD_T] = "DRD_T"};
    static const char *const action[] = {
        [PSA2_WRITE_A] = "write_A", [PSA2_WRITE_T] = "write_T", [PSA2_SYNC_A] = "sync_A", [PSA2_SYNC_T] = "sync_T"};
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; i < p->setup_count; i++) {
        const struct psa2_setup_step *s = &p->setup[i];
        char text[64];
        int at = snprintf(text, sizeof text, "%s %s", on[s->on], action[s->action]);
        for (unsigned k = 0; k < s->count; k++)
            at += snprintf(text + at, sizeof text - (size_t)at, " %02X", s->bytes[k]);
        cJSON_AddItemToArray(list, cJSON_CreateString(text));
    }
    return list;
}

cJSON *profile_dump_field(const struct psa2_profile *p, const struct psa2_field *d)
{
    const void *at = (const char *)p + d->offset;
    char digits[EXACT_MAX];
    unsigned integer;
    double real;
    switch (d->type) {
    case PSA2_FIELD_STRING:
        return cJSON_CreateString(at);
    case PSA2_FIELD_UINT:
        memcpy(&integer, at, sizeof integer);
        return cJSON_CreateNumber(integer);
    case PSA2_FIELD_REAL:
        memcpy(&real, at, sizeof real);
        exact_number(real, digits);
        return cJSON_CreateRaw(digits);
    case PSA2_FIELD_BOOL:
        return cJSON_CreateBool(*(const bool *)at);
    case PSA2_FIELD_WORDS:
        return words_of(p);
    case PSA2_FIELD_SETUP:
        break;
    }
    return setup_of(p);
}

cJSON *profile_dump(const struct psa2_profile *p)
{
    cJSON *j = cJSON_CreateObject();
    for (unsigned i = 0; i < psa2_field_count; i++)
        cJSON_AddItemToObject(j, psa2_fields[i].key, profile_dump_field(p, &psa2_fields[i]));
    return j;
}
