/* What the tests of libpsabench share: parts that must come up, calls that must succeed, recordings read back. */
#ifndef PSABENCH_TESTS_API_RIG_H
#define PSABENCH_TESTS_API_RIG_H

#define _POSIX_C_SOURCE 200809L /* mkstemp */

#include "rig.h"

#include "api/psabench.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#define MS INT64_C(1000000)
#define S  INT64_C(1000000000)

static inline psabench_part *part(psabench *b, const char *kind, const char *name, const char *options)
{
    psabench_part *p = psabench_part_new(b, kind, name, options);
    if (!p) fail_msg("%s", psabench_error_text(b));
    return p;
}

/* A call that must succeed. */
static inline void good(const psabench *b, int result)
{
    if (result < 0) fail_msg("%d: %s", result, psabench_error_text(b));
}

static inline int pin(const psabench_part *p, const char *name)
{
    const int number = psabench_pin(p, name);
    if (number < 0) fail_msg("%s", psabench_error_text(psabench_of(p)));
    return number;
}

static inline void set(psabench_part *p, const char *name, int level)
{
    good(psabench_of(p), psabench_set(p, pin(p, name), level));
}

static inline int get(const psabench_part *p, const char *name)
{
    const int level = psabench_get(p, pin(p, name));
    good(psabench_of(p), level);
    return level;
}

static inline void run(psabench *b, int64_t ns)
{
    good(b, psabench_run_for(b, ns));
}

static inline void until(psabench_part *p, const char *name, int level)
{
    good(psabench_of(p), psabench_run_until_level(p, pin(p, name), level, S));
}

static inline uint64_t counter(const psabench_part *p, const char *name)
{
    uint64_t value;
    const char *found;
    for (int i = 0; (found = psabench_counter(p, i, &value)); i++)
        if (strcmp(found, name) == 0) return value;
    fail_msg("no counter %s", name);
    return 0;
}

static inline int32_t code24(const uint8_t b[3])
{
    return (int32_t)(((uint32_t)b[0] << 16 | (uint32_t)b[1] << 8 | b[2]) ^ 0x800000) - 0x800000;
}

/* ---- recordings ---- */

struct rig_change {
    int64_t t_ns;
    char name[40]; /* part.pin */
    int level;
};

struct rig_vcd {
    char path[64];
    struct rig_change change[20000];
    unsigned count; /* of changes behind the initial levels */
    int64_t start_ns, end_ns;
};

static inline void rig_vcd_path(struct rig_vcd *v)
{
    strcpy(v->path, "/tmp/psabench-XXXXXX");
    const int fd = mkstemp(v->path);
    assert_true(fd >= 0);
    (void)close(fd);
}

/* Reads the file and removes it. The pin's name is found by its code. */
static inline void rig_vcd_read(struct rig_vcd *v)
{
    static char names[1000][64]; /* "code part.pin" */
    char line[100];
    char scope[32] = "";
    unsigned count = 0;
    bool initial = false;
    int64_t t_ns = -1;
    FILE *f = fopen(v->path, "r");
    assert_non_null(f);
    v->count = 0;
    v->start_ns = -1;
    while (fgets(line, sizeof line, f)) {
        char code[8];
        char name[16];
        line[strcspn(line, "\n")] = '\0';
        if (sscanf(line, "$scope module %31s", scope) == 1) continue;
        if (sscanf(line, "$var wire 1 %7s %15s", code, name) == 2) {
            assert_true(count < COUNT(names));
            (void)snprintf(names[count++], sizeof names[0], "%s %s.%s", code, scope, name);
        } else if (line[0] == '#') {
            const int64_t next_ns = strtoll(line + 1, NULL, 10);
            assert_true(next_ns > t_ns);
            t_ns = next_ns;
            if (v->start_ns < 0) v->start_ns = t_ns;
        } else if (line[0] == '$') {
            initial = strcmp(line, "$dumpvars") == 0;
        } else {
            const size_t len = strlen(line + 1);
            unsigned i = 0;
            while (i < count && !(strncmp(names[i], line + 1, len) == 0 && names[i][len] == ' ')) i++;
            assert_true(i < count && (line[0] == '0' || line[0] == '1'));
            if (initial) continue;
            assert_true(v->count < COUNT(v->change));
            struct rig_change *c = &v->change[v->count++];
            c->t_ns = t_ns;
            c->level = line[0] == '1';
            (void)snprintf(c->name, sizeof c->name, "%.39s", names[i] + len + 1);
        }
    }
    v->end_ns = t_ns;
    (void)fclose(f);
    (void)unlink(v->path);
}

/* What a watcher of one pin has heard. */
struct rig_seen {
    psabench_part *p;
    int pin;
    unsigned count, wrong;
    int64_t t_ns[100];
    int level[100];
};

static inline void rig_note(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    struct rig_seen *s = ctx;
    s->wrong +=
        p != s->p || number != s->pin || psabench_get(p, number) != level || psabench_now_ns(psabench_of(p)) != t_ns;
    if (s->count < COUNT(s->t_ns)) s->t_ns[s->count] = t_ns, s->level[s->count] = level;
    s->count++;
}

#endif
