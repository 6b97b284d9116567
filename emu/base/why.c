#include "base/why.h"

#include "base/text.h"

#include <stdio.h>
#include <string.h>

bool why_fail(char *why, size_t cap, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(why, cap, format, ap);
    va_end(ap);
    if (cap) text_one_line(why);
    return false;
}

bool why_vexpected(char *why, size_t cap, const char *where, const char *got, const char *expected, va_list ap)
{
    size_t at = (size_t)snprintf(why, cap, "%s: expected ", where);
    if (at < cap) at += (size_t)vsnprintf(why + at, cap - at, expected, ap);
    if (at < cap && got) snprintf(why + at, cap - at, ", got %s", got);
    if (cap) text_one_line(why);
    return false;
}

bool why_expected(char *why, size_t cap, const char *where, const char *got, const char *expected, ...)
{
    va_list ap;
    va_start(ap, expected);
    why_vexpected(why, cap, where, got, expected, ap);
    va_end(ap);
    return false;
}

const char *why_text(char out[WHY_TEXT_MAX], const char *text)
{
    const bool fits = strlen(text) <= WHY_TEXT_MAX - 8;
    snprintf(out, WHY_TEXT_MAX, fits ? "\"%s\"" : "\"%.76s...\"", text);
    return out;
}

const char *why_real(char out[WHY_REAL_MAX], double x)
{
    snprintf(out, WHY_REAL_MAX, "%.10g", x);
    return out;
}

void why_list_add(char *list, size_t cap, const char *word)
{
    const size_t at = strlen(list);
    snprintf(list + at, cap - at, "%s%s", at ? ", " : "", word);
}
