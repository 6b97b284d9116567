#include "app/list.h"

#include "control/control.h"
#include "scenario/find.h"
#include "scenario/profile.h"

#include <stdlib.h>
#include <string.h>

/* First sentence of the comment that a file begins with, as far as it is on the first line: what the file is. */
static void first_comment(const char *path, char *text, size_t cap)
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

static bool list_files(FILE *out, const char *proto_folder, char *why, size_t cap)
{
    char folder[FIND_PATH_MAX], path[FIND_PATH_MAX + FIND_NAME_MAX + 8], comment[256];
    char(*names)[FIND_NAME_MAX];
    unsigned count;
    const bool profiles = strcmp(proto_folder, "profiles") == 0;
    if (!find_proto_folder(proto_folder, folder, why, cap) || !find_names(folder, &names, &count, why, cap))
        return false;
    for (unsigned i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%s/%s.yaml", folder, names[i]);
        first_comment(path, comment, sizeof comment);
        if (profiles) list_profile(out, path, comment);
        else fprintf(out, "%-13s %s\n", names[i], comment);
    }
    free(names);
    return true;
}

bool list_profiles(FILE *out, char *why, size_t cap)
{
    return list_files(out, "profiles", why, cap);
}

bool list_scenarios(FILE *out, char *why, size_t cap)
{
    return list_files(out, "scenarios", why, cap);
}

void list_commands(FILE *out)
{
    control_markdown(control_tables, out);
    fprintf(out, "\n");
    control_markdown(control_truth_tables, out);
}
