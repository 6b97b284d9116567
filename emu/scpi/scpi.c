#include "scpi/scpi.h"

#include "command/args.h"
#include "scpi/internal.h"

#include <stdio.h>
#include <string.h>

/* ---- a unit of a message */

/* The standard's number of an error; by then only a missing argument can be wrong. */
static int error_code(const struct control_error *r)
{
    static const struct {
        const char *code;
        int number;
    } rows[] = {{"syntax", -102}, {"argument", -109}, {"type", -104},
                {"range", -222},  {"state", -221},    {"machine", -240}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (strcmp(rows[i].code, r->code) == 0) return rows[i].number;
    }
    return -200;
}

/* Command errors are of the form of the message: its rest makes no sense any more. */
static bool fail_unit(struct scpi *s, int code, const char *what)
{
    scpi_error(&s->status, code, what);
    return code <= -200;
}

static bool do_row(struct scpi *s, const struct control_command *row, const struct control_scpi *how,
                   const unsigned suffix[4], const struct scpi_unit *u, int64_t t_ns)
{
    struct scpi_failure why = {0};
    cJSON *args = scpi_args(s->control->bench, row, how, suffix, u, &why);
    if (!args) return fail_unit(s, why.code, why.what);
    cJSON *result = cJSON_CreateObject();
    const bool done = control_call(s->control, row->name, args, result, t_ns) == CONTROL_DONE;
    if (done && how->result) scpi_put_fields(s, result, how->result);
    cJSON_Delete(args);
    cJSON_Delete(result);
    scpi_look(s, t_ns);
    return done || fail_unit(s, error_code(&s->control->error), s->control->error.why);
}

/* ANGLe? MAX: what the setting of the same name would take. */
static bool do_limit(struct scpi *s, struct scpi_text header, const struct scpi_unit *u)
{
    const struct control_scpi *how;
    unsigned suffix[4] = {1, 1, 1, 1};
    double x;
    const struct control_command *row = scpi_find_row(s, header, false, &how, suffix);
    if (!row || u->params != 1) return fail_unit(s, -108, NULL);
    const unsigned arg = scpi_suffixes(how->header);
    const bool numeric = arg < control_arg_count(row) && control_type_numeric(row->arg[arg].type);
    if (!numeric || u->param[0].form != SCPI_WORD ||
        !scpi_limit(s->control->bench, row, arg, suffix, u->param[0].text, &x)) {
        return fail_unit(s, -224, "expected MIN, MAX or DEF");
    }
    scpi_putf(s, "%.12g", x);
    return true;
}

static const struct scpi_command *find_common(struct scpi_text header, bool query)
{
    const struct scpi_command *row;
    unsigned suffix[4];
    for (unsigned i = 0; (row = scpi_common(i)); i++) {
        if (scpi_asks(row->pattern) == query && scpi_match(row->pattern, header, suffix)) break;
    }
    return row;
}

static bool do_common(struct scpi *s, const struct scpi_command *row, const struct scpi_unit *u, int64_t t_ns)
{
    char range[80];
    const struct scpi_param *p = u->param;
    snprintf(range, sizeof range, "%s: expected an integer from 0 to %u", row->pattern, row->max);
    if (u->params > (row->max > 0)) return fail_unit(s, -108, NULL);
    if (u->params < (row->max > 0)) return fail_unit(s, -109, range);
    if (row->max && p->form != SCPI_NUMBER) return fail_unit(s, p->form == SCPI_WORD ? -148 : -158, range);
    if (row->max && p->text.n) return fail_unit(s, -138, range);
    if (row->max && !(p->number > -0.5 && p->number < row->max + 0.5)) return fail_unit(s, -222, range);
    scpi_look(s, t_ns);
    row->run(&(struct scpi_call){s, row, row->max ? (unsigned)(p->number + 0.5) : 0, t_ns});
    return true;
}

/* The header with the path it is in: SCPI-99 volume 1, 6.2.4. False: too long. */
static bool make_path(struct scpi *s, const struct scpi_unit *u, char *full, struct scpi_text *header)
{
    const size_t before = u->rooted || u->common ? 0 : s->path_len;
    if (before + u->header.n > SCPI_HEADER_MAX) return false;
    memcpy(full, s->path, before);
    memcpy(full + before, u->header.p, u->header.n);
    *header = (struct scpi_text){full, before + u->header.n};
    if (u->common) return true; /* leaves the path as it is */
    s->path_len = header->n;
    while (s->path_len > 0 && full[s->path_len - 1] != ':') s->path_len--;
    memcpy(s->path, full, s->path_len);
    return true;
}

static bool do_unit(struct scpi *s, const struct scpi_unit *u, int64_t t_ns)
{
    char full[SCPI_HEADER_MAX + 1];
    struct scpi_text header;
    const struct control_scpi *how;
    unsigned suffix[4] = {1, 1, 1, 1};
    if (!make_path(s, u, full, &header)) return fail_unit(s, -112, NULL);
    const struct scpi_command *common = find_common(header, u->query);
    if (common) return do_common(s, common, u, t_ns);
    const struct control_command *row = scpi_find_row(s, header, u->query, &how, suffix);
    const bool of_its_own = row && control_arg_count(row) > scpi_suffixes(how->header);
    if (row && u->query && u->params && !of_its_own) return do_limit(s, header, u);
    if (row) return do_row(s, row, how, suffix, u, t_ns);
    full[header.n] = '\0';
    return fail_unit(s, -113, full);
}

/* ---- a message */

static void go_on(struct scpi *s, int64_t t_ns)
{
    struct scpi_unit u;
    while (s->pos < s->len && !scpi_busy(s)) {
        struct scpi_text rest = {s->line + s->pos, s->len - s->pos};
        const int err = scpi_lex_unit(&rest, &u);
        s->pos = s->len - rest.n;
        const bool good = err ? fail_unit(s, err, NULL) && false : !u.header.n || do_unit(s, &u, t_ns);
        if (!good) s->pos = s->len;
    }
    if (scpi_busy(s)) return;
    if (s->out_len) s->reply(s->ctx, s->out, s->out_len);
    s->out_len = 0;
}

static void on_rest(void *ctx, int64_t t_ns)
{
    struct scpi *s = ctx;
    const bool busy = scpi_busy(s);
    if (!s->opc && !busy) return;
    scpi_await(s, t_ns); /* once more, if another command came meanwhile */
    if (!busy || scpi_busy(s)) return;
    go_on(s, t_ns);
    if (!scpi_busy(s) && s->idle) s->idle(s->ctx, t_ns);
}

void scpi_open(struct scpi *s)
{
    scpi_status_init(&s->status);
    sched_ev(&s->rest, on_rest, s);
    s->opc = false;
    s->wait = SCPI_GO;
    s->pos = s->len = s->path_len = s->out_len = 0;
}

void scpi_close(struct scpi *s)
{
    sched_cancel(s->sched, &s->rest);
}

void scpi_line(struct scpi *s, const char *text, size_t len, int64_t t_ns)
{
    if (!text || len > sizeof s->line) {
        scpi_error(&s->status, -363, "expected a message of up to 4096 bytes");
        return;
    }
    memcpy(s->line, text, len);
    s->pos = s->path_len = s->out_len = 0;
    s->len = len;
    scpi_look(s, t_ns);
    go_on(s, t_ns);
}
