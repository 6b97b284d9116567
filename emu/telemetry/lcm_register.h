/* Register and object accesses out of the SDO frames on the bus (CiA 301 7.2.4): expedited ones, as all numbers are. */
#ifndef PSABENCH_TELEMETRY_LCM_REGISTER_H
#define PSABENCH_TELEMETRY_LCM_REGISTER_H

#include "telemetry/lcm_feed.h"

/* A data frame with an 11-bit identifier of the unit's node: publishes the access that it completes. */
void lcm_register_take(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns);

#endif
