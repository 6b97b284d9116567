/* Keys of a unit, and one entry for many units. */
#include "base/why.h"
#include "canopen/uds_door.h"
#include "scenario/keys.h"

#include "scenario/profile.h"

#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

#define UNIT(m) offsetof(struct scenario_unit, m)

/* ---- board and profile: they decide what the other keys default to, so they are read first, wherever they stand */

/* What is wrong within the profile is reported with its line there, that it is another board's with the line here. */
static bool find_profile(struct yaml_file *f, const struct yaml_node *node, const char *name, struct scenario_unit *u)
{
    char path[FIND_PATH_MAX];
    const struct board_type *type = u->board->type;
    const struct board_name *of;
    if (!yaml_find_proto(f, node, "profile", "profiles", name, path)) return false;
    if (!profile_yaml_load(path, &of, &u->profile, f->why, f->cap)) return false;
    if (!board_name_takes(u->board, of)) {
        return yaml_file_fail(f, node, "profile", "expected a profile of %s (board: %s), got %s, one of %s (board: %s)",
                              board_name_title(u->board), u->board->name, name, board_name_title(of), of->name);
    }
    if (type->cfg_profiled) type->cfg_profiled(&u->cfg.board, &u->profile);
    return true;
}

/* Makes it a unit of another board, with its defaults. */
static void set_board(struct scenario_unit *u, const struct board_name *name)
{
    u->board = name;
    unit_cfg_type(&u->cfg, name->type);
    fields_default(name->type->fields, &u->profile);
}

/* A unit of the type that its mapping names, the i-th of it, with its profile; the type's defaults for the rest. */
static bool begin_unit(struct yaml_file *f, const struct yaml_node *node, const struct scenario *s,
                       struct scenario_unit *u)
{
    const struct yaml_node *profile = yaml_get(node, "profile");
    const struct board_name *found = profile_yaml_board(f, node);
    if (!found) return false;
    set_board(u, found);
    unsigned before = 0;
    for (unsigned i = 0; i < s->unit_count; i++) before += s->units[i].cfg.type == found->type;
    if (u->cfg.node + before <= 127) u->cfg.node = (uint8_t)(u->cfg.node + before); /* else find_node()'s business */
    if (!profile) return !found->profile || find_profile(f, node, found->profile, u);
    const char *name = yaml_scalar(profile);
    if (!name) return yaml_file_expected(f, profile, "profile", "a name of proto/profiles or a path");
    return find_profile(f, profile, name, u);
}

static void dump_board(const struct field *d, const void *section, cJSON *to)
{
    cJSON_AddStringToObject(to, d->key, ((const struct scenario_unit *)section)->board->name);
}

/* Fields that differ from the profile. */
static bool load_profile_set(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario_unit *u = section;
    const struct board_type *type = u->board->type;
    const size_t outer = strlen(f->where);
    if (!yaml_load_by(f, node, "profile_set", type->fields, &u->profile, profile_yaml_value, NULL)) return false;
    snprintf(f->where + outer, sizeof f->where - outer, "profile_set: "); /* a whole sentence follows */
    if (!profile_yaml_check(f, node, type, &u->profile)) return false;
    f->where[outer] = '\0';
    return true;
}

/* Every field: the dump needs no other file. */
static void dump_profile_set(const struct field *d, const void *section, cJSON *to)
{
    const struct scenario_unit *u = section;
    yaml_dump(u->board->type->fields, &u->profile, cJSON_AddObjectToObject(to, d->key));
}

/* ---- the tables */

/* While a mapping is read: the unit it describes, and how many such there are. */
struct entry {
    struct scenario_unit unit; /* first: the offsets of the table hold */
    uint32_t count;            /* 0: not given */
};

static bool load_count(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct entry *e = section;
    const struct field row = {.key = "count",
                              .type = FIELD_U32,
                              .offset = offsetof(struct entry, count),
                              .min = 1,
                              .max = SCENARIO_UNITS_MAX};
    return yaml_load_value(f, node, &row, e);
}

