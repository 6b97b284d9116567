#include "command/utf8.h"

#include <stddef.h>

/* Unicode 15, table 3-7: the first byte, and what the second may be; further ones are 80..BF. */
static const struct {
    unsigned char first, last, second_low, second_high;
    unsigned char length;
} forms[] = {
    {0x01, 0x7F, 0, 0, 1},       {0xC2, 0xDF, 0x80, 0xBF, 2}, {0xE0, 0xE0, 0xA0, 0xBF, 3},
    {0xE1, 0xEC, 0x80, 0xBF, 3}, {0xED, 0xED, 0x80, 0x9F, 3}, {0xEE, 0xEF, 0x80, 0xBF, 3},
    {0xF0, 0xF0, 0x90, 0xBF, 4}, {0xF1, 0xF3, 0x80, 0xBF, 4}, {0xF4, 0xF4, 0x80, 0x8F, 4},
};

/* Bytes of the character at `at`, 0: there is none. A NUL is in no character, so nothing is read behind it. */
static unsigned length_at(const char *at)
{
    const unsigned char *b = (const unsigned char *)at;
    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        if (b[0] < forms[i].first || b[0] > forms[i].last) continue;
        if (forms[i].length > 1 && (b[1] < forms[i].second_low || b[1] > forms[i].second_high)) return 0;
        for (unsigned n = 2; n < forms[i].length; n++)
            if ((b[n] & 0xC0) != 0x80) return 0;
        return forms[i].length;
    }
    return 0;
}

bool utf8_valid(const char *text)
{
    for (unsigned n; *text; text += n)
        if (!(n = length_at(text))) return false;
    return true;
}

void utf8_clean(char *text)
{
    while (*text) {
        const unsigned n = length_at(text);
        if (!n) *text = '?';
        text += n ? n : 1;
    }
}
