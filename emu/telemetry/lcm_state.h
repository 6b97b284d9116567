/* What the instruments show, and the truth. */
#ifndef PSABENCH_TELEMETRY_LCM_STATE_H
#define PSABENCH_TELEMETRY_LCM_STATE_H

#include "telemetry/lcm_feed.h"

void lcm_state_instruments(struct lcm_feed *f, int64_t t_ns);
void lcm_state_truth(struct lcm_feed *f, struct lcm_unit *u, int64_t t_ns);

#endif
