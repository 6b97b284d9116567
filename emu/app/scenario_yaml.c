#include "app/scenario_yaml.h"

#include "app/profile_yaml.h"
#include "app/yaml_file.h"

#include <stdio.h>
#include <string.h>

#define COUNT(a) (sizeof(a) / sizeof *(a))

/* ---- leaves: tables only */

#define BUS(m)  offsetof(struct can_bus_cfg, m)
#define HEAD(m) offsetof(struct head_cfg, m)
#define AFE(m)  offsetof(struct afe_cfg, m)
#define MEMS(m) offsetof(struct mems_g, m)

// clang-format off
static const struct yaml_field bus_fields[] = {
    {"bitrate_hz",      YAML_U32, BUS(bitrate_hz),      0, 1e6, NULL},
    {"data_bitrate_hz", YAML_U32, BUS(data_bitrate_hz), 0, 8e6, NULL},
};
static const struct yaml_field site_fields[] = {
    {"g_mps2", YAML_REAL, offsetof(struct site, g_mps2), 0, 20, NULL},
};
static const struct yaml_field head_fields[] = {
    {"resolution_arcsec",        YAML_REAL, HEAD(resolution_arcsec),        0, 3600, NULL},
    {"setting_error_arcsec_rms", YAML_REAL, HEAD(setting_error_arcsec_rms), 0, 3600, NULL},
    {"periodic_arcsec",          YAML_REAL, HEAD(periodic_arcsec),          0, 3600, NULL},
    {"periodic_order",           YAML_U32,  HEAD(periodic_order),           0, 3600, NULL},
    {"mount_error_arcsec_rms",   YAML_REAL, HEAD(mount_error_arcsec_rms),   0, 3600, NULL},
    {"turn_s",                   YAML_REAL, HEAD(turn_s),                   0, 3600, NULL},
};

static bool load_input(struct yaml_file *f, yaml_node_t *node, void *section);

static const struct yaml_field afe_fields[] = {
    {"input",                    YAML_CUSTOM, 0, 0, 0, load_input},
    {"load_ohm",                 YAML_REAL, AFE(load_ohm),                 1, 1e6, NULL},
    {"load_tol_ppm",             YAML_REAL, AFE(load_tol_ppm),             -1e5, 1e5, NULL},
    {"load_tc_ppm_per_k",        YAML_REAL, AFE(load_tc_ppm_per_k),        -1e4, 1e4, NULL},
    {"divider_ratio",            YAML_REAL, AFE(divider_ratio),            1, 1000, NULL},
    {"divider_tol_ppm",          YAML_REAL, AFE(divider_tol_ppm),          -1e5, 1e5, NULL},
    {"divider_tc_ppm_per_k",     YAML_REAL, AFE(divider_tc_ppm_per_k),     -1e4, 1e4, NULL},
    {"buffer_offset_v",          YAML_REAL, AFE(buffer_offset_v),          -1, 1, NULL},
    {"buffer_offset_tc_v_per_k", YAML_REAL, AFE(buffer_offset_tc_v_per_k), -1e-2, 1e-2, NULL},
    {"clip_v",                   YAML_REAL, AFE(clip_v),                   0.1, 100, NULL},
    {"filter_hz",                YAML_REAL, AFE(filter_hz),                0, 1e6, NULL},
    {"noise_v_rthz",             YAML_REAL, AFE(noise_v_rthz),             0, 1e-2, NULL},
};
static const struct yaml_field mems_fields[] = {
    {"u0_v",            YAML_REAL, MEMS(u0_v),            -10, 10, NULL},
    {"kx_v_per_g",      YAML_REAL, MEMS(kx_v_per_g),      -10, 10, NULL},
    {"ky_v_per_g",      YAML_REAL, MEMS(ky_v_per_g),      -10, 10, NULL},
    {"kz_v_per_g",      YAML_REAL, MEMS(kz_v_per_g),      -10, 10, NULL},
    {"kxy_v_per_g2",    YAML_REAL, MEMS(kxy_v_per_g2),    -1, 1, NULL},
    {"kxx_v_per_g2",    YAML_REAL, MEMS(kxx_v_per_g2),    -1, 1, NULL},
    {"kyy_v_per_g2",    YAML_REAL, MEMS(kyy_v_per_g2),    -1, 1, NULL},
    {"alpha0_deg",      YAML_REAL, MEMS(alpha0_deg),      -10, 10, NULL},
    {"drift_v_per_s",   YAML_REAL, MEMS(drift_v_per_s),   -1, 1, NULL},
    {"noise_v_rthz",    YAML_REAL, MEMS(noise_v_rthz),    0, 1, NULL},
    {"reading_noise_v", YAML_REAL, MEMS(reading_noise_v), 0, 1, NULL},
};
// clang-format on

