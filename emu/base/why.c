#include "base/why.h"

#include "base/text.h"

#include <errno.h>
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

const char *why_found(int err)
{
    static const struct {
        int err;
        const char *text;
    } found[] = {{ENOENT, "no such file"},
                 {EISDIR, "a folder"},
                 {ENOTDIR, "a file among the folders of the path"},
                 {EACCES, "one without permission"},
                 {EPERM, "one without permission"},
                 {EROFS, "a read-only file system"},
                 {ELOOP, "a loop of links"},
                 {ENAMETOOLONG, "too long a name"},
                 {ENXIO, "a socket, or a pipe without a reader"},
                 {EADDRINUSE, "one in use"},
                 {ENETUNREACH, "none"}};
    for (size_t i = 0; i < sizeof found / sizeof *found; i++)
        if (found[i].err == err) return found[i].text;
    return strerror(err);
}

bool why_machine(int err)
{
    static const int machine[] = {ENOSPC, EDQUOT, EFBIG, EIO, EMFILE, ENFILE, ENOMEM, ESTALE};
    for (size_t i = 0; i < sizeof machine / sizeof *machine; i++)
        if (machine[i] == err) return true;
    return false;
}

bool why_unwritable(char *why, size_t cap, const char *where, int err)
{
    if (why_machine(err)) return why_fail(why, cap, "%s: %s", where, strerror(err));
    const char *const got = err == ENOENT ? "no such folder" : why_found(err);
    return why_expected(why, cap, where, got, "a path that can be written");
}

bool why_port(char *why, size_t cap, const char *where, int err)
{
    return why_expected(why, cap, where, why_found(err), "a free port of 127.0.0.1 or 0 (any free port)");
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
