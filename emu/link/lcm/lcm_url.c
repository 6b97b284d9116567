#include "link/lcm/lcm_url.h"

#include "base/why.h"

#include <string.h>

static const char file_scheme[] = "file://", udpm_scheme[] = "udpm://";

/* A decimal number up to max without sign or leading zeros; moves *text behind it. */
static bool parse_number(const char **text, unsigned max, unsigned *v)
{
    const char *c = *text;
    unsigned x = 0;
    for (; *c >= '0' && *c <= '9'; c++) {
        x = x * 10 + (unsigned)(*c - '0');
        if (x > max) return false;
    }
    if (c == *text || (**text == '0' && c > *text + 1)) return false;
    *text = c;
    *v = x;
    return true;
}

static bool parse_group(const char **text, uint8_t group[4])
{
    for (unsigned i = 0; i < 4; i++) {
        unsigned v;
        if (i > 0 && *(*text)++ != '.') return false;
        if (!parse_number(text, 255, &v)) return false;
        group[i] = (uint8_t)v;
    }
    return group[0] >= 224 && group[0] <= 239;
}

static bool parse_udpm(const char *rest, struct lcm_url *u)
{
    unsigned port = 7667;
    *u = (struct lcm_url){.kind = LCM_UDPM, .group = {239, 255, 76, 67}};
    if (*rest && *rest != '?' && *rest != ':' && !parse_group(&rest, u->group)) return false;
    if (*rest == ':') {
        rest++;
        if (!parse_number(&rest, 65535, &port) || port == 0) return false;
    }
    u->port = (uint16_t)port;
    return !*rest || strcmp(rest, "?") == 0 || strcmp(rest, "?ttl=0") == 0;
}

bool lcm_url_parse(const char *text, const char *where, struct lcm_url *u, char *why, size_t cap)
{
    if (strncmp(text, file_scheme, sizeof file_scheme - 1) == 0) {
        *u = (struct lcm_url){.kind = LCM_FILE, .path = text + sizeof file_scheme - 1};
        return (*u->path && !strchr(u->path, '?')) ||
               why_expected(why, cap, where, WHY_TEXT(text), "file://PATH without options");
    }
    if (strncmp(text, udpm_scheme, sizeof udpm_scheme - 1) != 0)
        return why_expected(why, cap, where, WHY_TEXT(text), "file://PATH or udpm://[GROUP[:PORT]]");
    if (parse_udpm(text + sizeof udpm_scheme - 1, u)) return true;
    const char *ttl = strstr(text, "ttl=");
    if (ttl && strcmp(ttl, "ttl=0") != 0)
        return why_expected(why, cap, where, WHY_TEXT(text), "ttl=0, so that messages stay on this machine");
    return why_expected(why, cap, where, WHY_TEXT(text),
                        "udpm://GROUP:PORT with a multicast group from 224.0.0.0 to 239.255.255.255");
}
