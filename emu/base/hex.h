/* Hexadecimal digits of the text protocols. Pure. */
#ifndef PSABENCH_BASE_HEX_H
#define PSABENCH_BASE_HEX_H

#include <stddef.h>
#include <stdint.h>

/* Value of one digit, upper or lower case; -1 for anything else. */
static inline int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

/* Value of n digits; -1 when one of them is none, or n is not 1..8. */
static inline int64_t hex_get(const char *p, size_t n)
{
    if (n < 1 || n > 8) return -1;
    int64_t v = 0;
    for (size_t i = 0; i < n; i++) {
        const int d = hex_digit(p[i]);
        if (d < 0) return -1;
        v = v * 16 + d;
    }
    return v;
}

/* Writes n upper-case digits. */
static inline void hex_put(char *p, uint32_t v, size_t n)
{
    for (size_t i = n; i-- > 0; v >>= 4) p[i] = "0123456789ABCDEF"[v & 15];
}

#endif
