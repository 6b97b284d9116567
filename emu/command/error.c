#include "command/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool control_refuse_in(struct control_refusal *r, const char *code, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(r->why, sizeof r->why, format, ap);
    va_end(ap);
    r->code = code;
    return false;
}

void control_list_add(char *list, size_t cap, const char *word)
{
    const size_t at = strlen(list);
    snprintf(list + at, cap - at, "%s%s", at ? ", " : "", word);
}
