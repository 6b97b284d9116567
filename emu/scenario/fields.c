#include "scenario/fields.h"

#include "base/why.h"
#include "command/exact.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- rows */

static size_t rows_of(const struct yaml_fields *t)
{
    size_t n = 0;
    for (size_t i = 0; i < t->count; i++) n += t->row[i].type == YAML_INLINE ? rows_of(t->row[i].sub) : 1;
    return n;
}

const struct yaml_field *yaml_row(const struct yaml_fields *t, size_t i, size_t *offset)
{
    *offset = 0;
    for (size_t k = 0; k < t->count; k++) {
        const struct yaml_field *d = &t->row[k];
        const size_t n = d->type == YAML_INLINE ? rows_of(d->sub) : 1;
        if (i >= n) {
            i -= n;
            continue;
        }
        if (d->type != YAML_INLINE) return d;
        const struct yaml_field *in = yaml_row(d->sub, i, offset);
        *offset += d->offset;
        return in;
    }
    return NULL;
}

static const char *key_at(const void *ctx, size_t i)
{
    size_t offset;
    const struct yaml_field *d = yaml_row(ctx, i, &offset);
    return d ? d->key : NULL;
}

static const char *choice_at(const void *ctx, size_t i)
{
    return ((const char *const *)ctx)[i];
}

/* ---- values */

static bool load_real(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, double *v)
{
    const char *text = yaml_scalar(node);
    char *end = NULL;
    if (text) *v = strtod(text, &end);
    if (!text || end == text || *end || !isfinite(*v)) return yaml_file_expected(f, node, d->key, "a number");
    if (*v >= d->min && *v <= d->max) return true;
    return yaml_file_expected(f, node, d->key, "%.10g to %.10g", d->min, d->max);
}

static bool load_integer(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, uint64_t *v)
{
    const char *text = yaml_scalar(node);
    char *end;
    errno = 0;
    *v = strtoull(text, &end, 0);
    if (text[0] < '0' || text[0] > '9' || *end || errno)
        return yaml_file_expected(f, node, d->key, "an integer of 0 or more");
    if (d->type == YAML_U64 || ((double)*v >= d->min && (double)*v <= d->max)) return true;
    return yaml_file_expected(f, node, d->key, "%.10g to %.10g", d->min, d->max);
}

static bool load_bool(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, bool *v)
{
    const char *text = yaml_scalar(node);
    *v = strcmp(text, "true") == 0;
    return *v || strcmp(text, "false") == 0 || yaml_file_expected(f, node, d->key, "true or false");
}

static bool load_text(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, char *v)
{
    const char *text = yaml_scalar(node);
    const size_t len = strlen(text);
    if (len < 1 || len + 1 > (size_t)d->max)
        return yaml_file_expected(f, node, d->key, "1 to %d characters", (int)d->max - 1);
    memcpy(v, text, len + 1);
    return true;
}

/* "exact, modulator or direct" */
static void list_choices(const struct yaml_field *d, char *out, size_t cap)
{
    int at = 0;
    for (unsigned i = 0; d->choices[i] && at >= 0 && (size_t)at < cap; i++) {
        const char *between = i == 0 ? "" : d->choices[i + 1] ? ", " : " or ";
        at += snprintf(out + at, cap - (size_t)at, "%s%s", between, d->choices[i]);
    }
}

static bool load_choice(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, int *v)
{
    const char *text = yaml_scalar(node);
    char all[256] = "";
    for (int i = 0; text && d->choices[i]; i++) {
        *v = i;
        if (strcmp(d->choices[i], text) == 0) return true;
    }
    list_choices(d, all, sizeof all);
    const char *near = text ? yaml_nearest(text, choice_at, d->choices) : NULL;
    return yaml_file_expected(f, node, d->key, "%s%s%s%s", all, near ? " (nearest: " : "", near ? near : "",
                              near ? ")" : "");
}

static bool load_reals(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, double *v)
{
    unsigned n = 0;
    if (d->type == YAML_EACH && node->kind == YAML_SCALAR) {
        for (; n < d->count; n++)
            if (!load_real(f, node, d, &v[n])) return false;
        return true;
    }
    if (node->kind != YAML_SEQUENCE || yaml_count(node) != d->count) {
        return yaml_file_expected(f, node, d->key, "%s%u numbers (%s)",
                                  d->type == YAML_EACH ? "one value or a list of " : "a list of ", d->count, d->what);
    }
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!load_real(f, i->value, d, &v[n++])) return false;
    return true;
}

static bool load_section(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, char *section)
{
    const bool there = true;
    if (d->present) memcpy(section + d->present, &there, sizeof there);
    return yaml_load(f, node, d->key, d->sub, section + d->offset);
}

static bool load_number(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, void *at)
{
    uint64_t integer = 0;
    if (!load_integer(f, node, d, &integer)) return false;
    if (d->type == YAML_U8) *(uint8_t *)at = (uint8_t)integer;
    if (d->type == YAML_U32) *(uint32_t *)at = (uint32_t)integer;
    if (d->type == YAML_U64) *(uint64_t *)at = integer;
    return true;
}

