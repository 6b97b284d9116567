#include "app/yaml_file.h"

#include "base/text.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool yaml_file_fail(struct yaml_file *f, const yaml_node_t *node, const char *key, const char *format, ...)
{
    va_list ap;
    const size_t line = node ? node->start_mark.line + 1 : 1;
    const int n = snprintf(f->why, f->cap, "%s:%zu: %s%s%s", f->path, line, f->where, key ? key : "", key ? ": " : "");
    va_start(ap, format);
    if (n >= 0 && (size_t)n < f->cap) vsnprintf(f->why + n, f->cap - (size_t)n, format, ap);
    va_end(ap);
    text_one_line(f->why);
    return false;
}

yaml_node_t *yaml_file_root(struct yaml_file *f)
{
    return yaml_document_get_root_node(&f->doc);
}

yaml_node_t *yaml_file_node(struct yaml_file *f, int index)
{
    return yaml_document_get_node(&f->doc, index);
}

const char *yaml_file_scalar(const yaml_node_t *node)
{
    if (!node || node->type != YAML_SCALAR_NODE) return NULL;
    const char *text = (const char *)node->data.scalar.value;
    const size_t len = node->data.scalar.length;
    return len <= YAML_FILE_TEXT && strlen(text) == len ? text : NULL;
}

static bool tell_parser(struct yaml_file *f, const yaml_parser_t *p)
{
    snprintf(f->why, f->cap, "%s:%zu: not YAML: %s", f->path, p->problem_mark.line + 1,
             p->problem ? p->problem : "no memory");
    return false;
}

bool yaml_file_parse(struct yaml_file *f, const char *path, const char *text, size_t len, char *why, size_t cap)
{
    yaml_parser_t parser;
    *f = (struct yaml_file){.path = path, .why = why, .cap = cap};
    if (!yaml_parser_initialize(&parser)) {
        snprintf(why, cap, "%s: no memory", path);
        return false;
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, len);
    const bool ok = yaml_parser_load(&parser, &f->doc);
    if (!ok) tell_parser(f, &parser);
    yaml_parser_delete(&parser);
    if (!ok || yaml_file_root(f)) return ok;
    yaml_document_delete(&f->doc);
    snprintf(why, cap, "%s:1: empty: a mapping `key: value` is wanted", path);
    return false;
}

bool yaml_file_open(struct yaml_file *f, const char *path, char *why, size_t cap)
{
    FILE *in = fopen(path, "rbe");
    if (!in) {
        snprintf(why, cap, "%s: %s", path, strerror(errno));
        return false;
    }
    char *text = malloc(YAML_FILE_MAX);
    const size_t len = text ? fread(text, 1, YAML_FILE_MAX, in) : 0;
    const bool bad = ferror(in) || len == YAML_FILE_MAX || !text;
    fclose(in);
    if (bad) snprintf(why, cap, "%s: cannot be read, or longer than %d bytes", path, YAML_FILE_MAX);
    const bool ok = !bad && yaml_file_parse(f, path, text, len, why, cap);
    free(text);
    return ok;
}

void yaml_file_close(struct yaml_file *f)
{
    yaml_document_delete(&f->doc);
}

/* ---- values */

static bool get_real(const char *text, double *v)
{
    char *end;
    *v = strtod(text, &end);
    return end != text && !*end && isfinite(*v);
}

static bool load_real(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, const char *text, double *v)
{
    if (!get_real(text, v)) return yaml_file_fail(f, node, d->key, "\"%s\" is not a number", text);
    if (*v >= d->min && *v <= d->max) return true;
    return yaml_file_fail(f, node, d->key, "%s is outside %.10g ... %.10g", text, d->min, d->max);
}

