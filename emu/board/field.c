#include "board/field.h"

#include "base/why.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- a value from its text */

static enum field_result parse_real(const struct field *d, const char *text, void *at)
{
    char *end;
    const double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v)) return FIELD_UNLIKE;
    if (v < d->min || v > d->max) return FIELD_OUT_OF_RANGE;
    memcpy(at, &v, sizeof v);
    return FIELD_OK;
}

static enum field_result parse_integer(const struct field *d, const char *text, void *at)
{
    char *end;
    errno = 0;
    const uint64_t v = strtoull(text, &end, 0);
    if (text[0] < '0' || text[0] > '9' || *end || errno) return FIELD_UNLIKE;
    if ((double)v < d->min || (double)v > d->max) return FIELD_OUT_OF_RANGE;
    if (d->type == FIELD_U8) *(uint8_t *)at = (uint8_t)v;
    if (d->type == FIELD_U32) *(uint32_t *)at = (uint32_t)v;
    if (d->type == FIELD_U64) *(uint64_t *)at = v;
    return FIELD_OK;
}

static enum field_result parse_bool(const struct field *d, const char *text, void *at)
{
    (void)d;
    const bool yes = strcmp(text, "true") == 0;
    if (!yes && strcmp(text, "false") != 0) return FIELD_UNLIKE;
    memcpy(at, &yes, sizeof yes);
    return FIELD_OK;
}

static enum field_result parse_text(const struct field *d, const char *text, void *at)
{
    const size_t len = strlen(text);
    if (len < 1 || len + 1 > (size_t)d->max) return FIELD_UNLIKE;
    memcpy(at, text, len + 1);
    return FIELD_OK;
}

static enum field_result parse_choice(const struct field *d, const char *text, void *at)
{
    for (int i = 0; d->choices[i]; i++) {
        if (strcmp(d->choices[i], text) != 0) continue;
        memcpy(at, &i, sizeof i);
        return FIELD_OK;
    }
    return FIELD_UNLIKE;
}

static const struct {
    enum field_result (*parse)(const struct field *d, const char *text, void *at);
    size_t element;   /* bytes of one element of a list */
    const char *like; /* numbers, BOOL */
} types[] = {
    [FIELD_REAL] = {parse_real, 0, "a number"},      [FIELD_REALS] = {parse_real, sizeof(double), "a number"},
    [FIELD_U8] = {parse_integer, 0, "an integer"},   [FIELD_EACH] = {parse_real, sizeof(double), "a number"},
    [FIELD_U32] = {parse_integer, 0, "an integer"},  [FIELD_U64] = {parse_integer, 0, "an integer"},
    [FIELD_BOOL] = {parse_bool, 0, "true or false"}, [FIELD_TEXT] = {parse_text, 0, NULL},
    [FIELD_CHOICE] = {parse_choice, 0, NULL},        [FIELD_LIST] = {NULL, 0, NULL},
};

enum field_result field_parse(const struct field *d, const char *text, void *at)
{
    return types[d->type].parse(d, text, at);
}

static void append_choices(const struct field *d, char *out, size_t cap)
{
    size_t at = 0;
    for (unsigned i = 0; d->choices[i] && at < cap; i++) {
        const char *between = i == 0 ? "" : d->choices[i + 1] ? ", " : " or ";
        at += (size_t)snprintf(out + at, cap - at, "%s%s", between, d->choices[i]);
    }
}

void field_words(const struct field *d, char *out, size_t cap)
{
    if (d->type == FIELD_CHOICE) append_choices(d, out, cap);
    else if (d->type == FIELD_TEXT) (void)snprintf(out, cap, "1 to %d characters", (int)d->max - 1);
    else (void)snprintf(out, cap, "%s", d->type == FIELD_LIST ? d->like : types[d->type].like);
}

bool field_is_integer(const struct field *d)
{
    return d->type == FIELD_U8 || d->type == FIELD_U32 || d->type == FIELD_U64;
}

static bool has_reals(const struct field *d)
{
    return d->type == FIELD_REAL || d->type == FIELD_REALS || d->type == FIELD_EACH;
}

