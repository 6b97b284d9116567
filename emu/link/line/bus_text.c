#include "link/line/bus_text.h"

#include "base/hex.h"

#include <inttypes.h>
#include <stdio.h>

static const char op_letter[] = {[BUS_READ] = 'R', [BUS_WRITE] = 'W', [BUS_WHO] = '?'};

/* What is left of a line. */
struct text {
    const char *at, *end;
};

static void skip_blanks(struct text *t)
{
    while (t->at < t->end && (*t->at == ' ' || *t->at == '\t')) t->at++;
}

/* The next field without its blanks; empty at the end of the line. */
static struct text next_field(struct text *t)
{
    skip_blanks(t);
    struct text f = {t->at, t->at};
    while (f.end < t->end && *f.end != ' ' && *f.end != '\t') f.end++;
    t->at = f.end;
    return f;
}

static bool is_empty(struct text f)
{
    return f.at == f.end;
}

/* An address may have the h with which answers write it. */
static struct text without_h(struct text f)
{
    if (f.end - f.at > 1 && (f.end[-1] == 'h' || f.end[-1] == 'H')) f.end--;
    return f;
}

/* A number of at most `most` digits. */
static bool parse_number(struct text f, int base, unsigned most, uint32_t *out)
{
    uint32_t v = 0;
    if (is_empty(f) || (size_t)(f.end - f.at) > most) return false;
    for (; f.at < f.end; f.at++) {
        const int d = hex_digit(*f.at);
        if (d < 0 || d >= base) return false;
        v = v * (uint32_t)base + (uint32_t)d;
    }
    *out = v;
    return true;
}

static bool op_of(struct text f, enum bus_op *op)
{
    if (f.end - f.at != 1) return false;
    for (unsigned i = 0; i < sizeof op_letter; i++) {
        const bool lower = *f.at >= 'a' && *f.at <= 'z';
        if ((lower ? *f.at - 'a' + 'A' : *f.at) != op_letter[i]) continue;
        *op = (enum bus_op)i;
        return true;
    }
    return false;
}

static enum bus_text_err parse_data(struct text *t, struct bus_request *out)
{
    const struct text f = next_field(t);
    uint32_t v = 0;
    if (is_empty(f)) return BUS_TEXT_SYNTAX;
    if (!parse_number(f, 16, 4, &v)) return BUS_TEXT_NUMBER;
    out->data = (uint16_t)v;
    return BUS_TEXT_OK;
}

/* May be missing; 0 would mean the board's own. */
static enum bus_text_err parse_strobe(struct text *t, struct bus_request *out)
{
    const struct text f = next_field(t);
    uint32_t v = 0;
    if (is_empty(f)) return BUS_TEXT_OK;
    if (!parse_number(f, 10, 9, &v) || v == 0) return BUS_TEXT_NUMBER;
    out->strobe_ns = v;
    return BUS_TEXT_OK;
}

enum bus_text_err bus_text_parse(const char *line, size_t len, struct bus_request *out, unsigned *fields)
{
    struct text t = {line, line + len};
    *out = (struct bus_request){.op = BUS_READ};
    *fields = 0;
    if (len > BUS_TEXT_LINE_MAX) return BUS_TEXT_OVERLONG;
    if (len && t.end[-1] == '\r') t.end--;
    if (!op_of(next_field(&t), &out->op)) return BUS_TEXT_SYNTAX;
    *fields = 1;
    if (out->op != BUS_WHO) {
        const struct text f = next_field(&t);
        uint32_t address = 0;
        if (is_empty(f)) return BUS_TEXT_SYNTAX;
        if (!parse_number(without_h(f), 16, 2, &address)) return BUS_TEXT_NUMBER;
        out->address = (uint8_t)address;
        *fields = 2;
        enum bus_text_err err = out->op == BUS_WRITE ? parse_data(&t, out) : BUS_TEXT_OK;
        if (err == BUS_TEXT_OK) err = parse_strobe(&t, out);
        if (err != BUS_TEXT_OK) return err;
    }
    return is_empty(next_field(&t)) ? BUS_TEXT_OK : BUS_TEXT_SYNTAX;
}

const char *bus_text_code(enum bus_text_err err)
{
    static const char *const code[] = {"", "syntax", "number", "overlong"};
    return code[err];
}

size_t bus_text_done(const struct bus_request *r, uint16_t data, int64_t t_ns, char *out)
{
    return (size_t)snprintf(out, BUS_TEXT_MAX, "%c %02Xh %04X t=%" PRId64 "\n", op_letter[r->op], r->address, data,
                            t_ns);
}

size_t bus_text_refused(const struct bus_request *r, unsigned fields, const char *code, int64_t t_ns, char *out)
{
    char address[8] = "-";
    if (fields > 1) (void)snprintf(address, sizeof address, "%02Xh", r->address);
    return (size_t)snprintf(out, BUS_TEXT_MAX, "E %.32s %c %s t=%" PRId64 "\n", code, fields ? op_letter[r->op] : '-',
                            address, t_ns);
}
