/* Keys of a mapping as a table: from one table come the loader, the dump that gives the same bench again, the default
 * values and the reference in docs/scenarios.md.
 *
 * A row says where its value lies in the section's struct. A section may contain sections; a row without a key puts the
 * rows of another table beside its own. */
#ifndef PSABENCH_SCENARIO_FIELDS_H
#define PSABENCH_SCENARIO_FIELDS_H

#include "scenario/yaml_file.h"

#include <cjson/cJSON.h>

enum yaml_type {
    YAML_REAL,
    YAML_U8,
    YAML_U32,
    YAML_U64,
    YAML_BOOL,
    YAML_TEXT,    /* char[], max: its size */
    YAML_CHOICE,  /* an enum: one of choices */
    YAML_REALS,   /* double[], a list of `count` */
    YAML_EACH,    /* the same, or one value for all of them */
    YAML_SECTION, /* a mapping by the table `sub`, its struct at offset */
    YAML_INLINE,  /* rows of `sub`, without a key of their own */
    YAML_CUSTOM   /* load and dump get the section */
};

struct yaml_fields;

struct yaml_field {
    const char *key; /* its unit at the end: turn_s */
    enum yaml_type type;
    size_t offset;
    double min, max;            /* of numbers, both included */
    const char *what;           /* some words for the reference */
    const char *const *choices; /* up to NULL */
    const struct yaml_fields *sub;
    size_t present; /* YAML_SECTION: offset of a bool beside it that tells that the section is there; 0: it always is */
    unsigned count; /* YAML_REALS, YAML_EACH */
    bool (*load)(struct yaml_file *f, const struct yaml_node *node, void *section);
    /* Adds the key to the dump, or leaves it out. NULL: never dumped, other keys say the same. */
    void (*dump)(const struct yaml_field *d, const void *section, cJSON *to);
};

struct yaml_fields {
    const struct yaml_field *row;
    size_t count;
};

#define YAML_FIELDS(rows)                                                                                              \
    {                                                                                                                  \
        rows, sizeof(rows) / sizeof *(rows)                                                                            \
    }

/* i-th row with a key; *offset is where its section's struct begins. NULL past the last. */
const struct yaml_field *yaml_row(const struct yaml_fields *t, size_t i, size_t *offset);

/* One value by its row; section is the struct that its offset counts from. */
bool yaml_load_value(struct yaml_file *f, const struct yaml_node *node, const struct yaml_field *d, void *section);

/* A mapping: every key must be in the table and come once; keys that do not come keep their value. name is put before
 * the key in messages; "" for the outermost mapping. */
bool yaml_load(struct yaml_file *f, const struct yaml_node *node, const char *name, const struct yaml_fields *t,
               void *section);

/* The error of a key that is none of name(ctx, i), i = 0 ... NULL; false. */
bool yaml_fail_unknown(struct yaml_file *f, const struct yaml_node *key, const char *(*name)(const void *ctx, size_t i),
                       const void *ctx);

/* Adds every key with its value. */
void yaml_dump(const struct yaml_fields *t, const void *section, cJSON *to);

/* Adds a list of mappings: `count` structs of `size` bytes in a row. */
void yaml_dump_list(const struct yaml_fields *t, const void *first, size_t size, size_t count, const char *key,
                    cJSON *to);

/* The row's value; NULL for one that has none of its own. */
cJSON *yaml_dump_value(const struct yaml_field *d, const void *section);

/* A mapping or sequence as JSON, for arguments that somebody else checks: plain scalars that are numbers, true, false
 * or null become such. NULL, with the error in why, when it is deeper or longer than arguments may be. */
cJSON *yaml_json(struct yaml_file *f, const struct yaml_node *node);

/* "s" of turn_s, "" of a key without a unit. */
const char *yaml_unit(const char *key);

#endif