// clang-format off
static const char *const sensors[] = {[UNIT_NO_SENSOR] = "none", [UNIT_MEMS] = "mems", [UNIT_QUARTZ] = "quartz",
                                      [UNIT_RECORDED] = "recorded", [UNIT_CVG] = "mems_gyro", NULL};
#define AXIS(i)                                                                                                        \
    {.key = "sensor", .type = FIELD_CHOICE, .offset = UNIT(cfg.axis[i].sensor), .choices = sensors,                     \
     .what = "type of the sensor; `none`: the channel is shorted; `recorded`: its output comes from a file"},                               \
    {.type = FIELD_INLINE, .offset = UNIT(cfg.axis[i].mems), .sub = &scenario_mems_fields},                             \
    {.key = "quartz", .type = FIELD_SECTION, .offset = UNIT(cfg.axis[i].quartz), .sub = &scenario_quartz_fields,        \
     .present = UNIT(cfg.axis[i].quartz_given), .what = "parameters of a quartz sensor; its afe.input is current"},    \
    {.key = "gyro", .type = FIELD_SECTION, .offset = UNIT(cfg.axis[i].cvg), .sub = &scenario_cvg_fields,                \
     .present = UNIT(cfg.axis[i].cvg_given), .what = "parameters of a mems_gyro"},                                      \
    {.key = "signal", .type = FIELD_SECTION, .offset = UNIT(series[i]), .sub = &scenario_series_fields,                 \
     .present = UNIT(series[i].given), .what = "what the sensor feels, or puts out, from a file: [recorded signals](recorded.md)"}, \
    {.key = "at_m", .type = FIELD_REALS, .offset = UNIT(cfg.axis[i].at_m), .count = 3, .min = -10, .max = 10,           \
     .what = "position of the sensor in the unit's case, x, y, z"},                                                   \
    {.key = "afe", .type = FIELD_SECTION, .offset = UNIT(cfg.board.afe[i]), .sub = &scenario_afe_fields,                \
     .what = "the analog chain"}
static const struct field axis_x_rows[] = {AXIS(0)}, axis_y_rows[] = {AXIS(1)}, axis_z_rows[] = {AXIS(2)};
const struct fields scenario_axis_fields = FIELDS(axis_x_rows);
static const struct fields axis_y_fields = FIELDS(axis_y_rows), axis_z_fields = FIELDS(axis_z_rows);

static const struct field axes_rows[] = {
    {.key = "x", .type = FIELD_SECTION, .sub = &scenario_axis_fields, .what = "channel X; its sensor has the unit's axes x, y, z"},
    {.key = "y", .type = FIELD_SECTION, .sub = &axis_y_fields, .what = "channel Y; its sensor has the unit's axes y, z, x"},
    {.key = "z", .type = FIELD_SECTION, .sub = &axis_z_fields, .what = "channel Z; its sensor has the unit's axes z, x, y"},
};
static const struct fields axes_fields = FIELDS(axes_rows);

static const char *const chains[] = {
    [ADS1282_CHAIN_EXACT] = "exact", [ADS1282_CHAIN_MODULATOR] = "modulator", [ADS1282_CHAIN_DIRECT] = "direct", NULL};

