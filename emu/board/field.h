/* A field of a struct as a row of a table: where its value lies, its range, its default, its words. From one table come the
 * loader of YAML (scenario/fields.h), the setter from text, the dump, the defaults and the reference of the keys. Pure. */
#ifndef PSABENCH_BOARD_FIELD_H
#define PSABENCH_BOARD_FIELD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum field_type {
    FIELD_REAL, /* double */
    FIELD_U8,
    FIELD_U32,
    FIELD_U64,
    FIELD_BOOL,
    FIELD_TEXT,   /* char[], max: its size */
    FIELD_CHOICE, /* an int or enum: index in choices */
    FIELD_REALS,  /* double[], a list of `count` */
    FIELD_EACH,   /* the same, or one value for all of them */
    FIELD_LIST,   /* a list of texts, read and written by functions of the row */
    /* of YAML alone */
    FIELD_SECTION, /* a mapping by the table `sub`, its struct at offset */
    FIELD_STRUCTS, /* a list of mappings by `sub`, dumped as many as the unsigned at `present` has; with a load of its own */
    FIELD_INLINE, /* rows of `sub`, without a key of their own */
    FIELD_CUSTOM  /* load and dump alone know */
};

struct fields;
struct yaml_file;
struct yaml_node;
struct cJSON;

struct field {
    const char *key; /* its unit at the end: turn_s */
    enum field_type type;
    size_t offset;
    double min, max;            /* of numbers, both included; LIST: most elements in max */
    const char *what;           /* some words for the reference, perhaps with source and grade */
    const char *const *choices; /* CHOICE: up to NULL */
    unsigned count;             /* REALS, EACH; LIST: 0, or the required number */
    /* defaults */
    double standard;                /* of a number, BOOL or CHOICE */
    const char *const *standard_of; /* of a TEXT, or of the elements of a LIST up to NULL */
    /* LIST */
    const char *like; /* "one of X, Y, Z, T" */
    /* Element i from its text (element 0 empties the list first); its text, false past the last. */
    bool (*parse)(void *section, unsigned i, const char *text);
    bool (*text)(const void *section, unsigned i, char *out, size_t cap);
    /* YAML: scenario/fields.h */
    const struct fields *sub;
    size_t present; /* SECTION: offset of a bool beside it that tells that the section is there; 0: it always is */
    bool (*load)(struct yaml_file *f, const struct yaml_node *node, void *section); /* in place of the type's */
    /* Adds the key to the dump, or leaves it out. NULL: the type's; of CUSTOM never dumped, other keys say the same. */
    void (*dump)(const struct field *d, const void *section, struct cJSON *to);
};

struct fields {
    const struct field *row;
    size_t count;
    size_t size; /* of the struct, for fields_default() */
};

#define FIELDS(rows)                                                                                                   \
    {                                                                                                                  \
        .row = (rows), .count = sizeof(rows) / sizeof *(rows)                                                          \
    }

/* Of a struct whose rows have defaults. */
#define FIELDS_OF(of, rows)                                                                                            \
    {                                                                                                                  \
        .row = (rows), .count = sizeof(rows) / sizeof *(rows), .size = sizeof(of)                                      \
    }

/* Rows with a default: the name of a profile; a number or BOOL; a choice of a list. */
#define FIELD_NAME(of, name_, words)                                                                                   \
    {                                                                                                                  \
        .key = "name", .type = FIELD_TEXT, .offset = offsetof(of, name), .min = 1, .max = sizeof(((of *)0)->name),     \
        .what = (words), .standard_of = (const char *const[])                                                          \
        {                                                                                                              \
            name_, NULL                                                                                                \
        }                                                                                                              \
    }
#define FIELD_ROW(of, member, kind, value, lo, hi, words)                                                              \
    {                                                                                                                  \
        .key = #member, .type = FIELD_##kind, .offset = offsetof(of, member), .standard = (value), .min = (lo),        \
        .max = (hi), .what = (words)                                                                                   \
    }
#define FIELD_PICK(of, member, value, list, words)                                                                     \
    {                                                                                                                  \
        .key = #member, .type = FIELD_CHOICE, .offset = offsetof(of, member), .standard = (value), .choices = (list),  \
        .what = (words)                                                                                                \
    }

enum field_result { FIELD_OK, FIELD_UNLIKE, FIELD_OUT_OF_RANGE };

/* One value, or one element of REALS and EACH, from its text to `at`, which stays as it is unless FIELD_OK. */
enum field_result field_parse(const struct field *d, const char *text, void *at);

/* What its texts are like: "a number", "slow, fast or both", "1 to 31 characters". */
void field_words(const struct field *d, char *out, size_t cap);

bool field_is_integer(const struct field *d);
bool field_is_number(const struct field *d); /* has a range; of REALS and EACH each element has */
bool field_is_list(const struct field *d);   /* a list of a known type, one element a value */
uint64_t field_integer(const struct field *d, const void *at);
unsigned field_elements(const struct field *d); /* the most it takes; 1 for a scalar */

/* ---- all rows of a table without YAML's own types */

void fields_default(const struct fields *t, void *section);

/* Sets one field from its text, as YAML, the command line and tests have it; index: element of a list, else 0. False with a
 * sentence in why, and the section untouched, if the key is unknown or the text no such value. */
bool fields_set(const struct fields *t, void *section, const char *key, unsigned index, const char *text, char *why,
                size_t cap);
bool field_set(const struct field *d, void *section, unsigned index, const char *text, char *why, size_t cap);

/* Whether all numbers are in their ranges and there is a name; else a sentence in why that begins with the key. */
bool fields_check(const struct fields *t, const void *section, char *why, size_t cap);

const struct field *fields_find(const struct fields *t, const char *key);

#endif
