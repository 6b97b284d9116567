#include "api/internal.h"

#include <stdlib.h>
#include <string.h>

/* Registry of the kinds of parts. */
enum { KINDS = 9 };

const struct api_kind *const api_kinds[KINDS] = {&api_ads1281, &api_ads1282, &api_ads1255, &api_ads1256, &api_ad7710,
                                                 &api_ad7711,  &api_ad7711a, &api_ad7712,  &api_psa2};
const unsigned api_kind_count = KINDS;

const char *psabench_parts(void)
{
    return "ads1281 ads1282 ads1255 ads1256 ad7710 ad7711 ad7711a ad7712 psa2"; /* a test holds it against api_kinds */
}

static const struct api_kind *find_kind(const char *name)
{
    for (unsigned i = 0; name && i < api_kind_count; i++)
        if (strcmp(api_kinds[i]->name, name) == 0) return api_kinds[i];
    return NULL;
}

const char *psabench_options(const char *part)
{
    const struct api_kind *k = find_kind(part);
    return k ? k->options_text : NULL;
}

/* ---- making a part ---- */

static bool is_name_char(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
}

static int check_name(psabench *b, const char *name)
{
    size_t len = 0;
    while (name && name[len] && len < API_NAME && is_name_char(name[len])) len++;
    if (!name || len == 0 || len >= API_NAME || name[len])
        return api_fail(b, PSABENCH_BAD_ARGUMENT,
                        "name: expected 1 to %d of the characters A-Z a-z 0-9 _ - ., got %.40s", API_NAME - 1,
                        name ? name : "NULL");
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        if (strcmp(p->name, name) == 0)
            return api_fail(b, PSABENCH_BAD_ARGUMENT, "name: expected one that no part of this bench has, got %s",
                            name);
    return PSABENCH_OK;
}

/* Not on the list yet. */
static struct psabench_part *allocate_part(psabench *b, const struct api_kind *k, const char *name)
{
    struct psabench_part *p = calloc(1, k->size);
    if (!p) {
        (void)api_fail(b, PSABENCH_SYSTEM, "part %s: out of memory", name);
        return NULL;
    }
    p->kind = k;
    p->bench = b;
    strcpy(p->name, name); /* its length has been checked */
    for (unsigned i = 0; i < k->pin_count; i++) p->level |= (uint32_t)k->pins[i].idle << i;
    p->sclk = api_find_pin(k, "SCLK");
    p->din = api_find_pin(k, "DIN");
    p->dout = api_find_pin(k, "DOUT");
    return p;
}

psabench_part *psabench_part_new(psabench *b, const char *part, const char *name, const char *options)
{
    char why[API_WHY];
    if (!b || api_may_move(b, "psabench_part_new()") || check_name(b, name)) return NULL;
    const struct api_kind *k = find_kind(part);
    if (!k) {
        (void)api_fail(b, PSABENCH_BAD_ARGUMENT, "part: expected one of %s, got %.40s", psabench_parts(),
                       part ? part : "NULL");
        return NULL;
    }
    struct psabench_part *p = allocate_part(b, k, name);
    if (!p) return NULL;
    if (!api_options(p, options, why, sizeof why)) {
        (void)api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: %s", name, why);
        free(p);
        return NULL;
    }
    k->open(p);
    struct psabench_part **end = &b->parts;
    while (*end) end = &(*end)->next;
    *end = p;
    return p;
}
