/* Parameters of a program message unit as arguments of a row of the command table. */
#include "command/args.h"
#include "scpi/internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static bool word_is(struct scpi_text t, const char *mnemonic)
{
    return scpi_is(mnemonic, strlen(mnemonic), t);
}

unsigned scpi_suffixes(const char *pattern)
{
    unsigned n = 0;
    for (; *pattern; pattern++) n += *pattern == '#';
    return n;
}

static void arg_range(const struct control_bench *b, const struct control_command *row, unsigned arg,
                      const unsigned suffix[4], double *min, double *max)
{
    struct control_value v[CONTROL_ARGS_MAX] = {{0}};
    for (unsigned i = 0; i < 4; i++)
        v[i] = (struct control_value){.given = true, .real = suffix[i], .count = suffix[i]};
    control_arg_limits(b, row, arg, v, min, max);
}

bool scpi_limit(const struct control_bench *b, const struct control_command *row, unsigned arg,
                const unsigned suffix[4], struct scpi_text word, double *out)
{
    double min, max;
    arg_range(b, row, arg, suffix, &min, &max);
    if (word_is(word, "MINimum")) *out = min;
    else if (word_is(word, "MAXimum")) *out = max;
    else if (word_is(word, "DEFault")) *out = row->arg[arg].def;
    else return false;
    return true;
}

/* ---- one parameter */

struct source {
    const struct control_bench *bench;
    const struct control_command *row;
    unsigned arg;
    const unsigned *suffix;
    const struct scpi_param *param;
    struct scpi_failure *why;
};

/* The error of a parameter: NULL. */
__attribute__((format(printf, 3, 4))) static cJSON *reject_param(const struct source *s, int code, const char *expected,
                                                                 ...)
{
    const struct scpi_param *p = s->param;
    char got[WHY_TEXT_MAX];
    va_list ap;
    if (p->form == SCPI_NUMBER) snprintf(got, sizeof got, "%.10g%s", p->number, p->text.n ? " " : "");
    else snprintf(got, sizeof got, "\"");
    const size_t at = strlen(got);
    snprintf(got + at, sizeof got - at, "%.*s%s", (int)(p->text.n < 60 ? p->text.n : 60), p->text.p ? p->text.p : "",
             p->form == SCPI_NUMBER ? "" : "\"");
    va_start(ap, expected);
    why_vexpected(s->why->what, sizeof s->why->what, s->row->arg[s->arg].name, got, expected, ap);
    va_end(ap);
    s->why->code = code;
    return NULL;
}

static cJSON *to_number(const struct source *s)
{
    const struct control_arg *a = &s->row->arg[s->arg];
    double x;
    if (s->param->form == SCPI_STRING) return reject_param(s, -158, "a number");
    if (s->param->form == SCPI_WORD) {
        if (scpi_limit(s->bench, s->row, s->arg, s->suffix, s->param->text, &x)) return cJSON_CreateNumber(x);
        return reject_param(s, -148, "a number, MIN, MAX or DEF");
    }
    const int err = scpi_to_unit(a->unit, s->param->text, s->param->number, &x);
    if (err)
        return a->unit ? reject_param(s, err, "a value in %s", a->unit)
                       : reject_param(s, err, "a value without a unit");
    return cJSON_CreateNumber(x);
}

static cJSON *to_bool(const struct source *s)
{
    const struct scpi_param *p = s->param;
    if (p->form == SCPI_STRING) return reject_param(s, -158, "ON, OFF, 1 or 0");
    if (p->form == SCPI_NUMBER && p->text.n) return reject_param(s, -138, "ON, OFF, 1 or 0");
    if (p->form == SCPI_NUMBER) return cJSON_CreateBool(p->number >= 0.5 || p->number <= -0.5);
    if (word_is(p->text, "ON")) return cJSON_CreateTrue();
    if (word_is(p->text, "OFF")) return cJSON_CreateFalse();
    return reject_param(s, -224, "ON, OFF, 1 or 0");
}

/* Four letters, three if the fourth is a vowel: SCPI-99 volume 1, 6.2.1. */
static size_t short_form(const char *word)
{
    const size_t len = strlen(word);
    return len <= 4 ? len : strchr("aeiou", word[3]) ? 3 : 4;
}

static const char *find_choice(const struct control_arg *a, struct scpi_text t)
{
    const char *found = NULL;
    unsigned shorts = 0;
    for (unsigned i = 0; a->choices[i]; i++) {
        if (word_is(t, a->choices[i])) return a->choices[i];
        if (!scpi_is(a->choices[i], short_form(a->choices[i]), t)) continue;
        shorts++;
        found = a->choices[i];
    }
    return shorts == 1 ? found : NULL;
}

