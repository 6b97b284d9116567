/* Rows of the command tables: by number, by name. */
#include "command/args.h"

#include <string.h>

const struct control_command *control_row(const struct control_table *const *tables, unsigned i)
{
    for (; *tables; i -= (*tables)->count, tables++) {
        if (i < (*tables)->count) return &(*tables)->row[i];
    }
    return NULL;
}

const struct control_command *control_find(const struct control_table *const *tables, const char *name)
{
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(tables, i)); i++) {
        if (strcmp(row->name, name) == 0) return row;
    }
    return NULL;
}
