#include "command/exact.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void exact_number(double x, char out[EXACT_MAX])
{
    if (!isfinite(x)) {
        strcpy(out, "null");
        return;
    }
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(out, EXACT_MAX, "%.*g", digits, x);
        if (strtod(out, NULL) == x) return;
    }
}

static bool make_exact(cJSON *tree)
{
    for (cJSON *j = tree; j; j = j->next) {
        if (j->child && !make_exact(j->child)) return false;
        if (!cJSON_IsNumber(j)) continue;
        char *text = cJSON_malloc(EXACT_MAX);
        if (!text) return false;
        exact_number(j->valuedouble, text);
        j->valuestring = text;
        j->type = cJSON_Raw;
    }
    return true;
}

char *exact_line(cJSON *tree)
{
    return make_exact(tree) ? cJSON_PrintUnformatted(tree) : NULL;
}
