/* Reads proto/profiles/NAME.yaml for the tests: the subset those files use ("key: value", "[a, b]", "- item", "#"). */
#ifndef PSABENCH_TESTS_PSA2_PROFILES_H
#define PSABENCH_TESTS_PSA2_PROFILES_H

#include "rig.h"

#include "board/psa2/profile.h"

#include <string.h>

static inline char *psa2_trim(char *s)
{
    while (*s == ' ') s++;
    size_t n = strlen(s);
    while (n && (s[n - 1] == ' ' || s[n - 1] == '\n')) s[--n] = '\0';
    return s;
}

static inline void psa2_set(struct psa2_profile *p, const char *key, unsigned index, char *text)
{
    char why[200];
    if (!fields_set(&psa2_fields, p, key, index, psa2_trim(text), why, sizeof why)) fail_msg("%s", why);
}

static inline struct psa2_profile psa2_profile_file(const char *name)
{
    char path[100];
    char line[200];
    char key[40] = "";
    unsigned item = 0;
    struct psa2_profile p;
    memset(&p, 0, sizeof p);
    (void)snprintf(path, sizeof path, "proto/profiles/%s.yaml", name);
    FILE *f = fopen(path, "r");
    if (!f) fail_msg("cannot open %s: run the tests from the top of the repository", path);
    while (fgets(line, sizeof line, f)) {
        line[strcspn(line, "#")] = '\0';
        char *text = psa2_trim(line);
        char *colon = strchr(text, ':');
        if (strncmp(text, "- ", 2) == 0) {
            psa2_set(&p, key, item++, text + 2);
        } else if (colon) {
            *colon = '\0';
            (void)snprintf(key, sizeof key, "%.39s", text);
            item = 0;
            char *value = psa2_trim(colon + 1);
            if (strcmp(key, "board") == 0) continue; /* whose it is; not the profile's */
            if (value[0] == '[')
                for (char *e = strtok(value, "[],"); e; e = strtok(NULL, "[],")) psa2_set(&p, key, item++, e);
            else if (value[0]) psa2_set(&p, key, 0, value);
        }
    }
    (void)fclose(f);
    return p;
}

/* Every field, and the steps of the set-up, which are a list of texts. */
static inline void psa2_assert_same(const struct psa2_profile *got, const struct psa2_profile *want, const char *name)
{
    for (unsigned i = 0; i < psa2_fields.count; i++) {
        const struct field *f = &psa2_fields.row[i];
        const bool words = strcmp(f->key, "word") == 0;
        const size_t size = f->type == FIELD_TEXT   ? strlen(want->name) + 1
                            : f->type == FIELD_REAL ? sizeof(double)
                            : f->type == FIELD_BOOL ? sizeof(bool)
                            : words                 ? sizeof want->word
                            : f->type == FIELD_LIST ? 0
                                                    : sizeof(unsigned);
        if (memcmp((const char *)want + f->offset, (const char *)got + f->offset, size) != 0)
            fail_msg("%s: %s differs", name, f->key);
    }
    assert_int_equal(got->setup_count, want->setup_count);
    for (unsigned i = 0; i < want->setup_count; i++) {
        assert_int_equal(got->setup[i].on, want->setup[i].on);
        assert_int_equal(got->setup[i].action, want->setup[i].action);
        assert_int_equal(got->setup[i].count, want->setup[i].count);
        assert_memory_equal(got->setup[i].bytes, want->setup[i].bytes, sizeof want->setup[i].bytes);
    }
}

#endif