static bool load_input(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct afe_cfg *a = section;
    const char *text = yaml_file_scalar(node);
    const bool current = text && strcmp(text, "current") == 0;
    if (!current && (!text || strcmp(text, "voltage") != 0)) {
        return yaml_file_fail(f, node, "input", "current or voltage is wanted");
    }
    a->input = current ? AFE_CURRENT : AFE_VOLTAGE;
    return true;
}

/* ---- an axis: sensor, its parameters, its chain */

struct axis {
    struct unit_axis_cfg *sensor;
    struct afe_cfg *afe;
};

static bool load_sensor(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct axis *a = section;
    const char *text = yaml_file_scalar(node);
    const bool mems = text && strcmp(text, "mems") == 0;
    if (!mems && (!text || strcmp(text, "none") != 0))
        return yaml_file_fail(f, node, "sensor", "mems or none is wanted");
    a->sensor->sensor = mems ? UNIT_MEMS : UNIT_NO_SENSOR;
    return true;
}

static bool load_afe(struct yaml_file *f, yaml_node_t *node, void *section)
{
    return yaml_file_section(f, node, "afe", afe_fields, COUNT(afe_fields), ((struct axis *)section)->afe);
}

/* The keys of the sensor stand beside `sensor` and `afe`: one table made of both. */
static bool load_axis(struct yaml_file *f, yaml_node_t *node, const char *name, struct unit_cfg *u, unsigned axis)
{
    struct axis a = {&u->axis[axis], &u->board.afe[axis]};
    struct {
        struct axis axis; /* first: what load_sensor and load_afe get */
        struct mems_g mems;
    } section = {a, u->axis[axis].mems};
    struct yaml_field fields[2 + COUNT(mems_fields)] = {
        {.key = "sensor", .type = YAML_CUSTOM, .load = load_sensor},
        {.key = "afe", .type = YAML_CUSTOM, .load = load_afe},
    };
    for (size_t i = 0; i < COUNT(mems_fields); i++) {
        fields[2 + i] = mems_fields[i];
        fields[2 + i].offset += (size_t)((char *)&section.mems - (char *)&section);
    }
    if (!yaml_file_section(f, node, name, fields, COUNT(fields), &section)) return false;
    u->axis[axis].mems = section.mems;
    return true;
}

static bool load_axis_x(struct yaml_file *f, yaml_node_t *node, void *u)
{
    return load_axis(f, node, "x", u, 0);
}

static bool load_axis_y(struct yaml_file *f, yaml_node_t *node, void *u)
{
    return load_axis(f, node, "y", u, 1);
}

static bool load_axis_z(struct yaml_file *f, yaml_node_t *node, void *u)
{
    return load_axis(f, node, "z", u, 2);
}

static const struct yaml_field axes_fields[] = {
    {.key = "x", .type = YAML_CUSTOM, .load = load_axis_x},
    {.key = "y", .type = YAML_CUSTOM, .load = load_axis_y},
    {.key = "z", .type = YAML_CUSTOM, .load = load_axis_z},
};

/* ---- a unit */

static bool load_axes(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario_unit *u = section;
    return yaml_file_section(f, node, "axes", axes_fields, COUNT(axes_fields), &u->cfg);
}

