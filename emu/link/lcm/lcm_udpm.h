/* LCM over UDP multicast, by liblcm. The library is loaded when it is asked for: a machine without it runs everything else.
 *
 * The hop limit is 0: messages stay on this machine. Nothing waits for a receiver: what the kernel has no room for is lost
 * there. */
#ifndef PSABENCH_LINK_LCM_LCM_UDPM_H
#define PSABENCH_LINK_LCM_LCM_UDPM_H

#include "link/lcm/lcm_url.h"

struct lcm_udpm {
    void *library; /* NULL: not open */
    void *lcm;
    int (*publish)(void *lcm, const char *channel, const void *data, unsigned len);
    uint64_t sent, lost; /* lost: what liblcm could not send */
};

/* False with one line in why, which begins with `where`: no liblcm.so.1, no route for multicast. */
bool lcm_udpm_open(struct lcm_udpm *u, const struct lcm_url *url, const char *where, char *why, size_t cap);

void lcm_udpm_send(struct lcm_udpm *u, const char *channel, const void *data, size_t len);
void lcm_udpm_close(struct lcm_udpm *u);

#endif
