#include "scpi/lex.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NUMBER_MAX = 255, EXPONENT_MAX = 32000, SUFFIX_DIGITS_MAX = 4 };

/* ---- characters; the locale has no say */

static bool is_space(char c)
{
    return (unsigned char)c <= ' ';
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static char upper_char(char c)
{
    return c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
}

static bool is_alpha(char c)
{
    return upper_char(c) >= 'A' && upper_char(c) <= 'Z';
}

static bool is_word(char c)
{
    return is_alpha(c) || is_digit(c) || c == '_';
}

static char first_char(const struct scpi_text *t)
{
    return t->n ? *t->p : '\0';
}

static void skip_text(struct scpi_text *t, size_t n)
{
    t->p += n;
    t->n -= n;
}

static void skip_spaces(struct scpi_text *t)
{
    while (t->n && is_space(*t->p)) skip_text(t, 1);
}

static size_t span_of(struct scpi_text t, bool (*is)(char))
{
    size_t n = 0;
    while (n < t.n && is(t.p[n])) n++;
    return n;
}

/* ---- header */

static int lex_mnemonic(struct scpi_text *t)
{
    if (!is_alpha(first_char(t))) return t->n && !is_space(*t->p) && !strchr(";,:?", *t->p) ? -101 : -102;
    const size_t n = span_of(*t, is_word);
    size_t letters = n;
    while (is_digit(t->p[letters - 1])) letters--;
    if (letters > SCPI_MNEMONIC_MAX) return -112;
    if (n - letters > SUFFIX_DIGITS_MAX) return -114;
    skip_text(t, n);
    return 0;
}

static int lex_header(struct scpi_text *t, struct scpi_unit *u)
{
    u->rooted = first_char(t) == ':';
    if (u->rooted) skip_text(t, 1);
    const char *start = t->p;
    u->common = first_char(t) == '*';
    if (u->common && u->rooted) return -102;
    if (u->common) skip_text(t, 1);
    for (bool more = true; more;) {
        const int err = lex_mnemonic(t);
        if (err) return err;
        more = !u->common && first_char(t) == ':';
        if (more) skip_text(t, 1);
    }
    u->header = (struct scpi_text){start, (size_t)(t->p - start)};
    u->query = first_char(t) == '?';
    if (u->query) skip_text(t, 1);
    if (u->header.n > SCPI_HEADER_MAX) return -112;
    return t->n && !is_space(*t->p) && *t->p != ';' ? -111 : 0;
}

/* ---- parameters */

/* Length of a decimal number, NRf; 0 when there is none. An E belongs to it only before a digit: 5 EV is a suffix. */
static size_t number_length(struct scpi_text t)
{
    size_t n = 0, digits = 0, e;
    if (n < t.n && (t.p[n] == '+' || t.p[n] == '-')) n++;
    for (; n < t.n && is_digit(t.p[n]); n++) digits++;
    if (n < t.n && t.p[n] == '.') n++;
    for (; n < t.n && is_digit(t.p[n]); n++) digits++;
    if (!digits) return 0;
    e = n;
    if (e < t.n && upper_char(t.p[e]) == 'E') e++;
    if (e > n && e < t.n && (t.p[e] == '+' || t.p[e] == '-')) e++;
    if (e == n || e >= t.n || !is_digit(t.p[e])) return n;
    while (e < t.n && is_digit(t.p[e])) e++;
    return e;
}

static bool is_suffix(char c)
{
    return is_alpha(c) || is_digit(c) || c == '/' || c == '.' || c == '-';
}

/* What follows a number: perhaps a suffix. */
static int lex_suffix(struct scpi_text *t, struct scpi_param *p)
{
    skip_spaces(t);
    const size_t n = is_alpha(first_char(t)) || first_char(t) == '/' ? span_of(*t, is_suffix) : 0;
    p->text = (struct scpi_text){t->p, n};
    if (n > SCPI_SUFFIX_MAX) return -134;
    skip_text(t, n);
    return 0;
}

static int lex_decimal(struct scpi_text *t, struct scpi_param *p)
{
    char digits[NUMBER_MAX + 1];
    const size_t n = number_length(*t);
    if (!n) return -121;
    if (n > NUMBER_MAX) return -124;
    memcpy(digits, t->p, n);
    digits[n] = '\0';
    const char *e = strpbrk(digits, "eE");
    if (e && labs(strtol(e + 1, NULL, 10)) > EXPONENT_MAX) return -123;
    p->form = SCPI_NUMBER;
    p->number = strtod(digits, NULL);
    skip_text(t, n);
    if (!isfinite(p->number)) return -222;
    return lex_suffix(t, p);
}

/* #H, #Q, #B; a digit after the # begins a block, which nothing here takes. */
static int lex_nondecimal(struct scpi_text *t, struct scpi_param *p)
{
    static const char bases[] = "BQH";
    static const int base[] = {2, 8, 16};
    skip_text(t, 1);
    const char *which = t->n && *t->p ? strchr(bases, upper_char(*t->p)) : NULL;
    if (!which) return t->n && is_digit(*t->p) ? -168 : -102;
    skip_text(t, 1);
    const size_t n = span_of(*t, is_word);
    char digits[17], *end;
    if (n == 0 || n >= sizeof digits) return n ? -124 : -121;
    memcpy(digits, t->p, n);
    digits[n] = '\0';
    p->form = SCPI_NUMBER;
    p->number = (double)strtoull(digits, &end, base[which - bases]);
    p->text = (struct scpi_text){t->p + n, 0};
    skip_text(t, n);
    return *end ? -121 : 0;
}

static int lex_string(struct scpi_text *t, struct scpi_param *p)
{
    const char quote = *t->p;
    skip_text(t, 1);
    const char *start = t->p;
    for (;;) {
        if (!t->n) return -151;
        const bool ends = *t->p == quote;
        skip_text(t, 1);
        if (ends && first_char(t) != quote) break;
        if (ends) skip_text(t, 1);
    }
    p->form = SCPI_STRING;
    p->text = (struct scpi_text){start, (size_t)(t->p - start) - 1};
    return 0;
}

static int lex_word(struct scpi_text *t, struct scpi_param *p)
{
    const size_t n = span_of(*t, is_word);
    if (n > SCPI_WORD_MAX) return -144;
    p->form = SCPI_WORD;
    p->text = (struct scpi_text){t->p, n};
    skip_text(t, n);
    return 0;
}

static int lex_param(struct scpi_text *t, struct scpi_param *p)
{
    const char c = first_char(t);
    if (is_alpha(c)) return lex_word(t, p);
    if (c == '#') return lex_nondecimal(t, p);
    if (c == '"' || c == '\'') return lex_string(t, p);
    if (c == '(') return -178;
    if (!t->n || c == ';' || c == ',') return -102; /* nothing between separators */
    return is_digit(c) || (c && strchr("+-.", c)) ? lex_decimal(t, p) : -101;
}

int scpi_lex_unit(struct scpi_text *t, struct scpi_unit *u)
{
    u->header = (struct scpi_text){t->p, 0};
    u->params = 0;
    skip_spaces(t);
    int err = t->n && *t->p != ';' ? lex_header(t, u) : 0;
    if (err) return err;
    skip_spaces(t);
    while (t->n && *t->p != ';') {
        if (u->params == SCPI_PARAMS_MAX) return -223;
        err = lex_param(t, &u->param[u->params++]);
        if (err) return err;
        skip_spaces(t);
        if (t->n && *t->p != ';' && *t->p != ',') return -103;
        if (first_char(t) != ',') continue;
        skip_text(t, 1);
        skip_spaces(t);
        if (!t->n || *t->p == ';') return -102;
    }
    if (t->n) skip_text(t, 1);
    return 0;
}

/* ---- matching */

bool scpi_is(const char *mnemonic, size_t len, struct scpi_text text)
{
    size_t s = 0;
    while (s < len && mnemonic[s] == upper_char(mnemonic[s])) s++;
    if (!text.n || (text.n != len && text.n != s)) return false;
    for (size_t i = 0; i < text.n; i++) {
        if (upper_char(text.p[i]) != upper_char(mnemonic[i])) return false;
    }
    return true;
}

/* One node of a header: letters, then its numeric suffix. */
static bool match_node(const char *node, size_t len, bool numbered, struct scpi_text h, unsigned *suffix)
{
    size_t letters = h.n;
    while (letters > 0 && is_digit(h.p[letters - 1])) letters--;
    *suffix = 0;
    for (size_t i = letters; i < h.n; i++) *suffix = *suffix * 10 + (unsigned)(h.p[i] - '0');
    if (letters == h.n) *suffix = 1;
    else if (!numbered) return false;
    return scpi_is(node, len, (struct scpi_text){h.p, letters});
}

static struct scpi_text take_node(struct scpi_text *h)
{
    struct scpi_text node = {h->p, 0};
    while (node.n < h->n && h->p[node.n] != ':') node.n++;
    skip_text(h, node.n);
    if (h->n) skip_text(h, 1);
    return node;
}

/* Patterns leave out one node after the other where they may, as the table of SYSTem:ERRor[:NEXT] has it: at most the last
 * node of a branch is optional, so that no choice has to be taken back. */
bool scpi_match(const char *pattern, struct scpi_text header, unsigned suffix[4])
{
    unsigned found = 0;
    for (const char *p = pattern; *p && *p != '?';) {
        const bool optional = *p == '[';
        p += strspn(p, "[:");
        const size_t len = strcspn(p, "#:[]?");
        const bool numbered = p[len] == '#';
        struct scpi_text rest = header;
        const struct scpi_text node = take_node(&rest);
        unsigned number;
        if (node.n && match_node(p, len, numbered, node, &number)) {
            header = rest;
            if (numbered && found < 4) suffix[found++] = number;
        } else if (!optional) {
            return false;
        }
        p += len;
        p += strspn(p, "#]:");
    }
    return header.n == 0;
}

/* ---- units */

/* pi/180 and the like to full precision; a reading in the argument's unit is number * factor + offset. */
static const struct suffix {
    const char *unit, *suffix;
    double factor, offset;
} suffixes[] = {
    // clang-format off
    {"deg", "DEG", 1, 0}, {"deg", "RAD", 57.295779513082320877, 0}, {"deg", "MNT", 1.0 / 60, 0}, {"deg", "SEC", 1.0 / 3600, 0},
    {"deg/s", "DPS", 1, 0}, {"deg/s", "DEG/S", 1, 0}, {"deg/s", "RAD/S", 57.295779513082320877, 0},
    {"deg/s", "DEG/HR", 1.0 / 3600, 0}, {"deg/s", "RPM", 6, 0},
    {"s", "S", 1, 0}, {"s", "MS", 1e-3, 0}, {"s", "US", 1e-6, 0}, {"s", "NS", 1e-9, 0}, {"s", "MIN", 60, 0}, {"s", "HR", 3600, 0},
    {"degC", "CEL", 1, 0}, {"degC", "K", 1, -273.15}, {"degC", "FAR", 1 / 1.8, -32 / 1.8},
    {"K/min", "K/MIN", 1, 0}, {"K/min", "CEL/MIN", 1, 0}, {"K/min", "K/S", 60, 0}, {"K/min", "K/HR", 1.0 / 60, 0},
    {"V", "V", 1, 0}, {"V", "MV", 1e-3, 0}, {"V", "UV", 1e-6, 0}, {"V", "KV", 1e3, 0},
    {"Hz", "HZ", 1, 0}, {"Hz", "KHZ", 1e3, 0}, {"Hz", "MHZ", 1e6, 0}, {"Hz", "MAHZ", 1e6, 0}, /* 488.2 table 7-2: MHZ is mega */
    // clang-format on
};

const char *scpi_suffix(const char *unit, unsigned i)
{
    for (size_t k = 0; unit && k < sizeof suffixes / sizeof *suffixes; k++) {
        if (strcmp(suffixes[k].unit, unit) == 0 && i-- == 0) return suffixes[k].suffix;
    }
    return NULL;
}

int scpi_to_unit(const char *unit, struct scpi_text suffix, double number, double *out)
{
    *out = number;
    if (!suffix.n) return 0;
    if (!unit) return -138;
    for (size_t k = 0; k < sizeof suffixes / sizeof *suffixes; k++) {
        const struct suffix *s = &suffixes[k];
        if (strcmp(s->unit, unit) != 0 || !scpi_is(s->suffix, strlen(s->suffix), suffix)) continue;
        *out = number * s->factor + s->offset;
        return 0;
    }
    return -131;
}
