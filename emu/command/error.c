#include "command/error.h"

#include <stdio.h>

bool control_reject_in(struct control_error *r, const char *code, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(r->why, sizeof r->why, format, ap);
    va_end(ap);
    r->code = code;
    return false;
}

bool control_expected(struct control_error *r, const char *code, const char *where, const char *got,
                      const char *expected, ...)
{
    va_list ap;
    va_start(ap, expected);
    why_vexpected(r->why, sizeof r->why, where, got, expected, ap);
    va_end(ap);
    r->code = code;
    return false;
}
