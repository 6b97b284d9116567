/* What the commands of a session need: its response, the end of a motion, the rows of its instrument. */
#include "command/args.h"
#include "scpi/internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- the response */

void scpi_put(struct scpi *s, const char *text)
{
    const size_t n = strlen(text), sep = s->out_len > 0;
    if (s->out_len + sep + n >
        sizeof s->out) { /* 488.2 6.3.1.7: the output queue is full and the message not at its end */
        scpi_error(&s->status, -430, "the answers to one message are longer than 8192 bytes");
        s->out_len = 0;
        s->pos = s->len;
        return;
    }
    if (sep) s->out[s->out_len++] = ';';
    memcpy(s->out + s->out_len, text, n);
    s->out_len += n;
}

void scpi_putf(struct scpi *s, const char *format, ...)
{
    char text[256];
    va_list ap;
    va_start(ap, format);
    vsnprintf(text, sizeof text, format, ap);
    va_end(ap);
    scpi_put(s, text);
}

static bool is_word(const char *text)
{
    for (; *text; text++) {
        const char c = *text;
        if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_')) return false;
    }
    return true;
}

/* A word is character data in capitals, other text a string in quotes. */
static size_t format_text(const char *text, char *out, size_t cap)
{
    if (!is_word(text)) return (size_t)snprintf(out, cap, "\"%.200s\"", text);
    size_t n = 0;
    for (; text[n] && n < cap - 1; n++)
        out[n] = (char)(text[n] >= 'a' && text[n] <= 'z' ? text[n] - 'a' + 'A' : text[n]);
    out[n] = '\0';
    return n;
}

/* Numbers with as many digits as always survive the way through a double: 30 degrees are 30, not 29.999999999999996. */
static size_t format_item(const cJSON *j, char *out, size_t cap)
{
    if (cJSON_IsBool(j)) return (size_t)snprintf(out, cap, "%d", cJSON_IsTrue(j));
    if (cJSON_IsNumber(j)) return (size_t)snprintf(out, cap, "%.15g", j->valuedouble);
    if (cJSON_IsString(j)) return format_text(j->valuestring, out, cap);
    return (size_t)snprintf(out, cap, "9.91E37"); /* not a number: SCPI-99 volume 1, 7.2.1.5 */
}

enum { ITEM_MAX = 256 };

/* Appends an item after a comma. */
static size_t append_item(const cJSON *j, char *text, size_t at, size_t cap)
{
    if (at + ITEM_MAX >= cap) return at;
    if (at) text[at++] = ',';
    return at + format_item(j, text + at, cap - at);
}

void scpi_put_fields(struct scpi *s, const cJSON *result, const char *fields)
{
    char text[sizeof s->out + 2 * ITEM_MAX] = "", name[64]; /* longer than what scpi_put() takes */
    size_t at = 0;
    while (*fields) {
        const size_t n = strcspn(fields, ",");
        snprintf(name, sizeof name, "%.*s", (int)n, fields);
        const cJSON *j = cJSON_GetObjectItemCaseSensitive(result, name), *item = NULL;
        if (!cJSON_IsArray(j)) at = append_item(j, text, at, sizeof text);
        else cJSON_ArrayForEach(item, j) at = append_item(item, text, at, sizeof text);
        fields += n + (fields[n] == ',');
    }
    scpi_put(s, text);
}

/* ---- waiting for the end of a motion */

static int64_t rest_ns(const struct scpi *s, int64_t t_ns)
{
    return s->kind->rest_ns ? s->kind->rest_ns(s->control->bench) : t_ns;
}

/* What has waited for the end: *OPC, *OPC?, *WAI. */
static void end_wait(struct scpi *s)
{
    if (s->opc) s->status.esr |= SCPI_ESR_OPC;
    s->opc = false;
    if (s->wait == SCPI_OPC_QUERY) scpi_put(s, "1");
    s->wait = SCPI_GO;
}

void scpi_await(struct scpi *s, int64_t t_ns)
{
    if (rest_ns(s, t_ns) <= t_ns) end_wait(s);
    else sched_at(s->sched, &s->rest, rest_ns(s, t_ns));
}

bool scpi_busy(const struct scpi *s)
{
    return s->wait != SCPI_GO;
}

void scpi_look(struct scpi *s, int64_t t_ns)
{
    const struct control_bench *b = s->control->bench;
    if (s->kind->operation) scpi_condition(&s->status.operation, s->kind->operation(b, t_ns));
    if (s->kind->questionable) scpi_condition(&s->status.questionable, s->kind->questionable(b, t_ns));
    if (s->opc || scpi_busy(s)) sched_at(s->sched, &s->rest, rest_ns(s, t_ns));
}

/* ---- rows */

bool scpi_asks(const char *pattern)
{
    return pattern[strlen(pattern) - 1] == '?';
}

bool scpi_belongs(const struct scpi_kind *kind, const struct control_command *row)
{
    return strncmp(row->name, kind->module, strlen(kind->module)) == 0;
}

bool scpi_present(const struct scpi_kind *kind, const struct control_bench *b)
{
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(control_tables, i)); i++)
        if (scpi_belongs(kind, row) && row->missing && row->missing(b)) return false;
    return true;
}

const struct control_command *scpi_find_row(const struct scpi *s, struct scpi_text header, bool query,
                                            const struct control_scpi **how, unsigned suffix[4])
{
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(control_tables, i)); i++) {
        if (!scpi_belongs(s->kind, row)) continue;
        for (unsigned k = 0; k < CONTROL_SCPI_MAX && row->scpi[k].header; k++) {
            *how = &row->scpi[k];
            if (scpi_asks((*how)->header) == query && scpi_match((*how)->header, header, suffix)) return row;
        }
    }
    return NULL;
}
