/* Keys of the site and the instruments. */
#include "scenario/keys.h"

#include <string.h>

#define RAD_PER_DEG 0.017453292519943295

/* ---- site */

#define SITE(m) offsetof(struct scenario_site, m)

// clang-format off
static const struct field site_rows[] = {
    {.key = "g_mps2",        .type = FIELD_REAL, .offset = SITE(g_mps2), .min = 0.001, .max = 20, .what = "local gravity (with a latitude: its normal gravity)"},
    {.key = "latitude_deg",  .type = FIELD_REAL, .offset = SITE(latitude_deg), .min = -90, .max = 90, .what = "geodetic latitude; without it the Earth does not rotate"},
    {.key = "longitude_deg", .type = FIELD_REAL, .offset = SITE(longitude_deg), .min = -180, .max = 360, .what = "longitude, positive east"},
    {.key = "height_m",      .type = FIELD_REAL, .offset = SITE(height_m), .min = -500, .max = 9000, .what = "height above the ellipsoid"},
    {.key = "azimuth_deg",   .type = FIELD_REAL, .offset = SITE(azimuth_deg), .min = -360, .max = 360, .what = "azimuth of the bench's x axis from north, clockwise"},
};
const struct fields scenario_site_fields = FIELDS(site_rows);
// clang-format on

bool scenario_load_site(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario_site *site = &((struct scenario *)section)->site;
    if (!yaml_load(f, node, "site", &scenario_site_fields, site)) return false;
    site->placed = yaml_get(node, "latitude_deg") != NULL;
    if (site->placed && !yaml_get(node, "g_mps2"))
        site->g_mps2 = earth_gravity_mps2(site->latitude_deg * RAD_PER_DEG, site->height_m);
    for (size_t i = 2; i < scenario_site_fields.count && !site->placed; i++) {
        const char *key = site_rows[i].key;
        if (yaml_get(node, key))
            return yaml_file_fail(f, yaml_get(node, key), "site", "expected latitude_deg beside %s, got none", key);
    }
    return true;
}

void scenario_dump_site(const struct field *d, const void *section, cJSON *to)
{
    const struct scenario_site *site = &((const struct scenario *)section)->site;
    const struct fields rows = {.row = site_rows, .count = site->placed ? scenario_site_fields.count : 1};
    yaml_dump(&rows, site, cJSON_AddObjectToObject(to, d->key));
}

struct site scenario_site(const struct scenario_site *s)
{
    return (struct site){.g_mps2 = s->g_mps2,
                         .latitude_rad = s->latitude_deg * RAD_PER_DEG,
                         .longitude_rad = s->longitude_deg * RAD_PER_DEG,
                         .height_m = s->height_m,
                         .azimuth_rad = s->azimuth_deg * RAD_PER_DEG,
                         .placed = s->placed};
}

/* ---- dividing head and chamber and supply: tables only */

#define HEAD(m)    offsetof(struct head_cfg, m)
#define CHAMBER(m) offsetof(struct chamber_cfg, m)
#define SUPPLY(m)  offsetof(struct supply_cfg, m)

// clang-format off
static const struct field head_rows[] = {
    {.key = "resolution_arcsec",        .type = FIELD_REAL, .offset = HEAD(resolution_arcsec),        .max = 3600, .what = "step of the scale; 0: none"},
    {.key = "setting_error_arcsec_rms", .type = FIELD_REAL, .offset = HEAD(setting_error_arcsec_rms), .max = 3600, .what = "setting error, drawn at each turn"},
    {.key = "periodic_arcsec",          .type = FIELD_REAL, .offset = HEAD(periodic_arcsec),          .max = 3600, .what = "error of the divided circle, amplitude"},
    {.key = "periodic_order",           .type = FIELD_U32,  .offset = HEAD(periodic_order),           .max = 3600, .what = "periods of that error per turn; 0: 1"},
    {.key = "mount_error_arcsec_rms",   .type = FIELD_REAL, .offset = HEAD(mount_error_arcsec_rms),   .max = 3600, .what = "tilt of the unit, drawn at each mounting"},
    {.key = "turn_s",                   .type = FIELD_REAL, .offset = HEAD(turn_s),                   .max = 3600, .what = "duration of a turn; 0: at once"},
};
const struct fields scenario_head_fields = FIELDS(head_rows);

