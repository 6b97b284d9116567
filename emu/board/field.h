/* A field of a board's profile as the loader, the help and the docs see it; one table a board type. Pure. */
#ifndef PSABENCH_BOARD_FIELD_H
#define PSABENCH_BOARD_FIELD_H

#include <stdbool.h>
#include <stddef.h>

enum board_field_type {
    BOARD_FIELD_STRING, /* char[32] */
    BOARD_FIELD_UINT,   /* unsigned */
    BOARD_FIELD_REAL,   /* double */
    BOARD_FIELD_REALS,  /* double[count]; a sequence of count in YAML */
    BOARD_FIELD_BOOL,
    BOARD_FIELD_CHOICE, /* int: index in choices */
    BOARD_FIELD_LIST    /* a sequence of texts, read and written by the board */
};

struct board_field {
    const char *key; /* YAML key, unit in its name */
    enum board_field_type type;
    size_t offset;
    double min, max;            /* of numbers, and of characters of a string; LIST: most elements in max */
    const char *what;           /* one sentence, source and grade at its end */
    unsigned count;             /* REALS; LIST: 0, or the required number */
    const char *const *choices; /* CHOICE: up to NULL */
    const char *like;           /* LIST: "one of X, Y, Z, T" */
    /* LIST: element i from its text (element 0 empties the list first); its text, false past the last. */
    bool (*parse)(void *profile, unsigned i, const char *text);
    bool (*text)(const void *profile, unsigned i, char *out, size_t cap);
    double standard;           /* default of a number, BOOL or CHOICE */
    const char *standard_name; /* STRING: its default */
};

/* Rows of a board's table: the name of its profile; a number or BOOL; a choice of a list. */
#define BOARD_FIELD_NAME(profile, name_, words)                                                                        \
    {                                                                                                                  \
        .key = "name", .type = BOARD_FIELD_STRING, .offset = offsetof(profile, name), .min = 1, .max = 31,             \
        .what = (words), .standard_name = (name_)                                                                      \
    }
#define BOARD_FIELD_ROW(profile, member, kind, value, lo, hi, words)                                                   \
    {                                                                                                                  \
        .key = #member, .type = BOARD_FIELD_##kind, .offset = offsetof(profile, member), .standard = (value),          \
        .min = (lo), .max = (hi), .what = (words)                                                                      \
    }
#define BOARD_FIELD_PICK(profile, member, value, list, words)                                                          \
    {                                                                                                                  \
        .key = #member, .type = BOARD_FIELD_CHOICE, .offset = offsetof(profile, member), .standard = (value),          \
        .choices = (list), .what = (words)                                                                             \
    }

/* Sets all fields but sequences to their defaults. */
void board_field_defaults(const struct board_field *fields, unsigned n, void *profile);

/* Sets one field from its text, as YAML, the command line and tests have it; index: element of a sequence, else 0. False with
 * a sentence in why, and the profile untouched, if the key is unknown or the text no such value. */
bool board_field_set(const struct board_field *fields, unsigned n, void *profile, const char *key, unsigned index,
                     const char *text, char *why, size_t cap);

/* Whether all numbers are in their ranges and there is a name; else a sentence in why that begins with the key. */
bool board_field_check(const struct board_field *fields, unsigned n, const void *profile, char *why, size_t cap);

const struct board_field *board_field_find(const struct board_field *fields, unsigned n, const char *key);

bool board_field_is_list(const struct board_field *f);      /* a sequence in YAML */
unsigned board_field_elements(const struct board_field *f); /* the most it takes; 1 for a scalar */

#endif
