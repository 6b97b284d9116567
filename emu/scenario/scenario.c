#include "scenario/scenario.h"

#include "base/text.h"
#include "command/exact.h"
#include "scenario/keys.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define VERSION TEXT_OF(PSABENCH_VERSION) /* of pyproject.toml, by way of the Makefile */

#define SCENARIO(m) offsetof(struct scenario, m)

/* ---- buses */

static bool check_rate(struct yaml_file *f, const struct yaml_node *node, const struct scenario_bus *b)
{
    if (!b->cfg.bitrate_hz || b->cfg.bitrate_hz >= 10000) return true;
    return yaml_file_fail(f, yaml_at(node, "bitrate_hz"), "bitrate_hz",
                          "expected 10000 or more, or 0 (frames take no time), got %u", b->cfg.bitrate_hz);
}

static bool load_bus(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario *s = section;
    if (!yaml_load(f, node, "bus", &scenario_bus_fields, &s->bus[0].cfg)) return false;
    snprintf(f->where, sizeof f->where, "bus.");
    if (!check_rate(f, node, &s->bus[0])) return false;
    f->where[0] = '\0';
    return true;
}

static bool check_bus(struct yaml_file *f, const struct yaml_node *node, const struct scenario *s, unsigned i)
{
    const char *name = s->bus[i].name;
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_";
    if (name[strspn(name, letters)])
        return yaml_file_fail(f, node, "name", "expected letters, digits and _, got \"%s\"", name);
    for (unsigned k = 0; k < i; k++)
        if (strcmp(s->bus[k].name, name) == 0)
            return yaml_file_fail(f, node, "name", "expected a name of its own, got \"%s\", which another bus has",
                                  name);
    return check_rate(f, node, &s->bus[i]);
}

static bool load_buses(struct yaml_file *f, const struct yaml_node *node, struct scenario *s)
{
    if (node->kind != YAML_SEQUENCE || !node->first) return yaml_file_expected(f, node, "buses", "a list of buses");
    s->bus_count = 0;
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        char where[40];
        const unsigned n = s->bus_count;
        if (n == SCENARIO_BUSES_MAX)
            return yaml_file_fail(f, i->value, "buses", "expected up to %u buses, got more", SCENARIO_BUSES_MAX);
        s->bus[n] = (struct scenario_bus){.cfg = {.bitrate_hz = 1000000, .data_bitrate_hz = 5000000}};
        snprintf(s->bus[n].name, sizeof s->bus[n].name, "can%u", n);
        snprintf(where, sizeof where, "buses.%s", s->bus[n].name);
        if (!yaml_load(f, i->value, where, &scenario_buses_fields, &s->bus[n])) return false;
        snprintf(f->where, sizeof f->where, "%s.", where);
        if (!check_bus(f, i->value, s, n)) return false;
        f->where[0] = '\0';
        s->bus_count++;
    }
    return true;
}

/* The buses are known before the units that name them are read. */
static bool buses_are_loaded(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    (void)section;
    if (!yaml_get(f->root, "bus")) return true;
    return yaml_file_fail(f, node, "buses", "expected bus or buses, got both");
}

/* ---- units and their spread */

static void dump_units(const struct field *d, const void *section, cJSON *to)
{
    const struct scenario *s = section;
    cJSON *list = cJSON_AddArrayToObject(to, d->key);
    for (unsigned i = 0; i < s->unit_count; i++) {
        cJSON *j = cJSON_CreateObject();
        scenario_dump_unit(&s->units[i], j);
        cJSON_AddItemToArray(list, j);
    }
}

/* A number, from 0 to the width of its range: a deviation. */
static bool load_deviation(struct yaml_file *f, const struct yaml_node *node, const struct field *d, void *section)
{
    struct field row = *d;
    if (d->type == FIELD_SECTION)
        return yaml_load_by(f, node, d->key, d->sub, (char *)section + d->offset, load_deviation, NULL);
    row.min = 0;
    row.max = d->max - d->min;
    return yaml_load_value(f, node, &row, section);
}

static bool load_spread(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario *s = section;
    return yaml_load_by(f, node, "spread", &scenario_spread_fields, &s->spread, load_deviation, NULL);
}

// clang-format off
static const struct field spread_rows[] = {
    {.type = FIELD_INLINE, .offset = offsetof(struct scenario_spread, mems), .sub = &scenario_mems_fields},
    {.key = "gyro", .type = FIELD_SECTION, .offset = offsetof(struct scenario_spread, cvg), .sub = &scenario_cvg_fields, .what = "parameters of a mems_gyro"},
    {.key = "afe", .type = FIELD_SECTION, .offset = offsetof(struct scenario_spread, afe), .sub = &scenario_afe_numbers, .what = "parameters of the analog chain"},
    {.key = "quartz", .type = FIELD_CUSTOM, .load = scenario_load_batch, .dump = scenario_dump_batch, .what = "batch of the quartz sensors: a name of proto/batches, a path, or a mapping; their temperature, glue and position are drawn from it"},
};
const struct fields scenario_spread_fields = FIELDS(spread_rows);
// clang-format on

