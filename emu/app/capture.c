#define _GNU_SOURCE /* fileno */
#include "app/service.h"

#include "base/why.h"
#include "link/own_file.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static struct capture_file *file_now(struct capture_job *j)
{
    return &j->file[j->number % CAPTURE_FILES_SHOWN];
}

/* "run.vcd", of several "run-3.vcd". */
static void name_file(const struct capture_job *j, char path[CAPTURE_PATH_MAX])
{
    if (j->files == 1) {
        snprintf(path, CAPTURE_PATH_MAX, "%s", j->path);
        return;
    }
    const char *const slash = strrchr(j->path, '/');
    const char *const dot = strrchr(slash ? slash : j->path, '.');
    const int stem = (int)(dot ? dot - j->path : (ptrdiff_t)strlen(j->path));
    snprintf(path, CAPTURE_PATH_MAX, "%.*s-%" PRIu32 "%s", stem, j->path, j->done + 1, dot ? dot : "");
}

/* ---- files */

/* A file that cannot be written is one line on stderr; the bench goes on. */
static void fail_file(struct service *s, const char *reason)
{
    struct capture_file *f = file_now(&s->capture);
    snprintf(f->why, sizeof f->why, "%.90s", reason);
    fprintf(stderr, "psa-emu: capture %s: %s; the run continues\n", f->path, reason);
    s->incomplete = true;
}

static void disarm_job(struct service *s)
{
    struct capture *c = &s->capture.core;
    capture_off(c);
    free(c->cfg.ring);
    free(c->cfg.copy);
    c->cfg.ring = NULL;
    c->cfg.copy = NULL;
    control_watch_disarm(&s->control);
}

static void end_file(struct service *s)
{
    struct capture_job *j = &s->capture;
    struct capture_file *f = file_now(j);
    struct capture *c = &j->core;
    const uint64_t lost = c->lost;
    capture_end(c);
    f->from_ns = c->from_ns;
    f->end_ns = c->end_ns;
    f->bytes = c->vcd.bytes;
    f->lost = lost;
    const int error = vcd_error(&c->vcd);
    if (error && !c->vcd.limited) {
        (void)own_file_cut(fileno(j->out));
        fail_file(s, own_file_strerror(error));
    } else if (error) {
        snprintf(f->why, sizeof f->why, "its limit of %g MB is reached", (double)c->vcd.max_bytes * 1e-6);
    } else if (lost) {
        fail_file(s, "edges are missing: the ring is too small (ring_mb)");
    }
    fclose(j->out);
    j->out = NULL;
    if (++j->done == j->files) disarm_job(s);
}

static void begin_file(struct service *s)
{
    struct capture_job *j = &s->capture;
    char why[CAPTURE_PATH_MAX + 256];
    bool user;
    j->number++;
    struct capture_file *f = file_now(j);
    *f = (struct capture_file){.number = j->number, .trigger_ns = j->core.trigger_ns};
    name_file(j, f->path);
    j->out = own_file_output("", f->path, &user, why, sizeof why);
    if (!j->out) {
        const size_t named = strncmp(why, f->path, strlen(f->path)) == 0 ? strlen(f->path) + strlen(": ") : 0;
        fail_file(s, why + named); /* the path is said beside it */
        disarm_job(s);
        return;
    }
    capture_begin(&j->core, &(struct vcd_cfg){.out = j->out,
                                              .scope = s->bench->unit[j->unit].type->name,
                                              .unit_ns = s->o->vcd_unit_ns,
                                              .max_bytes = j->max_bytes});
    f->from_ns = j->core.from_ns;
}

void service_follow_capture(struct service *s)
{
    struct capture *c = &s->capture.core;
    if (c->state == CAPTURE_OFF || c->state == CAPTURE_ARMED) return;
    if (c->state == CAPTURE_TRIGGERED) begin_file(s);
    else capture_drain(c);
    if (c->state == CAPTURE_FULL || (c->state == CAPTURE_WRITING && c->vcd.error)) end_file(s);
}

void service_end_capture(struct service *s)
{
    struct capture *c = &s->capture.core;
    if (c->state == CAPTURE_TRIGGERED) begin_file(s);
    capture_drain(c);
    if (c->state == CAPTURE_WRITING || c->state == CAPTURE_FULL) end_file(s);
    if (c->state != CAPTURE_OFF) disarm_job(s);
}

void service_abandon_capture(struct service *s)
{
    if (s->capture.out) fclose(s->capture.out);
    s->capture.out = NULL;
    disarm_job(s);
}

