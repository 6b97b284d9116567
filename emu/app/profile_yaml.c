#include "app/profile_yaml.h"

#include <stdio.h>
#include <string.h>

enum { WHY = 512 };

static bool set(struct yaml_file *f, yaml_node_t *node, const char *key, unsigned index, struct psa2_profile *p)
{
    char why[WHY];
    const char *text = yaml_file_scalar(node);
    if (!text) return yaml_file_fail(f, node, key, "one value of up to %u characters is wanted", YAML_FILE_TEXT);
    if (psa2_profile_set(p, key, index, text, why, sizeof why)) return true;
    /* The setter names the key itself; the line is ours to add. */
    return yaml_file_fail(f, node, NULL, "%s", why);
}

static bool set_sequence(struct yaml_file *f, yaml_node_t *node, const struct psa2_field *field, struct psa2_profile *p)
{
    const char *key = field->key;
    unsigned index = 0;
    for (yaml_node_item_t *i = node->data.sequence.items.start; i < node->data.sequence.items.top; i++) {
        if (!set(f, yaml_file_node(f, *i), key, index++, p)) return false;
    }
    if (field->type == PSA2_FIELD_WORDS && index != PSA2_WORDS) {
        return yaml_file_fail(f, node, key, "%u elements; %u are wanted", index, PSA2_WORDS);
    }
    return index > 0 || yaml_file_fail(f, node, key, "at least one element is wanted");
}

static const struct psa2_field *find(const char *key)
{
    for (unsigned i = 0; i < psa2_field_count; i++) {
        if (strcmp(psa2_fields[i].key, key) == 0) return &psa2_fields[i];
    }
    return NULL;
}

static bool load_pair(struct yaml_file *f, const yaml_node_pair_t *pair, struct psa2_profile *p, uint64_t *seen)
{
    yaml_node_t *key_node = yaml_file_node(f, pair->key);
    yaml_node_t *value = yaml_file_node(f, pair->value);
    const char *key = yaml_file_scalar(key_node);
    if (!key) return yaml_file_fail(f, key_node, NULL, "a key is one word");
    const struct psa2_field *field = find(key);
    if (!field) return set(f, key_node, key, 0, p); /* refuses it, with the keys there are */
    const uint64_t bit = UINT64_C(1) << (field - psa2_fields);
    if (*seen & bit) return yaml_file_fail(f, key_node, key, "comes twice");
    *seen |= bit;
    const bool list = field->type == PSA2_FIELD_WORDS || field->type == PSA2_FIELD_SETUP;
    if (list && value->type != YAML_SEQUENCE_NODE)
        return yaml_file_fail(f, value, key, "a sequence is wanted: %s", field->what);
    return list ? set_sequence(f, value, field, p) : set(f, value, key, 0, p);
}

bool profile_yaml_fields(struct yaml_file *f, yaml_node_t *mapping, struct psa2_profile *p)
{
    uint64_t seen = 0;
    if (mapping->type != YAML_MAPPING_NODE) return yaml_file_fail(f, mapping, NULL, "a mapping `key: value` is wanted");
    for (yaml_node_pair_t *i = mapping->data.mapping.pairs.start; i < mapping->data.mapping.pairs.top; i++) {
        if (!load_pair(f, i, p, &seen)) return false;
    }
    return true;
}

/* Node of the key that a sentence of the check begins with, or the mapping: so that the message has its line. */
static const yaml_node_t *blame(struct yaml_file *f, const yaml_node_t *mapping, const char *sentence)
{
    const size_t len = strcspn(sentence, " :=,");
    for (yaml_node_pair_t *i = mapping->data.mapping.pairs.start; i < mapping->data.mapping.pairs.top; i++) {
        const yaml_node_t *key_node = yaml_file_node(f, i->key);
        const char *key = yaml_file_scalar(key_node);
        if (key && strlen(key) == len && strncmp(key, sentence, len) == 0) return key_node;
    }
    return mapping;
}

bool profile_yaml_check(struct yaml_file *f, yaml_node_t *mapping, const struct psa2_profile *p)
{
    char why[WHY];
    if (psa2_profile_check(p, why, sizeof why)) return true;
    return yaml_file_fail(f, blame(f, mapping, why), NULL, "%s", why);
}

bool profile_yaml_load(const char *path, struct psa2_profile *p, char *why, size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_open(&f, path, why, cap)) return false;
    *p = psa2_profile_default();
    yaml_node_t *root = yaml_file_root(&f);
    const bool ok = profile_yaml_fields(&f, root, p) && profile_yaml_check(&f, root, p);
    yaml_file_close(&f);
    return ok;
}
