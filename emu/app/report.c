/* What all parts of the service report of themselves: lines on stderr, and files for counters. */
#include "app/service.h"

#include <stdio.h>

void service_say(const char *text)
{
    fprintf(stderr, "psa-emu: %s\n", text);
}

void service_report_file(const char *what, const char *path, const char *reason, const char *stored)
{
    fprintf(stderr, "psa-emu: %s %s: %s; %s; the run continues\n", what, path, reason, stored);
}

cJSON *service_add_file(cJSON *files, const char *kind, const char *path, double bytes, const char *error)
{
    cJSON *f = cJSON_CreateObject();
    cJSON_AddStringToObject(f, "kind", kind);
    cJSON_AddStringToObject(f, "path", path);
    cJSON_AddNumberToObject(f, "bytes", bytes);
    if (error) cJSON_AddStringToObject(f, "error", error);
    cJSON_AddItemToArray(files, f);
    return f;
}
