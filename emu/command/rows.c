/* Rows of the command tables: by number, by name, as a page. */
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

/* ---- as Markdown */

static void print_arg(FILE *out, const struct control_arg *a)
{
    fprintf(out, "`%s`%s %s", a->name, a->optional ? " (optional)" : "", a->what);
    if (control_type_numeric(a->type)) {
        fprintf(out, ", %.10g to ", a->min);
        if (a->least > 0.0) fprintf(out, "%.10g and %.10g to ", -a->least, a->least);
        fprintf(out, "%.10g%s%s", a->max, a->unit ? " " : "", a->unit ? a->unit : "");
    }
    const char *word;
    for (unsigned i = 0; (word = control_choice(a, i)); i++) fprintf(out, "%s%s", i ? ", " : ": ", word);
}

void control_markdown(const struct control_table *const *tables, FILE *out)
{
    const struct control_command *row;
    fprintf(out, "| command | what it does | arguments |\n|---|---|---|\n");
    for (unsigned i = 0; (row = control_row(tables, i)); i++) {
        const unsigned args = control_arg_count(row);
        fprintf(out, "| `%s` | %s | %s", row->name, row->what, args ? "" : "none");
        for (unsigned k = 0; k < args; k++) {
            if (k) fprintf(out, "; ");
            print_arg(out, &row->arg[k]);
        }
        fprintf(out, " |\n");
    }
}