static const struct field chamber_rows[] = {
    {.key = "start_degc",            .type = FIELD_REAL, .offset = CHAMBER(start_degc), .min = -100, .max = 200, .what = "temperature of air and units, and set point, at power-on"},
    {.key = "min_degc",              .type = FIELD_REAL, .offset = CHAMBER(min_degc), .min = -100, .max = 200, .what = "lowest set point"},
    {.key = "max_degc",              .type = FIELD_REAL, .offset = CHAMBER(max_degc), .min = -100, .max = 200, .what = "highest set point"},
    {.key = "heating_max_k_per_min", .type = FIELD_REAL, .offset = CHAMBER(heating_max_k_per_min), .min = 0.001, .max = 100, .what = "fastest rise of the air"},
    {.key = "cooling_max_k_per_min", .type = FIELD_REAL, .offset = CHAMBER(cooling_max_k_per_min), .min = 0.001, .max = 100, .what = "fastest fall of the air"},
    {.key = "ramp_k_per_min",        .type = FIELD_REAL, .offset = CHAMBER(ramp_k_per_min), .min = 0.001, .max = 100, .what = "ramp at power-on; the lesser of ramp and limit applies"},
    {.key = "tau_case_s",            .type = FIELD_REAL, .offset = CHAMBER(tau_case_s), .max = 1e5, .what = "lag of a unit's case behind the air; 0: none"},
    {.key = "tau_element_s",         .type = FIELD_REAL, .offset = CHAMBER(tau_element_s), .max = 1e5, .what = "lag of a sensor's element behind the case; 0: none"},
    {.key = "readout_offset_k",      .type = FIELD_REAL, .offset = CHAMBER(readout_offset_k), .min = -10, .max = 10, .what = "error of the chamber's thermometer"},
    {.key = "readout_resolution_k",  .type = FIELD_REAL, .offset = CHAMBER(readout_resolution_k), .max = 10, .what = "resolution of the chamber's thermometer; 0: none"},
};
const struct fields scenario_chamber_fields = FIELDS(chamber_rows);

static const struct field supply_rows[] = {
    {.key = "volt_v",               .type = FIELD_REAL, .offset = SUPPLY(volt_v), .max = 100, .what = "voltage at power-on, with the output on"},
    {.key = "volt_max_v",           .type = FIELD_REAL, .offset = SUPPLY(volt_max_v), .min = 0.1, .max = 100, .what = "highest voltage setting"},
    {.key = "slew_v_per_s",         .type = FIELD_REAL, .offset = SUPPLY(slew_v_per_s), .max = 1e6, .what = "slew rate after a command; 0: infinite"},
    {.key = "ripple_v",             .type = FIELD_REAL, .offset = SUPPLY(ripple_v), .max = 100, .what = "amplitude of the ripple at power-on; 0: none"},
    {.key = "ripple_hz",            .type = FIELD_REAL, .offset = SUPPLY(ripple_hz), .max = 1e6, .what = "frequency of the ripple"},
    {.key = "ripple_max_v",         .type = FIELD_REAL, .offset = SUPPLY(ripple_max_v), .max = 100, .what = "largest ripple amplitude"},
    {.key = "ripple_max_hz",        .type = FIELD_REAL, .offset = SUPPLY(ripple_max_hz), .max = 1e6, .what = "highest ripple frequency"},
    {.key = "brownout_v",           .type = FIELD_REAL, .offset = SUPPLY(brownout_v), .max = 100, .what = "voltage below which the boards are off"},
    {.key = "hysteresis_v",         .type = FIELD_REAL, .offset = SUPPLY(hysteresis_v), .min = 1e-6, .max = 100, .what = "hysteresis: boards turn on at brownout_v + hysteresis_v"},
    {.key = "readout_resolution_v", .type = FIELD_REAL, .offset = SUPPLY(readout_resolution_v), .max = 10, .what = "resolution of the supply's voltmeter; 0: none"},
};
const struct fields scenario_supply_fields = FIELDS(supply_rows);