bool field_is_number(const struct field *d)
{
    return field_is_integer(d) || has_reals(d);
}

bool field_is_list(const struct field *d)
{
    return d->type == FIELD_REALS || d->type == FIELD_EACH || d->type == FIELD_LIST;
}

unsigned field_elements(const struct field *d)
{
    if (!field_is_list(d)) return 1;
    return d->count ? d->count : (unsigned)d->max;
}

uint64_t field_integer(const struct field *d, const void *at)
{
    return d->type == FIELD_U8    ? *(const uint8_t *)at
           : d->type == FIELD_U32 ? *(const uint32_t *)at
                                  : *(const uint64_t *)at;
}

/* ---- all rows of a table */

static void set_default(const struct field *d, void *section)
{
    void *at = (char *)section + d->offset;
    if (d->type == FIELD_REAL) *(double *)at = d->standard;
    if (d->type == FIELD_U32) *(uint32_t *)at = (uint32_t)d->standard;
    if (d->type == FIELD_CHOICE) *(int *)at = (int)d->standard;
    if (d->type == FIELD_BOOL) *(bool *)at = d->standard != 0.0;
    if (d->type == FIELD_TEXT) memcpy(at, d->standard_of[0], strlen(d->standard_of[0]) + 1);
    for (unsigned i = 0; d->type == FIELD_LIST && d->standard_of[i]; i++) (void)d->parse(section, i, d->standard_of[i]);
}

void fields_default(const struct fields *t, void *section)
{
    memset(section, 0, t->size);
    for (size_t i = 0; i < t->count; i++) set_default(&t->row[i], section);
}

const struct field *fields_find(const struct fields *t, const char *key)
{
    for (size_t i = 0; i < t->count; i++)
        if (strcmp(t->row[i].key, key) == 0) return &t->row[i];
    return NULL;
}

bool field_set(const struct field *d, void *section, unsigned index, const char *text, char *why, size_t cap)
{
    char words[256];
    if (index >= field_elements(d))
        return why_expected(why, cap, d->key, "more", "up to %u elements", field_elements(d));
    if (d->type == FIELD_LIST
            ? d->parse(section, index, text)
            : field_parse(d, text, (char *)section + d->offset + index * types[d->type].element) == FIELD_OK)
        return true;
    field_words(d, words, sizeof words);
    if (!field_is_number(d)) return why_expected(why, cap, d->key, WHY_TEXT(text), "%s", words);
    return why_expected(why, cap, d->key, WHY_TEXT(text), "%s from %.10g to %.10g", words, d->min, d->max);
}

bool fields_set(const struct fields *t, void *section, const char *key, unsigned index, const char *text, char *why,
                size_t cap)
{
    char known[400] = "";
    const struct field *d = fields_find(t, key);
    if (d) return field_set(d, section, index, text, why, cap);
    for (size_t i = 0; i < t->count; i++) why_list_add(known, sizeof known, t->row[i].key);
    return why_fail(why, cap, "%.40s: unknown key; expected one of %s", key, known);
}

static bool check_numbers(const struct field *d, const void *at, char *why, size_t cap)
{
    for (unsigned i = 0; field_is_number(d) && i < field_elements(d); i++) {
        const double v = has_reals(d) ? ((const double *)at)[i] : (double)field_integer(d, at);
        if (v >= d->min && v <= d->max) continue;
        return why_expected(why, cap, d->key, WHY_REAL(v), "%.10g to %.10g", d->min, d->max);
    }
    return true;
}

bool fields_check(const struct fields *t, const void *section, char *why, size_t cap)
{
    for (size_t i = 0; i < t->count; i++) {
        const struct field *d = &t->row[i];
        const char *at = (const char *)section + d->offset;
        if (d->type == FIELD_TEXT && d->min > 0 && !*at)
            return why_expected(why, cap, d->key, "none", "a name of 1 to 31 characters");
        if (!check_numbers(d, at, why, cap)) return false;
    }
    return true;
}