bool yaml_load_value(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, void *section)
{
    void *at = (char *)section + d->offset;
    if (d->type == YAML_CUSTOM) return d->load(f, node, section);
    if (d->type == YAML_SECTION) return load_section(f, node, d, section);
    if (d->type == YAML_REALS || d->type == YAML_EACH) return load_reals(f, node, d, at);
    if (d->type == YAML_CHOICE) return load_choice(f, node, d, at);
    if (!yaml_scalar(node))
        return yaml_file_expected(f, node, d->key, "one value of up to %u characters", YAML_FILE_TEXT);
    if (d->type == YAML_REAL) return load_real(f, node, d, at);
    if (d->type == YAML_BOOL) return load_bool(f, node, d, at);
    if (d->type == YAML_TEXT) return load_text(f, node, d, at);
    return load_number(f, node, d, at);
}

/* ---- sections */

bool yaml_fail_unknown(struct yaml_file *f, const struct yaml_node *key, const char *(*name)(const void *ctx, size_t i),
                       const void *ctx)
{
    char known[600] = "";
    for (size_t i = 0; name(ctx, i); i++) why_list_add(known, sizeof known, name(ctx, i));
    const char *text = yaml_scalar(key), *near = text ? yaml_nearest(text, name, ctx) : NULL;
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
                      const struct yaml_fields *t, char *section)
{
    const char *name = yaml_scalar(pair->key);
    const struct yaml_field *d;
    size_t offset;
    for (size_t i = 0; name && (d = yaml_row(t, i, &offset)); i++) {
        if (strcmp(d->key, name) != 0) continue;
        if (comes_again(node, pair, name))
            return yaml_file_fail(f, pair->key, name, "expected the key once, got it twice");
        return yaml_load_value(f, pair->value, d, section + offset);
    }
    return yaml_fail_unknown(f, pair->key, key_at, t);
}

bool yaml_load(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct yaml_fields *t,
               void *section)
{
    const size_t outer = strlen(f->where);
    if (node->kind != YAML_MAPPING) return yaml_file_expected(f, node, *name ? name : NULL, "a mapping `key: value`");
    if (*name) snprintf(f->where + outer, sizeof f->where - outer, "%s.", name);
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!load_pair(f, node, i, t, section)) return false;
    f->where[outer] = '\0';
    return true;
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

static cJSON *section_of(const struct yaml_fields *t, const void *section)
{
    cJSON *j = cJSON_CreateObject();
    yaml_dump(t, section, j);
    return j;
}

// Long: one row per type.
cJSON *yaml_dump_value(const struct yaml_field *d, const void *section)
{
    const void *at = (const char *)section + d->offset;
    uint32_t u32;
    uint64_t u64;
    double real;
    int choice;
    switch (d->type) {
    case YAML_REAL:
        memcpy(&real, at, sizeof real);
        return real_of(real);
    case YAML_U8:
        return integer_json(*(const uint8_t *)at);
    case YAML_U32:
        memcpy(&u32, at, sizeof u32);
        return integer_json(u32);
    case YAML_U64:
        memcpy(&u64, at, sizeof u64);
        return integer_json(u64);
    case YAML_BOOL:
        return cJSON_CreateBool(*(const bool *)at);
    case YAML_TEXT:
        return cJSON_CreateString(at);
    case YAML_CHOICE:
        memcpy(&choice, at, sizeof choice);
        return cJSON_CreateString(d->choices[choice]);
    case YAML_REALS:
    case YAML_EACH:
        return reals_json(at, d->count);
    case YAML_SECTION:
        return section_of(d->sub, at);
    case YAML_INLINE:
    case YAML_CUSTOM:
        break;
    }
    return NULL;
}

void yaml_dump(const struct yaml_fields *t, const void *section, cJSON *to)
{
    const struct yaml_field *d;
    size_t offset;
    for (size_t i = 0; (d = yaml_row(t, i, &offset)); i++) {
        const char *base = (const char *)section + offset;
        if (d->type == YAML_CUSTOM && d->dump) d->dump(d, base, to);
        if (d->type == YAML_CUSTOM) continue;
        if (d->type == YAML_SECTION && d->present && !*(const bool *)(base + d->present)) continue;
        cJSON_AddItemToObject(to, d->key, yaml_dump_value(d, base));
    }
}

void yaml_dump_list(const struct yaml_fields *t, const void *first, size_t size, size_t count, const char *key,
                    cJSON *to)
{
    cJSON *list = cJSON_AddArrayToObject(to, key);
    for (size_t i = 0; i < count; i++) cJSON_AddItemToArray(list, section_of(t, (const char *)first + i * size));
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

/* ---- units of names */

// clang-format off
static const struct {
    const char *end, *unit;
} units[] = { /* the longer first */
    {"_ppm_per_k", "ppm/K"}, {"_k_per_min", "K/min"}, {"_v_per_g2", "V/g²"}, {"_v_per_g", "V/g"}, {"_v_per_k", "V/K"},
    {"_v_per_s", "V/s"}, {"_a_per_k", "A/K"}, {"_v_rthz", "V/√Hz"}, {"_v_rts", "V/√s"}, {"_arcsec_rms", "arcsec"},
    {"_arcsec", "arcsec"}, {"_mps2", "m/s²"}, {"_dps2", "°/s²"}, {"_dps", "°/s"}, {"_degc", "°C"}, {"_deg", "°"},
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