static const struct field unit_rows[] = {
    {.key = "name",   .type = FIELD_TEXT, .offset = UNIT(name), .max = 32, .what = "letters, digits and _; with `count` it includes a number format, `%02u`"},
    {.key = "count",  .type = FIELD_CUSTOM, .min = 1, .max = SCENARIO_UNITS_MAX, .load = load_count, .what = "number of equal units; name, node and serial count up"},
    {.key = "board",  .type = FIELD_CUSTOM, .dump = dump_board, .what = "type of the board, or a name of one of its profiles: see below"},
    {.key = "profile", .type = FIELD_CUSTOM, .what = "name in proto/profiles, or a path, relative to the scenario"},
    {.key = "profile_set", .type = FIELD_CUSTOM, .load = load_profile_set, .dump = dump_profile_set, .what = "fields of the profile that differ"},
    {.key = "bus",    .type = FIELD_TEXT, .offset = UNIT(bus_name), .max = 16, .what = "name of the unit's bus (the first)"},
    {.key = "node",   .type = FIELD_U8, .offset = UNIT(cfg.node), .min = 1, .max = 127, .what = "CANopen node id, unique on a bus (the board's default, or the next free one)"},
    {.key = "uds_ecu", .type = FIELD_U8, .offset = UNIT(uds_ecu), .max = UDS_ECU_MAX, .what = "number of the unit's [UDS](tools/uds.md) server, unique on a bus: requests 7DFh + number, responses 7E7h + number; 0: none"},
    {.key = "serial", .type = FIELD_U32, .offset = UNIT(cfg.board.serial), .min = 1, .max = 4294967295.0, .what = "serial number, unique; noise and spread are drawn from it"},
    {.key = "frame_form", .type = FIELD_U8, .offset = UNIT(frame_form), .max = 3, .what = "0 pair, 1 fast, 2 FD frame, 3 FD block; written to object 2020h at the start"},
    {.key = "spread", .type = FIELD_BOOL, .offset = UNIT(spread), .what = "draw parameters from the scenario's `spread`"},
    {.key = "axes",   .type = FIELD_SECTION, .sub = &axes_fields, .what = "the channels `x`, `y`, `z`"},
    {.key = "level",  .type = FIELD_TEXT, .offset = UNIT(level), .max = 32, .what = "gyro unit: name of the PSA-2 that reads its level sensors"},
    {.key = "on",     .type = FIELD_CHOICE, .offset = UNIT(cfg.mounting.on), .choices = unit_mounts, .what = "mounting place"},
    {.key = "lever_arm_m", .type = FIELD_REALS, .offset = UNIT(cfg.mounting.lever_m), .count = 3, .min = -10, .max = 10, .what = "from the instrument's centre to the unit, mount's x, y, z"},
    {.key = "misalignment_arcsec", .type = FIELD_REALS, .offset = UNIT(misalignment_arcsec), .count = 3, .min = -36000, .max = 36000, .what = "misalignment of the case in the mount, about x, y, z"},
    {.key = "tau_case_s", .type = FIELD_REAL, .offset = UNIT(cfg.tau_case_s), .max = 1e5, .what = "time constant in the chamber; 0: the chamber's"},
    {.key = "tau_element_s", .type = FIELD_REAL, .offset = UNIT(cfg.tau_element_s), .max = 1e5, .what = "time constant in the chamber; 0: the chamber's"},
    {.key = "temp_degc", .type = FIELD_EACH, .offset = UNIT(cfg.temp_degc), .count = UNIT_TEMPS, .min = -60, .max = 125, .what = "temperature of X, Y, Z and the board without a chamber"},
    {.key = "adc_chain", .type = FIELD_CHOICE, .offset = UNIT(cfg.board.adc_chain), .choices = chains, .what = "model of the accelerometer converters: [ADS1282](chips/ads1282.md)"},
    {.key = "adc_noise_scale", .type = FIELD_REAL, .offset = UNIT(cfg.board.adc_noise_scale), .max = 1000, .what = "scale of the converters' noise; 1: published noise, 0: none"},
    {.key = "temp_noise_scale", .type = FIELD_REAL, .offset = UNIT(cfg.board.temp_noise_scale), .max = 1000, .what = "scale of the temperature converter's noise"},
    {.key = "temp_adc_offset_v", .type = FIELD_REAL, .offset = UNIT(cfg.board.temp_adc_offset_v), .min = -0.1, .max = 0.1, .what = "offset of the temperature converter before calibration"},
    {.key = "temp_adc_gain_error", .type = FIELD_REAL, .offset = UNIT(cfg.board.temp_adc_gain_error), .min = -0.1, .max = 0.1, .what = "relative gain error of the temperature converter before calibration"},
};
const struct fields scenario_unit_fields = FIELDS(unit_rows);
// clang-format on

