/* The reference of the keys, from the tables that load them. */
#include "scenario/keys.h"

#include "scenario/profile.h"

#include <stdlib.h>
#include <string.h>

/* A mapping of the scenario: where it is, what it is, its rows, and a struct with the defaults. */
struct chapter {
    const char *path, *words;
    const struct fields *rows;
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
    {"magnetic", "The Earth's magnetic field and the induction sensor on the vehicle: [magnetic heading](instruments.md#magnetic-heading). All E0.", &scenario_magnetic_fields, IN(lab.magnetic)},
    {"flight", "An aircraft over the ellipsoid, from the site on: [a flight](procedures/flight.md).", &scenario_flight_fields, IN(lab.flight)},
    {"flight.legs[]", "A leg: one of the first ten keys, and keys that go with it.", &scenario_leg_fields, NO_DEFAULTS},
    {"flight.baro", "Its barometric altimeter.", &scenario_baro_fields, IN(lab.flight.baro)},
    {"spread", "Standard deviations of the production spread, by the keys of a channel; a unit with `spread: true` draws its own.", &scenario_spread_fields, IN(spread)},
    {"spread.quartz", "A batch of quartz sensors, and a file of proto/batches: [groups, glue, tolerances](instruments.md#a-batch).", &scenario_batch_fields, IN(spread.quartz)},
    {"units[]", "A unit, or `count` of them. The defaults are those of the first.", &scenario_unit_fields, IN(units)},
    {"units[].axes.x", "A channel; `y` and `z` have the same keys.", &scenario_axis_fields, IN(units)},
    {"units[].axes.x.quartz", "A quartz sensor with current output.", &scenario_quartz_fields, IN(units[0].cfg.axis[0].quartz)},
    {"units[].axes.x.quartz.pendulum", "The pendulum: equations (1) to (5) of the [quartz article](instruments.md#the-quartz-accelerometer).", &scenario_pendulum_fields, IN(units[0].cfg.axis[0].quartz.pendulum)},
    {"units[].axes.x.signal", "A signal from a file: [recorded signals](recorded.md).", &scenario_series_fields, IN(units[0].series[0])},
    {"units[].axes.x.afe", "Its analog chain: [afe](boards/psa2.md).", &scenario_afe_fields, IN(units[0].cfg.board.afe)},
    {"timeline[]", "A command that the bench gives to itself, as an operator would on the control socket.", &scenario_event_fields, NO_DEFAULTS},
};
// clang-format on

static const char *kind_of(const struct field *d)
{
    static const char *const kinds[] = {
        [FIELD_REAL] = "number",     [FIELD_U8] = "integer",      [FIELD_U32] = "integer",
        [FIELD_U64] = "integer",     [FIELD_BOOL] = "boolean",    [FIELD_TEXT] = "text",
        [FIELD_CHOICE] = "one word", [FIELD_REALS] = "list",      [FIELD_EACH] = "number or list",
        [FIELD_LIST] = "list",       [FIELD_SECTION] = "mapping", [FIELD_CUSTOM] = "see there",
    };
    return d->load ? "see there" : kinds[d->type];
}

/* "number, V/g" */
static void print_kind(FILE *out, const struct field *d)
{
    const char *unit = yaml_unit(d->key);
    fprintf(out, "%s%s%s", kind_of(d), *unit ? ", " : "", unit);
    if (d->count) fprintf(out, " (%u)", d->count);
}

static void print_range(FILE *out, const struct field *d)
{
    if (d->type == FIELD_U64) fprintf(out, "0 to 2^64 - 1");
    else if (field_is_number(d) && d->min < d->max) fprintf(out, "%.10g to %.10g", d->min, d->max);
    if (d->type == FIELD_TEXT && d->max > 0) fprintf(out, "1 to %d characters", (int)d->max - 1);
    for (unsigned i = 0; d->type == FIELD_CHOICE && d->choices[i]; i++)
        fprintf(out, "%s`%s`", i ? ", " : "", d->choices[i]);
}

static void print_heading(FILE *out, const char *title, const char *words)
{
    fprintf(out, "### %s\n\n%s\n\n| key | kind, unit | range | default | meaning |\n|---|---|---|---|---|\n", title,
            words);
}

/* value: the default, deleted here; NULL: none. */
static void print_row(FILE *out, const struct field *d, cJSON *value)
{
    char *text = value ? cJSON_PrintUnformatted(value) : NULL;
    fprintf(out, "| `%s` | ", d->key);
    print_kind(out, d);
    fprintf(out, " | ");
    print_range(out, d);
    fprintf(out, " | %s | %s |\n", text ? text : "", d->what);
    cJSON_free(text);
    cJSON_Delete(value);
}

static void print_chapter(FILE *out, const struct chapter *c, const struct scenario *s)
{
    const char *section = c->offset == NO_DEFAULTS ? NULL : (const char *)s + c->offset;
    const struct field *d;
    char title[64] = "Scenario";
    size_t offset;
    if (*c->path) snprintf(title, sizeof title, "`%s`", c->path);
    print_heading(out, title, c->words);
    for (size_t i = 0; (d = yaml_row(c->rows, i, &offset)); i++)
        print_row(out, d, section && d->type != FIELD_SECTION ? yaml_dump_value(d, section + offset) : NULL);
    fprintf(out, "\n");
}