/* ---- timeline and faults */

static bool print_args(struct yaml_file *f, const struct yaml_node *node, cJSON *args, struct scenario_event *e)
{
    char *line = exact_line(args);
    const bool fits = line && strlen(line) < sizeof e->args;
    if (fits) snprintf(e->args, sizeof e->args, "%s", line);
    free(line);
    cJSON_Delete(args);
    return fits ||
           yaml_file_fail(f, node, NULL, "expected arguments of up to %u characters, got more", SCENARIO_ARGS_MAX - 1);
}

static bool load_args(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    if (node->kind != YAML_MAPPING) return yaml_file_expected(f, node, "args", "a mapping `name: value`");
    cJSON *args = yaml_json(f, node);
    return args && print_args(f, node, args, section);
}

static void dump_args(const struct field *d, const void *section, cJSON *to)
{
    cJSON_AddRawToObject(to, d->key, ((const struct scenario_event *)section)->args);
}

// clang-format off
static const struct field event_rows[] = {
    {.key = "at_s", .type = FIELD_REAL, .offset = offsetof(struct scenario_event, at_s), .max = 1e6, .what = "simulated time since power-on"},
    {.key = "cmd",  .type = FIELD_TEXT, .offset = offsetof(struct scenario_event, cmd), .max = 32, .what = "a command of the control socket"},
    {.key = "args", .type = FIELD_CUSTOM, .load = load_args, .dump = dump_args, .what = "arguments of the command, a mapping"},
};
const struct fields scenario_event_fields = FIELDS_OF(struct scenario_event, event_rows);
// clang-format on

static struct scenario_event *new_event(struct yaml_file *f, const struct yaml_node *node, const char *list,
                                        struct scenario_events *events)
{
    if (events->count == SCENARIO_EVENTS_MAX) {
        yaml_file_fail(f, node, list, "expected up to %u entries, got more", SCENARIO_EVENTS_MAX);
        return NULL;
    }
    struct scenario_event *e = &events->event[events->count];
    *e = (struct scenario_event){.args = "{}", .line = node->line, .column = node->column};
    return e;
}

static bool load_timeline(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario_events *t = &((struct scenario *)section)->timeline;
    if (node->kind != YAML_SEQUENCE) return yaml_file_expected(f, node, "timeline", "a list of commands");
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        char where[32];
        struct scenario_event *e = new_event(f, i->value, "timeline", t);
        snprintf(where, sizeof where, "timeline[%u]", t->count);
        if (!e || !yaml_load(f, i->value, where, &scenario_event_fields, e)) return false;
        if (!e->cmd[0]) return yaml_file_fail(f, i->value, where, "expected cmd, a command, got none");
        t->count++;
    }
    return true;
}

static bool load_faults(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario_events *t = &((struct scenario *)section)->faults;
    if (node->kind != YAML_SEQUENCE) return yaml_file_expected(f, node, "faults", "a list of faults");
    for (const struct yaml_item *i = node->first; i; i = i->next) {
        struct scenario_event *e = new_event(f, i->value, "faults", t);
        if (!e) return false;
        if (i->value->kind != YAML_MAPPING)
            return yaml_file_expected(f, i->value, "faults", "a mapping with the arguments of fault.add");
        snprintf(e->cmd, sizeof e->cmd, "fault.add");
        cJSON *args = yaml_json(f, i->value);
        if (!args || !print_args(f, i->value, args, e)) return false;
        t->count++;
    }
    return true;
}

static void dump_faults(const struct field *d, const void *section, cJSON *to)
{
    const struct scenario_events *t = &((const struct scenario *)section)->faults;
    cJSON *list = cJSON_AddArrayToObject(to, d->key);
    for (unsigned i = 0; i < t->count; i++) cJSON_AddItemToArray(list, cJSON_CreateRaw(t->event[i].args));
}

/* ---- the whole */

static bool load_version(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    (void)section;
    return yaml_scalar(node) || yaml_file_expected(f, node, "version", "a word");
}

static void dump_version(const struct field *d, const void *section, cJSON *to)
{
    (void)section;
    cJSON_AddStringToObject(to, d->key, VERSION);
}

