#define _GNU_SOURCE /* memmem */
#include "link/http.h"

#include <string.h>

static const char *const beginnings[] = {"GET ",     "POST ",  "PUT ",  "HEAD ", "PATCH ", "DELETE ", "OPTIONS ",
                                         "CONNECT ", "TRACE ", "HOST:", "Host:", "host:",  "\x16\x03"};

bool http_begins(const char *bytes, size_t n)
{
    for (size_t i = 0; i < sizeof beginnings / sizeof *beginnings; i++) {
        const size_t len = strlen(beginnings[i]);
        if (n >= len && memcmp(bytes, beginnings[i], len) == 0) return true;
    }
    return false;
}

bool http_line(const char *line, size_t n)
{
    static const char version[] = " HTTP/1.";
    return memmem(line, n, version, sizeof version - 1) != NULL;
}
