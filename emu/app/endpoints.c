#define _GNU_SOURCE /* open_memstream, strtok_r */
#include "app/endpoints.h"

#include <stdlib.h>
#include <string.h>

/* ready key=value key=value: an object. */
static void add_one(cJSON *endpoints, char *line)
{
    char *rest = NULL;
    cJSON *e = cJSON_CreateObject();
    for (char *word = strtok_r(line, " ", &rest); word; word = strtok_r(NULL, " ", &rest)) {
        char *value = strchr(word, '=');
        if (!value) continue;
        *value = '\0';
        cJSON_AddStringToObject(e, word, value + 1);
    }
    if (e->child) cJSON_AddItemToArray(endpoints, e);
    else cJSON_Delete(e);
}

void endpoints_add(cJSON *result, char *text)
{
    char *rest = NULL;
    cJSON *endpoints = cJSON_AddArrayToObject(result, "endpoints");
    for (char *line = strtok_r(text, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) add_one(endpoints, line);
}

bool endpoints_describe(const struct ports *p, const struct options *o, cJSON *result)
{
    char *text = NULL;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    if (!out) return false;
    ports_ready(p, o, out);
    const bool whole = fclose(out) == 0;
    if (whole) endpoints_add(result, text);
    free(text);
    return whole;
}