/* ---- what no table can say */

static bool is_plain(const char *name)
{
    return name[strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_")] == '\0';
}

/* Keys of settings that not every board has. */
static const struct {
    const char *key;
    enum { OF_FORMS, OF_INPUTS, OF_CAPABILITY } of;
} some_have[] = {
    {"frame_form", OF_FORMS},
    {"axes", OF_INPUTS},
    {"adc_noise_scale", OF_INPUTS},
    {"level", OF_CAPABILITY},
    {"adc_chain", OF_CAPABILITY},
    {"temp_noise_scale", OF_CAPABILITY},
    {"temp_adc_offset_v", OF_CAPABILITY},
    {"temp_adc_gain_error", OF_CAPABILITY},
};
enum { SOME_HAVE = sizeof some_have / sizeof *some_have };

static bool has_key(const struct board_type *t, unsigned i)
{
    if (some_have[i].of == OF_INPUTS) return t->analog;
    return some_have[i].of == OF_CAPABILITY ? board_has(t, some_have[i].key) : t->frame_forms > 0;
}

static bool check_keys(struct yaml_file *f, const struct yaml_node *node, const struct scenario_unit *u)
{
    const struct board_type *t = u->cfg.type;
    for (unsigned i = 0; i < SOME_HAVE; i++) {
        const struct yaml_node *value = yaml_get(node, some_have[i].key);
        if (value && !has_key(t, i))
            return yaml_file_fail(f, value, some_have[i].key, "expected a key of a %s, got one of another board",
                                  t->title);
    }
    if (u->frame_form && u->frame_form >= t->frame_forms)
        return yaml_file_expected(f, yaml_get(node, "frame_form"), "frame_form", "0 to %u for a %s", t->frame_forms - 1,
                                  t->title);
    return true;
}

void scenario_dump_unit(const struct scenario_unit *u, cJSON *to)
{
    yaml_dump(&scenario_unit_fields, u, to);
    for (unsigned i = 0; i < SOME_HAVE; i++)
        if (!has_key(u->cfg.type, i)) cJSON_DeleteItemFromObject(to, some_have[i].key);
    if (!u->level[0]) cJSON_DeleteItemFromObject(to, "level");
}

/* A quartz sensor's amperes must not be taken for volts. */
static bool check_inputs(struct yaml_file *f, const struct yaml_node *node, const struct scenario_unit *u)
{
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        if (u->cfg.axis[i].sensor == UNIT_QUARTZ && u->cfg.board.afe[i].input != AFE_CURRENT) {
            return yaml_file_fail(f, yaml_at(node, "axes"), "axes",
                                  "%c: expected afe: {input: current} for a quartz sensor", "xyz"[i]);
        }
        if (u->cfg.axis[i].sensor == UNIT_CVG && u->cfg.board.afe[i].input != AFE_VOLTAGE) {
            return yaml_file_fail(f, yaml_at(node, "axes"), "axes",
                                  "%c: expected afe: {input: voltage} for a mems_gyro", "xyz"[i]);
        }
    }
    return true;
}

