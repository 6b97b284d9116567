/* The argument of --mavlink: KIND[:PORT|:LINK][,KEY=VALUE...]. Pure; bounded. */
#ifndef PSABENCH_APP_OPTIONS_MAVLINK_H
#define PSABENCH_APP_OPTIONS_MAVLINK_H

#include "app/options.h"

#define OPTIONS_MAVLINK_PORT 14550u /* where ground stations listen; of tcp: 5760 */

/* arg is kept by pointer. False with what would be right in *form. */
bool options_mavlink(const char *arg, struct options_mavlink *o, const char **form);

#endif
