#define _GNU_SOURCE /* realpath */
/* The files that a scenario names for its signals. */
#include "base/why.h"
#include "scenario/scenario.h"
#include "scenario/series_file.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Absolute, so that a dump in another folder names the same file. */
static bool absolute_path(const char *beside, char *file, size_t size, char *why, size_t cap)
{
    char path[2 * FIND_PATH_MAX], whole[PATH_MAX];
    const char *slash = file[0] != '/' ? strrchr(beside, '/') : NULL;
    const int folder = slash ? (int)(slash - beside) + 1 : 0;
    snprintf(path, sizeof path, "%.*s%s", folder, beside, file);
    if (!realpath(path, whole)) return why_expected(why, cap, path, why_found(errno), "a recorded signal in CSV");
    if (strlen(whole) >= size)
        return why_fail(why, cap, "%.80s...: expected a path of up to %zu bytes", whole, size - 1);
    memcpy(file, whole, strlen(whole) + 1);
    return true;
}

static bool open_series(const char *beside, struct scenario_series *from, struct series *s, char *why, size_t cap)
{
    char hex[SHA256_HEX];
    *s = (struct series){
        .start_ns = (int64_t)llround(from->start_s * 1e9), .between = from->between, .end = from->at_end};
    if (!absolute_path(beside, from->file, sizeof from->file, why, cap)) return false;
    if (!series_file_open(from->file, from->column, s, hex, why, cap)) return false;
    if (from->sha256[0] && strcmp(from->sha256, hex) != 0)
        return why_fail(why, cap, "%s: expected the SHA-256 %s, got %s: the file has changed", from->file, from->sha256,
                        hex);
    if (s->end == SERIES_END_REPEAT && s->count < 2)
        return why_fail(why, cap, "%s: expected two samples or more for at_end: repeat, got one", from->file);
    memcpy(from->sha256, hex, sizeof hex);
    return true;
}

bool scenario_open(struct scenario *s, char *why, size_t cap)
{
    for (unsigned i = 0; i < s->unit_count; i++) {
        struct scenario_unit *u = &s->units[i];
        for (unsigned k = 0; k < UNIT_AXES; k++) {
            char what[512];
            if (!u->series[k].given || open_series(s->path, &u->series[k], &u->cfg.axis[k].series, what, sizeof what))
                continue;
            snprintf(why, cap, "units.%s.axes.%c.signal: %s", u->name, "xyz"[k], what);
            return false;
        }
    }
    return true;
}
