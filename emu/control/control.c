#include "control/control.h"

#include "command/args.h"
#include "command/exact.h"
#include "command/utf8.h"
#include "control/commands.h"
#include "control/internal.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void control_init(struct control *c, const struct control_table *const *tables, const struct control_bench *bench)
{
    memset(c, 0, offsetof(struct control, reply));
    c->tables = tables;
    c->bench = bench;
}

/* ---- carrying out */

/* The one way to carry out a command. */
static enum control_outcome carry_out(struct control *c, const struct control_command *row,
                                      const struct control_value *v, cJSON *result, int64_t t_ns)
{
    const struct control_call call = {c, c->bench, v, result, t_ns};
    const char *missing = row->missing ? row->missing(c->bench) : NULL;
    const enum control_outcome outcome = missing ? control_reject(c, "state", "%s", missing) : row->run(&call);
    /* Rejected by its handler, too: replayed, it is rejected again. */
    if (row->changes && c->bench->process.journal) {
        cJSON *args = control_args_json(row, v);
        c->bench->process.journal(c->bench->ctx, row, args, outcome != CONTROL_REJECTED, t_ns);
        cJSON_Delete(args);
    }
    return outcome;
}

enum control_outcome control_call(struct control *c, const char *cmd, const cJSON *args, cJSON *result, int64_t t_ns)
{
    struct control_value v[CONTROL_ARGS_MAX];
    const struct control_command *row = control_find(c->tables, cmd);
    if (!row) return control_reject(c, "command", "\"%.40s\": unknown command; see help", cmd);
    if (!control_args(c->bench, row, args, v, &c->error)) return CONTROL_REJECTED;
    return carry_out(c, row, v, result, t_ns);
}

bool control_check(const struct control_table *const *tables, const struct control_bench *b, const char *cmd,
                   const cJSON *args, char *why)
{
    struct control_value v[CONTROL_ARGS_MAX];
    struct control_error error;
    const struct control_command *row = control_find(tables, cmd);
    if (row && control_args(b, row, args, v, &error)) return true;
    if (row) snprintf(why, CONTROL_WHY_MAX, "%s", error.why);
    else snprintf(why, CONTROL_WHY_MAX, "\"%.40s\": unknown command", cmd);
    return false;
}

/* ---- a run */

static uint64_t delivered_to(const struct control_bench *b, const struct control_arrival *a)
{
    struct control_client k;
    for (unsigned i = 0; !a->any && b->clients.nth(b->ctx, i, &k); i++) {
        if (k.connection == a->connection) return k.delivered;
    }
    return a->any ? b->clients.can_rx(b->ctx) : 0;
}

/* The next piece of a run that waits for frames. False: they have come, its time is over, or --for has ended. */
static bool goes_on(struct control *c, int64_t t_ns)
{
    struct control_arrival *a = &c->arrival;
    if (!a->active || t_ns >= a->end_ns || t_ns < a->piece_end_ns || delivered_to(c->bench, a) >= a->rx) return false;
    a->piece_end_ns = a->end_ns - t_ns < a->piece_ns ? a->end_ns : t_ns + a->piece_ns;
    return c->bench->sim.run(c->bench->ctx, a->piece_end_ns - t_ns, 0, c->error.why);
}

const char *control_run_done(struct control *c, int64_t t_ns)
{
    if (goes_on(c, t_ns)) return NULL;
    c->arrival.active = false;
    cJSON *id = c->run_id;
    struct control_cycle *cycle = c->running;
    c->run_id = NULL;
    c->running = NULL;
    c->waiting = false;
    const struct control_until until = control_watch_end(c);
    if (cycle) return control_cycle_reply(c, cycle, id, t_ns);
    cJSON *result = cJSON_CreateObject();
    if (until.active) cJSON_AddBoolToObject(result, "reached", until.reached);
    if (until.active) cJSON_AddNumberToObject(result, "seen", (double)until.seen);
    return control_reply(c, id, true, result, t_ns);
}

void control_run_forget(struct control *c)
{
    (void)control_watch_end(c);
    c->arrival.active = false;
    cJSON_Delete(c->run_id);
    c->run_id = NULL;
    c->running = NULL;
    c->waiting = false;
}

/* ---- one line */

#define ID_LIMIT 9007199254740992.0 /* 2^53: whole numbers below it come back as they were */

static bool is_repeatable(const cJSON *id)
{
    const cJSON *item;
    cJSON_ArrayForEach(item, id)
    {
        if (!is_repeatable(item)) return false;
    }
    return !cJSON_IsNumber(id) || fabs(id->valuedouble) < ID_LIMIT;
}

/* As text, with every digit of its numbers: cJSON would print fifteen. NULL for one that a reply could not repeat. */
static cJSON *copy_id(cJSON *id)
{
    char *text = is_repeatable(id) ? exact_line(id) : NULL;
    cJSON *copy = text ? cJSON_CreateRaw(text) : NULL;
    free(text);
    return copy;
}

static enum control_outcome dispatch_request(struct control *c, const cJSON *request, cJSON *result, int64_t t_ns)
{
    if (!cJSON_IsObject(request)) {
        return control_reject(
            c, "syntax", "expected a JSON object such as {\"id\":1,\"cmd\":\"help\"} in a line of up to 4095 bytes");
    }
    const cJSON *j;
    cJSON_ArrayForEach(j, request)
    {
        if (strcmp(j->string, "id") != 0 && strcmp(j->string, "cmd") != 0 && strcmp(j->string, "args") != 0) {
            return control_reject(c, "syntax", "expected the members id, cmd and args, got \"%.40s\"", j->string);
        }
        if (cJSON_GetObjectItemCaseSensitive(request, j->string) != j) {
            return control_reject(c, "syntax", "%s: expected one value, got two", j->string);
        }
    }
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(request, "cmd");
    if (!cJSON_IsString(name)) return control_reject(c, "syntax", "cmd: expected the name of a command; see help");
    return control_call(c, name->valuestring, cJSON_GetObjectItemCaseSensitive(request, "args"), result, t_ns);
}

/* cJSON would end the string there. */
static bool has_escaped_nul(const char *line)
{
    for (const char *at = line; (at = strchr(at, '\\')) && at[1]; at += 2)
        if (strncmp(at + 1, "u0000", 5) == 0) return true;
    return false;
}

const char *control_line(struct control *c, const char *line, int64_t t_ns)
{
    const bool text = line && utf8_valid(line) && !has_escaped_nul(line);
    cJSON *request = text ? cJSON_ParseWithOpts(line, NULL, true) : NULL; /* true: and nothing behind it */
    cJSON *result = cJSON_CreateObject();
    cJSON *given = cJSON_DetachItemFromObjectCaseSensitive(request, "id"), *id = given ? copy_id(given) : NULL;
    c->commands++;
    c->started = NULL;
    enum control_outcome outcome = CONTROL_REJECTED;
    if (line && !text) (void)control_reject(c, "syntax", "expected a line of UTF-8 without NUL");
    else if (given && !id) (void)control_reject(c, "syntax", "id: expected numbers below 2^53 in it");
    else outcome = dispatch_request(c, request, result, t_ns);
    cJSON_Delete(given);
    cJSON_Delete(request);
    if (outcome != CONTROL_LATER) return control_reply(c, id, outcome == CONTROL_DONE, result, t_ns);
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