static bool load_integer(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, const char *text,
                         uint64_t *v)
{
    char *end;
    errno = 0;
    *v = strtoull(text, &end, 0);
    if (text[0] < '0' || text[0] > '9' || *end || errno) {
        return yaml_file_fail(f, node, d->key, "\"%s\" is not an integer of 0 or more", text);
    }
    if (d->type == YAML_U64 || ((double)*v >= d->min && (double)*v <= d->max)) return true;
    return yaml_file_fail(f, node, d->key, "%s is outside %.10g ... %.10g", text, d->min, d->max);
}

static bool load_bool(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, const char *text, bool *v)
{
    *v = strcmp(text, "true") == 0;
    return *v || strcmp(text, "false") == 0 || yaml_file_fail(f, node, d->key, "\"%s\": true or false is wanted", text);
}

static bool load_text(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, const char *text, char *v)
{
    const size_t len = strlen(text);
    if (len < 1 || len + 1 > (size_t)d->max) {
        return yaml_file_fail(f, node, d->key, "1 to %d characters are wanted", (int)d->max - 1);
    }
    memcpy(v, text, len + 1);
    return true;
}

bool yaml_file_value(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, void *section)
{
    void *at = (char *)section + d->offset;
    if (d->type == YAML_CUSTOM) return d->load(f, node, section);
    const char *text = yaml_file_scalar(node);
    if (!text) return yaml_file_fail(f, node, d->key, "one value of up to %u characters is wanted", YAML_FILE_TEXT);
    uint64_t integer = 0;
    switch (d->type) {
    case YAML_REAL:
        return load_real(f, node, d, text, at);
    case YAML_BOOL:
        return load_bool(f, node, d, text, at);
    case YAML_TEXT:
        return load_text(f, node, d, text, at);
    default:
        break;
    }
    if (!load_integer(f, node, d, text, &integer)) return false;
    if (d->type == YAML_U8) *(uint8_t *)at = (uint8_t)integer;
    if (d->type == YAML_U32) *(uint32_t *)at = (uint32_t)integer;
    if (d->type == YAML_U64) *(uint64_t *)at = integer;
    return true;
}

/* ---- sections */

static bool fail_unknown(struct yaml_file *f, const yaml_node_t *key, const struct yaml_field *fields, size_t count)
{
    char known[512] = "";
    for (size_t i = 0; i < count; i++) {
        const size_t at = strlen(known);
        snprintf(known + at, sizeof known - at, "%s%s", at ? ", " : "", fields[i].key);
    }
    const char *text = yaml_file_scalar(key);
    return yaml_file_fail(f, key, text ? text : "?", "unknown key; known here: %s", known);
}

static bool load_pair(struct yaml_file *f, const yaml_node_pair_t *pair, const struct yaml_field *fields, size_t count,
                      void *section, uint64_t *seen)
{
    yaml_node_t *key = yaml_file_node(f, pair->key);
    const char *name = yaml_file_scalar(key);
    for (size_t i = 0; name && i < count; i++) {
        if (strcmp(fields[i].key, name) != 0) continue;
        if (*seen >> i & 1) return yaml_file_fail(f, key, name, "comes twice");
        *seen |= UINT64_C(1) << i;
        return yaml_file_value(f, yaml_file_node(f, pair->value), &fields[i], section);
    }
    return fail_unknown(f, key, fields, count);
}

bool yaml_file_section(struct yaml_file *f, yaml_node_t *node, const char *name, const struct yaml_field *fields,
                       size_t count, void *section)
{
    uint64_t seen = 0;
    const size_t outer = strlen(f->where);
    if (node->type != YAML_MAPPING_NODE)
        return yaml_file_fail(f, node, *name ? name : NULL, "a mapping `key: value` is wanted");
    if (*name) snprintf(f->where + outer, sizeof f->where - outer, "%s.", name);
    for (yaml_node_pair_t *p = node->data.mapping.pairs.start; p < node->data.mapping.pairs.top; p++) {
        if (!load_pair(f, p, fields, count, section, &seen)) return false;
    }
    f->where[outer] = '\0';
    return true;
}
