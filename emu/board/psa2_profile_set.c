#include "board/psa2_profile.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Text of one field -> *value, the field's bytes; false if the text is not such a value. */
typedef bool parse_fn(const struct psa2_field *f, const char *text, void *value);

static bool parse_string(const struct psa2_field *f, const char *text, void *value)
{
    const size_t len = strlen(text);
    if (len < (size_t)f->min || len > (size_t)f->max) return false;
    memcpy(value, text, len + 1);
    return true;
}

static bool parse_uint(const struct psa2_field *f, const char *text, void *value)
{
    char *end;
    errno = 0;
    const unsigned long v = strtoul(text, &end, 0);
    if (!isdigit((unsigned char)text[0]) || *end || errno || (double)v < f->min || (double)v > f->max) return false;
    const unsigned u = (unsigned)v;
    memcpy(value, &u, sizeof u);
    return true;
}

static bool parse_real(const struct psa2_field *f, const char *text, void *value)
{
    char *end;
    const double v = strtod(text, &end);
    if (end == text || *end || !isfinite(v) || v < f->min || v > f->max) return false;
    memcpy(value, &v, sizeof v);
    return true;
}

static bool parse_bool(const struct psa2_field *f, const char *text, void *value)
{
    (void)f;
    const bool yes = strcmp(text, "true") == 0;
    if (!yes && strcmp(text, "false") != 0) return false;
    memcpy(value, &yes, sizeof yes);
    return true;
}

static bool parse_word(const struct psa2_field *f, const char *text, void *value)
{
    (void)f;
    static const char names[] = "XYZT";
    const char *at = text[0] && !text[1] ? strchr(names, text[0]) : NULL;
    if (!at) return false;
    const enum psa2_word w = (enum psa2_word)(at - names);
    memcpy(value, &w, sizeof w);
    return true;
}

static const char *skip_word(const char *text, const char *word)
{
    const size_t len = strlen(word);
    if (strncmp(text, word, len) != 0 || (text[len] && text[len] != ' ')) return NULL;
    for (text += len; *text == ' ';) text++;
    return text;
}

static bool parse_bytes(const char *text, struct psa2_setup_step *s)
{
    while (*text) {
        char *end;
        if (s->count == sizeof s->bytes || !isxdigit((unsigned char)*text)) return false;
        const unsigned long v = strtoul(text, &end, 16);
        if (v > 0xFF || end - text > 2 || (*end && *end != ' ')) return false;
        s->bytes[s->count++] = (uint8_t)v;
        for (text = end; *text == ' ';) text++;
    }
    return true;
}

/* "DRD_A write_A 41 00 56": event, action, bytes in hexadecimal. */
static bool parse_step(const struct psa2_field *f, const char *text, void *value)
{
    (void)f;
    static const char *const events[] = {"DRD_A", "DRD_T"};
    static const char *const actions[] = {"write_A", "write_T", "sync_A", "sync_T"};
    struct psa2_setup_step s = {.count = 0};
    const char *rest = NULL;
    for (unsigned i = 0; i < 2 && !rest; i++)
        if ((rest = skip_word(text, events[i]))) s.on = (enum psa2_setup_event)i;
    if (!rest) return false;
    text = rest;
    rest = NULL;
    for (unsigned i = 0; i < 4 && !rest; i++)
        if ((rest = skip_word(text, actions[i]))) s.action = (enum psa2_setup_action)i;
    if (!rest || !parse_bytes(rest, &s)) return false;
    if ((s.count > 0) != (s.action == PSA2_WRITE_A || s.action == PSA2_WRITE_T)) return false;
    memcpy(value, &s, sizeof s);
    return true;
}

static const struct {
    parse_fn *parse;
    size_t element; /* bytes of one element of a sequence, 0 for a scalar */
    const char *like;
} types[] = {
    [PSA2_FIELD_STRING] = {parse_string, 0, "1 to 31 characters"},
    [PSA2_FIELD_UINT] = {parse_uint, 0, "an integer"},
    [PSA2_FIELD_REAL] = {parse_real, 0, "a number"},
    [PSA2_FIELD_BOOL] = {parse_bool, 0, "true or false"},
    [PSA2_FIELD_WORDS] = {parse_word, sizeof(enum psa2_word), "one of X, Y, Z, T"},
    [PSA2_FIELD_SETUP] = {parse_step, sizeof(struct psa2_setup_step),
                          "like \"DRD_A write_A 41 00 56\" or \"DRD_T sync_T\""},
};

static const struct psa2_field *find(const char *key)
{
    for (unsigned i = 0; i < psa2_field_count; i++)
        if (strcmp(psa2_fields[i].key, key) == 0) return &psa2_fields[i];
    return NULL;
}

static unsigned elements_max(const struct psa2_field *f)
{
    return f->type == PSA2_FIELD_WORDS ? PSA2_WORDS : f->type == PSA2_FIELD_SETUP ? PSA2_SETUP_MAX : 1;
}

static void not_a_value(const struct psa2_field *f, const char *text, char *why, size_t cap)
{
    if (f->type == PSA2_FIELD_UINT || f->type == PSA2_FIELD_REAL)
        (void)snprintf(why, cap, "%s: \"%.40s\" is not %s of %.10g .. %.10g", f->key, text, types[f->type].like, f->min,
                       f->max);
    else (void)snprintf(why, cap, "%s: \"%.40s\" is not %s", f->key, text, types[f->type].like);
}

static void not_a_key(const char *key, char *why, size_t cap)
{
    int at = snprintf(why, cap, "%.40s: unknown key; known here: ", key);
    for (unsigned i = 0; i < psa2_field_count && at >= 0 && (size_t)at < cap; i++)
        at += snprintf(why + at, cap - (size_t)at, "%s%s", i ? ", " : "", psa2_fields[i].key);
}

bool psa2_profile_set(struct psa2_profile *p, const char *key, unsigned index, const char *text, char *why, size_t cap)
{
    const struct psa2_field *f = find(key);
    if (!f) {
        not_a_key(key, why, cap);
        return false;
    }
    if (index >= elements_max(f)) {
        (void)snprintf(why, cap, "%s: more than %u elements", key, elements_max(f));
        return false;
    }
    if (!types[f->type].parse(f, text, (char *)p + f->offset + index * types[f->type].element)) {
        not_a_value(f, text, why, cap);
        return false;
    }
    if (f->type == PSA2_FIELD_SETUP) p->setup_count = index + 1;
    return true;
}