bool service_is_sliced(void *ctx)
{
    const struct service *s = ctx;
    return s->capture.core.state != CAPTURE_OFF || logic_is_sampling(&s->ports.logic);
}

/* ---- commands */

/* What opening it later would show, as far as it can be known now. */
static bool check_path(const char *path, char *why)
{
    struct stat st;
    char folder[CAPTURE_PATH_MAX];
    const char *const slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path) + 1 : 2, slash ? path : "./");
    if (stat(path, &st) == 0 && !S_ISREG(st.st_mode))
        return why_fail(why, CONTROL_WHY_MAX, "%.100s: expected a regular file or none, got another kind of file",
                        path);
    if (access(folder, W_OK | X_OK) == 0) return true;
    return why_unwritable(why, CONTROL_WHY_MAX, path, errno);
}

/* False without memory. */
static bool arm_job(struct service *s, const struct control_capture *a)
{
    struct unit *u = &s->bench->unit[a->unit];
    const struct capture_cfg cfg = {.pre_ns = a->pre_ns,
                                    .post_ns = a->post_ns,
                                    .mask = bench_recorded(s->bench, a->unit, s->o->pairs),
                                    .sig = a->line,
                                    .when = (enum capture_when)a->when,
                                    .ring = malloc(a->ring_bytes),
                                    .steps_max = (unsigned)(a->ring_bytes / sizeof(struct trace_step)),
                                    .copy = malloc(sizeof(struct trace))};
    if (!cfg.ring || !cfg.copy) {
        free(cfg.ring);
        free(cfg.copy);
        return false;
    }
    capture_arm(&s->capture.core, unit_trace(u), &cfg);
    return true;
}

static bool do_arm(void *ctx, const struct control_capture *a, char *why)
{
    struct service *s = ctx;
    struct capture_job *j = &s->capture;
    if (j->core.state != CAPTURE_OFF)
        return why_fail(why, CONTROL_WHY_MAX, "expected no armed capture, got one; end it with probe.disarm");
    if (strlen(a->path) + 16 > sizeof j->path) return why_fail(why, CONTROL_WHY_MAX, "path: expected a shorter one");
    if (!check_path(a->path, why)) return false;
    snprintf(j->path, sizeof j->path, "%s", a->path);
    j->unit = a->unit;
    j->files = a->files;
    j->done = 0;
    j->max_bytes = a->max_bytes;
    return arm_job(s, a) || why_fail(why, CONTROL_WHY_MAX, "out of memory");
}

static bool do_disarm(void *ctx, char *why)
{
    struct service *s = ctx;
    if (s->capture.core.state == CAPTURE_OFF)
        return why_fail(why, CONTROL_WHY_MAX, "expected an armed capture (probe.arm), got none");
    service_end_capture(s);
    return true;
}

static void do_trigger(void *ctx, int64_t t_ns)
{
    capture_trigger(&((struct service *)ctx)->capture.core, t_ns);
}

static void add_capture(cJSON *all, const struct capture_file *f)
{
    cJSON *j = cJSON_CreateObject();
    cJSON_AddNumberToObject(j, "number", (double)f->number);
    cJSON_AddStringToObject(j, "path", f->path);
    cJSON_AddNumberToObject(j, "trigger_ns", (double)f->trigger_ns);
    cJSON_AddNumberToObject(j, "from_ns", (double)f->from_ns);
    if (f->end_ns) cJSON_AddNumberToObject(j, "end_ns", (double)f->end_ns);
    cJSON_AddNumberToObject(j, "bytes", (double)f->bytes);
    cJSON_AddNumberToObject(j, "lost", (double)f->lost);
    if (f->why[0]) cJSON_AddStringToObject(j, "error", f->why);
    cJSON_AddItemToArray(all, j);
}

static void do_describe(void *ctx, cJSON *result)
{
    static const char *const states[] = {"off", "armed", "triggered", "writing", "writing"};
    const struct capture_job *j = &((struct service *)ctx)->capture;
    cJSON_AddStringToObject(result, "state", states[j->core.state]);
    cJSON_AddNumberToObject(result, "triggers", (double)j->core.triggers);
    cJSON *all = cJSON_AddArrayToObject(result, "captures");
    const uint64_t first = j->number > CAPTURE_FILES_SHOWN ? j->number - CAPTURE_FILES_SHOWN + 1 : 1;
    for (uint64_t n = first; n <= j->number; n++) add_capture(all, &j->file[n % CAPTURE_FILES_SHOWN]);
}

const struct control_captures service_captures = {
    .arm = do_arm, .disarm = do_disarm, .trigger = do_trigger, .describe = do_describe};