/* ---- rate table */

#define TABLE(m) offsetof(struct table_cfg, m)
#define AXIS(m)  offsetof(struct table_axis_cfg, m)

static const char *const along[] = {[POSE_X] = "x", [POSE_Y] = "y", [POSE_Z] = "z", NULL};
static const struct field axis_rows[] = {
    {.key = "along",                    .type = FIELD_CHOICE, .offset = AXIS(along), .choices = along, .what = "direction of the axis in the frame that carries it; z points down"},
    {.key = "rate_max_dps",             .type = FIELD_REAL, .offset = AXIS(rate_max_dps), .min = 1e-6, .max = 1e5, .what = "largest rate"},
    {.key = "accel_max_dps2",           .type = FIELD_REAL, .offset = AXIS(accel_max_dps2), .min = 1e-6, .max = 1e6, .what = "largest acceleration"},
    {.key = "angle_min_deg",            .type = FIELD_REAL, .offset = AXIS(angle_min_deg), .min = -36000, .max = 36000, .what = "lowest angle; both 0: unlimited rotation"},
    {.key = "angle_max_deg",            .type = FIELD_REAL, .offset = AXIS(angle_max_deg), .min = -36000, .max = 36000, .what = "highest angle"},
    {.key = "nonorthogonality_arcsec",  .type = FIELD_REAL, .offset = AXIS(nonorthogonality_arcsec), .min = -3600, .max = 3600, .what = "deviation from a right angle to the outer axis"},
    {.key = "wobble_arcsec",            .type = FIELD_REAL, .offset = AXIS(wobble_arcsec), .max = 3600, .what = "half-angle of the cone that the axis describes during a turn"},
    {.key = "wobble_order",             .type = FIELD_U32,  .offset = AXIS(wobble_order), .max = 3600, .what = "wobble periods per turn; 0: 1"},
    {.key = "wobble_phase_deg",         .type = FIELD_REAL, .offset = AXIS(wobble_phase_deg), .min = -360, .max = 360, .what = "phase of the wobble at angle 0"},
    {.key = "readout_noise_arcsec_rms", .type = FIELD_REAL, .offset = AXIS(readout_noise_arcsec_rms), .max = 3600, .what = "noise of the readout"},
    {.key = "readout_resolution_arcsec", .type = FIELD_REAL, .offset = AXIS(readout_resolution_arcsec), .max = 3600, .what = "resolution of the readout; 0: none"},
    {.key = "readout_delay_s",          .type = FIELD_REAL, .offset = AXIS(readout_delay_s), .max = 1, .what = "delay of the readout"},
    {.key = "readout_zero_arcsec",      .type = FIELD_REAL, .offset = AXIS(readout_zero_arcsec), .min = -3600, .max = 3600, .what = "offset of the readout"},
};
const struct fields scenario_axis_of_table_fields = FIELDS_OF(struct table_axis_cfg, axis_rows);

static bool load_axes(struct yaml_file *f, const struct yaml_node *node, void *section);

static const struct field table_rows[] = {
    {.key = "base_tilt_x_arcsec", .type = FIELD_REAL, .offset = TABLE(base_tilt_x_arcsec), .min = -36000, .max = 36000, .what = "tilt of the base about the bench's x"},
    {.key = "base_tilt_y_arcsec", .type = FIELD_REAL, .offset = TABLE(base_tilt_y_arcsec), .min = -36000, .max = 36000, .what = "tilt of the base about the bench's y"},
    {.key = "coarse", .type = FIELD_BOOL, .offset = TABLE(coarse), .what = "it shows no angles and no rates"},
    {.key = "axes", .type = FIELD_STRUCTS, .offset = TABLE(axis), .present = TABLE(axes), .sub = &scenario_axis_of_table_fields, .load = load_axes, .what = "number of axes, 1 to 3, or a sequence of axes from the outermost"},
};
const struct fields scenario_table_fields = FIELDS(table_rows);
// clang-format on

