/* Counters of the parts: what happened, and what a program did against the data sheet. */
#include "api/internal.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static uint64_t value_of(const psabench_part *p, const struct api_counter *c)
{
    uint32_t v;
    if (c->get) return c->get(p);
    memcpy(&v, (const char *)p + c->offset, sizeof v);
    return v;
}

const char *psabench_counter(const psabench_part *p, int i, uint64_t *value)
{
    if (!p || i < 0 || (unsigned)i >= p->kind->counter_count) return NULL;
    const struct api_counter *c = &p->kind->counters[i];
    if (value) *value = value_of(p, c);
    return c->name;
}

int64_t psabench_count(const psabench_part *p, const char *name)
{
    char list[API_WHY];
    if (!p) return PSABENCH_BAD_ARGUMENT;
    for (unsigned i = 0; name && i < p->kind->counter_count; i++)
        if (strcmp(p->kind->counters[i].name, name) == 0) return (int64_t)value_of(p, &p->kind->counters[i]);
    api_list(p->kind->counters, sizeof *p->kind->counters, p->kind->counter_count, list);
    return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: counter of %s: expected one of%s, got %.40s", p->name,
                    p->kind->name, list, name ? name : "NULL");
}

const char *psabench_violation(const psabench_part *p, int i, uint64_t *value)
{
    if (!p || i < 0) return NULL;
    for (unsigned k = 0; k < p->kind->counter_count; k++) {
        const struct api_counter *c = &p->kind->counters[k];
        if (!c->violation || i--) continue;
        if (value) *value = value_of(p, c);
        return c->name;
    }
    return NULL;
}

int psabench_check(const psabench_part *p)
{
    char list[API_WHY] = "";
    size_t len = 0;
    uint64_t value;
    const char *name;
    if (!p) return PSABENCH_BAD_ARGUMENT;
    for (int i = 0; (name = psabench_violation(p, i, &value)) && len < sizeof list; i++)
        if (value) len += (size_t)snprintf(list + len, sizeof list - len, " %s %" PRIu64, name, value);
    if (!len) return PSABENCH_OK;
    return api_fail(p->bench, PSABENCH_VIOLATED, "%s: expected no violations of the data sheet, got%s", p->name, list);
}
