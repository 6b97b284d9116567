/* SHA-256 (FIPS 180-4): what a file or a state is distinguished by. Pure; nothing allocates. */
#ifndef PSABENCH_BASE_SHA256_H
#define PSABENCH_BASE_SHA256_H

#include <stddef.h>
#include <stdint.h>

#define SHA256_BYTES 32u
#define SHA256_HEX   65u /* 64 digits and the NUL */

struct sha256 { /* read-only outside sha256.c */
    uint32_t h[8];
    uint64_t len; /* bytes so far */
    uint8_t block[64];
};

void sha256_init(struct sha256 *s);
void sha256_add(struct sha256 *s, const void *bytes, size_t n);

/* The digest in lower-case hexadecimal; s is used up. */
void sha256_hex(struct sha256 *s, char out[SHA256_HEX]);

#endif