static bool load_profile_named(struct yaml_file *f, const yaml_node_t *node, const char *name, struct scenario_unit *u)
{
    char path[FIND_PATH_MAX], why[400];
    if (!find_proto("profiles", name, f->path, path, why, sizeof why))
        return yaml_file_fail(f, node, "profile", "%s", why);
    return profile_yaml_load(path, &u->profile, f->why, f->cap);
}

static bool load_profile(struct yaml_file *f, yaml_node_t *node, void *section)
{
    const char *name = yaml_file_scalar(node);
    struct scenario_unit *u = section;
    if (!name) return yaml_file_fail(f, node, "profile", "a name of proto/profiles or a path is wanted");
    if (u->profile_changed)
        return yaml_file_fail(f, node, "profile", "stands after profile_set, which changes it; name it before");
    u->profile_named = true;
    return load_profile_named(f, node, name, u);
}

/* board: psa1 is the same board with its own profile. */
static bool load_board(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario_unit *u = section;
    const char *name = yaml_file_scalar(node);
    const bool psa1 = name && strcmp(name, "psa1") == 0;
    if (!psa1 && (!name || strcmp(name, "psa2") != 0))
        return yaml_file_fail(f, node, "board", "psa2 or psa1 is wanted");
    snprintf(u->board_name, sizeof u->board_name, "%s", name);
    if (!psa1 || u->profile_named) return true;
    if (u->profile_changed)
        return yaml_file_fail(f, node, "board", "stands after profile_set, which changes its profile; name it before");
    return load_profile_named(f, node, "psa1", u);
}

/* Fields that differ from the profile, which must have been named before. */
static bool load_profile_set(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario_unit *u = section;
    const size_t outer = strlen(f->where);
    u->profile_changed = true;
    if (node->type != YAML_MAPPING_NODE)
        return yaml_file_fail(f, node, "profile_set", "a mapping `key: value` is wanted");
    snprintf(f->where + outer, sizeof f->where - outer, "profile_set.");
    if (!profile_yaml_fields(f, node, &u->profile)) return false;
    snprintf(f->where + outer, sizeof f->where - outer, "profile_set: "); /* a whole sentence follows */
    if (!profile_yaml_check(f, node, &u->profile)) return false;
    f->where[outer] = '\0';
    return true;
}

static const struct yaml_field temp_field = {"temp_degc", YAML_REAL, 0, -60, 125, NULL};

/* One value for all, or those of X, Y, Z and the board. */
static bool load_temps(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario_unit *u = section;
    double one = 0;
    if (node->type != YAML_SEQUENCE_NODE) {
        if (!yaml_file_value(f, node, &temp_field, &one)) return false;
        for (unsigned i = 0; i < UNIT_TEMPS; i++) u->cfg.temp_degc[i] = one;
        return true;
    }
    const yaml_node_item_t *items = node->data.sequence.items.start;
    if (node->data.sequence.items.top - items != UNIT_TEMPS) {
        return yaml_file_fail(f, node, "temp_degc", "one value or four, of X, Y, Z and the board, are wanted");
    }
    for (unsigned i = 0; i < UNIT_TEMPS; i++) {
        if (!yaml_file_value(f, yaml_file_node(f, items[i]), &temp_field, &u->cfg.temp_degc[i])) return false;
    }
    return true;
}

static bool load_adc_chain(struct yaml_file *f, yaml_node_t *node, void *section)
{
    static const char *const chains[] = {
        [ADS1282_CHAIN_EXACT] = "exact", [ADS1282_CHAIN_MODULATOR] = "modulator", [ADS1282_CHAIN_DIRECT] = "direct"};
    const char *text = yaml_file_scalar(node);
    for (unsigned i = 0; text && i < COUNT(chains); i++) {
        if (strcmp(text, chains[i]) != 0) continue;
        ((struct scenario_unit *)section)->cfg.board.adc_chain = (enum ads1282_chain)i;
        return true;
    }
    return yaml_file_fail(f, node, "adc_chain", "exact, modulator or direct is wanted");
}

