/* Files that grow while the emulator runs: VCD of lines, CAN logs, truth log, LCM log. Each is checked after time has moved. A file
 * that ends early (full disk, limit, removed file) ends with a whole line, and one line on stderr gives the reason. */
#define _GNU_SOURCE /* fileno */
#include "app/service.h"
#include "link/own_file.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LOOK_NS INT64_C(1000000000) /* wall time between two checks that the files are still there */

enum { STORED_MAX = 96, TAIL = 4096 };

/* ---- what is left of a file */

/* "stored 1310680 bytes, edges before 0.104 s": the last time of a VCD that ends with a whole line. */
static void describe_vcd(struct service *s, char stored[STORED_MAX])
{
    char tail[TAIL + 1];
    const int fd = fileno(s->ports.vcd);
    const off_t size = own_file_cut(fd), from = size > TAIL ? size - TAIL : 0;
    const ssize_t n = size ? pread(fd, tail, (size_t)(size - from), from) : 0;
    tail[n > 0 ? n : 0] = '\0';
    const char *time = strrchr(tail, '#');
    const double t_s = time ? (double)strtoll(time + 1, NULL, 10) * (double)s->bench->vcd.chunk.unit_ns * 1e-9 : 0.0;
    snprintf(stored, STORED_MAX, "stored %lld bytes, edges before %.9f s", (long long)size, t_s);
}

/* A pipe or a device cannot be read back. */
static void describe_stored(struct service *s, char stored[STORED_MAX])
{
    struct stat st;
    const int fd = fileno(s->ports.vcd);
    if (own_file_removed(fd)) snprintf(stored, STORED_MAX, "stored 0 bytes");
    else if (fstat(fd, &st) == 0 && S_ISREG(st.st_mode)) describe_vcd(s, stored);
    else snprintf(stored, STORED_MAX, "wrote %" PRIu64 " bytes", s->bench->vcd.bytes);
}

enum { REASON_MAX = 64 };

static void describe_reason(const struct vcd *v, char reason[REASON_MAX])
{
    if (v->limited) snprintf(reason, REASON_MAX, "its limit of %g MB is reached", (double)v->max_bytes * 1e-6);
    else snprintf(reason, REASON_MAX, "%s", own_file_strerror(v->error));
}

/* The limit of vcd.start is no fault: the exit status is that of the run. */
static void end_vcd(struct service *s)
{
    char stored[STORED_MAX], reason[REASON_MAX];
    describe_reason(&s->bench->vcd, reason);
    describe_stored(s, stored);
    service_report_file("VCD file", s->vcd_path, reason, stored);
    control_file_ended(&s->control, s->vcd_path, s->bench->vcd.bytes, reason, s->bench->sched.now_ns);
    snprintf(s->vcd_why, sizeof s->vcd_why, "%.100s: %s; %.80s", s->vcd_path, reason, stored);
    if (!s->bench->vcd.limited) s->incomplete = true;
}

/* ---- checks */

static void check_vcd(struct service *s, bool look)
{
    struct vcd *v = &s->bench->vcd;
    if (look && !v->error && own_file_gone(fileno(s->ports.vcd), s->vcd_path)) {
        vcd_flush(v); /* a moved file is complete up to now */
        vcd_fail(v, ESTALE);
    }
    if (vcd_error(v)) end_vcd(s);
}

static void check_log(struct service *s, struct can_log *l, bool look)
{
    char stored[STORED_MAX];
    if (look) can_log_look(l);
    if (!l->error || l->reported) return;
    l->reported = true;
    snprintf(stored, sizeof stored, "stored %" PRIu64 " of %" PRIu64 " frames so far", l->stored, l->frames);
    service_report_file("CAN log", l->path, own_file_strerror(l->error), stored);
    s->incomplete = true;
}

static void check_truth(struct service *s, bool look)
{
    char stored[STORED_MAX];
    struct truth_log *l = &s->truth_log;
    if (look && own_file_gone(fileno(l->out), s->o->truth_log)) l->error = ESTALE;
    if (!l->error || l->reported) return;
    l->reported = true;
    (void)own_file_cut(fileno(l->out));
    snprintf(stored, sizeof stored, "stored %" PRIu64 " lines", own_file_removed(fileno(l->out)) ? 0 : l->lines);
    service_report_file("truth log", s->o->truth_log, own_file_strerror(l->error), stored);
    s->incomplete = true;
}

static void check_all(struct service *s, bool look)
{
    if (s->bench->recording) check_vcd(s, look);
    for (unsigned i = 0; i < s->ports.can_count; i++)
        if (s->ports.can[i]->kind == OPTIONS_CAN_LOG) check_log(s, &s->ports.can[i]->log, look);
    if (s->truth_log.out) check_truth(s, look);
}

static bool has_files(const struct service *s)
{
    bool log = false;
    for (unsigned i = 0; i < s->ports.can_count; i++) log |= s->ports.can[i]->kind == OPTIONS_CAN_LOG;
    return log || s->bench->recording || s->truth_log.out;
}

void service_check_files(struct service *s)
{
    if (!has_files(s)) return;
    const int64_t now_ns = pace_clock_ns();
    const bool look = now_ns >= s->look_ns;
    if (look) s->look_ns = now_ns + LOOK_NS;
    check_all(s, look);
}

