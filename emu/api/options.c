#include "api/internal.h"

#include "base/why.h"

#include <string.h>

enum { KEY = 32, VALUE = 64 };

/* Digits of a number, the point left out; their count after the point in *decimals. NULL if there are none or too many to
 * be exact in a double. */
static const char *take_digits(const char *s, uint64_t *digits, int *decimals)
{
    unsigned count = 0;
    bool point = false;
    for (*digits = 0, *decimals = 0; (*s >= '0' && *s <= '9') || (*s == '.' && !point); s++) {
        point = point || *s == '.';
        if (*s == '.') continue;
        *digits = *digits * 10 + (uint64_t)(*s - '0');
        *decimals += point;
        if (++count > 15) return NULL;
    }
    return count ? s : NULL;
}

/* [-]digits[.digits][e[-]digits], whatever the locale of the program (strtod would ask it), exactly rounded: both the
 * digits and the power of ten are exact. */
static bool parse_number(const char *s, double *v)
{
    uint64_t digits;
    uint64_t exponent = 0;
    int decimals;
    int none;
    const bool minus = *s == '-';
    bool minus_exponent = false;
    s = take_digits(s + minus, &digits, &decimals);
    if (s && *s == 'e') {
        minus_exponent = s[1] == '-';
        if (strchr(s, '.')) return false; /* a whole number of tens */
        s = take_digits(s + 1 + minus_exponent, &exponent, &none);
    }
    if (!s || *s || exponent > 99) return false;
    const int ten = (minus_exponent ? -(int)exponent : (int)exponent) - decimals;
    if (ten > 22 || ten < -22) return false;
    double power = 1.0;
    for (int i = 0; i < (ten < 0 ? -ten : ten); i++) power *= 10.0;
    *v = ten < 0 ? (double)digits / power : (double)digits * power;
    if (minus) *v = -*v;
    return true;
}

static bool set_number(void *at, const struct api_option *o, const char *text, char *why, size_t cap)
{
    double v;
    const bool good = parse_number(text, &v) && v >= o->min && v <= o->max;
    if (!good || (o->type == API_UINT && v != (double)(uint32_t)v))
        return why_fail(why, cap, "option %s: expected %s from %.10g to %.10g, got %s", o->key,
                        o->type == API_UINT ? "a whole number" : "a number", o->min, o->max, text);
    const uint32_t u = o->type == API_UINT ? (uint32_t)v : 0;
    if (o->type == API_UINT) memcpy(at, &u, sizeof u);
    else memcpy(at, &v, sizeof v);
    return true;
}

static bool set_bool(void *at, const struct api_option *o, const char *text, char *why, size_t cap)
{
    if (strcmp(text, "0") != 0 && strcmp(text, "1") != 0)
        return why_fail(why, cap, "option %s: expected 0 or 1, got %s", o->key, text);
    const bool v = text[0] == '1';
    memcpy(at, &v, sizeof v);
    return true;
}

static bool set_choice(void *at, const struct api_option *o, const char *text, char *why, size_t cap)
{
    const size_t len = strlen(text);
    unsigned number = 0;
    for (const char *c = o->choices; c; number++) {
        const char *bar = strchr(c, '|');
        const size_t n = bar ? (size_t)(bar - c) : strlen(c);
        if (n == len && memcmp(c, text, n) == 0) {
            memcpy(at, &number, sizeof number);
            return true;
        }
        c = bar ? bar + 1 : NULL;
    }
    return why_fail(why, cap, "option %s: expected one of %s, got %s", o->key, o->choices, text);
}

static bool set_option(struct psabench_part *p, const struct api_option *o, const char *text, char *why, size_t cap)
{
    void *at = (char *)p + o->offset;
    if (o->type == API_BOOL) return set_bool(at, o, text, why, cap);
    if (o->type == API_CHOICE) return set_choice(at, o, text, why, cap);
    return set_number(at, o, text, why, cap);
}

static const struct api_option *find_option(const struct api_kind *k, const char *key)
{
    for (unsigned i = 0; i < k->option_count; i++)
        if (strcmp(k->options[i].key, key) == 0) return &k->options[i];
    return NULL;
}

static bool fail_unknown(const struct api_kind *k, const char *key, char *why, size_t cap)
{
    char list[API_WHY];
    api_list(k->options, sizeof *k->options, k->option_count, list);
    return why_fail(why, cap, "option of %s: expected one of%s, got %s", k->name, list, key);
}

/* One word "key=value". */
static bool take_word(struct psabench_part *p, const char *word, size_t len, char *why, size_t cap)
{
    char key[KEY];
    char value[VALUE];
    const char *equals = memchr(word, '=', len);
    if (!equals) return why_fail(why, cap, "option: expected key=value, got %.*s", (int)(len < KEY ? len : KEY), word);
    const size_t n = (size_t)(equals - word);
    const size_t m = len - n - 1;
    if (n >= sizeof key || m >= sizeof value)
        return why_fail(why, cap, "option: expected a key of up to %d and a value of up to %d characters, got %.*s...",
                        KEY - 1, VALUE - 1, KEY - 1, word);
    memcpy(key, word, n);
    key[n] = '\0';
    memcpy(value, equals + 1, m);
    value[m] = '\0';
    const struct api_option *o = find_option(p->kind, key);
    return o ? set_option(p, o, value, why, cap) : fail_unknown(p->kind, key, why, cap);
}

bool api_options(struct psabench_part *p, const char *text, char *why, size_t cap)
{
    for (unsigned i = 0; i < p->kind->option_count; i++)
        if (!set_option(p, &p->kind->options[i], p->kind->options[i].standard, why, cap)) return false;
    for (const char *word = text ? text : ""; *(word += strspn(word, " "));) {
        const size_t len = strcspn(word, " ");
        if (!take_word(p, word, len, why, cap)) return false;
        word += len;
    }
    return true;
}