static cJSON *to_choice(const struct source *s)
{
    const struct control_arg *a = &s->row->arg[s->arg];
    char words[160] = "";
    if (s->param->form == SCPI_NUMBER) return reject_param(s, -128, "a word");
    const char *found = find_choice(a, s->param->text);
    if (found) return cJSON_CreateString(found);
    for (unsigned i = 0; a->choices[i]; i++) why_list_add(words, sizeof words, a->choices[i]);
    return reject_param(s, -224, "one of %s", words);
}

static cJSON *to_string(const struct source *s)
{
    const struct scpi_param *p = s->param;
    char text[SCPI_LINE_MAX];
    size_t n = 0;
    if (p->form == SCPI_NUMBER) return reject_param(s, -128, "a string");
    for (size_t i = 0; i < p->text.n && n < sizeof text - 1; i++) {
        text[n++] = p->text.p[i];
        if (p->form == SCPI_STRING && i + 1 < p->text.n && p->text.p[i] == p->text.p[-1] &&
            p->text.p[i + 1] == p->text.p[i])
            i++; /* a doubled quote */
    }
    text[n] = '\0';
    return cJSON_CreateString(text);
}

static cJSON *convert_param(const struct source *s)
{
    static cJSON *(*const to[])(const struct source *) = {
        [CONTROL_REAL] = to_number, [CONTROL_COUNT] = to_number, [CONTROL_BOOL] = to_bool,
        [CONTROL_NAME] = to_string, [CONTROL_TEXT] = to_string,  [CONTROL_CHOICE] = to_choice,
        [CONTROL_UNIT] = to_string, [CONTROL_REALS] = to_number,
    };
    return to[s->row->arg[s->arg].type](s);
}

/* ---- all of them */

/* A suffix that the argument does not take is the header's fault. */
static bool suffix_fits(const struct control_bench *b, const struct control_command *row, unsigned arg,
                        const unsigned suffix[4], struct scpi_failure *why)
{
    double min, max;
    arg_range(b, row, arg, suffix, &min, &max);
    if (suffix[arg] >= min && suffix[arg] <= max) return true;
    why->code = -114;
    return why_expected(why->what, sizeof why->what, row->arg[arg].name, WHY_REAL(suffix[arg]), "%.10g to %.10g", min,
                        max);
}

/* Which argument the i-th parameter is: lists are dealt in turn, time, rate, time, rate. -1: there is none. */
static int arg_of_param(const struct control_command *row, unsigned suffixes, unsigned i)
{
    const unsigned args = control_arg_count(row);
    unsigned list = suffixes, lists = 0;
    while (list < args && row->arg[list].type != CONTROL_REALS) list++;
    while (list + lists < args && row->arg[list + lists].type == CONTROL_REALS) lists++;
    const unsigned arg = suffixes + i;
    if (lists && arg >= list) return (int)(list + (arg - list) % lists);
    return arg < args ? (int)arg : -1;
}

static bool add_param(const struct source *s, cJSON *args)
{
    const struct control_arg *a = &s->row->arg[s->arg];
    cJSON *item = convert_param(s);
    if (!item) return false;
    if (a->type != CONTROL_REALS) return cJSON_AddItemToObject(args, a->name, item);
    cJSON *list = cJSON_GetObjectItemCaseSensitive(args, a->name);
    return cJSON_AddItemToArray(list ? list : cJSON_AddArrayToObject(args, a->name), item);
}

cJSON *scpi_args(const struct control_bench *b, const struct control_command *row, const struct control_scpi *how,
                 const unsigned suffix[4], const struct scpi_unit *u, struct scpi_failure *why)
{
    const unsigned suffixes = scpi_suffixes(how->header);
    cJSON *args = cJSON_CreateObject();
    bool good = true;
    for (unsigned i = 0; i < suffixes && good; i++) {
        good = suffix_fits(b, row, i, suffix, why);
        cJSON_AddNumberToObject(args, row->arg[i].name, suffix[i]);
    }
    for (unsigned i = 0; i < u->params && good; i++) {
        const int arg = arg_of_param(row, suffixes, i);
        if (arg < 0) {
            why->code = -108;
            why_expected(why->what, sizeof why->what, how->header, WHY_REAL(u->params), "up to %u parameters",
                         control_arg_count(row) - suffixes);
        }
        good = arg >= 0 && add_param(&(struct source){b, row, (unsigned)arg, suffix, &u->param[i], why}, args);
    }
    if (good) return args;
    cJSON_Delete(args);
    return NULL;
}
