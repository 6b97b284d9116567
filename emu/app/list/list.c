#include "app/list/list.h"

#include "control/control.h"
#include "scenario/find.h"
#include "scenario/profile.h"
#include "scpi/lex.h"
#include "scpi/scpi.h"

#include <stdlib.h>
#include <string.h>

void list_comment(const char *path, char *text, size_t cap)
{
    char line[256] = "";
    text[0] = '\0';
    FILE *in = fopen(path, "re");
    if (!in) return;
    const bool read = fgets(line, sizeof line, in);
    fclose(in);
    if (!read || line[0] != '#') return;
    line[strcspn(line, "\n")] = '\0';
    char *end = strstr(line, ". ");
    if (end) end[1] = '\0';
    snprintf(text, cap, "%s", line + 1 + strspn(line + 1, " "));
}

static void list_profile(FILE *out, const char *path, const char *comment)
{
    char why[512];
    const struct board_name *board;
    union board_profile_store p;
    if (!profile_yaml_load(path, &board, &p, why, sizeof why)) {
        fprintf(out, "%s\n", why);
        return;
    }
    char about[256];
    board->type->about(&p, about, sizeof about);
    fprintf(out, "%-12s %s: %s\n", board_profile_name(board->type, &p), board_name_title(board), about);
    if (*comment) fprintf(out, "             %s\n", comment);
}

bool list_files(FILE *out, const char *proto_folder, char *why, size_t cap)
{
    char folder[FIND_PATH_MAX], path[FIND_PATH_MAX + FIND_NAME_MAX + 8], comment[256];
    char(*names)[FIND_NAME_MAX];
    unsigned count;
    const bool profiles = strcmp(proto_folder, "profiles") == 0;
    if (!find_proto_folder(proto_folder, folder, why, cap) || !find_names(folder, &names, &count, why, cap))
        return false;
    for (unsigned i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%s/%s.yaml", folder, names[i]);
        list_comment(path, comment, sizeof comment);
        if (profiles) list_profile(out, path, comment);
        else fprintf(out, "%-13s %s\n", names[i], comment);
    }
    free(names);
    return true;
}

/* ---- commands */

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

void list_table(FILE *out, const struct control_table *const *tables)
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

void list_commands(FILE *out)
{
    list_table(out, control_tables);
    fprintf(out, "\n");
    list_table(out, control_truth_tables);
}

/* ---- SCPI headers */

static void print_params(FILE *out, const struct control_command *row, unsigned suffixes)
{
    for (unsigned i = suffixes; i < control_arg_count(row); i++) {
        const struct control_arg *a = &row->arg[i];
        const char *next = ": ", *word;
        fprintf(out, "%s%s%s", i > suffixes ? "; " : "", a->name, a->optional ? " (optional)" : "");
        if (control_type_numeric(a->type)) {
            fprintf(out, " %.10g to %.10g", a->min, a->max);
            next = " ";
        }
        for (unsigned k = 0; (word = a->choices ? a->choices[k] : scpi_suffix(a->unit, k)); k++, next = ", ")
            fprintf(out, "%s%s", next, word);
        if (a->type == CONTROL_BOOL) fprintf(out, ": ON, OFF, 1, 0");
    }
}

static void print_common(FILE *out)
{
    const struct scpi_command *row;
    fprintf(out, "| header | parameter | what it does |\n|---|---|---|\n");
    for (unsigned i = 0; (row = scpi_common(i)); i++) {
        fprintf(out, "| `%s` | ", row->pattern);
        if (row->max) fprintf(out, "0 to %u", row->max);
        fprintf(out, " | %s |\n", row->what);
    }
}

static void print_headers(FILE *out, const struct control_command *row)
{
    for (unsigned i = 0; i < CONTROL_SCPI_MAX && row->scpi[i].header; i++) {
        const struct control_scpi *how = &row->scpi[i];
        fprintf(out, "| `%s` | ", how->header);
        if (how->result) fprintf(out, "returns %s", how->result);
        else print_params(out, row, scpi_suffixes(how->header));
        fprintf(out, " | `%s` | %s |\n", row->name, row->what);
    }
}

void list_scpi(FILE *out)
{
    const struct control_command *row;
    print_common(out);
    for (const struct scpi_kind *kind = scpi_kinds; kind->name; kind++) {
        fprintf(out, "\n| header | parameters, response | command | what it does |\n|---|---|---|---|\n");
        for (unsigned i = 0; (row = control_row(control_tables, i)); i++) {
            if (scpi_belongs(kind, row)) print_headers(out, row);
        }
    }
}
