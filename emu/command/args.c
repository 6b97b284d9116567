/* Arguments of commands: from JSON to values and back, and how the manual shows them. */
#include "command/args.h"

#include "command/error.h"
#include "command/events.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { NAME_MAX_BYTES = 31, TEXT_MAX_BYTES = 1023 };

unsigned control_arg_count(const struct control_command *row)
{
    unsigned n = 0;
    while (row->arg && row->arg[n].name) n++;
    return n;
}

/* ---- one function for each type */

struct target {
    const struct control_bench *bench;
    const struct control_arg *arg;
    struct control_error *why;
};

/* What is wrong with the argument: its code, what was got, what is expected. */
#define EXPECTED(t, code, got, ...) control_expected((t)->why, code, (t)->arg->name, got, __VA_ARGS__)

static bool in_range(const struct target *t, double x, double min, double max)
{
    const char *unit = t->arg->unit ? t->arg->unit : "", *gap = t->arg->unit ? " " : "";
    const double least = t->arg->least;
    if (x >= min && x <= max && !(x != 0.0 && fabs(x) < least)) return true;
    if (least <= 0.0) return EXPECTED(t, "range", WHY_REAL(x), "%.10g to %.10g%s%s", min, max, gap, unit);
    return EXPECTED(t, "range", WHY_REAL(x), "%.10g to %.10g or %.10g to %.10g%s%s", min, -least, least, max, gap,
                    unit);
}

/* What came in the place of another type. */
static const char *json_kind(const cJSON *j)
{
    return cJSON_IsNumber(j)   ? "a number"
           : cJSON_IsString(j) ? "a string"
           : cJSON_IsBool(j)   ? (cJSON_IsTrue(j) ? "true" : "false")
           : cJSON_IsArray(j)  ? "a list"
           : cJSON_IsObject(j) ? "an object"
                               : "null";
}

static bool parse_real(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!cJSON_IsNumber(j)) return EXPECTED(t, "type", json_kind(j), "a number");
    v->real = j->valuedouble;
    return in_range(t, v->real, t->arg->min, t->arg->max);
}

static bool parse_count(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!parse_real(t, j, v)) return false;
    if (v->real != floor(v->real)) return EXPECTED(t, "type", WHY_REAL(v->real), "an integer");
    v->count = (uint64_t)v->real;
    return true;
}

static bool parse_bool(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!cJSON_IsBool(j)) return EXPECTED(t, "type", json_kind(j), "true or false");
    v->on = cJSON_IsTrue(j);
    return true;
}

static bool parse_text(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!cJSON_IsString(j)) return EXPECTED(t, "type", json_kind(j), "a string");
    v->text = j->valuestring;
    if (strlen(v->text) > TEXT_MAX_BYTES)
        return EXPECTED(t, "range", WHY_TEXT(v->text), "up to %d bytes", TEXT_MAX_BYTES);
    return *v->text || EXPECTED(t, "range", WHY_TEXT(v->text), "a text");
}

static bool parse_name(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!parse_text(t, j, v)) return false;
    bool good = strlen(v->text) <= NAME_MAX_BYTES;
    for (const char *s = v->text; *s; s++) good = good && *s > ' ' && *s <= '~';
    return good || EXPECTED(t, "range", WHY_TEXT(v->text), "a name of up to %d printable characters without spaces",
                            NAME_MAX_BYTES);
}

static bool parse_choice(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!parse_text(t, j, v)) return false;
    char words[192] = "";
    for (v->choice = 0; t->arg->choices[v->choice]; v->choice++) {
        const char *word = t->arg->choices[v->choice];
        if (strcmp(word, v->text) == 0) {
            v->text = word;
            return true;
        }
        why_list_add(words, sizeof words, word);
    }
    return EXPECTED(t, "range", WHY_TEXT(v->text), "one of %s", words);
}

static bool parse_unit(const struct target *t, const cJSON *j, struct control_value *v)
{
    if (!parse_text(t, j, v)) return false;
    char names[160] = "";
    for (v->unit = 0; v->unit < t->bench->units; v->unit++) {
        if (strcmp(t->bench->unit_name[v->unit], v->text) == 0) return true;
        why_list_add(names, sizeof names, t->bench->unit_name[v->unit]);
    }
    v->unit = 0;
    return EXPECTED(t, "range", WHY_TEXT(v->text), "a unit: %s", names[0] ? names : "there is none");
}

static bool parse_reals(const struct target *t, const cJSON *j, struct control_value *v)
{
    const cJSON *item;
    if (!cJSON_IsArray(j)) return EXPECTED(t, "type", json_kind(j), "a list of numbers");
    v->n = 0;
    cJSON_ArrayForEach(item, j)
    {
        if (v->n == CONTROL_REALS_MAX) return EXPECTED(t, "range", "more", "1 to %u numbers", CONTROL_REALS_MAX);
        if (!cJSON_IsNumber(item)) return EXPECTED(t, "type", json_kind(item), "a list of numbers");
        if (!in_range(t, item->valuedouble, t->arg->min, t->arg->max)) return false;
        v->reals[v->n++] = item->valuedouble;
    }
    return v->n > 0 || EXPECTED(t, "range", "none", "1 to %u numbers", CONTROL_REALS_MAX);
}

/* ---- and back */

