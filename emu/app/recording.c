/* Recordings: VCD files of lines, the log of the truth. */
#include "app/service.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

void service_recording_error(struct service *s, const char *what_now)
{
    const int err = vcd_error(&s->bench->vcd);
    if (!err) return;
    fprintf(stderr, "psa-emu: VCD file %s: %s; %s\n", s->vcd_path, strerror(err), what_now);
    s->vcd_failed = true;
}

static bool do_vcd_flush(void *ctx, char *why)
{
    struct service *s = ctx;
    if (s->bench->recording) vcd_flush(&s->bench->vcd);
    else snprintf(why, CONTROL_WHY_MAX, "no recording; start one with --vcd FILE or vcd.start");
    return s->bench->recording;
}

static bool do_vcd_start(void *ctx, const char *path, unsigned unit, char *why)
{
    struct service *s = ctx;
    if (s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "a recording is running; stop it with vcd.stop");
        return false;
    }
    FILE *file = fopen(path, "wbe");
    if (!file) {
        snprintf(why, CONTROL_WHY_MAX, "%.200s: %s", path, strerror(errno));
        return false;
    }
    s->ports.vcd = file;
    snprintf(s->vcd_path, sizeof s->vcd_path, "%s", path);
    return bench_record(s->bench, unit, file, s->o->vcd_unit_ns);
}

static bool do_vcd_stop(void *ctx, char *why)
{
    struct service *s = ctx;
    if (!s->bench->recording) {
        snprintf(why, CONTROL_WHY_MAX, "no recording");
        return false;
    }
    bench_record_end(s->bench);
    service_recording_error(s, "the recording is incomplete");
    fclose(s->ports.vcd);
    s->ports.vcd = NULL;
    return true;
}

const struct control_recording service_recording = {.start = do_vcd_start, .stop = do_vcd_stop, .flush = do_vcd_flush};

bool service_open_truth_log(struct service *s, char *why, size_t cap)
{
    if (!s->o->truth_log) return true;
    FILE *out = fopen(s->o->truth_log, "wbe");
    if (out) truth_log_open(&s->truth_log, out, s->o->truth_every_ns, &s->truth, &s->bench->sched);
    else snprintf(why, cap, "--truth-log %s: %s", s->o->truth_log, strerror(errno));
    return out != NULL;
}
