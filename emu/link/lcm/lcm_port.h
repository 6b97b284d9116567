/* Where LCM messages go: an event log or UDP multicast. */
#ifndef PSABENCH_LINK_LCM_LCM_PORT_H
#define PSABENCH_LINK_LCM_LCM_PORT_H

#include "link/lcm/lcm_log.h"
#include "link/lcm/lcm_udpm.h"

struct lcm_port {
    struct lcm_url url;
    struct lcm_udpm udpm;
    struct lcm_log log;
};

/* text: a URL of lcm_url.h; stays the caller's. False with one line in why, and *user: the fault lies with what was given. */
bool lcm_port_open(struct lcm_port *p, const char *text, bool *user, char *why, size_t cap);

/* t_us: since the UNIX epoch; a network does not carry it. */
void lcm_port_publish(struct lcm_port *p, const char *channel, const void *data, size_t len, int64_t t_us);

void lcm_port_close(struct lcm_port *p);

#endif
