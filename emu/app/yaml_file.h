/* A YAML file as the loaders see it: a document whose nodes know their line, and errors of one line,
 *
 *     proto/scenarios/quiet.yaml:12: units.a.node: 200 is outside 1 ... 127
 *
 * what, where, and what would be right. The first error counts; the loader stops there. */
#ifndef PSABENCH_APP_YAML_FILE_H
#define PSABENCH_APP_YAML_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <yaml.h>

#define YAML_FILE_MAX  (1 << 20) /* bytes: no profile or scenario is as long */
#define YAML_FILE_TEXT 128u      /* longest scalar */

struct yaml_file {
    const char *path;
    yaml_document_t doc;
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
__attribute__((format(printf, 4, 5))) bool yaml_file_fail(struct yaml_file *f, const yaml_node_t *node, const char *key,
                                                          const char *format, ...);

yaml_node_t *yaml_file_root(struct yaml_file *f);
yaml_node_t *yaml_file_node(struct yaml_file *f, int index);

/* Text of a scalar, NULL for anything else, for one longer than YAML_FILE_TEXT and for one with a NUL in it. */
const char *yaml_file_scalar(const yaml_node_t *node);

/* ---- sections driven by a table */

enum yaml_type { YAML_REAL, YAML_U8, YAML_U32, YAML_U64, YAML_BOOL, YAML_TEXT, YAML_CUSTOM };

struct yaml_field {
    const char *key; /* unit in its name */
    enum yaml_type type;
    size_t offset;   /* of the value in the section's struct */
    double min, max; /* of numbers, both included; of a text: bytes with its NUL in max */
    bool (*load)(struct yaml_file *f, yaml_node_t *node, void *section); /* YAML_CUSTOM */
};

/* One value by its row; section is the struct that its offset counts from. */
bool yaml_file_value(struct yaml_file *f, yaml_node_t *node, const struct yaml_field *d, void *section);

/* Loads a mapping: every key must be in the table and come once; keys that do not come keep their value. name is put
 * before the key in messages. */
bool yaml_file_section(struct yaml_file *f, yaml_node_t *node, const char *name, const struct yaml_field *fields,
                       size_t count, void *section);

#endif