/* The column's unit has to be what the sensor takes. */
static bool check_signal(struct yaml_file *f, const struct yaml_node *node, const struct scenario_unit *u, unsigned i)
{
    const struct scenario_series *s = &u->series[i];
    const enum unit_sensor sensor = u->cfg.axis[i].sensor;
    const bool current = u->cfg.board.afe[i].input == AFE_CURRENT;
    const char *unit = sensor == UNIT_RECORDED ? (current ? "_a" : "_v") : "_mps2";
    const size_t len = strlen(s->column), n = strlen(unit);
    const struct yaml_node *at = yaml_at(node, "axes");
    if (!s->given) {
        return sensor != UNIT_RECORDED ||
               yaml_file_fail(f, at, "axes", "%c: expected a signal for a recorded sensor, got none", "xyz"[i]);
    }
    if (sensor == UNIT_NO_SENSOR || sensor == UNIT_CVG)
        return yaml_file_fail(f, at, "axes", "%c.signal: expected a sensor that takes it, got %s", "xyz"[i],
                              sensors[sensor]);
    if (!s->file[0]) return yaml_file_fail(f, at, "axes", "%c.signal: expected a file, got none", "xyz"[i]);
    if (len <= n || strcmp(s->column + len - n, unit) != 0)
        return yaml_file_fail(f, at, "axes", "%c.signal: expected a column that ends in %s, got \"%s\"", "xyz"[i], unit,
                              s -> column);
    return true;
}

static bool check_signals(struct yaml_file *f, const struct yaml_node *node, const struct scenario_unit *u)
{
    for (unsigned i = 0; i < UNIT_AXES; i++)
        if (!check_signal(f, node, u, i)) return false;
    return true;
}

#define STANDARD_G_MPS2 9.80665

/* What follows from the parts of a pendulum is within the limits of the keys that it decides. */
static bool check_pendulum(struct yaml_file *f, const struct yaml_node *node, const char *where,
                           const struct pendulum *p)
{
    const struct pendulum_law law = pendulum_law(p, STANDARD_G_MPS2);
    const struct {
        const char *key;
        double value;
    } rows[] = {{"pendulous_ug_per_g2", law.deflection_urad_per_g},
                {"natural_hz", law.natural_hz},
                {"scale_a_per_g", law.scale_a_per_g},
                {"hinge_ug_per_urad", law.hinge_ug_per_urad}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct field *d = fields_find(&scenario_quartz_fields, rows[i].key);
        if (!(rows[i].value <= d->max))
            return yaml_file_fail(f, node, where, "expected parts that give %s up to %g, got %.4g", d->key, d->max,
                                  rows[i].value);
    }
    return true;
}

static bool check_pendulums(struct yaml_file *f, const struct yaml_node *node, const struct scenario_unit *u)
{
    static const char *const axes[] = {"x", "y", "z"};
    static const char *const where[] = {"axes.x.quartz.pendulum", "axes.y.quartz.pendulum", "axes.z.quartz.pendulum"};
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        const struct quartz_g *const q = &u->cfg.axis[i].quartz;
        const struct yaml_node *const axis = yaml_at(yaml_at(node, "axes"), axes[i]);
        const struct yaml_node *const parts = yaml_at(yaml_at(axis, "quartz"), "pendulum");
        if (q->pendulum_given && !check_pendulum(f, parts, where[i], &q->pendulum)) return false;
    }
    return true;
}

/* A name, a node and a number that no other unit of the scenario has. */
static bool check_unit(struct yaml_file *f, const struct yaml_node *node, const struct scenario *s,
                       const struct scenario_unit *u)
{
    if (!is_plain(u->name))
        return yaml_file_fail(f, yaml_at(node, "name"), "name", "expected letters, digits and _, got \"%s\"", u->name);
    if (!check_inputs(f, node, u) || !check_signals(f, node, u) || !check_pendulums(f, node, u)) return false;
    for (const struct scenario_unit *other = s->units; other < s->units + s->unit_count; other++) {
        if (strcmp(other->name, u->name) == 0)
            return yaml_file_fail(f, yaml_at(node, "name"), "name",
                                  "expected a name of its own, got \"%s\", which another unit has", u->name);
        if (other->cfg.node == u->cfg.node && other->bus == u->bus) {
            return yaml_file_fail(f, yaml_at(node, "node"), "node",
                                  "expected a node of its own, got %u, which unit %s has", u->cfg.node, other->name);
        }
        if (u->uds_ecu && other->uds_ecu == u->uds_ecu && other->bus == u->bus) {
            return yaml_file_fail(f, yaml_at(node, "uds_ecu"), "uds_ecu",
                                  "expected a number of its own, got %u, which unit %s has", u->uds_ecu, other->name);
        }
        if (other->cfg.board.serial == u->cfg.board.serial) {
            return yaml_file_fail(f, yaml_at(node, "serial"), "serial",
                                  "expected a number of its own, got %u, which unit %s has", u->cfg.board.serial,
                                  other->name);
        }
    }
    return true;
}

