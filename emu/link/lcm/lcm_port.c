#include "link/lcm/lcm_port.h"

#include "link/own_file.h"

#include <stdio.h>

bool lcm_port_open(struct lcm_port *p, const char *text, bool *user, char *why, size_t cap)
{
    char where[256];
    long owner = 0;
    *user = true;
    p->log.fd = -1;
    p->udpm.library = NULL;
    if (!lcm_url_parse(text, "--lcm", &p->url, why, cap)) return false;
    snprintf(where, sizeof where, "--lcm %s", text);
    if (p->url.kind == LCM_UDPM) {
        *user = false;
        return lcm_udpm_open(&p->udpm, &p->url, where, why, cap);
    }
    const int err = lcm_log_open(&p->log, p->url.path, &owner);
    return !err || own_file_fail("--lcm file://", p->url.path, err, owner, user, why, cap);
}

void lcm_port_publish(struct lcm_port *p, const char *channel, const void *data, size_t len, int64_t t_us)
{
    if (p->url.kind == LCM_FILE) lcm_log_put(&p->log, channel, data, len, t_us);
    else lcm_udpm_send(&p->udpm, channel, data, len);
}

void lcm_port_close(struct lcm_port *p)
{
    if (p->url.kind == LCM_FILE) lcm_log_close(&p->log);
    else lcm_udpm_close(&p->udpm);
}
