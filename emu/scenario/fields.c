#include "scenario/fields.h"

#include "base/why.h"
#include "command/exact.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- rows */

static size_t rows_of(const struct fields *t)
{
    size_t n = 0;
    for (size_t i = 0; i < t->count; i++) n += t->row[i].type == FIELD_INLINE ? rows_of(t->row[i].sub) : 1;
    return n;
}

const struct field *yaml_row(const struct fields *t, size_t i, size_t *offset)
{
    *offset = 0;
    for (size_t k = 0; k < t->count; k++) {
        const struct field *d = &t->row[k];
        const size_t n = d->type == FIELD_INLINE ? rows_of(d->sub) : 1;
        if (i >= n) {
            i -= n;
            continue;
        }
        if (d->type != FIELD_INLINE) return d;
        const struct field *in = yaml_row(d->sub, i, offset);
        *offset += d->offset;
        return in;
    }
    return NULL;
}

static const char *key_at(const void *ctx, size_t i)
{
    size_t offset;
    const struct field *d = yaml_row(ctx, i, &offset);
    return d ? d->key : NULL;
}

static const char *choice_at(const void *ctx, size_t i)
{
    return ((const char *const *)ctx)[i];
}

/* ---- values */

static bool load_scalar(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *at)
{
    char words[256];
    const char *text = yaml_scalar(node);
    const enum field_result r = text ? field_parse(d, text, at) : FIELD_UNLIKE;
    if (r == FIELD_OK) return true;
    if (r == FIELD_OUT_OF_RANGE) return yaml_file_expected(f, node, d->key, "%.10g to %.10g", d->min, d->max);
    const char *near = text && d->type == FIELD_CHOICE ? yaml_nearest(text, choice_at, d->choices) : NULL;
    field_words(d, words, sizeof words);
    return yaml_file_expected(f, node, d->key, "%s%s%s%s%s", words, field_is_integer(d) ? " of 0 or more" : "",
                              near ? " (nearest: " : "", near ? near : "", near ? ")" : "");
}

static bool load_reals(struct yaml_file *f, const struct yaml_node *node, const struct field *d, double *v)
{
    unsigned n = 0;
    if (d->type == FIELD_EACH && node->kind == YAML_SCALAR) {
        for (; n < d->count; n++)
            if (!load_scalar(f, node, d, &v[n])) return false;
        return true;
    }
    if (node->kind != YAML_SEQUENCE || yaml_count(node) != d->count) {
        return yaml_file_expected(f, node, d->key, "%s%u numbers (%s)",
                                  d->type == FIELD_EACH ? "one value or a list of " : "a list of ", d->count, d->what);
    }
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!load_scalar(f, i->value, d, &v[n++])) return false;
    return true;
}

static bool load_section(struct yaml_file *f, const struct yaml_node *node, const struct field *d, char *section)
{
    const bool there = true;
    if (d->present) memcpy(section + d->present, &there, sizeof there);
    return yaml_load(f, node, d->key, d->sub, section + d->offset);
}

bool yaml_load_value(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *section)
{
    void *at = (char *)section + d->offset;
    if (d->load) return d->load(f, node, section);
    if (d->type == FIELD_CUSTOM) return true; /* read elsewhere */
    if (d->type == FIELD_SECTION) return load_section(f, node, d, section);
    if (d->type == FIELD_REALS || d->type == FIELD_EACH) return load_reals(f, node, d, at);
    if (d->type != FIELD_CHOICE && !yaml_scalar(node))
        return yaml_file_expected(f, node, d->key, "one value of up to %u characters", YAML_FILE_TEXT);
    return load_scalar(f, node, d, at);
}

/* ---- sections */

static bool fail_unknown(struct yaml_file *f, const struct yaml_node *key, const struct fields *t)
{
    char known[600] = "";
    for (size_t i = 0; key_at(t, i); i++) why_list_add(known, sizeof known, key_at(t, i));
    const char *text = yaml_scalar(key), *near = text ? yaml_nearest(text, key_at, t) : NULL;
    const bool unit = near && strncmp(near, text, strlen(text)) == 0 && *yaml_unit(near);
    return yaml_file_fail(f, key, text ? text : "?", "unknown key%s%s%s; expected one of %s", near ? ", nearest: " : "",
                          near ? near : "", unit ? " (its unit is part of the name)" : "", known);
}

static bool comes_again(const struct yaml_node *node, const struct yaml_item *of, const char *name)
{
    for (const struct yaml_item *i = node->first; i != of; i = i->next)
        if (strcmp(yaml_scalar(i->key), name) == 0) return true;
    return false;
}