static const char *bus_at(const void *ctx, size_t i)
{
    const struct scenario *s = ctx;
    return i < s->bus_count ? s->bus[i].name : NULL;
}

/* Who has been given no node and finds his type's taken, has the next one that is free. */
static void find_node(const struct yaml_node *node, const struct scenario *s, struct scenario_unit *u)
{
    if (yaml_get(node, "node") || yaml_get(node, "count")) return;
    for (unsigned i = 0; i < s->unit_count && u->cfg.node < 127; i++) {
        if (s->units[i].bus != u->bus || s->units[i].cfg.node != u->cfg.node) continue;
        u->cfg.node++;
        i = UINT_MAX; /* from the first on again */
    }
}

static bool find_bus(struct yaml_file *f, const struct yaml_node *node, const struct scenario *s,
                     struct scenario_unit *u)
{
    char known[160] = "";
    if (!u->bus_name[0]) snprintf(u->bus_name, sizeof u->bus_name, "%s", s->bus[0].name);
    for (u->bus = 0; u->bus < s->bus_count; u->bus++) {
        if (strcmp(s->bus[u->bus].name, u->bus_name) == 0) return true;
        why_list_add(known, sizeof known, s->bus[u->bus].name);
    }
    const char *near = yaml_nearest(u->bus_name, bus_at, s);
    return yaml_file_fail(f, yaml_at(node, "bus"), "bus", "expected one of %s%s%s%s, got \"%s\"", known,
                          near ? " (nearest: " : "", near ? near : "", near ? ")" : "", u->bus_name);
}

/* The number n in a pattern like u%02u; false if there is not exactly one place for it. */
static bool number_name(const char *pattern, unsigned n, char *name, size_t cap)
{
    const char *percent = strchr(pattern, '%');
    if (!percent || strchr(percent + 1, '%')) return false;
    const bool padded = percent[1] == '0' && percent[2] >= '1' && percent[2] <= '9';
    const char *end = percent + (padded ? 3 : 1);
    if (*end != 'u') return false;
    const int width = padded ? percent[2] - '0' : 1;
    const int len = snprintf(name, cap, "%.*s%0*u%s", (int)(percent - pattern), pattern, width, n, end + 1);
    return len > 0 && (size_t)len < cap;
}

struct scenario_unit scenario_unit_default(unsigned i)
{
    struct scenario_unit u = {.cfg = unit_default(NULL)};
    if (i < 26) snprintf(u.name, sizeof u.name, "%c", 'a' + (int)i);
    else snprintf(u.name, sizeof u.name, "u%02u", i + 1);
    u.cfg.board.serial = i + 1;
    set_board(&u, &board_names[0]);
    return u;
}

