/* Rows of the command tables: by number, by name, as a page. */
#include "command/args.h"

#include <stdio.h>
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

/* ---- as Markdown */

static size_t markdown_arg(const struct control_arg *a, char *out, size_t cap)
{
    size_t at = (size_t)snprintf(out, cap, "`%s`%s %s", a->name, a->optional ? " (optional)" : "", a->what);
    if (control_type_numeric(a->type) && at < cap) {
        at += (size_t)snprintf(out + at, cap - at, ", %.10g to ", a->min);
        if (a->least > 0.0 && at < cap) {
            at += (size_t)snprintf(out + at, cap - at, "%.10g and %.10g to ", -a->least, a->least);
        }
        if (at < cap) {
            at += (size_t)snprintf(out + at, cap - at, "%.10g%s%s", a->max, a->unit ? " " : "", a->unit ? a->unit : "");
        }
    }
    const char *word;
    for (unsigned i = 0; (word = control_choice(a, i)) && at < cap; i++) {
        at += (size_t)snprintf(out + at, cap - at, "%s%s", i ? ", " : ": ", word);
    }
    return at;
}

static const char *markdown_args(const struct control_command *row, char *out, size_t cap)
{
    size_t at = 0;
    snprintf(out, cap, "none");
    for (unsigned i = 0; i < control_arg_count(row) && at + 2 < cap; i++) {
        if (i) at += (size_t)snprintf(out + at, cap - at, "; ");
        at += markdown_arg(&row->arg[i], out + at, cap - at);
    }
    return out;
}

bool control_markdown(const struct control_table *const *tables, unsigned line, char *out, size_t cap)
{
    char args[8192];
    if (line == 0) snprintf(out, cap, "| command | what it does | arguments |");
    if (line == 1) snprintf(out, cap, "|---|---|---|");
    if (line < 2) return true;
    const struct control_command *row = control_row(tables, line - 2);
    if (row) snprintf(out, cap, "| `%s` | %s | %s |", row->name, row->what, markdown_args(row, args, sizeof args));
    return row != NULL;
}