static bool check_axis(struct yaml_file *f, const struct yaml_node *node, const struct table_axis_cfg *a)
{
    const bool endless = a->angle_min_deg == 0.0 && a->angle_max_deg == 0.0;
    return endless || a->angle_min_deg < a->angle_max_deg ||
           yaml_file_fail(f, node, "axes", "expected angle_min_deg below angle_max_deg %.10g, got %.10g",
                          a->angle_max_deg, a->angle_min_deg);
}

static bool load_axes(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct table_cfg *t = section;
    const struct field number = {.key = "axes", .type = FIELD_U32, .min = 1, .max = TABLE_AXES_MAX};
    uint32_t n = yaml_count(node);
    if (node->kind == YAML_SCALAR && !yaml_load_value(f, node, &number, &n)) return false;
    if (n < 1 || n > TABLE_AXES_MAX) return yaml_file_expected(f, node, "axes", "1 to %u axes", TABLE_AXES_MAX);
    const struct table_cfg model = table_default(n);
    memcpy(t->axis, model.axis, sizeof t->axis);
    t->axes = n;
    unsigned i = 0;
    for (const struct yaml_item *item = node->first; item; item = item->next, i++) {
        char where[16];
        snprintf(where, sizeof where, "axes[%u]", i);
        if (!yaml_load(f, item->value, where, &scenario_axis_of_table_fields, &t->axis[i])) return false;
        if (!check_axis(f, item->value, &t->axis[i])) return false;
    }
    return true;
}

bool scenario_load_table(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct table_cfg *t = &((struct scenario *)section)->lab.table;
    if (!yaml_load(f, node, "table", &scenario_table_fields, t)) return false;
    if (t->axes) return true;
    const struct table_cfg model = table_default(1); /* no axes said: the model as it is */
    memcpy(t->axis, model.axis, sizeof t->axis);
    t->axes = model.axes;
    return true;
}

void scenario_dump_table(const struct field *d, const void *section, cJSON *to)
{
    const struct table_cfg *t = &((const struct scenario *)section)->lab.table;
    if (t->axes) yaml_dump(&scenario_table_fields, t, cJSON_AddObjectToObject(to, d->key));
}

/* ---- what is in two keys */

bool scenario_check_lab(struct yaml_file *f, const struct yaml_node *root, const struct lab_cfg *lab)
{
    const struct chamber_cfg *c = &lab->chamber;
    const struct supply_cfg *s = &lab->supply;
    if (!(c->min_degc <= c->start_degc && c->start_degc <= c->max_degc)) {
        return yaml_file_fail(f, yaml_at(yaml_at(root, "chamber"), "start_degc"), "chamber.start_degc",
                              "expected %.10g to %.10g (min_degc to max_degc), got %.10g", c->min_degc, c->max_degc,
                              c->start_degc);
    }
    if (s->volt_v > s->volt_max_v)
        return yaml_file_fail(f, yaml_at(yaml_at(root, "supply"), "volt_v"), "supply.volt_v",
                              "expected up to %.10g (volt_max_v), got %.10g", s->volt_max_v, s->volt_v);
    if (s->ripple_v > s->ripple_max_v || s->ripple_hz > s->ripple_max_hz)
        return yaml_file_fail(
            f, yaml_at(yaml_at(root, "supply"), "ripple_v"), "supply.ripple_v",
            "expected up to %.10g V (ripple_max_v) and %.10g Hz (ripple_max_hz), got %.10g V and %.10g Hz",
            s->ripple_max_v, s->ripple_max_hz, s->ripple_v, s->ripple_hz);
    return true;
}
