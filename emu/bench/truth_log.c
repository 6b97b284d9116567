#include "bench/truth_log.h"

#include "command/exact.h"

#include <errno.h>
#include <stdlib.h>

static void write_unit(struct truth_log *l, const char *unit, int64_t t_ns)
{
    cJSON *args = cJSON_CreateObject(), *line = cJSON_CreateObject();
    cJSON_AddStringToObject(args, "unit", unit);
    cJSON_AddNumberToObject(line, "t_ns", (double)t_ns);
    cJSON_AddStringToObject(line, "unit", unit);
    const bool ok = control_call(l->truth, "truth.state", args, line, t_ns) == CONTROL_DONE;
    char *text = ok ? exact_line(line) : NULL;
    errno = text ? 0 : ENOMEM;
    if (!text || fprintf(l->out, "%s\n", text) < 0) l->error = errno ? errno : EIO;
    else l->lines++;
    free(text);
    cJSON_Delete(line);
    cJSON_Delete(args);
}

static void on_due(void *ctx, int64_t t_ns)
{
    struct truth_log *l = ctx;
    const struct control_bench *b = l->truth->bench;
    for (unsigned i = 0; i < b->units && !l->error; i++) write_unit(l, b->unit_name[i], t_ns);
    if (!l->error) sched_at(l->sched, &l->ev, t_ns + l->every_ns);
}

void truth_log_open(struct truth_log *l, FILE *out, int64_t every_ns, struct control *truth, struct sched *s)
{
    *l = (struct truth_log){.out = out, .truth = truth, .sched = s, .every_ns = every_ns};
    sched_ev(&l->ev, on_due, l);
    sched_at(s, &l->ev, s->now_ns ? (s->now_ns / every_ns + 1) * every_ns : 0);
}

int truth_log_close(struct truth_log *l)
{
    if (!l->out) return 0;
    sched_cancel(l->sched, &l->ev);
    errno = 0;
    if (fclose(l->out) != 0 && !l->error) l->error = errno ? errno : EIO;
    l->out = NULL;
    return l->error;
}
