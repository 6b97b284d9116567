/* The reference of the keys, from the tables that load them. */
#include "scenario/keys.h"

#include "scenario/profile.h"

#include <stdlib.h>
#include <string.h>

/* A mapping of the scenario: where it is, what it is, its rows, and a struct with the defaults. */
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
    {"site", "Where the bench is.", &scenario_site_fields, IN(site)},
    {"head", "The dividing head.", &scenario_head_fields, IN(lab.head)},
    {"table", "The rate table; `table: {}` is the model with one axis.", &scenario_table_fields, IN(lab.table)},
    {"table.axes[]", "An axis of it, from the outermost.", &scenario_axis_of_table_fields, IN(lab.table.axis)},
    {"chamber", "The thermal chamber; `chamber: {}` is the model.", &scenario_chamber_fields, IN(lab.chamber)},
    {"supply", "The power supply; `supply: {}` is the model.", &scenario_supply_fields, IN(lab.supply)},
    {"platform", "The gyro-stabilised platform of [the gyro unit](boards/gyro.md); `platform: {}` has the article's figures and ours.", &scenario_platform_fields, IN(lab.platform)},
    {"vehicle", "What the platform is on.", &scenario_vehicle_fields, IN(lab.vehicle)},
    {"vehicle.sway", "Its pitch and roll about their means.", &scenario_sway_fields, IN(lab.vehicle.sway)},
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

static void print_profile_range(FILE *out, const struct board_field *d)
{
    const bool number = d->type == BOARD_FIELD_UINT || d->type == BOARD_FIELD_REAL || d->type == BOARD_FIELD_REALS;
    if (number) fprintf(out, "%.10g to %.10g", d->min, d->max);
    for (unsigned i = 0; d->type == BOARD_FIELD_CHOICE && d->choices[i]; i++)
        fprintf(out, "%s`%s`", i ? ", " : "", d->choices[i]);
}

static void print_profile(FILE *out, const struct board_type *t)
{
    static const char *const kinds[] = {
        [BOARD_FIELD_STRING] = "text",  [BOARD_FIELD_UINT] = "integer",    [BOARD_FIELD_REAL] = "number",
        [BOARD_FIELD_BOOL] = "boolean", [BOARD_FIELD_CHOICE] = "one word", [BOARD_FIELD_REALS] = "list",
        [BOARD_FIELD_LIST] = "list"};
    union board_profile_store p;
    memset(&p, 0, sizeof p);
    t->profile_default(&p);
    fprintf(out,
            "### %s: `units[].profile_set`, and a file of proto/profiles\n\nThe board. The defaults are those of "
            "`%s`.\n\n| key | kind, unit | range | default | meaning |\n|---|---|---|---|---|\n",
            t->title, t->profile_name);
    for (unsigned i = 0; i < t->field_count; i++) {
        const struct board_field *d = &t->fields[i];
        const char *unit = yaml_unit(d->key);
        cJSON *j = profile_dump_field(d, &p);
        char *text = cJSON_PrintUnformatted(j);
        fprintf(out, "| `%s` | %s%s%s | ", d->key, kinds[d->type], *unit ? ", " : "", unit);
        print_profile_range(out, d);
        fprintf(out, " | %s | %s |\n", text ? text : "", d->what);
        cJSON_free(text);
        cJSON_Delete(j);
    }
    fprintf(out, "\n");
}

/* What `board` may say, and what follows from it. */
static void print_boards(FILE *out)
{
    fprintf(out, "### Boards\n\nWhat `units[].board` may say; a unit without it is a PSA-2. `profile` names another "
                 "profile of the same board; `psa2` and `pik` take those of their other names, too.\n\n| `board` | "
                 "board | profile | `node` of the first |\n|---|---|---|---|\n");
    for (const struct board_name *n = board_names; n->name; n++)
        fprintf(out, "| `%s` | %s | `%s` | %u |\n", n->name, board_name_title(n),
                n->profile ? n->profile : n->type->profile_name, n->type->node);
    fprintf(out, "\n");
}

void scenario_keys(FILE *out)
{
    struct scenario *s = malloc(sizeof *s);
    if (!s) return;
    scenario_default(s, "");
    s->lab.table = table_default(1);
    s->units[0] = scenario_unit_default(0);
    for (size_t i = 0; i < sizeof chapters / sizeof *chapters; i++) print_chapter(out, &chapters[i], s);
    print_boards(out);
    for (unsigned i = 0; board_types[i]; i++) print_profile(out, board_types[i]);
    free(s);
}