static cJSON *value_json(const struct control_arg *a, const struct control_value *v)
{
    if (a->type == CONTROL_REALS) return cJSON_CreateDoubleArray(v->reals, (int)v->n);
    if (a->type == CONTROL_BOOL) return cJSON_CreateBool(v->on);
    return control_type_numeric(a->type) ? cJSON_CreateNumber(v->real) : cJSON_CreateString(v->text);
}

static const struct {
    const char *name;
    bool (*parse)(const struct target *t, const cJSON *j, struct control_value *v);
    bool numeric;
} types[] = {
    [CONTROL_REAL] = {"number", parse_real, true},    [CONTROL_COUNT] = {"integer", parse_count, true},
    [CONTROL_BOOL] = {"boolean", parse_bool, false},  [CONTROL_NAME] = {"string", parse_name, false},
    [CONTROL_TEXT] = {"string", parse_text, false},   [CONTROL_CHOICE] = {"choice", parse_choice, false},
    [CONTROL_EVENT] = {"choice", parse_name, false},  [CONTROL_UNIT] = {"unit", parse_unit, false},
    [CONTROL_REALS] = {"numbers", parse_reals, true},
};

const char *control_choice(const struct control_arg *a, unsigned i)
{
    if (a->type == CONTROL_EVENT) return control_event(i);
    return a->choices ? a->choices[i] : NULL;
}

const char *control_type_name(enum control_type type)
{
    return types[type].name;
}

bool control_type_numeric(enum control_type type)
{
    return types[type].numeric;
}

cJSON *control_args_json(const struct control_command *row, const struct control_value *v)
{
    cJSON *args = cJSON_CreateObject();
    for (unsigned i = 0; i < control_arg_count(row); i++) {
        if (v[i].given) cJSON_AddItemToObject(args, row->arg[i].name, value_json(&row->arg[i], &v[i]));
    }
    return args;
}

/* ---- all arguments of a command */

static const struct control_arg *find_arg(const struct control_command *row, const char *name)
{
    for (unsigned i = 0; i < control_arg_count(row); i++) {
        if (strcmp(row->arg[i].name, name) == 0) return &row->arg[i];
    }
    return NULL;
}

static bool reject_unknown(struct control_error *why, const struct control_command *row, const char *name)
{
    char known[160] = "";
    for (unsigned i = 0; i < control_arg_count(row); i++) why_list_add(known, sizeof known, row->arg[i].name);
    return control_expected(why, "argument", "args", WHY_TEXT(name), "%s", known[0] ? known : "no arguments");
}

void control_arg_limits(const struct control_bench *b, const struct control_command *row, unsigned i,
                        const struct control_value *v, double *min, double *max)
{
    const struct control_arg *a = &row->arg[i];
    *min = a->min;
    *max = a->max;
    if (!b->lab || (row->missing && row->missing(b))) return;
    if (a->lab_min) memcpy(min, (const char *)b->lab + a->lab_min, sizeof *min);
    if (a->lab_max) memcpy(max, (const char *)b->lab + a->lab_max, sizeof *max);
    if (a->limits) a->limits(b, v, min, max);
}

/* Limits that depend on this bench's instruments; the arguments before this one are valid. */
static bool within_limits(const struct target *t, const struct control_command *row, unsigned n,
                          const struct control_value *all)
{
    double min, max;
    const struct control_value *v = &all[n];
    if (!v->given || !control_type_numeric(t->arg->type)) return true;
    control_arg_limits(t->bench, row, n, all, &min, &max);
    for (unsigned i = 0; i < v->n; i++) {
        if (!in_range(t, v->reals[i], min, max)) return false;
    }
    return t->arg->type == CONTROL_REALS || in_range(t, v->real, min, max);
}

bool control_args(const struct control_bench *b, const struct control_command *row, const cJSON *args,
                  struct control_value v[CONTROL_ARGS_MAX], struct control_error *why)
{
    memset(v, 0, CONTROL_ARGS_MAX * sizeof *v);
    if (args && !cJSON_IsObject(args)) return control_expected(why, "syntax", "args", json_kind(args), "an object");
    const cJSON *j;
    cJSON_ArrayForEach(j, args)
    {
        const struct control_arg *a = find_arg(row, j->string);
        if (!a) return reject_unknown(why, row, j->string);
        struct control_value *value = &v[a - row->arg];
        if (value->given) return control_expected(why, "argument", a->name, "two", "one value");
        if (!types[a->type].parse(&(struct target){b, a, why}, j, value)) return false;
        value->given = true;
    }
    for (unsigned i = 0; i < control_arg_count(row); i++) {
        const struct control_arg *a = &row->arg[i];
        if (!v[i].given && !a->optional)
            return control_expected(why, "argument", a->name, "nothing", "a value (%s)", a->what);
        if (!within_limits(&(struct target){b, a, why}, row, i, v)) return false;
    }
    return !row->check || row->check(b, v, why);
}

/* ---- rows */

const struct control_command *control_row(const struct control_table *const *tables, unsigned i)
{
    for (; *tables; i -= (*tables)->count, tables++) {
        if (i < (*tables)->count) return &(*tables)->row[i];
    }
    return NULL;
}

const struct control_command *control_find(const struct control_table *const *tables, const char *name)
{
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(tables, i)); i++) {
        if (strcmp(row->name, name) == 0) return row;
    }
    return NULL;
}