static bool load_pair(struct yaml_file *f, const struct yaml_node *node, const struct yaml_item *pair,
                      const struct fields *t, char *section, yaml_value_fn *load_value)
{
    const char *name = yaml_scalar(pair->key);
    const struct field *d;
    size_t offset;
    for (size_t i = 0; name && (d = yaml_row(t, i, &offset)); i++) {
        if (strcmp(d->key, name) != 0) continue;
        if (comes_again(node, pair, name))
            return yaml_file_fail(f, pair->key, name, "expected the key once, got it twice");
        return load_value(f, pair->value, d, section + offset);
    }
    return fail_unknown(f, pair->key, t);
}

bool yaml_load_by(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct fields *t,
                  void *section, yaml_value_fn *load_value, const char *except)
{
    const size_t outer = strlen(f->where);
    if (node->kind != YAML_MAPPING) return yaml_file_expected(f, node, *name ? name : NULL, "a mapping `key: value`");
    if (*name) snprintf(f->where + outer, sizeof f->where - outer, "%s.", name);
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        const char *key = except ? yaml_scalar(i->key) : NULL;
        if (key && strcmp(key, except) == 0) continue;
        if (!load_pair(f, node, i, t, section, load_value)) return false;
    }
    f->where[outer] = '\0';
    return true;
}

bool yaml_load(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct fields *t,
               void *section)
{
    return yaml_load_by(f, node, name, t, section, yaml_load_value, NULL);
}

/* ---- dump */

/* JSON numbers are doubles to many readers; ours reads all 64 bits. */
static cJSON *integer_json(uint64_t v)
{
    char digits[24];
    snprintf(digits, sizeof digits, "%" PRIu64, v);
    return cJSON_CreateRaw(digits);
}

/* The very same double when it is read back. */
static cJSON *real_of(double v)
{
    char digits[EXACT_MAX];
    exact_number(v, digits);
    return cJSON_CreateRaw(digits);
}

static cJSON *reals_json(const double *v, unsigned count)
{
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; i < count; i++) cJSON_AddItemToArray(list, real_of(v[i]));
    return list;
}

static cJSON *section_of(const struct fields *t, const void *section)
{
    cJSON *j = cJSON_CreateObject();
    yaml_dump(t, section, j);
    return j;
}

static cJSON *texts_json(const struct field *d, const void *section)
{
    char text[128];
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; d->text(section, i, text, sizeof text); i++)
        cJSON_AddItemToArray(list, cJSON_CreateString(text));
    return list;
}

cJSON *yaml_dump_value(const struct field *d, const void *section)
{
    const void *at = (const char *)section + d->offset;
    switch (d->type) {
    case FIELD_U8:
    case FIELD_U32:
    case FIELD_U64:
        return integer_json(field_integer(d, at));
    case FIELD_REAL:
        return real_of(*(const double *)at);
    case FIELD_BOOL:
        return cJSON_CreateBool(*(const bool *)at);
    case FIELD_TEXT:
        return cJSON_CreateString(at);
    case FIELD_CHOICE:
        return cJSON_CreateString(d->choices[*(const int *)at]);
    case FIELD_REALS:
    case FIELD_EACH:
        return reals_json(at, d->count);
    case FIELD_LIST:
        return texts_json(d, section);
    case FIELD_SECTION:
        return section_of(d->sub, at);
    case FIELD_STRUCTS:
    case FIELD_INLINE:
    case FIELD_CUSTOM:
        break;
    }
    return NULL;
}

static cJSON *structs_json(const struct field *d, const char *section)
{
    const unsigned *count = (const void *)(section + d->present);
    cJSON *list = cJSON_CreateArray();
    for (unsigned i = 0; i < *count; i++)
        cJSON_AddItemToArray(list, section_of(d->sub, section + d->offset + i * d->sub->size));
    return list;
}

void yaml_dump(const struct fields *t, const void *section, cJSON *to)
{
    const struct field *d;
    size_t offset;
    for (size_t i = 0; (d = yaml_row(t, i, &offset)); i++) {
        const char *base = (const char *)section + offset;
        if (d->type == FIELD_SECTION && d->present && !*(const bool *)(base + d->present)) continue;
        if (d->dump) d->dump(d, base, to);
        else if (d->type == FIELD_STRUCTS) cJSON_AddItemToObject(to, d->key, structs_json(d, base));
        else if (d->type != FIELD_CUSTOM) cJSON_AddItemToObject(to, d->key, yaml_dump_value(d, base));
    }
}

/* ---- arguments that somebody else checks */

enum { JSON_DEPTH_MAX = 4, JSON_ITEMS_MAX = 256 };