#define UNIT(m) offsetof(struct scenario_unit, m)

// clang-format off
static const struct yaml_field unit_fields[] = {
    {"name",                YAML_TEXT, UNIT(name), 0, 32, NULL},
    {"board",               YAML_CUSTOM, 0, 0, 0, load_board},
    {"profile",             YAML_CUSTOM, 0, 0, 0, load_profile},
    {"profile_set",         YAML_CUSTOM, 0, 0, 0, load_profile_set},
    {"node",                YAML_U8, UNIT(cfg.node), 1, 127, NULL},
    {"serial",              YAML_U32, UNIT(cfg.board.serial), 1, 4294967295.0, NULL},
    {"frame_form",          YAML_U8, UNIT(frame_form), 0, 3, NULL},
    {"axes",                YAML_CUSTOM, 0, 0, 0, load_axes},
    {"temp_degc",           YAML_CUSTOM, 0, 0, 0, load_temps},
    {"adc_chain",           YAML_CUSTOM, 0, 0, 0, load_adc_chain},
    {"adc_noise_scale",     YAML_REAL, UNIT(cfg.board.adc_noise_scale), 0, 1000, NULL},
    {"temp_noise_scale",    YAML_REAL, UNIT(cfg.board.temp_noise_scale), 0, 1000, NULL},
    {"temp_adc_offset_v",   YAML_REAL, UNIT(cfg.board.temp_adc_offset_v), -0.1, 0.1, NULL},
    {"temp_adc_gain_error", YAML_REAL, UNIT(cfg.board.temp_adc_gain_error), -0.1, 0.1, NULL},
};
// clang-format on

/* A name and a number that no other unit of the scenario has. */
static bool check_unit(struct yaml_file *f, const yaml_node_t *node, const struct scenario *s,
                       const struct scenario_unit *u)
{
    for (const char *p = u->name; *p; p++) {
        const bool plain =
            (*p >= 'a' && *p <= 'z') || (*p >= 'A' && *p <= 'Z') || (*p >= '0' && *p <= '9') || *p == '_';
        if (!plain) return yaml_file_fail(f, node, "name", "\"%s\": letters, digits and _ are wanted", u->name);
    }
    for (const struct scenario_unit *other = s->units; other < u; other++) {
        if (strcmp(other->name, u->name) == 0)
            return yaml_file_fail(f, node, "name", "\"%s\" is taken by another unit", u->name);
        if (other->cfg.node == u->cfg.node) {
            return yaml_file_fail(f, node, "node", "%u is taken by unit %s; each needs its own", u->cfg.node,
                                  other->name);
        }
        if (other->cfg.board.serial == u->cfg.board.serial) {
            return yaml_file_fail(f, node, "serial", "%u is taken by unit %s; each needs its own", u->cfg.board.serial,
                                  other->name);
        }
    }
    return true;
}

/* The unit's name as the messages need it before it is loaded. */
static const char *name_in(struct yaml_file *f, const yaml_node_t *node, const char *otherwise)
{
    const yaml_node_pair_t *end = node->type == YAML_MAPPING_NODE ? node->data.mapping.pairs.top : NULL;
    for (const yaml_node_pair_t *p = end ? node->data.mapping.pairs.start : NULL; p < end; p++) {
        const char *key = yaml_file_scalar(yaml_file_node(f, p->key));
        const char *name = yaml_file_scalar(yaml_file_node(f, p->value));
        if (key && name && strcmp(key, "name") == 0) return name;
    }
    return otherwise;
}

