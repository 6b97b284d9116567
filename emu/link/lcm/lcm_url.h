/* Where LCM messages go, in LCM's own notation: file://PATH or udpm://[GROUP[:PORT]][?ttl=0]. Pure. */
#ifndef PSABENCH_LINK_LCM_LCM_URL_H
#define PSABENCH_LINK_LCM_LCM_URL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum lcm_kind { LCM_FILE, LCM_UDPM };

struct lcm_url {
    enum lcm_kind kind;
    const char *path; /* of the file, part of the text */
    uint8_t group[4]; /* of the multicast, 224 to 239; LCM's default is 239.255.76.67 */
    uint16_t port;    /* LCM's default is 7667 */
};

/* The text stays the caller's. False with one line in why, which begins with `where`. A ttl above 0 is rejected: messages do
 * not leave this machine. */
bool lcm_url_parse(const char *text, const char *where, struct lcm_url *u, char *why, size_t cap);

#endif
