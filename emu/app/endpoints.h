/* The endpoints of the `ready` lines as JSON, for commands. */
#ifndef PSABENCH_APP_ENDPOINTS_H
#define PSABENCH_APP_ENDPOINTS_H

#include "app/ports.h"

#include <cjson/cJSON.h>

/* Adds an array "endpoints", an object for each `ready key=value ...` line of text, which is cut up. */
void endpoints_add(cJSON *result, char *text);

/* The same of open ports. False without memory. */
bool endpoints_describe(const struct ports *p, const struct options *o, cJSON *result);

#endif
