#include "base/why.h"

#include "base/text.h"

#include <stdarg.h>
#include <stdio.h>

bool why_fail(char *why, size_t cap, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    vsnprintf(why, cap, format, ap);
    va_end(ap);
    text_one_line(why);
    return false;
}
