#include "control/control.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void control_init(struct control *c, const struct control_command *table, unsigned count,
                  const struct control_bench *bench)
{
    *c = (struct control){.table = table, .count = count, .bench = bench};
}

enum control_outcome control_refuse(struct control *c, const char *code, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(c->why, sizeof c->why, format, ap);
    va_end(ap);
    c->code = code;
    return CONTROL_REFUSED;
}

/* ---- arguments */

static unsigned arg_count(const struct control_command *cmd)
{
    unsigned n = 0;
    while (n < CONTROL_ARGS_MAX && cmd->arg[n].name) n++;
    return n;
}

static enum control_outcome parse_real(struct control *c, const struct control_arg *a, const cJSON *j,
                                       struct control_value *v)
{
    if (!cJSON_IsNumber(j)) return control_refuse(c, "type", "%s: a number is wanted", a->name);
    if (!(j->valuedouble >= a->min && j->valuedouble <= a->max)) {
        return control_refuse(c, "range", "%s: %.10g is outside %.10g ... %.10g", a->name, j->valuedouble, a->min,
                              a->max);
    }
    v->real = j->valuedouble;
    return CONTROL_DONE;
}

static enum control_outcome parse_count(struct control *c, const struct control_arg *a, const cJSON *j,
                                        struct control_value *v)
{
    if (parse_real(c, a, j, v) == CONTROL_REFUSED) return CONTROL_REFUSED;
    if (v->real != floor(v->real)) return control_refuse(c, "type", "%s: %.10g is not an integer", a->name, v->real);
    v->count = (uint64_t)v->real;
    return CONTROL_DONE;
}

static enum control_outcome parse_name(struct control *c, const struct control_arg *a, const cJSON *j,
                                       struct control_value *v)
{
    if (!cJSON_IsString(j)) return control_refuse(c, "type", "%s: a string is wanted", a->name);
    v->name = j->valuestring;
    return CONTROL_DONE;
}

static enum control_outcome parse_face(struct control *c, const struct control_arg *a, const cJSON *j,
                                       struct control_value *v)
{
    if (parse_name(c, a, j, v) == CONTROL_REFUSED) return CONTROL_REFUSED;
    const int face = head_face_by_name(v->name);
    if (face < 0) {
        return control_refuse(c, "range", "%s: \"%.40s\" is no face: direct, reversed, side or side_reversed", a->name,
                              v->name);
    }
    v->face = (enum head_face)face;
    return CONTROL_DONE;
}

static enum control_outcome parse_unit(struct control *c, const struct control_arg *a, const cJSON *j,
                                       struct control_value *v)
{
    if (parse_name(c, a, j, v) == CONTROL_REFUSED) return CONTROL_REFUSED;
    char names[160] = "";
    for (unsigned i = 0; i < c->bench->units; i++) {
        const char *name = c->bench->unit[i]->cfg.name;
        v->unit = i;
        if (strcmp(name, v->name) == 0) return CONTROL_DONE;
        const size_t at = strlen(names);
        snprintf(names + at, sizeof names - at, "%s%s", at ? ", " : "", name);
    }
    return control_refuse(c, "range", "%s: no unit \"%.40s\"; there is %s", a->name, v->name, names);
}

typedef enum control_outcome parse_fn(struct control *, const struct control_arg *, const cJSON *,
                                      struct control_value *);

static const struct {
    const char *name;
    parse_fn *parse;
} types[] = {
    [CONTROL_REAL] = {"number", parse_real}, [CONTROL_COUNT] = {"integer", parse_count},
    [CONTROL_NAME] = {"string", parse_name}, [CONTROL_FACE] = {"face", parse_face},
    [CONTROL_UNIT] = {"unit", parse_unit},
};

static const struct control_arg *find_arg(const struct control_command *cmd, const char *name)
{
    for (unsigned i = 0; i < arg_count(cmd); i++) {
        if (strcmp(cmd->arg[i].name, name) == 0) return &cmd->arg[i];
    }
    return NULL;
}

static enum control_outcome refuse_unknown_arg(struct control *c, const struct control_command *cmd, const char *name)
{
    char known[128] = "";
    for (unsigned i = 0; i < arg_count(cmd); i++) {
        const size_t at = strlen(known);
        snprintf(known + at, sizeof known - at, "%s%s", at ? ", " : "", cmd->arg[i].name);
    }
    return control_refuse(c, "argument", "no argument \"%.40s\"; it takes %s", name, known[0] ? known : "none");
}

static enum control_outcome parse_args(struct control *c, const struct control_command *cmd, const cJSON *args,
                                       struct control_value *v)
{
    if (args && !cJSON_IsObject(args)) return control_refuse(c, "syntax", "args: an object is wanted");
    const cJSON *j;
    cJSON_ArrayForEach(j, args)
    {
        const struct control_arg *a = find_arg(cmd, j->string);
        if (!a) return refuse_unknown_arg(c, cmd, j->string);
        struct control_value *value = &v[a - cmd->arg];
        if (types[a->type].parse(c, a, j, value) == CONTROL_REFUSED) return CONTROL_REFUSED;
        value->given = true;
    }
    for (unsigned i = 0; i < arg_count(cmd); i++) {
        if (!v[i].given && !cmd->arg[i].optional) {
            return control_refuse(c, "argument", "%s is missing: %s", cmd->arg[i].name, cmd->arg[i].what);
        }
    }
    return CONTROL_DONE;
}

