#include "scenario/series_csv.h"

#include "base/why.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CELL_MAX = 64, NS_DIGITS = 9 };

void series_csv_init(struct series_csv *c, const char *column)
{
    *c = (struct series_csv){.index = 0};
    snprintf(c->column, sizeof c->column, "%s", column);
}

struct cell {
    const char *text;
    size_t n;
};

/* The cell that begins at *at, without blanks; *at goes behind its comma, to NULL behind the last one. */
static struct cell next_cell(const char **at, const char *end)
{
    const char *from = *at;
    const char *comma = memchr(from, ',', (size_t)(end - from));
    const char *to = comma ? comma : end;
    *at = comma ? comma + 1 : NULL;
    while (from < to && (*from == ' ' || *from == '\t')) from++;
    while (to > from && (to[-1] == ' ' || to[-1] == '\t')) to--;
    return (struct cell){from, (size_t)(to - from)};
}

static bool cell_is(struct cell c, const char *text)
{
    return c.n == strlen(text) && memcmp(c.text, text, c.n) == 0;
}

/* Printable, as a message shows it. */
static const char *shown_cell(char out[CELL_MAX], struct cell c)
{
    size_t i = 0;
    for (; i < c.n && i + 1 < CELL_MAX; i++) out[i] = c.text[i] >= ' ' && c.text[i] <= '~' ? c.text[i] : '?';
    out[i] = '\0';
    return out;
}

static enum series_csv_line bad_cell(struct cell c, const char *expected, char *why, size_t cap)
{
    char text[CELL_MAX];
    why_fail(why, cap, "expected %s, got \"%s\"", expected, shown_cell(text, c));
    return SERIES_CSV_BAD;
}

static enum series_csv_line read_header(struct series_csv *c, const char *at, const char *end, char *why, size_t cap)
{
    const struct cell time = next_cell(&at, end);
    c->in_s = cell_is(time, "t_s");
    if (!c->in_s && !cell_is(time, "t_ns")) return bad_cell(time, "a first column t_s or t_ns", why, cap);
    unsigned found = 0;
    for (c->columns = 1; at; c->columns++) {
        if (!cell_is(next_cell(&at, end), c->column)) continue;
        if (found) return why_fail(why, cap, "expected one column %s, got two", c->column), SERIES_CSV_BAD;
        found = c->columns;
    }
    if (c->columns > SERIES_CSV_COLUMNS)
        return why_fail(why, cap, "expected up to %d columns, got %u", SERIES_CSV_COLUMNS, c->columns), SERIES_CSV_BAD;
    if (!found) return why_fail(why, cap, "expected a column %s, got none", c->column), SERIES_CSV_BAD;
    c->index = found;
    return SERIES_CSV_NONE;
}

/* Digits as a number; false for none and for more than would fit. *at goes behind them. */
static bool read_digits(const char **at, const char *end, int64_t *value, unsigned *digits)
{
    const char *from = *at;
    for (; *at < end && **at >= '0' && **at <= '9'; ++*at) {
        if (*value > SERIES_CSV_MOST_NS) return false;
        *value = *value * 10 + (**at - '0');
    }
    *digits = (unsigned)(*at - from);
    return *digits > 0;
}

/* Exactly: no double is on the way. */
static bool read_time(const struct series_csv *c, struct cell cell, int64_t *t_ns)
{
    const char *at = cell.text, *end = cell.text + cell.n;
    const bool minus = at < end && *at == '-';
    int64_t ns = 0;
    unsigned digits, decimals = 0;
    if (at < end && (*at == '-' || *at == '+')) at++;
    if (!read_digits(&at, end, &ns, &digits)) return false;
    if (at < end && c->in_s && *at == '.') {
        while (end > at + 1 + NS_DIGITS && end[-1] == '0') end--; /* zeros past the nanosecond say nothing */
        at++;
        if (!read_digits(&at, end, &ns, &decimals) || decimals > NS_DIGITS) return false;
    }
    for (unsigned i = decimals; c->in_s && i < NS_DIGITS; i++) {
        if (ns > SERIES_CSV_MOST_NS) return false;
        ns *= 10;
    }
    *t_ns = minus ? -ns : ns;
    return at == end && ns <= SERIES_CSV_MOST_NS;
}

/* As strtod in the C locale, without its hexadecimal, its infinities and its blanks. */
static bool read_value(struct cell cell, double *value)
{
    char text[CELL_MAX], *end;
    if (cell.n == 0 || cell.n >= sizeof text) return false;
    memcpy(text, cell.text, cell.n);
    text[cell.n] = '\0';
    if (text[strspn(text, "0123456789+-.eE")] != '\0') return false;
    *value = strtod(text, &end);
    return end == text + cell.n && fabs(*value) <= SERIES_CSV_VALUE_MAX;
}

static enum series_csv_line read_sample(struct series_csv *c, const char *at, const char *end,
                                        struct series_sample *out, char *why, size_t cap)
{
    unsigned k = 0;
    const struct cell time = next_cell(&at, end);
    if (!read_time(c, time, &out->t_ns))
        return bad_cell(time, c->in_s ? "seconds as a decimal of up to 9 places" : "whole nanoseconds", why, cap);
    if (c->any && out->t_ns <= c->last_ns) return bad_cell(time, "a time after that of the sample before", why, cap);
    for (k = 1; at; k++) {
        const struct cell cell = next_cell(&at, end);
        if (k == c->index && !read_value(cell, &out->value))
            return bad_cell(cell, "a number of magnitude up to 1e6", why, cap);
    }
    if (k != c->columns) return why_fail(why, cap, "expected %u columns, got %u", c->columns, k), SERIES_CSV_BAD;
    c->any = true;
    c->last_ns = out->t_ns;
    return SERIES_CSV_SAMPLE;
}

enum series_csv_line series_csv_line(struct series_csv *c, const char *line, size_t n, struct series_sample *out,
                                     char *why, size_t cap)
{
    if (n > SERIES_CSV_LINE)
        return why_fail(why, cap, "expected lines of up to %d bytes, got more", SERIES_CSV_LINE), SERIES_CSV_BAD;
    if (n && line[n - 1] == '\r') n--;
    if (n && line[0] == '#') return SERIES_CSV_NONE;
    return c->index ? read_sample(c, line, line + n, out, why, cap) : read_header(c, line, line + n, why, cap);
}