static bool load_unit(struct yaml_file *f, yaml_node_t *node, struct scenario *s)
{
    char where[40];
    if (s->unit_count == SCENARIO_UNITS_MAX)
        return yaml_file_fail(f, node, "units", "up to %u are wanted", SCENARIO_UNITS_MAX);
    const unsigned i = s->unit_count;
    struct scenario_unit *u = &s->units[i];
    *u = (struct scenario_unit){.board_name = "psa2", .profile = psa2_profile_default(), .cfg = unit_default(NULL)};
    snprintf(u->name, sizeof u->name, "%c", 'a' + (int)i);
    u->cfg.node = (uint8_t)(5 + i);
    u->cfg.board.serial = i + 1;
    snprintf(where, sizeof where, "units.%.31s", name_in(f, node, u->name));
    if (!yaml_file_section(f, node, where, unit_fields, COUNT(unit_fields), u)) return false;
    snprintf(f->where, sizeof f->where, "%s.", where);
    if (!check_unit(f, node, s, u)) return false;
    f->where[0] = '\0';
    s->unit_count++;
    return true;
}

/* ---- the whole */

static bool load_bus(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario *s = section;
    return yaml_file_section(f, node, "bus", bus_fields, COUNT(bus_fields), &s->bus);
}

static bool load_site(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario *s = section;
    return yaml_file_section(f, node, "site", site_fields, COUNT(site_fields), &s->site);
}

static bool load_head(struct yaml_file *f, yaml_node_t *node, void *section)
{
    struct scenario *s = section;
    return yaml_file_section(f, node, "head", head_fields, COUNT(head_fields), &s->head);
}

static bool load_units(struct yaml_file *f, yaml_node_t *node, void *section)
{
    if (node->type != YAML_SEQUENCE_NODE) return yaml_file_fail(f, node, "units", "a sequence of units is wanted");
    for (yaml_node_item_t *i = node->data.sequence.items.start; i < node->data.sequence.items.top; i++) {
        if (!load_unit(f, yaml_file_node(f, *i), section)) return false;
    }
    return true;
}

static const struct yaml_field scenario_fields[] = {
    {.key = "seed", .type = YAML_U64, .offset = offsetof(struct scenario, seed)},
    {.key = "start", .type = YAML_BOOL, .offset = offsetof(struct scenario, start)},
    {.key = "bus", .type = YAML_CUSTOM, .load = load_bus},
    {.key = "site", .type = YAML_CUSTOM, .load = load_site},
    {.key = "head", .type = YAML_CUSTOM, .load = load_head},
    {.key = "units", .type = YAML_CUSTOM, .load = load_units},
};

static bool load(struct yaml_file *f, struct scenario *s)
{
    *s = (struct scenario){
        .seed = 1, .bus = {.bitrate_hz = 1000000, .data_bitrate_hz = 5000000}, .site = {.g_mps2 = 9.81}};
    snprintf(s->path, sizeof s->path, "%s", f->path);
    if (!yaml_file_section(f, yaml_file_root(f), "", scenario_fields, COUNT(scenario_fields), s)) return false;
    if (s->bus.bitrate_hz && s->bus.bitrate_hz < 10000) {
        return yaml_file_fail(f, NULL, "bus.bitrate_hz", "%u is below 10000; 0 is a bus on which frames take no time",
                              s->bus.bitrate_hz);
    }
    return s->unit_count > 0 || yaml_file_fail(f, NULL, "units", "at least one unit is wanted");
}

bool scenario_parse(const char *path, const char *text, size_t len, struct scenario *s, char *why, size_t cap)
{
    struct yaml_file f;
    if (!yaml_file_parse(&f, path, text, len, why, cap)) return false;
    const bool ok = load(&f, s);
    yaml_file_close(&f);
    return ok;
}

bool scenario_load(const char *name, struct scenario *s, char *why, size_t cap)
{
    struct yaml_file f;
    char path[FIND_PATH_MAX];
    if (!find_proto("scenarios", name, NULL, path, why, cap) || !yaml_file_open(&f, path, why, cap)) return false;
    const bool ok = load(&f, s);
    yaml_file_close(&f);
    return ok;
}

void scenario_bind(struct scenario *s)
{
    for (unsigned i = 0; i < s->unit_count; i++) {
        struct scenario_unit *u = &s->units[i];
        u->cfg.name = u->name;
        u->cfg.profile = &u->profile;
        u->cfg.board.seed = s->seed;
    }
}
