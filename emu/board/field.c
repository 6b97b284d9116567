#include "board/field.h"

#include "base/why.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Text of one element -> *value, its bytes; false if the text is not such a value. */
typedef bool parse_fn(const struct board_field *f, const char *text, void *value);

static bool parse_string(const struct board_field *f, const char *text, void *value)
{
    const size_t len = strlen(text);
    if (len < (size_t)f->min || len > (size_t)f->max) return false;
    memcpy(value, text, len + 1);
    return true;
}

static bool parse_uint(const struct board_field *f, const char *text, void *value)
{
    char *end;
    errno = 0;
    const unsigned long v = strtoul(text, &end, 0);
    if (!isdigit((unsigned char)text[0]) || *end || errno || (double)v < f->min || (double)v > f->max) return false;
    const unsigned u = (unsigned)v;
    memcpy(value, &u, sizeof u);
    return true;
}

static bool parse_real(const struct board_field *f, const char *text, void *value)
{
    char *end;
    const double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v) || v < f->min || v > f->max) return false;
    memcpy(value, &v, sizeof v);
    return true;
}

static bool parse_bool(const struct board_field *f, const char *text, void *value)
{
    (void)f;
    const bool yes = strcmp(text, "true") == 0;
    if (!yes && strcmp(text, "false") != 0) return false;
    memcpy(value, &yes, sizeof yes);
    return true;
}

static bool parse_choice(const struct board_field *f, const char *text, void *value)
{
    for (int i = 0; f->choices[i]; i++) {
        if (strcmp(f->choices[i], text) != 0) continue;
        memcpy(value, &i, sizeof i);
        return true;
    }
    return false;
}

static const struct {
    parse_fn *parse; /* NULL: the board's own */
    size_t element;  /* bytes of one element of a sequence */
    const char *like;
} types[] = {
    [BOARD_FIELD_STRING] = {parse_string, 0, "1 to 31 characters"},
    [BOARD_FIELD_UINT] = {parse_uint, 0, "an integer"},
    [BOARD_FIELD_REAL] = {parse_real, 0, "a number"},
    [BOARD_FIELD_REALS] = {parse_real, sizeof(double), "a number"},
    [BOARD_FIELD_BOOL] = {parse_bool, 0, "true or false"},
    [BOARD_FIELD_CHOICE] = {parse_choice, 0, NULL},
    [BOARD_FIELD_LIST] = {NULL, 0, NULL},
};

static void set_default(const struct board_field *f, void *value)
{
    if (f->type == BOARD_FIELD_STRING) memcpy(value, f->standard_name, strlen(f->standard_name) + 1);
    else if (f->type == BOARD_FIELD_UINT) *(unsigned *)value = (unsigned)f->standard;
    else if (f->type == BOARD_FIELD_REAL) *(double *)value = f->standard;
    else if (f->type == BOARD_FIELD_CHOICE) *(int *)value = (int)f->standard;
    else if (f->type == BOARD_FIELD_BOOL) *(bool *)value = f->standard != 0.0;
}

void board_field_defaults(const struct board_field *fields, unsigned n, void *profile)
{
    for (unsigned i = 0; i < n; i++) set_default(&fields[i], (char *)profile + fields[i].offset);
}

const struct board_field *board_field_find(const struct board_field *fields, unsigned n, const char *key)
{
    for (unsigned i = 0; i < n; i++)
        if (strcmp(fields[i].key, key) == 0) return &fields[i];
    return NULL;
}

bool board_field_is_list(const struct board_field *f)
{
    return f->type == BOARD_FIELD_REALS || f->type == BOARD_FIELD_LIST;
}

unsigned board_field_elements(const struct board_field *f)
{
    if (!board_field_is_list(f)) return 1;
    return f->count ? f->count : (unsigned)f->max;
}

static bool is_number(const struct board_field *f)
{
    return f->type == BOARD_FIELD_UINT || f->type == BOARD_FIELD_REAL || f->type == BOARD_FIELD_REALS;
}

static void append_word(char *out, size_t cap, const char *separator, const char *word)
{
    const size_t at = strlen(out);
    (void)snprintf(out + at, cap - at, "%s%s", at ? separator : "", word);
}

static bool reject_value(const struct board_field *f, const char *text, char *why, size_t cap)
{
    char words[200] = "";
    for (unsigned i = 0; f->type == BOARD_FIELD_CHOICE && f->choices[i]; i++)
        append_word(words, sizeof words, f->choices[i + 1] ? ", " : " or ", f->choices[i]);
    const char *like = f->type == BOARD_FIELD_CHOICE ? words
                       : f->type == BOARD_FIELD_LIST ? f->like
                                                     : types[f->type].like;
    if (!is_number(f)) return why_expected(why, cap, f->key, WHY_TEXT(text), "%s", like);
    return why_expected(why, cap, f->key, WHY_TEXT(text), "%s from %.10g to %.10g", like, f->min, f->max);
}

static bool reject_key(const struct board_field *fields, unsigned n, const char *key, char *why, size_t cap)
{
    char known[400] = "";
    for (unsigned i = 0; i < n; i++) why_list_add(known, sizeof known, fields[i].key);
    return why_fail(why, cap, "%.40s: unknown key; expected one of %s", key, known);
}

bool board_field_set(const struct board_field *fields, unsigned n, void *profile, const char *key, unsigned index,
                     const char *text, char *why, size_t cap)
{
    const struct board_field *f = board_field_find(fields, n, key);
    if (!f) return reject_key(fields, n, key, why, cap);
    if (index >= board_field_elements(f))
        return why_expected(why, cap, key, "more", "up to %u elements", board_field_elements(f));
    void *value = (char *)profile + f->offset + index * types[f->type].element;
    const bool done =
        f->type == BOARD_FIELD_LIST ? f->parse(profile, index, text) : types[f->type].parse(f, text, value);
    return done || reject_value(f, text, why, cap);
}

static double number_of(const struct board_field *f, const void *profile, unsigned index)
{
    const char *at = (const char *)profile + f->offset + index * types[f->type].element;
    unsigned u;
    double d;
    if (f->type != BOARD_FIELD_UINT) {
        memcpy(&d, at, sizeof d);
        return d;
    }
    memcpy(&u, at, sizeof u);
    return u;
}

static bool check_numbers(const struct board_field *f, const void *profile, char *why, size_t cap)
{
    for (unsigned i = 0; is_number(f) && i < board_field_elements(f); i++) {
        const double v = number_of(f, profile, i);
        if (v >= f->min && v <= f->max) continue;
        return why_expected(why, cap, f->key, WHY_REAL(v), "%.10g to %.10g", f->min, f->max);
    }
    return true;
}

bool board_field_check(const struct board_field *fields, unsigned n, const void *profile, char *why, size_t cap)
{
    for (unsigned i = 0; i < n; i++) {
        const struct board_field *f = &fields[i];
        if (f->type == BOARD_FIELD_STRING && f->min > 0 && !*((const char *)profile + f->offset))
            return why_expected(why, cap, f->key, "none", "a name of 1 to 31 characters");
        if (!check_numbers(f, profile, why, cap)) return false;
    }
    return true;
}
