/* The argument of --mavlink: KIND[:PORT|:LINK][,KEY=VALUE...]. Pure; bounded. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_OPTIONS_H
#define PSABENCH_LINK_MAVLINK_MAV_OPTIONS_H

#include "link/mavlink/mav_kind.h"

#include <stdbool.h>
#include <stdint.h>

#define MAV_OPTIONS_PORT 14550u /* where ground stations listen; of tcp: 5760 */

struct mav_options {
    const char *arg; /* as given */
    enum mav_port_kind kind;
    uint16_t port;                    /* 0: a free one */
    char link[256];                   /* of the pty; "": none */
    char unit[32];                    /* "": the first */
    uint8_t sysid, compid, autopilot; /* autopilot: MAV_AUTOPILOT */
    double imu_hz, angles_hz, hil_hz; /* 0: not sent */
};

/* arg is kept by pointer. False with what would be right in *form. */
bool mav_options_parse(const char *arg, struct mav_options *o, const char **form);

#endif
