#include "control/control.h"

#include "command/args.h"
#include "control/commands.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const struct control_table *const control_tables[] = {
    &commands_bench, &commands_head,  &commands_table,    &commands_chamber, &commands_supply, &commands_platform,
    &commands_watch, &commands_fault, &commands_snapshot, &commands_bus,     &commands_can,    NULL};
const struct control_table *const control_truth_tables[] = {&commands_truth, NULL};

void control_init(struct control *c, const struct control_table *const *tables, const struct control_bench *bench)
{
    *c = (struct control){.tables = tables, .bench = bench};
}

enum control_outcome control_refuse(struct control *c, const char *code, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(c->refusal.why, sizeof c->refusal.why, format, ap);
    va_end(ap);
    c->refusal.code = code;
    return CONTROL_REFUSED;
}

void control_settle_inputs(const struct control_bench *b, int64_t t_ns)
{
    for (unsigned i = 0; i < b->units; i++) unit_sample_until(b->unit[i], t_ns);
}

/* ---- carrying out */

enum control_outcome control_do(struct control *c, const struct control_command *row, const struct control_value *v,
                                cJSON *result, int64_t t_ns)
{
    const enum control_outcome outcome = row->run(c, v, result, t_ns);
    /* Refused by its handler, too: converters may have taken their inputs by then, which moves their noise. */
    if (row->changes && c->bench->journal) {
        cJSON *args = control_args_json(row, v);
        c->bench->journal(c->bench->ctx, row, args, outcome != CONTROL_REFUSED, t_ns);
        cJSON_Delete(args);
    }
    return outcome;
}

enum control_outcome control_call(struct control *c, const char *cmd, const cJSON *args, cJSON *result, int64_t t_ns)
{
    struct control_value v[CONTROL_ARGS_MAX];
    const struct control_command *row = control_find(c->tables, cmd);
    if (!row) return control_refuse(c, "command", "\"%.40s\": unknown command; help lists them", cmd);
    if (!control_args(c->bench, row, args, v, &c->refusal)) return CONTROL_REFUSED;
    return control_do(c, row, v, result, t_ns);
}

bool control_check(const struct control_bench *b, const char *cmd, const cJSON *args, char *why)
{
    struct control_value v[CONTROL_ARGS_MAX];
    struct control_refusal refusal;
    const struct control_command *row = control_find(control_tables, cmd);
    if (row && control_args(b, row, args, v, &refusal)) return true;
    if (row) snprintf(why, CONTROL_WHY_MAX, "%s", refusal.why);
    else snprintf(why, CONTROL_WHY_MAX, "\"%.40s\": unknown command", cmd);
    return false;
}

/* ---- replies */

static const char *print(struct control *c, cJSON *reply)
{
    static const char too_long[] = "{\"ok\":false,\"error\":{\"code\":\"machine\",\"text\":\"reply too long\"}}";
    if (!cJSON_PrintPreallocated(reply, c->reply, (int)sizeof c->reply, 0)) memcpy(c->reply, too_long, sizeof too_long);
    cJSON_Delete(reply);
    return c->reply;
}

/* What has been delivered to each CAN client so far, by its number: the barrier of a host that drives several. */
static void add_rx(const struct control *c, cJSON *reply)
{
    struct control_client k;
    char number[16];
    cJSON_AddNumberToObject(reply, "can_rx", (double)c->bench->can_rx(c->bench->ctx));
    cJSON *rx = cJSON_AddObjectToObject(reply, "rx");
    for (unsigned i = 0; c->bench->client(c->bench->ctx, i, &k); i++) {
        snprintf(number, sizeof number, "%" PRIu32, k.came);
        cJSON_AddNumberToObject(rx, number, (double)k.delivered);
    }
}

/* Takes over id and result. */
static const char *reply_with(struct control *c, cJSON *id, bool ok, cJSON *result, int64_t t_ns)
{
    cJSON *reply = cJSON_CreateObject();
    cJSON_AddItemToObject(reply, "id", id ? id : cJSON_CreateNull());
    cJSON_AddBoolToObject(reply, "ok", ok);
    cJSON_AddNumberToObject(reply, "t_ns", (double)t_ns);
    add_rx(c, reply);
    if (ok) {
        cJSON_AddItemToObject(reply, "result", result ? result : cJSON_CreateObject());
        return print(c, reply);
    }
    cJSON_Delete(result);
    c->refused++;
    cJSON *error = cJSON_AddObjectToObject(reply, "error");
    cJSON_AddStringToObject(error, "code", c->refusal.code);
    cJSON_AddStringToObject(error, "text", c->refusal.why);
    return print(c, reply);
}

