/* Keys of the aircraft: a list of legs, each with keys of its kind. */
#include "scenario/keys.h"

#include "base/why.h"
#include "phys/flight/ranges.h"

#include <stdio.h>
#include <stdlib.h>

#define FLIGHT(m) offsetof(struct flight_cfg, m)
#define LEG(m)    offsetof(struct flight_leg, m)

static bool load_legs(struct yaml_file *f, const struct yaml_node *node, void *section);
static void dump_legs(const struct field *d, const void *section, cJSON *to);

// clang-format off
static const struct field leg_rows[FLIGHT_KINDS + FLIGHT_PARAMS] = {
#define KIND(kind, name, lo, hi, words) [kind] = {.key = #name, .type = FIELD_REAL, .offset = LEG(value), .min = (lo), .max = (hi), .what = (words)},
    FLIGHT_KIND_RANGES(KIND)
#undef KIND
#define PARAM(param_, name, lo, hi, words) [FLIGHT_KINDS + (param_)] = {.key = #name, .type = FIELD_REAL, .offset = LEG(param[param_]), .min = (lo), .max = (hi), .what = (words)},
    FLIGHT_PARAM_RANGES(PARAM)
#undef PARAM
};
const struct fields scenario_leg_fields = FIELDS_OF(struct flight_leg, leg_rows);

static const struct field baro_rows[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct baro_cfg, name, lo, hi, words),
    FLIGHT_BARO_RANGES(ROW)
#undef ROW
};
const struct fields scenario_baro_fields = FIELDS(baro_rows);

static const struct field flight_rows[] = {
#define ROW(name, lo, hi, words) {.key = #name, .type = FIELD_REAL, .offset = FLIGHT(plan.name), .min = (lo), .max = (hi), .what = (words)},
    FLIGHT_PLAN_RANGES(ROW)
#undef ROW
    {.key = "baro", .type = FIELD_SECTION, .offset = FLIGHT(baro), .sub = &scenario_baro_fields, .what = "the barometric altimeter"},
    {.key = "legs", .type = FIELD_STRUCTS, .offset = FLIGHT(plan.leg), .present = FLIGHT(plan.legs), .sub = &scenario_leg_fields, .load = load_legs, .dump = dump_legs, .what = "a sequence of up to 64 legs; the first begins parked, the last ends at rest"},
};
const struct fields scenario_flight_fields = FIELDS(flight_rows);
// clang-format on

/* ---- legs */

/* How many kinds of legs the mapping has; *kind: the last of them. */
static unsigned kinds_of(const struct yaml_node *node, enum flight_leg_kind *kind)
{
    unsigned n = 0;
    for (unsigned k = 0; k < FLIGHT_KINDS; k++) {
        if (!yaml_get(node, leg_rows[k].key)) continue;
        *kind = (enum flight_leg_kind)k;
        n++;
    }
    return n;
}

static bool has_param(const struct flight_leg *l, unsigned param)
{
    return flight_kind(l->kind)->params >> param & 1u;
}

static bool check_params(struct yaml_file *f, const struct yaml_node *node, const char *where,
                         const struct flight_leg *l)
{
    for (unsigned k = 0; k < FLIGHT_PARAMS; k++) {
        const char *key = leg_rows[FLIGHT_KINDS + k].key;
        const struct yaml_node *value = yaml_get(node, key);
        if (value && !has_param(l, k))
            return yaml_file_fail(f, value, where, "expected no %s beside %s, got one", key, flight_kind(l->kind)->key);
    }
    return true;
}

/* A mistyped key comes before a missing one. */
static bool load_leg(struct yaml_file *f, const struct yaml_node *node, const char *where, struct flight_leg *l)
{
    enum flight_leg_kind kind = FLIGHT_PARK;
    const unsigned kinds = kinds_of(node, &kind);
    *l = flight_leg_of(kind, 0.0);
    if (!yaml_load(f, node, where, &scenario_leg_fields, l)) return false;
    if (kinds == 1) return check_params(f, node, where, l);
    char known[160] = "";
    for (unsigned k = 0; k < FLIGHT_KINDS; k++) why_list_add(known, sizeof known, leg_rows[k].key);
    return yaml_file_fail(f, node, where, "expected one of %s, got %s", known, kinds ? "more" : "none");
}

static bool load_legs(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct flight_plan_cfg *p = &((struct flight_cfg *)section)->plan;
    if (node->kind != YAML_SEQUENCE) return yaml_file_expected(f, node, "legs", "a list of legs");
    p->legs = 0;
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        char where[16];
        if (p->legs == FLIGHT_LEGS_MAX)
            return yaml_file_fail(f, i->value, "legs", "expected up to %u legs, got more", FLIGHT_LEGS_MAX);
        snprintf(where, sizeof where, "legs[%u]", p->legs);
        if (!load_leg(f, i->value, where, &p->leg[p->legs])) return false;
        p->legs++;
    }
    return true;
}

static cJSON *leg_json(const struct flight_leg *l)
{
    cJSON *j = cJSON_CreateObject();
    const struct field *value = &leg_rows[l->kind];
    cJSON_AddItemToObject(j, value->key, yaml_dump_value(value, l));
    for (unsigned k = 0; k < FLIGHT_PARAMS; k++) {
        const struct field *param = &leg_rows[FLIGHT_KINDS + k];
        if (has_param(l, k)) cJSON_AddItemToObject(j, param->key, yaml_dump_value(param, l));
    }
    return j;
}

static void dump_legs(const struct field *d, const void *section, cJSON *to)
{
    const struct flight_plan_cfg *p = &((const struct flight_cfg *)section)->plan;
    cJSON *list = cJSON_AddArrayToObject(to, d->key);
    for (unsigned i = 0; i < p->legs; i++) cJSON_AddItemToArray(list, leg_json(&p->leg[i]));
}

/* ---- what is in more than one key */

static const struct yaml_node *leg_node(const struct yaml_node *legs, unsigned i)
{
    const struct yaml_item *item = legs->first;
    while (i-- > 0) item = item->next;
    return item->value;
}

static bool check_legs(struct yaml_file *f, const struct yaml_node *legs, const struct scenario *s)
{
    char where[64];
    struct flight_error e;
    const struct site site = scenario_site(&s->site);
    struct flight *flight = malloc(sizeof *flight);
    if (!flight) return yaml_file_fail(f, legs, "flight", "expected memory, got none");
    const bool flies = flight_init(flight, &s->lab.flight, &site, &e);
    free(flight);
    if (flies) return true;
    snprintf(where, sizeof where, "flight.legs[%u].%s", e.leg, e.key);
    return yaml_file_fail(f, yaml_at(leg_node(legs, e.leg), e.key), where, "%s", e.text);
}

bool scenario_check_flight(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s)
{
    const struct yaml_node *flight = yaml_get(root, "flight");
    if (!flight) return true;
    if (!s->site.placed)
        return yaml_file_fail(f, flight, "flight", "expected site.latitude_deg, where it begins, got none");
    if (s->lab.flight.plan.legs == 0)
        return yaml_file_fail(f, flight, "flight.legs", "expected a list of legs, got none");
    return check_legs(f, yaml_get(flight, "legs"), s);
}