static cJSON *json_scalar(const struct yaml_node *node, const char *text)
{
    char *end;
    if (!node->plain) return cJSON_CreateString(text);
    if (strcmp(text, "true") == 0 || strcmp(text, "false") == 0) return cJSON_CreateBool(*text == 't');
    if (strcmp(text, "null") == 0 || strcmp(text, "~") == 0 || !*text) return cJSON_CreateNull();
    const double v = strtod(text, &end);
    const bool number = end != text && !*end && isfinite(v) && strchr("+-.0123456789", text[0]);
    return number ? cJSON_CreateNumber(v) : cJSON_CreateString(text);
}

static cJSON *json_node(struct yaml_file *f, const struct yaml_node *node, unsigned depth, unsigned *items)
{
    if (node->kind == YAML_SCALAR) {
        const char *text = yaml_scalar(node);
        if (!text) yaml_file_expected(f, node, "args", "a value of up to %u characters", YAML_FILE_TEXT);
        return text ? json_scalar(node, text) : NULL;
    }
    cJSON *j = node->kind == YAML_MAPPING ? cJSON_CreateObject() : cJSON_CreateArray();
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        const char *key = i->key ? yaml_scalar(i->key) : "";
        bool fits = key && depth < JSON_DEPTH_MAX && ++*items <= JSON_ITEMS_MAX;
        if (!fits) yaml_file_fail(f, i->value, "args", "expected fewer or less deeply nested arguments");
        if (fits && i->key && cJSON_HasObjectItem(j, key)) {
            yaml_file_fail(f, i->key, key, "expected the key once, got it twice");
            fits = false;
        }
        cJSON *v = fits ? json_node(f, i->value, depth + 1, items) : NULL;
        if (!v) {
            cJSON_Delete(j);
            return NULL;
        }
        if (i->key) cJSON_AddItemToObject(j, key, v);
        else cJSON_AddItemToArray(j, v);
    }
    return j;
}

cJSON *yaml_json(struct yaml_file *f, const struct yaml_node *node)
{
    unsigned items = 0;
    return json_node(f, node, 0, &items);
}

bool yaml_find_proto(struct yaml_file *f, const struct yaml_node *node, const char *key, const char *folder,
                     const char *name, char path[FIND_PATH_MAX])
{
    char why[400];
    if (find_proto(folder, name, f->path, path, why, sizeof why)) return true;
    return yaml_file_fail(f, node, key, "%s", why);
}

/* ---- units of names */

// clang-format off
static const struct {
    const char *end, *unit;
} units[] = { /* the longer first */
    {"share_a", ""},
    {"_ppm_per_k", "ppm/K"}, {"_k_per_min", "K/min"}, {"_v_per_g2", "V/g²"}, {"_v_per_g", "V/g"}, {"_v_per_k", "V/K"},
    {"_n_m_per_rad", "N m/rad"}, {"_v_per_rad", "V/rad"}, {"_n_m_per_a", "N m/A"}, {"_a_per_v", "A/V"}, {"_kg_m2", "kg m²"},
    {"_n_m_s", "N m s"}, {"_kg", "kg"}, {"_ug_per_urad", "µg/µrad"}, {"_arcsec_per_k", "arcsec/K"}, {"_ug_per_g2", "µg/g²"}, {"_ug_per_k", "µg/K"},
    {"_a_per_g", "A/g"}, {"_a_rthz", "A/√Hz"}, {"_mrad", "mrad"}, {"_urad", "µrad"}, {"_ug", "µg"},
    {"_v_per_s", "V/s"}, {"_a_per_k", "A/K"}, {"_v_rthz", "V/√Hz"}, {"_v_rts", "V/√s"}, {"_arcsec_rms", "arcsec"},
    {"_arcsec", "arcsec"}, {"_mps3", "m/s³"}, {"_mps2", "m/s²"}, {"_mps", "m/s"}, {"_m_per_h", "m/h"}, {"_dps2", "°/s²"}, {"_dps", "°/s"}, {"_degc", "°C"}, {"_deg", "°"},
    {"_bitrate_hz", "bit/s"}, {"bitrate_hz", "bit/s"}, {"_hz", "Hz"}, {"_ohm", "Ω"}, {"_ppm", "ppm"}, {"_lsb", "LSB"},
    {"_ms", "ms"}, {"_ns", "ns"}, {"_s", "s"}, {"_m", "m"}, {"_v", "V"}, {"_a", "A"}, {"_k", "K"}, {"_bits", "bit"},
};
// clang-format on

const char *yaml_unit(const char *key)
{
    const size_t len = strlen(key);
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        const size_t n = strlen(units[i].end);
        if (len >= n && strcmp(key + len - n, units[i].end) == 0) return units[i].unit;
    }
    return "";
}
