#define _GNU_SOURCE /* readlink, scandir */
#include "scenario/find.h"

#include "base/why.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* i-th place for protocol files; false past the last. An empty text: this place does not exist here. */
static bool proto_place(unsigned i, char *dir, size_t cap)
{
    static const char *const beside_program[] = {"../proto", "../share/psabench/proto"};
    char program[FIND_PATH_MAX];
    const char *env = getenv("PSABENCH_PROTO");
    dir[0] = '\0';
    if (i == 0 && env) snprintf(dir, cap, "%s", env);
    if (i == 1) snprintf(dir, cap, "proto");
    if (i < 2) return true;
    if (i > 3) return false;
    const ssize_t n = readlink("/proc/self/exe", program, sizeof program - 1);
    if (n <= 0) return true;
    program[n] = '\0';
    char *slash = strrchr(program, '/');
    if (slash) *slash = '\0';
    snprintf(dir, cap, "%.380s/%s", program, beside_program[i - 2]);
    return true;
}

static bool is_path(const char *name)
{
    const size_t len = strlen(name);
    return strchr(name, '/') || (len > 5 && strcmp(name + len - 5, ".yaml") == 0);
}

static void take_path(const char *name, const char *beside, char *path)
{
    const char *slash = beside && name[0] != '/' ? strrchr(beside, '/') : NULL;
    if (slash) snprintf(path, FIND_PATH_MAX, "%.*s/%s", (int)(slash - beside), beside, name);
    else snprintf(path, FIND_PATH_MAX, "%s", name);
}

bool find_proto_folder(const char *folder, char *path, char *why, size_t cap)
{
    char dir[FIND_PATH_MAX];
    for (unsigned i = 0; proto_place(i, dir, sizeof dir); i++) {
        snprintf(path, FIND_PATH_MAX, "%.440s/%.60s", dir, folder);
        if (dir[0] && access(path, R_OK) == 0) return true;
    }
    snprintf(why, cap,
             "proto/%s: expected a file here or beside the program; PSABENCH_PROTO=DIR names the folder proto", folder);
    return false;
}

static int is_named(const struct dirent *e)
{
    const size_t len = strlen(e->d_name);
    return len > 5 && len - 5 < FIND_NAME_MAX && strcmp(e->d_name + len - 5, ".yaml") == 0;
}

bool find_names(const char *path, char (**names)[FIND_NAME_MAX], unsigned *count, char *why, size_t cap)
{
    struct dirent **found = NULL;
    const int n = scandir(path, &found, is_named, alphasort);
    *names = n < 0 ? NULL : calloc((size_t)n + 1, sizeof **names);
    *count = *names ? (unsigned)n : 0;
    for (int i = 0; i < n; i++) {
        if (*names) memcpy((*names)[i], found[i]->d_name, strlen(found[i]->d_name) - 5);
        free(found[i]);
    }
    free(found);
    if (!*names) why_expected(why, cap, path, why_found(errno), "a folder");
    return *names != NULL;
}

static void list_names(const char *folder, const char *name, char *why, size_t cap)
{
    char path[FIND_PATH_MAX];
    char(*names)[FIND_NAME_MAX];
    unsigned count;
    if (!find_proto_folder(folder, path, why, cap) || !find_names(path, &names, &count, why, cap)) return;
    int at = snprintf(why, cap, "%.60s: expected a path or a name from proto/%s:", name, folder);
    for (unsigned i = 0; i < count && at >= 0 && (size_t)at < cap; i++)
        at += snprintf(why + at, cap - (size_t)at, "%s %s", i ? "," : "", names[i]);
    free(names);
}

bool find_proto(const char *folder, const char *name, const char *beside, char *path, char *why, size_t cap)
{
    char dir[FIND_PATH_MAX];
    if (is_path(name)) {
        take_path(name, beside, path);
        if (access(path, R_OK) == 0) return true;
        return why_expected(why, cap, path, why_found(errno), "a %.*s file", (int)strlen(folder) - 1, folder);
    }
    for (unsigned i = 0; proto_place(i, dir, sizeof dir); i++) {
        snprintf(path, FIND_PATH_MAX, "%.380s/%s/%.60s.yaml", dir, folder, name);
        if (dir[0] && access(path, R_OK) == 0) return true;
    }
    list_names(folder, name, why, cap);
    return false;
}
