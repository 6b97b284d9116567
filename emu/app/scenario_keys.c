/* The reference of the keys, from the tables that load them. */
#include "app/scenario_fields.h"

#include "app/profile_yaml.h"

#include <stdlib.h>
#include <string.h>

/* A mapping of the scenario: where it stands, what it is, its rows, and a struct with the defaults. */
struct chapter {
    const char *path, *words;
    const struct yaml_fields *rows;
    size_t offset; /* of its struct in struct scenario; none: no defaults */
};

#define NO_DEFAULTS ((size_t)-1)
#define IN(m)       offsetof(struct scenario, m)

// clang-format off
static const struct chapter chapters[] = {
    {"", "The whole.", &scenario_fields, 0},
    {"buses[]", "A bus. `bus:` is short for a single one with the same keys but the name.", &scenario_buses_fields, IN(bus)},
    {"site", "Where the bench stands.", &scenario_site_fields, IN(site)},
    {"head", "The dividing head.", &scenario_head_fields, IN(lab.head)},
    {"table", "The rate table; `table: {}` is the model with one axis.", &scenario_table_fields, IN(lab.table)},
    {"table.axes[]", "An axis of it, from the outermost.", &scenario_axis_of_table_fields, IN(lab.table.axis)},
    {"chamber", "The thermal chamber; `chamber: {}` is the model.", &scenario_chamber_fields, IN(lab.chamber)},
    {"supply", "The power supply; `supply: {}` is the model.", &scenario_supply_fields, IN(lab.supply)},
    {"spread", "Standard deviations of the production spread, by the keys of a channel; a unit with `spread: true` draws its own.", &scenario_spread_fields, IN(spread)},
    {"units[]", "A unit, or `count` of them. The defaults are those of the first.", &scenario_unit_fields, IN(units)},
    {"units[].axes.x", "A channel; `y` and `z` have the same keys.", &scenario_axis_fields, IN(units)},
    {"units[].axes.x.quartz", "A quartz sensor with current output.", &scenario_quartz_fields, IN(units[0].cfg.axis[0].quartz)},
    {"units[].axes.x.afe", "Its analog chain: [afe](boards/psa2.md).", &scenario_afe_fields, IN(units[0].cfg.board.afe)},
    {"timeline[]", "A command that the bench gives to itself, as an operator would on the control socket.", &scenario_event_fields, NO_DEFAULTS},
};
// clang-format on

/* "number, V/g" */
static void print_kind(FILE *out, const struct yaml_field *d)
{
    static const char *const kinds[] = {
        [YAML_REAL] = "number",         [YAML_U8] = "integer",      [YAML_U32] = "integer",     [YAML_U64] = "integer",
        [YAML_BOOL] = "boolean",        [YAML_TEXT] = "text",       [YAML_CHOICE] = "one word", [YAML_REALS] = "list",
        [YAML_EACH] = "number or list", [YAML_SECTION] = "mapping", [YAML_CUSTOM] = "see there"};
    const char *unit = yaml_unit(d->key);
    fprintf(out, "%s%s%s", kinds[d->type], *unit ? ", " : "", unit);
    if (d->count) fprintf(out, " (%u)", d->count);
}

static void print_range(FILE *out, const struct yaml_field *d)
{
    const bool number = d->type == YAML_REAL || d->type == YAML_U8 || d->type == YAML_U32 || d->type == YAML_U64 ||
                        d->type == YAML_REALS || d->type == YAML_EACH;
    if (d->type == YAML_U64) fprintf(out, "0 to 2^64 - 1");
    else if (number) fprintf(out, "%.10g to %.10g", d->min, d->max);
    if (d->type == YAML_TEXT) fprintf(out, "1 to %d characters", (int)d->max - 1);
    for (unsigned i = 0; d->type == YAML_CHOICE && d->choices[i]; i++)
        fprintf(out, "%s`%s`", i ? ", " : "", d->choices[i]);
}

static void print_default(FILE *out, const struct yaml_field *d, const void *section)
{
    cJSON *j = section && d->type != YAML_SECTION ? yaml_dump_value(d, section) : NULL;
    char *text = j ? cJSON_PrintUnformatted(j) : NULL;
    fprintf(out, "%s", text ? text : "");
    cJSON_free(text);
    cJSON_Delete(j);
}

static void print_chapter(FILE *out, const struct chapter *c, const struct scenario *s)
{
    const char *section = c->offset == NO_DEFAULTS ? NULL : (const char *)s + c->offset;
    const struct yaml_field *d;
    size_t offset;
    fprintf(out, "%s%s%s%s\n\n| key | kind, unit | range | default | meaning |\n|---|---|---|---|---|\n",
            *c->path ? "### `" : "### ", *c->path ? c->path : "Scenario", *c->path ? "`\n\n" : "\n\n", c->words);
    for (size_t i = 0; (d = yaml_row(c->rows, i, &offset)); i++) {
        fprintf(out, "| `%s` | ", d->key);
        print_kind(out, d);
        fprintf(out, " | ");
        print_range(out, d);
        fprintf(out, " | ");
        print_default(out, d, section ? section + offset : NULL);
        fprintf(out, " | %s |\n", d->what);
    }
    fprintf(out, "\n");
}

static void print_profile(FILE *out)
{
    const struct psa2_profile p = psa2_profile_default();
    fprintf(out, "### `units[].profile_set`, and a file of proto/profiles\n\nThe board. The defaults are those of "
                 "`article`.\n\n| key | kind, unit | range | default | meaning |\n|---|---|---|---|---|\n");
    static const char *const kinds[] = {"text", "integer", "number", "boolean", "list", "list"};
    for (unsigned i = 0; i < psa2_field_count; i++) {
        const struct psa2_field *d = &psa2_fields[i];
        const bool number = d->type == PSA2_FIELD_UINT || d->type == PSA2_FIELD_REAL;
        const char *unit = yaml_unit(d->key);
        cJSON *j = profile_dump_field(&p, d);
        char *text = cJSON_PrintUnformatted(j);
        fprintf(out, "| `%s` | %s%s%s | ", d->key, kinds[d->type], *unit ? ", " : "", unit);
        if (number) fprintf(out, "%.10g to %.10g", d->min, d->max);
        fprintf(out, " | %s | %s |\n", text ? text : "", d->what);
        cJSON_free(text);
        cJSON_Delete(j);
    }
}

void scenario_keys(FILE *out)
{
    struct scenario *s = malloc(sizeof *s);
    if (!s) return;
    scenario_default(s, "");
    s->lab.table = table_default(1);
    s->units[0] = scenario_unit_default(0);
    for (size_t i = 0; i < sizeof chapters / sizeof *chapters; i++) print_chapter(out, &chapters[i], s);
    print_profile(out);
    free(s);
}