/* The k-th of the units that an entry represents. */
static bool place_unit(struct yaml_file *f, const struct yaml_node *node, const struct entry *e, unsigned k,
                       struct scenario *s)
{
    if (s->unit_count == SCENARIO_UNITS_MAX)
        return yaml_file_fail(f, node, "count", "expected up to %u units in all, got more", SCENARIO_UNITS_MAX);
    struct scenario_unit *u = &s->units[s->unit_count];
    *u = e->unit;
    if (e->count && !number_name(e->unit.name, k + 1, u->name, sizeof u->name)) {
        return yaml_file_fail(f, yaml_at(node, "name"), "name",
                              "expected a place for the number, as in u%%02u, got \"%s\"", e->unit.name);
    }
    const unsigned id = e->unit.cfg.node + k;
    if (id > 127) return yaml_file_fail(f, yaml_at(node, "node"), "node", "expected 1 to 127, got %u", id);
    u->cfg.node = (uint8_t)id;
    u->cfg.board.serial = e->unit.cfg.board.serial + k;
    if (u->cfg.board.serial < e->unit.cfg.board.serial || u->cfg.board.serial == 0)
        return yaml_file_fail(f, yaml_at(node, "serial"), "serial", "expected up to 4294967295, got more by count");
    if (!check_unit(f, node, s, u)) return false;
    s->unit_count++;
    return true;
}

static bool load_entry(struct yaml_file *f, const struct yaml_node *node, struct scenario *s)
{
    struct entry e = {.unit = scenario_unit_default(s->unit_count)};
    char where[40];
    const char *named = yaml_scalar(yaml_get(node, "name"));
    if (yaml_get(node, "count")) snprintf(e.unit.name, sizeof e.unit.name, "u%%02u");
    snprintf(where, sizeof where, "units.%.31s", named ? named : e.unit.name);
    snprintf(f->where, sizeof f->where, "%s.", where);
    if (!begin_unit(f, node, s, &e.unit)) return false;
    f->where[0] = '\0';
    if (!yaml_load(f, node, where, &scenario_unit_fields, &e)) return false;
    snprintf(f->where, sizeof f->where, "%s.", where);
    if (!check_keys(f, node, &e.unit) || !find_bus(f, node, s, &e.unit)) return false;
    find_node(node, s, &e.unit);
    for (unsigned k = 0; k < (e.count ? e.count : 1); k++)
        if (!place_unit(f, node, &e, k, s)) return false;
    f->where[0] = '\0';
    return true;
}

bool scenario_load_units(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    if (node->kind != YAML_SEQUENCE) return yaml_file_expected(f, node, "units", "a list of units");
    for (const struct yaml_item *i = node->first; i; i = i->next)
        if (!load_entry(f, i->value, section)) return false;
    return true;
}

/* The place of an antenna has to be known (unit.c). */
static bool check_antenna(struct yaml_file *f, const struct yaml_node *units, const struct scenario_unit *u)
{
    const double *const lever_m = u->cfg.mounting.lever_m;
    if (u->cfg.mounting.on == LAB_PLATFORM)
        return yaml_file_fail(
            f, units, "units",
            "%s: expected a receiver at the site or on flight, got one on the platform, whose vehicle "
            "has no longitude",
            u->name);
    if (lever_m[0] != 0.0 || lever_m[1] != 0.0 || lever_m[2] != 0.0)
        return yaml_file_fail(
            f, units, "units",
            "%s: expected lever_arm_m of [0, 0, 0] for a receiver, whose antenna has none, got another", u->name);
    return true;
}

bool scenario_check_seats(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s)
{
    for (unsigned i = 0; i < s->unit_count; i++) {
        const struct scenario_unit *u = &s->units[i];
        const bool there = u->cfg.mounting.on == LAB_TABLE      ? s->lab.table.axes > 0
                           : u->cfg.mounting.on == LAB_PLATFORM ? s->lab.platform.present
                           : u->cfg.mounting.on == LAB_FLIGHT   ? s->lab.flight.present
                                                                : true;
        const char *on = lab_mount_name(u->cfg.mounting.on);
        if (!there)
            return yaml_file_fail(f, yaml_get(root, "units"), "units",
                                  "%s: expected a section %s to mount it on, got none", u->name, on);
        if (u->cfg.type->receiver && !check_antenna(f, yaml_get(root, "units"), u)) return false;
    }
    return true;
}
