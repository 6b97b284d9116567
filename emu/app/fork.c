#define _GNU_SOURCE /* pipe2 */
#include "app/service.h"

#include "base/why.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { REPLY_MAX = 8192, FD_STDERR = 2 };

static const char failure[] = "fail ";

/* ---- the child */

/* Every descriptor of the parent but stderr and `keep` leads nowhere from now on: what the parent's links and files do when
 * they are closed reaches no one. */
static bool redirect_to_null(int keep)
{
    const int null = open("/dev/null", O_RDWR | O_CLOEXEC);
    DIR *open_fds = opendir("/proc/self/fd");
    if (null < 0 || !open_fds) return false;
    for (const struct dirent *e; (e = readdir(open_fds));) {
        const int fd = atoi(e->d_name);
        if (e->d_name[0] == '.' || fd == FD_STDERR || fd == keep || fd == null || fd == dirfd(open_fds)) continue;
        if (dup2(null, fd) < 0) return false;
    }
    closedir(open_fds);
    close(null);
    return true;
}

static bool take_over(struct service *s, const struct options *o, int out_fd, char *why, size_t cap)
{
    if (!redirect_to_null(out_fd)) return why_fail(why, cap, "/dev/null or /proc: %s", strerror(errno));
    service_abandon(s);
    return service_reopen(s, o, why, cap);
}

static bool reseed_child(struct service *s, uint64_t seed, char *why, size_t cap)
{
    cJSON *args = cJSON_CreateObject(), *result = cJSON_CreateObject();
    const bool made = args && result && cJSON_AddNumberToObject(args, "seed", (double)seed);
    const int64_t t_ns = s->bench->sched.now_ns;
    const bool done = made && control_call(&s->control, "reseed", args, result, t_ns) == CONTROL_DONE;
    cJSON_Delete(args);
    cJSON_Delete(result);
    return done || why_fail(why, cap, "reseed: %s", made ? s->control.error.why : "out of memory");
}

static _Noreturn void run_child(struct service *s, const struct options *o, const uint64_t *seed, int out_fd)
{
    char why[1024];
    FILE *out = fdopen(out_fd, "w");
    if (!out) _exit(SERVICE_MACHINE);
    if (!take_over(s, o, out_fd, why, sizeof why) || (seed && !reseed_child(s, *seed, why, sizeof why))) {
        fprintf(out, "%s%s\n", failure, why);
        fflush(out);
        _exit(SERVICE_MACHINE);
    }
    cJSON *endpoints = ports_endpoints(&s->ports, o);
    char *text = cJSON_PrintUnformatted(endpoints);
    fprintf(out, "%s\n", text ? text : "out of memory");
    cJSON_free(text);
    cJSON_Delete(endpoints);
    fclose(out);
    exit(service_live(s));
}

/* ---- the parent */

/* All that the child says until it closes its end. */
static size_t read_all(int fd, char *text, size_t cap)
{
    size_t len = 0;
    for (ssize_t n; len + 1 < cap; len += (size_t)n) {
        n = read(fd, text + len, cap - 1 - len);
        if (n < 0 && errno == EINTR) n = 0;
        else if (n <= 0) break;
    }
    text[len] = '\0';
    return len;
}

static bool put_result(pid_t pid, char *text, cJSON *result, char *why)
{
    const bool failed = strncmp(text, failure, sizeof failure - 1) == 0;
    cJSON *endpoints = failed ? NULL : cJSON_Parse(text);
    if (!endpoints) {
        text[strcspn(text, "\n")] = '\0';
        snprintf(why, CONTROL_WHY_MAX, "%.240s", failed ? text + sizeof failure - 1 : "the child ended at once");
        return false;
    }
    cJSON_AddNumberToObject(result, "pid", pid);
    cJSON_AddItemToObject(result, "endpoints", endpoints);
    return true;
}

/* What the child will have open. */
struct child_options {
    struct options o;
    char can[1024];
};

static bool make_options(struct child_options *w, const struct options *parent, const struct control_fork *f, char *why)
{
    struct options *o = &w->o;
    *o = *parent;
    o->restore = o->vcd = o->line = o->truth_log = o->lcm = o->resolved = NULL;
    o->control = f->control;
    o->truth = f->truth;
    o->wait_client = false;
    o->mavlink_count = 0;
    for (unsigned i = 0; i < o->scpi_count; i++) { /* the parent's ports and links are taken */
        o->scpi[i].port = 0;
        o->scpi[i].link = NULL;
    }
    for (unsigned i = 0; i < o->bus_count; i++) o->bus[i].link = NULL;
    for (unsigned i = 0; i < o->serial_count; i++) o->serial[i].link = NULL;
    snprintf(w->can, sizeof w->can, "%s", f->can);
    return options_cans(o, w->can, why, CONTROL_WHY_MAX);
}

bool service_fork(void *ctx, const struct control_fork *f, cJSON *result, char *why)
{
    struct service *s = ctx;
    char text[REPLY_MAX];
    int pipe_fd[2];
    struct child_options *w = malloc(sizeof *w);
    why[0] = '\0';
    if (!w || !make_options(w, s->o, f, why) || pipe2(pipe_fd, O_CLOEXEC) < 0) {
        if (!why[0]) snprintf(why, CONTROL_WHY_MAX, "%s", strerror(errno));
        free(w);
        return false;
    }
    fflush(NULL); /* or both would write what waits */
    const pid_t pid = fork();
    if (pid == 0) run_child(s, &w->o, f->seed, pipe_fd[1]); /* w is the child's as long as it lives */
    const int err = errno;
    free(w);
    close(pipe_fd[1]);
    if (pid > 0) read_all(pipe_fd[0], text, sizeof text);
    close(pipe_fd[0]);
    if (pid > 0) return put_result(pid, text, result, why);
    return why_fail(why, CONTROL_WHY_MAX, "fork: %s", strerror(err));
}
