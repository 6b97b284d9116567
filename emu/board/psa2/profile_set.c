#include "board/psa2/profile_internal.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char words[PSA2_WORDS + 1] = {
    [PSA2_WORD_X] = 'X', [PSA2_WORD_Y] = 'Y', [PSA2_WORD_Z] = 'Z', [PSA2_WORD_T] = 'T'};
static const char *const events[] = {[PSA2_ON_DRD_A] = "DRD_A", [PSA2_ON_DRD_T] = "DRD_T"};
static const char *const actions[] = {
    [PSA2_WRITE_A] = "write_A", [PSA2_WRITE_T] = "write_T", [PSA2_SYNC_A] = "sync_A", [PSA2_SYNC_T] = "sync_T"};

bool psa2_parse_word(void *profile, unsigned i, const char *text)
{
    struct psa2_profile *p = profile;
    const char *at = text[0] && !text[1] ? strchr(words, text[0]) : NULL;
    if (at) p->word[i] = (enum psa2_word)(at - words);
    return at != NULL;
}

bool psa2_word_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct psa2_profile *p = profile;
    if (i >= PSA2_WORDS) return false;
    (void)snprintf(out, cap, "%c", words[p->word[i]]);
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
bool psa2_parse_step(void *profile, unsigned i, const char *text)
{
    struct psa2_profile *p = profile;
    struct psa2_setup_step s = {.count = 0};
    const char *rest = NULL;
    for (unsigned k = 0; k < 2 && !rest; k++)
        if ((rest = skip_word(text, events[k]))) s.on = (enum psa2_setup_event)k;
    if (!rest) return false;
    text = rest;
    rest = NULL;
    for (unsigned k = 0; k < 4 && !rest; k++)
        if ((rest = skip_word(text, actions[k]))) s.action = (enum psa2_setup_action)k;
    if (!rest || !parse_bytes(rest, &s)) return false;
    if ((s.count > 0) != (s.action == PSA2_WRITE_A || s.action == PSA2_WRITE_T)) return false;
    p->setup[i] = s;
    p->setup_count = i + 1;
    return true;
}

bool psa2_step_text(const void *profile, unsigned i, char *out, size_t cap)
{
    const struct psa2_profile *p = profile;
    const struct psa2_setup_step *s = &p->setup[i];
    if (i >= p->setup_count) return false;
    (void)snprintf(out, cap, "%s %s", events[s->on], actions[s->action]);
    for (unsigned k = 0; k < s->count; k++) {
        const size_t at = strlen(out);
        (void)snprintf(out + at, cap - at, " %02X", s->bytes[k]);
    }
    return true;
}

bool psa2_profile_set(struct psa2_profile *p, const char *key, unsigned index, const char *text, char *why, size_t cap)
{
    return board_field_set(psa2_fields, PSA2_FIELDS, p, key, index, text, why, cap);
}