bool control_by_step(const struct control_bench *b)
{
    struct control_pace p = {0};
    b->pace(b->ctx, &p);
    return p.by_step;
}

/* The reply to a cycle that is over, or was given up; its place is free then if it is over. */
static const char *reply_cycle(struct control *c, struct control_cycle *k, cJSON *id, int64_t t_ns)
{
    cJSON *result = cJSON_CreateObject();
    const enum control_outcome outcome = control_cycle_result(c, k, result);
    k->client = NULL;
    k->id = NULL;
    if (k->over) k->control = NULL;
    return reply_with(c, id, outcome == CONTROL_DONE, result, t_ns);
}

void control_cycle_over(struct control *c, struct control_cycle *k, int64_t t_ns)
{
    if (c->waiting && c->running == k) {
        c->bench->run_stop(c->bench->ctx); /* answered with the run */
    } else if (k->client) {
        void *client = k->client;
        c->bench->reply(c->bench->ctx, client, reply_cycle(c, k, k->id, t_ns));
    } else {
        k->control = NULL;
    }
}

void control_cycles_forget(struct control *c, const void *client)
{
    for (unsigned i = 0; i < CONTROL_CYCLES_MAX; i++) {
        struct control_cycle *k = &c->cycle[i];
        if (!k->control || (client && k->client != client)) continue;
        cJSON_Delete(k->id);
        k->id = NULL;
        k->client = NULL;
    }
}

const char *control_run_done(struct control *c, int64_t t_ns)
{
    cJSON *id = c->run_id;
    struct control_cycle *cycle = c->running;
    c->run_id = NULL;
    c->running = NULL;
    c->waiting = false;
    const struct control_until until = control_watch_end(c);
    if (cycle) return reply_cycle(c, cycle, id, t_ns);
    cJSON *result = cJSON_CreateObject();
    if (until.active) cJSON_AddBoolToObject(result, "reached", until.reached);
    if (until.active) cJSON_AddNumberToObject(result, "seen", (double)until.seen);
    return reply_with(c, id, true, result, t_ns);
}

void control_run_forget(struct control *c)
{
    (void)control_watch_end(c);
    cJSON_Delete(c->run_id);
    c->run_id = NULL;
    c->running = NULL;
    c->waiting = false;
}

/* ---- one line */

static enum control_outcome dispatch(struct control *c, const cJSON *request, cJSON *result, int64_t t_ns)
{
    if (!cJSON_IsObject(request)) {
        return control_refuse(c, "syntax",
                              "not a JSON object: one {\"id\":1,\"cmd\":\"help\"} a line, up to 4095 bytes");
    }
    const cJSON *j;
    cJSON_ArrayForEach(j, request)
    {
        if (strcmp(j->string, "id") != 0 && strcmp(j->string, "cmd") != 0 && strcmp(j->string, "args") != 0) {
            return control_refuse(c, "syntax", "\"%.40s\": unknown member; a command has id, cmd and args", j->string);
        }
        if (cJSON_GetObjectItemCaseSensitive(request, j->string) != j) {
            return control_refuse(c, "syntax", "%s is given twice", j->string);
        }
    }
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(request, "cmd");
    if (!cJSON_IsString(name)) return control_refuse(c, "syntax", "cmd: a command's name is wanted; help lists them");
    return control_call(c, name->valuestring, cJSON_GetObjectItemCaseSensitive(request, "args"), result, t_ns);
}

const char *control_line(struct control *c, const char *line, int64_t t_ns)
{
    cJSON *request = line ? cJSON_ParseWithOpts(line, NULL, true) : NULL; /* true: and nothing behind it */
    cJSON *result = cJSON_CreateObject();
    cJSON *id = cJSON_DetachItemFromObjectCaseSensitive(request, "id");
    c->commands++;
    c->started = NULL;
    const enum control_outcome outcome = dispatch(c, request, result, t_ns);
    cJSON_Delete(request);
    if (outcome != CONTROL_LATER) return reply_with(c, id, outcome == CONTROL_DONE, result, t_ns);
    cJSON_Delete(result);
    if (c->started && !control_by_step(c->bench)) {
        c->started->id = id; /* control_cycle_over() answers */
        return NULL;
    }
    c->run_id = id;
    c->running = c->started;
    c->waiting = true;
    return NULL;
}