static void print_profile(FILE *out, const struct board_type *t)
{
    char title[96], words[96];
    union board_profile_store p;
    fields_default(t->fields, &p);
    snprintf(title, sizeof title, "%s: `units[].profile_set`, and a file of proto/profiles", t->title);
    snprintf(words, sizeof words, "The board. The defaults are those of `%s`.", t->profile_name);
    print_heading(out, title, words);
    for (size_t i = 0; i < t->fields->count; i++) {
        struct field d = t->fields->row[i];
        d.max = d.type == FIELD_TEXT ? 0 : d.max; /* of characters */
        d.count = 0;
        print_row(out, &d, yaml_dump_value(&t->fields->row[i], &p));
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

/* With an instrument and a unit to show the defaults of. NULL: no memory. */
static struct scenario *new_example(void)
{
    struct scenario *s = malloc(sizeof *s);
    if (!s) return NULL;
    scenario_default(s, "");
    s->lab.table = table_default(1);
    s->units[0] = scenario_unit_default(0);
    return s;
}

void scenario_keys(FILE *out)
{
    struct scenario *s = new_example();
    if (!s) return;
    for (size_t i = 0; i < sizeof chapters / sizeof *chapters; i++) print_chapter(out, &chapters[i], s);
    print_boards(out);
    for (unsigned i = 0; board_types[i]; i++) print_profile(out, board_types[i]);
    free(s);
}

/* ---- as JSON */

static cJSON *add_object(cJSON *list)
{
    cJSON *j = cJSON_CreateObject();
    cJSON_AddItemToArray(list, j);
    return j;
}

/* value: the default, which the tree takes; NULL: none. */
static void add_row(cJSON *list, const struct field *d, cJSON *value)
{
    cJSON *j = add_object(list);
    const char *unit = yaml_unit(d->key);
    cJSON_AddStringToObject(j, "key", d->key);
    cJSON_AddStringToObject(j, "type", kind_of(d));
    if (*unit) cJSON_AddStringToObject(j, "unit", unit);
    if (field_is_number(d) && d->min < d->max) {
        cJSON_AddNumberToObject(j, "min", d->min);
        cJSON_AddNumberToObject(j, "max", d->max);
    }
    cJSON *choices = d->type == FIELD_CHOICE ? cJSON_AddArrayToObject(j, "choices") : NULL;
    for (unsigned i = 0; choices && d->choices[i]; i++)
        cJSON_AddItemToArray(choices, cJSON_CreateString(d->choices[i]));
    if (value) cJSON_AddItemToObject(j, "default", value);
    cJSON_AddStringToObject(j, "what", d->what);
}

static void add_chapter(cJSON *list, const struct chapter *c, const struct scenario *s)
{
    const char *section = c->offset == NO_DEFAULTS ? NULL : (const char *)s + c->offset;
    cJSON *j = add_object(list);
    cJSON_AddStringToObject(j, "path", c->path);
    cJSON_AddStringToObject(j, "what", c->words);
    cJSON *keys = cJSON_AddArrayToObject(j, "keys");
    const struct field *d;
    size_t offset;
    for (size_t i = 0; (d = yaml_row(c->rows, i, &offset)); i++)
        add_row(keys, d, section && d->type != FIELD_SECTION ? yaml_dump_value(d, section + offset) : NULL);
}

static void add_profile(cJSON *list, const struct board_type *t)
{
    union board_profile_store p;
    cJSON *j = add_object(list);
    fields_default(t->fields, &p);
    cJSON_AddStringToObject(j, "profile", t->profile_name);
    cJSON *keys = cJSON_AddArrayToObject(j, "keys");
    for (size_t i = 0; i < t->fields->count; i++)
        add_row(keys, &t->fields->row[i], yaml_dump_value(&t->fields->row[i], &p));
}

void scenario_add_keys(cJSON *to)
{
    struct scenario *s = new_example();
    if (!s) return;
    cJSON *sections = cJSON_AddArrayToObject(to, "sections"), *boards = cJSON_AddArrayToObject(to, "boards");
    cJSON *profiles = cJSON_AddArrayToObject(to, "profiles");
    for (size_t i = 0; i < sizeof chapters / sizeof *chapters; i++) add_chapter(sections, &chapters[i], s);
    for (const struct board_name *n = board_names; n->name; n++) {
        cJSON *j = add_object(boards);
        cJSON_AddStringToObject(j, "board", n->name);
        cJSON_AddStringToObject(j, "title", board_name_title(n));
        cJSON_AddStringToObject(j, "profile", n->profile ? n->profile : n->type->profile_name);
        cJSON_AddNumberToObject(j, "node", n->type->node);
    }
    for (unsigned i = 0; board_types[i]; i++) add_profile(profiles, board_types[i]);
    free(s);
}