/* ---- replies */

static const char *print(struct control *c, cJSON *reply)
{
    static const char too_long[] = "{\"ok\":false,\"error\":{\"code\":\"machine\",\"text\":\"reply too long\"}}";
    if (!cJSON_PrintPreallocated(reply, c->reply, (int)sizeof c->reply, 0)) memcpy(c->reply, too_long, sizeof too_long);
    cJSON_Delete(reply);
    return c->reply;
}

/* Takes over id and result. */
static const char *reply_with(struct control *c, cJSON *id, bool ok, cJSON *result, int64_t t_ns)
{
    cJSON *reply = cJSON_CreateObject();
    cJSON_AddItemToObject(reply, "id", id ? id : cJSON_CreateNull());
    cJSON_AddBoolToObject(reply, "ok", ok);
    cJSON_AddNumberToObject(reply, "t_ns", (double)t_ns);
    cJSON_AddNumberToObject(reply, "can_rx", (double)c->bench->can_rx(c->bench->ctx));
    if (ok) {
        cJSON_AddItemToObject(reply, "result", result ? result : cJSON_CreateObject());
        return print(c, reply);
    }
    cJSON_Delete(result);
    c->refused++;
    cJSON *error = cJSON_AddObjectToObject(reply, "error");
    cJSON_AddStringToObject(error, "code", c->code);
    cJSON_AddStringToObject(error, "text", c->why);
    return print(c, reply);
}

const char *control_run_done(struct control *c, int64_t t_ns)
{
    cJSON *id = c->run_id;
    c->run_id = NULL;
    c->waiting = false;
    return reply_with(c, id, true, NULL, t_ns);
}

void control_run_forget(struct control *c)
{
    cJSON_Delete(c->run_id);
    c->run_id = NULL;
    c->waiting = false;
}

/* ---- one line */

static const struct control_command *find_command(const struct control *c, const char *name)
{
    for (unsigned i = 0; i < c->count; i++) {
        if (strcmp(c->table[i].name, name) == 0) return &c->table[i];
    }
    return NULL;
}

static enum control_outcome dispatch(struct control *c, const cJSON *request, cJSON *result, int64_t t_ns)
{
    struct control_value v[CONTROL_ARGS_MAX] = {{0}};
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
    }
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(request, "cmd");
    if (!cJSON_IsString(name)) return control_refuse(c, "syntax", "cmd: a command's name is wanted; help lists them");
    const struct control_command *cmd = find_command(c, name->valuestring);
    if (!cmd) return control_refuse(c, "command", "\"%.40s\": unknown command; help lists them", name->valuestring);
    const cJSON *args = cJSON_GetObjectItemCaseSensitive(request, "args");
    if (parse_args(c, cmd, args, v) == CONTROL_REFUSED) return CONTROL_REFUSED;
    return cmd->run(c, v, result, t_ns);
}

const char *control_line(struct control *c, const char *line, int64_t t_ns)
{
    cJSON *request = line ? cJSON_Parse(line) : NULL;
    cJSON *result = cJSON_CreateObject();
    cJSON *id = cJSON_DetachItemFromObjectCaseSensitive(request, "id");
    c->commands++;
    const enum control_outcome outcome = dispatch(c, request, result, t_ns);
    cJSON_Delete(request);
    if (outcome != CONTROL_LATER) return reply_with(c, id, outcome == CONTROL_DONE, result, t_ns);
    cJSON_Delete(result);
    c->run_id = id;
    c->waiting = true;
    return NULL;
}

/* ---- the table for people */

static size_t markdown_args(const struct control_command *cmd, char *out, size_t cap)
{
    size_t at = 0;
    out[0] = '\0';
    for (unsigned i = 0; i < arg_count(cmd) && at < cap; i++) {
        const struct control_arg *a = &cmd->arg[i];
        at += (size_t)snprintf(out + at, cap - at, "%s`%s`%s %s", i ? "; " : "", a->name,
                               a->optional ? " (optional)" : "", a->what);
        if ((a->type == CONTROL_REAL || a->type == CONTROL_COUNT) && at < cap) {
            at += (size_t)snprintf(out + at, cap - at, ", %.10g to %.10g", a->min, a->max);
        }
    }
    return at;
}

bool control_markdown(const struct control_command *table, unsigned count, unsigned line, char *out, size_t cap)
{
    char args[512];
    if (line == 0) snprintf(out, cap, "| command | what it does | arguments |");
    if (line == 1) snprintf(out, cap, "|---|---|---|");
    if (line < 2) return true;
    if (line - 2 >= count) return false;
    const struct control_command *cmd = &table[line - 2];
    snprintf(out, cap, "| `%s` | %s | %s |", cmd->name, cmd->what,
             markdown_args(cmd, args, sizeof args) ? args : "none");
    return true;
}