void service_end_files(struct service *s)
{
    const bool recorded = s->bench->recording;
    bench_finish(s->bench);
    service_end_capture(s);
    s->bench->recording = recorded; /* for check_all() */
    for (unsigned i = 0; i < s->ports.can_count; i++)
        if (s->ports.can[i]->kind == OPTIONS_CAN_LOG) (void)can_log_flush(&s->ports.can[i]->log);
    if (s->lcm) service_end_lcm(s);
    check_all(s, true);
    s->bench->recording = false;
    const bool reported = s->truth_log.reported;
    const int error = truth_log_close(&s->truth_log);
    if (!error || reported) return;
    service_report_file("truth log", s->o->truth_log, own_file_strerror(error), "its end is missing");
    s->incomplete = true;
}

/* ---- commands */

static bool do_vcd_flush(void *ctx, char *why)
{
    struct service *s = ctx;
    if (!s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "no recording; start one with --vcd FILE or vcd.start");
        return false;
    }
    vcd_flush(&s->bench->vcd);
    check_vcd(s, true);
    snprintf(why, CONTROL_WHY_MAX, "%s", s->vcd_why);
    return !s->vcd_why[0];
}

static bool do_vcd_start(void *ctx, const char *path, unsigned unit, bool wires, uint64_t max_bytes, char *why)
{
    struct service *s = ctx;
    bool user;
    if (s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "a recording is running; stop it with vcd.stop");
        return false;
    }
    const struct board_type *type = s->bench->unit[unit].type;
    if (wires && !type->pairs) {
        snprintf(why, CONTROL_WHY_MAX, "pairs: expected a board with differential pairs (psa2, bins), got %s",
                 type->name);
        return false;
    }
    struct stat st;
    if (stat(path, &st) == 0 && S_ISFIFO(st.st_mode)) { /* opening it waits for a reader, and the emulator with it */
        snprintf(why, CONTROL_WHY_MAX, "%.100s: expected a file, got a pipe; --vcd takes one", path);
        return false;
    }
    FILE *file = own_file_output("", path, &user, why, CONTROL_WHY_MAX);
    if (!file) return false;
    s->ports.vcd = file;
    s->vcd_why[0] = '\0';
    snprintf(s->vcd_path, sizeof s->vcd_path, "%s", path);
    const struct bench_recording what = {unit, wires || s->o->pairs, s->o->vcd_analog, s->o->vcd_unit_ns, max_bytes};
    return bench_record(s->bench, &what, file);
}

static bool do_vcd_stop(void *ctx, char *why)
{
    struct service *s = ctx;
    if (!s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "no recording");
        return false;
    }
    vcd_close(&s->bench->vcd, s->bench->sched.now_ns - TRACE_LAG_NS);
    check_vcd(s, true);
    s->bench->recording = false;
    fclose(s->ports.vcd);
    s->ports.vcd = NULL;
    snprintf(why, CONTROL_WHY_MAX, "%s", s->vcd_why);
    return !s->vcd_why[0];
}

const struct control_recording service_recording = {.start = do_vcd_start, .stop = do_vcd_stop, .flush = do_vcd_flush};

bool service_open_truth_log(struct service *s, char *why, size_t cap)
{
    if (!s->o->truth_log) return true;
    FILE *out = own_file_output("--truth-log ", s->o->truth_log, &s->refused, why, cap);
    if (out) truth_log_open(&s->truth_log, out, s->o->truth_every_ns, &s->truth, &s->bench->sched);
    return out != NULL;
}

/* ---- what there is, for counters */

static double size_of(int fd)
{
    struct stat st;
    return fstat(fd, &st) < 0 ? 0.0 : (double)st.st_size;
}

static const char *error_text(int error)
{
    return error ? own_file_strerror(error) : NULL;
}

static void add_vcd(cJSON *files, const struct service *s)
{
    char reason[REASON_MAX];
    const struct vcd *v = &s->bench->vcd;
    describe_reason(v, reason);
    cJSON *f = service_add_file(files, "vcd", s->vcd_path, (double)(v->bytes + v->len), v->error ? reason : NULL);
    if (v->max_bytes) cJSON_AddNumberToObject(f, "max_bytes", (double)v->max_bytes);
}

void service_describe_files(void *ctx, cJSON *result)
{
    const struct service *s = ctx;
    const struct truth_log *truth = &s->truth_log;
    cJSON *files = cJSON_AddArrayToObject(result, "files");
    if (s->bench->recording) add_vcd(files, s);
    for (unsigned i = 0; i < s->ports.can_count; i++) {
        const struct can_log *l = &s->ports.can[i]->log;
        if (s->ports.can[i]->kind == OPTIONS_CAN_LOG)
            service_add_file(files, "can log", l->path, size_of(l->fd) + (double)l->len, error_text(l->error));
    }
    if (truth->out)
        service_add_file(files, "truth log", s->o->truth_log, size_of(fileno(truth->out)), error_text(truth->error));
    if (s->lcm) service_describe_lcm(s, files);
    logic_describe(&s->ports.logic, result);
    cJSON *journal = cJSON_AddObjectToObject(result, "journal");
    cJSON_AddNumberToObject(journal, "bytes", (double)s->journal.len);
    cJSON_AddNumberToObject(journal, "max_bytes", JOURNAL_MAX);
}
