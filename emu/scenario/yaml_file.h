/* A YAML 1.2 file as the loaders see it: a tree whose nodes know their line and column, and errors of one line,
 *
 *     proto/scenarios/quiet.yaml:12:11: units.a.node: expected 1 to 127, got 200
 *
 * where, what was expected and what was there. The first error counts; the loader stops there. An alias is the node of its
 * anchor. JSON is YAML 1.2: a dumped scenario is read by the same functions. */
#ifndef PSABENCH_SCENARIO_YAML_FILE_H
#define PSABENCH_SCENARIO_YAML_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define YAML_FILE_MAX  (16 << 20) /* bytes: a dump of 1000 units has 4 MB */
#define YAML_FILE_TEXT 256u       /* longest scalar that is a value */
#define YAML_DEPTH_MAX 48u

enum yaml_kind { YAML_SCALAR, YAML_SEQUENCE, YAML_MAPPING };

struct yaml_node {
    enum yaml_kind kind;
    unsigned line, column;   /* from 1 */
    struct yaml_item *first; /* of a sequence or mapping */
    struct yaml_node *older; /* all nodes of the file, for yaml_file_close() */
    bool plain;              /* a scalar without quotes: it may be a number */
    size_t len;
    char text[]; /* of a scalar, with a NUL behind its last byte */
};

struct yaml_item {
    struct yaml_node *key; /* NULL in a sequence */
    struct yaml_node *value;
    struct yaml_item *next;
};

struct yaml_file {
    const char *path;
    struct yaml_node *root, *newest;
    char where[128]; /* section the loader is in, "units.a." */
    char *why;
    size_t cap;
};

/* Reads the whole file. False with a line in why: it cannot be read, or is not YAML. */
bool yaml_file_open(struct yaml_file *f, const char *path, char *why, size_t cap);
/* The same from memory; path is for the messages. */
bool yaml_file_parse(struct yaml_file *f, const char *path, const char *text, size_t len, char *why, size_t cap);
void yaml_file_close(struct yaml_file *f);

/* Writes the error and returns false. node may be NULL, key too. */
__attribute__((format(printf, 4, 5))) bool yaml_file_fail(struct yaml_file *f, const struct yaml_node *node,
                                                          const char *key, const char *format, ...);

/* The same as `key: expected ..., got` what the node has. */
__attribute__((format(printf, 4, 5))) bool yaml_file_expected(struct yaml_file *f, const struct yaml_node *node,
                                                              const char *key, const char *expected, ...);

/* Text of a scalar, NULL for anything else, for one longer than YAML_FILE_TEXT and for one with a NUL in it. */
const char *yaml_scalar(const struct yaml_node *node);

/* Value of a key of a mapping; NULL when it is not there, or node is no mapping. */
struct yaml_node *yaml_get(const struct yaml_node *node, const char *key);

/* Where to report what is wrong with a key: its value, or the mapping where it is not there. */
const struct yaml_node *yaml_at(const struct yaml_node *mapping, const char *key);

unsigned yaml_count(const struct yaml_node *node); /* items of a sequence or pairs of a mapping */

/* The one of the names that is most like a mistyped word: name(ctx, i) for i = 0 ... NULL. A name without its unit at the
 * end (turn for turn_s) is taken before all. NULL: none is near. */
const char *yaml_nearest(const char *word, const char *(*name)(const void *ctx, size_t i), const void *ctx);

#endif