// clang-format off
static const struct field scenario_rows[] = {
    {.key = "version", .type = FIELD_CUSTOM, .load = load_version, .dump = dump_version, .what = "version of the program that wrote the file; ignored"},
    {.key = "seed",  .type = FIELD_U64, .offset = SCENARIO(seed), .max = 18446744073709551615.0, .what = "random seed; each unit and noise source has its own stream"},
    {.key = "start", .type = FIELD_BOOL, .offset = SCENARIO(start), .what = "write the frame forms and start the units from the bench's own node, 1 ms after power-on"},
    {.key = "bus",   .type = FIELD_CUSTOM, .load = load_bus, .what = "the only bus, `can0`"},
    {.key = "buses", .type = FIELD_STRUCTS, .offset = SCENARIO(bus), .present = SCENARIO(bus_count), .sub = &scenario_buses_fields, .load = buses_are_loaded, .what = "a sequence of up to 8 buses"},
    {.key = "site",  .type = FIELD_CUSTOM, .load = scenario_load_site, .dump = scenario_dump_site, .what = "location of the bench"},
    {.key = "head",  .type = FIELD_SECTION, .offset = SCENARIO(lab.head), .sub = &scenario_head_fields, .what = "the dividing head"},
    {.key = "table", .type = FIELD_CUSTOM, .load = scenario_load_table, .dump = scenario_dump_table, .what = "the rate table; without it there is none"},
    {.key = "chamber", .type = FIELD_SECTION, .offset = SCENARIO(lab.chamber), .sub = &scenario_chamber_fields, .present = SCENARIO(lab.chamber.present), .what = "the thermal chamber; without it there is none"},
    {.key = "supply", .type = FIELD_SECTION, .offset = SCENARIO(lab.supply), .sub = &scenario_supply_fields, .present = SCENARIO(lab.supply.present), .what = "the power supply; without it the boards are always powered"},
    {.key = "platform", .type = FIELD_SECTION, .offset = SCENARIO(lab.platform), .sub = &scenario_platform_fields, .present = SCENARIO(lab.platform.present), .what = "the gyro-stabilised platform; without it there is none"},
    {.key = "vehicle", .type = FIELD_SECTION, .offset = SCENARIO(lab.vehicle), .sub = &scenario_vehicle_fields, .present = SCENARIO(lab.platform.present), .load = scenario_load_vehicle, .what = "the vehicle that carries the platform"},
    {.key = "magnetic", .type = FIELD_SECTION, .offset = SCENARIO(lab.magnetic), .sub = &scenario_magnetic_fields, .present = SCENARIO(lab.magnetic.present), .what = "the Earth's magnetic field and the induction sensor on the vehicle; without it there is none"},
    {.key = "flight", .type = FIELD_SECTION, .offset = SCENARIO(lab.flight), .sub = &scenario_flight_fields, .present = SCENARIO(lab.flight.present), .what = "an aircraft that flies a list of legs; without it there is none"},
    {.key = "spread", .type = FIELD_SECTION, .offset = SCENARIO(spread), .sub = &scenario_spread_fields, .load = load_spread, .what = "production spread: standard deviations from unit to unit"},
    {.key = "units", .type = FIELD_CUSTOM, .load = scenario_load_units, .dump = dump_units, .what = "a sequence of up to 1000 units"},
    {.key = "timeline", .type = FIELD_STRUCTS, .offset = SCENARIO(timeline.event), .present = SCENARIO(timeline.count), .sub = &scenario_event_fields, .load = load_timeline, .what = "a sequence of commands, each at its time"},
    {.key = "faults", .type = FIELD_CUSTOM, .load = load_faults, .dump = dump_faults, .what = "a sequence of faults: the arguments of fault.add, given before power-on"},
};
const struct fields scenario_fields = FIELDS(scenario_rows);
// clang-format on

void scenario_default(struct scenario *s, const char *path)
{
    memset(s, 0, offsetof(struct scenario, units));
    s->seed = 1;
    s->bus_count = 1;
    s->bus[0] = (struct scenario_bus){.name = "can0", .cfg = {.bitrate_hz = 1000000, .data_bitrate_hz = 5000000}};
    s->lab = lab_default();
    s->spread.quartz = quartz_batch_default();
    s->site.g_mps2 = s->lab.site.g_mps2;
    snprintf(s->path, sizeof s->path, "%s", path);
}

void scenario_copy(struct scenario *to, const struct scenario *from)
{
    memcpy(to, from, offsetof(struct scenario, units) + from->unit_count * sizeof from->units[0]);
}

static bool load_scenario(struct yaml_file *f, struct scenario *s)
{
    const struct yaml_node *buses = yaml_get(f->root, "buses");
    scenario_default(s, f->path);
    if (buses && !load_buses(f, buses, s)) return false;
    if (!yaml_load(f, f->root, "", &scenario_fields, s)) return false;
    if (!scenario_check_lab(f, f->root, &s->lab) || !scenario_check_seats(f, f->root, s)) return false;
    if (!scenario_check_platform(f, f->root, s) || !scenario_check_flight(f, f->root, s)) return false;
    return s->unit_count > 0 || yaml_file_fail(f, NULL, "units", "expected at least one unit, got none");
}

bool scenario_parse(const char *path, const char *text, size_t len, struct scenario *s, char *why, size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_parse(&f, path, text, len, why, cap)) return false;
    const bool ok = load_scenario(&f, s);
    yaml_file_close(&f);
    return ok;
}

bool scenario_load(const char *name, struct scenario *s, char *why, size_t cap)
{
    struct yaml_file f;
    char path[FIND_PATH_MAX];
    if (!find_proto("scenarios", name, NULL, path, why, cap) || !yaml_file_open(&f, path, why, cap)) return false;
    const bool ok = load_scenario(&f, s);
    yaml_file_close(&f);
    return ok;
}

cJSON *scenario_dump(const struct scenario *s)
{
    cJSON *j = cJSON_CreateObject();
    yaml_dump(&scenario_fields, s, j);
    return j;
}
