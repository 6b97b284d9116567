/* Keys of the gyro-stabilised platform and of the vehicle under it. */
#include "scenario/keys.h"

#include <string.h>

#define PLATFORM(m) offsetof(struct platform_cfg, m)
#define VEHICLE(m)  offsetof(struct vehicle_cfg, m)
#define SWAY(m)     offsetof(struct vehicle_sway, m)
#define MAGNETIC(m) offsetof(struct magnetic_cfg, m)

// clang-format off
static const struct field platform_rows[] = {
    {.key = "step_ns",         .type = FIELD_U32, .offset = PLATFORM(step_ns), .min = 1e6, .max = 2e7, .what = "integration step (E1: 10 ms); torques act from the next step"},
    {.key = "alpha0_deg",      .type = FIELD_REAL, .offset = PLATFORM(alpha0_deg), .min = -360, .max = 360, .what = "platform azimuth angle alpha at power-on, counter-clockwise from above; the azimuth of its y axis is -alpha"},
    {.key = "beta0_deg",       .type = FIELD_REAL, .offset = PLATFORM(beta0_deg), .min = -10, .max = 10, .what = "beta at power-on, before it is levelled"},
    {.key = "drift_degph",     .type = FIELD_REALS, .offset = PLATFORM(drift_degph), .count = PLATFORM_AXES, .min = -1000, .max = 1000, .what = "systematic drift about x and about z (25: E1 about x, E0 about z)"},
    {.key = "unbalance_degph_per_g", .type = FIELD_REALS, .offset = PLATFORM(unbalance_degph_per_g), .count = PLATFORM_AXES, .min = -100, .max = 100, .what = "mass unbalance: drift about x by the specific force along x, about z by that along z (E0)"},
    {.key = "quadrature_degph_per_g", .type = FIELD_REALS, .offset = PLATFORM(quadrature_degph_per_g), .count = PLATFORM_AXES, .min = -100, .max = 100, .what = "drift about x by the specific force along z, about z by that along x (E0)"},
    {.key = "gm_sigma_degph",  .type = FIELD_REAL, .offset = PLATFORM(gm_sigma_degph), .max = 100, .what = "random drift of each axis, Gauss-Markov, standard deviation (E1); 0: none"},
    {.key = "gm_tau_s",        .type = FIELD_REAL, .offset = PLATFORM(gm_tau_s), .min = 0.1, .max = 1e7, .what = "correlation time of the random drift (E1: mu = 0.001 1/s)"},
    {.key = "gm_from_zero",    .type = FIELD_BOOL, .offset = PLATFORM(gm_from_zero), .what = "random drift starts at 0 instead of a draw from its distribution"},
    {.key = "torquer_scale",   .type = FIELD_REALS, .offset = PLATFORM(torquer_scale), .count = PLATFORM_AXES, .min = -0.5, .max = 0.5, .what = "relative error of the torquers about x and z (E0; 0.001 is typical of a good one)"},
    {.key = "torquer_limit_dps", .type = FIELD_REAL, .offset = PLATFORM(torquer_limit_dps), .min = 0.01, .max = 100, .what = "largest rate of a torquer (E0)"},
    {.key = "servo_hz",        .type = FIELD_REAL, .offset = PLATFORM(servo.hz), .max = 1000, .what = "bandwidth of the stabilising motors that follow the gyroscope's pickoffs (E0); 0: ideal"},
    {.key = "servo_dead_arcsec", .type = FIELD_REAL, .offset = PLATFORM(servo.dead_arcsec), .max = 3600, .what = "dead zone of pickoff and motor, to each side (E0)"},
    {.key = "servo_limit_dps", .type = FIELD_REAL, .offset = PLATFORM(servo.limit_dps), .min = 0.01, .max = 1000, .what = "largest rate of a motor (E0)"},
    {.key = "level_tilt_arcmin", .type = FIELD_REALS, .offset = PLATFORM(level_tilt_arcmin), .count = 2, .min = -600, .max = 600, .what = "offset of the level sensors in beta and gamma (E1)"},
    {.key = "level_repeat_arcmin", .type = FIELD_REAL, .offset = PLATFORM(level_repeat_arcmin), .max = 60, .what = "random offset of the level sensors at each setting, standard deviation (E1: 1')"},
    {.key = "angle_zero_arcmin", .type = FIELD_REAL, .offset = PLATFORM(angle_zero_arcmin), .min = -600, .max = 600, .what = "offset of the angle sensor (E1)"},
    {.key = "angle_set_arcmin", .type = FIELD_REAL, .offset = PLATFORM(angle_set_arcmin), .max = 60, .what = "random setting error at each setting, standard deviation (E1)"},
    {.key = "angle_read_arcmin", .type = FIELD_REAL, .offset = PLATFORM(angle_read_arcmin), .max = 60, .what = "random encoder error at each setting, standard deviation (E0)"},
    {.key = "angle_step_arcsec", .type = FIELD_REAL, .offset = PLATFORM(angle_step_arcsec), .max = 3600, .what = "resolution of the encoder (E0); 0: none"},
};
const struct fields scenario_platform_fields = FIELDS(platform_rows);

static const struct field sway_rows[] = {
    {.key = "pitch_arcmin", .type = FIELD_REAL, .offset = SWAY(pitch_arcmin), .max = 600, .what = "amplitude of the pitch about its mean"},
    {.key = "pitch_s",      .type = FIELD_REAL, .offset = SWAY(pitch_s), .max = 1000, .what = "period; 0: none"},
    {.key = "roll_arcmin",  .type = FIELD_REAL, .offset = SWAY(roll_arcmin), .max = 600, .what = "amplitude of the roll about its mean"},
    {.key = "roll_s",       .type = FIELD_REAL, .offset = SWAY(roll_s), .max = 1000, .what = "period; 0: none"},
    {.key = "east_mg",      .type = FIELD_REAL, .offset = SWAY(east_mg), .max = 100, .what = "amplitude of the acceleration to the east at the level sensors (1 mg = 0.00980665 m/s²); 0.3 makes gyrocompassing impossible"},
    {.key = "east_s",       .type = FIELD_REAL, .offset = SWAY(east_s), .max = 1000, .what = "period; 0: none"},
    {.key = "north_mg",     .type = FIELD_REAL, .offset = SWAY(north_mg), .max = 100, .what = "amplitude of the acceleration to the north"},
    {.key = "north_s",      .type = FIELD_REAL, .offset = SWAY(north_s), .max = 1000, .what = "period; 0: none"},
};
const struct fields scenario_sway_fields = FIELDS(sway_rows);

static const struct field vehicle_rows[] = {
    {.key = "heading_deg", .type = FIELD_REAL, .offset = VEHICLE(heading_deg), .min = -360, .max = 360, .what = "heading at power-on, from north, clockwise"},
    {.key = "pitch_deg",   .type = FIELD_REAL, .offset = VEHICLE(pitch_deg), .min = -30, .max = 30, .what = "pitch, nose up"},
    {.key = "roll_deg",    .type = FIELD_REAL, .offset = VEHICLE(roll_deg), .min = -30, .max = 30, .what = "roll, right side down"},
    {.key = "sway",        .type = FIELD_SECTION, .offset = VEHICLE(sway), .sub = &scenario_sway_fields, .what = "sway of a parked vehicle in wind, from power-on"},
    {.key = "turn_dps",    .type = FIELD_REAL, .offset = VEHICLE(turn_dps), .min = 0.01, .max = 30, .what = "rate of a change of heading (E0)"},
    {.key = "tilt_dps",    .type = FIELD_REAL, .offset = VEHICLE(tilt_dps), .min = 0.01, .max = 30, .what = "rate of a change of pitch and roll (E0)"},
    {.key = "accel_mps2",  .type = FIELD_REAL, .offset = VEHICLE(accel_mps2), .min = 0.01, .max = 30, .what = "acceleration of a change of speed (E0)"},
};
const struct fields scenario_vehicle_fields = FIELDS(vehicle_rows);

static const struct field magnetic_rows[] = {
    {.key = "declination_deg",   .type = FIELD_REAL, .offset = MAGNETIC(declination_deg), .min = -180, .max = 180, .what = "magnetic declination at the site, positive to the east"},
    {.key = "declination_slope", .type = FIELD_REAL, .offset = MAGNETIC(declination_slope), .min = -10, .max = 10, .what = "its change, degrees per degree of latitude"},
    {.key = "dip_deg",           .type = FIELD_REAL, .offset = MAGNETIC(dip_deg), .min = -85, .max = 85, .what = "dip of the field at the site, positive below the horizon"},
    {.key = "dip_slope",         .type = FIELD_REAL, .offset = MAGNETIC(dip_slope), .min = -2, .max = 2, .what = "its change, degrees per degree of latitude"},
    {.key = "horizontal_ut",     .type = FIELD_REAL, .offset = MAGNETIC(horizontal_ut), .min = 1, .max = 100, .what = "horizontal field, microtesla"},
    {.key = "pendulous",         .type = FIELD_BOOL, .offset = MAGNETIC(pendulous), .what = "the sensor hangs along the apparent vertical; false: fixed to the vehicle"},
    {.key = "tilt_arcmin",       .type = FIELD_REALS, .offset = MAGNETIC(tilt_arcmin), .count = 2, .min = -600, .max = 600, .what = "constant tilt of its plane: nose up, right side down"},
    {.key = "deviation_deg",     .type = FIELD_REALS, .offset = MAGNETIC(deviation_deg), .count = MAGNETIC_DEVIATIONS, .min = -30, .max = 30, .what = "deviation A, B, C, D, E: A + B sin m + C cos m + D sin 2m + E cos 2m"},
    {.key = "noise_ut",          .type = FIELD_REAL, .offset = MAGNETIC(noise_ut), .max = 10, .what = "noise of each component of a reading, microtesla, standard deviation"},
};
const struct fields scenario_magnetic_fields = FIELDS(magnetic_rows);
// clang-format on

bool scenario_load_vehicle(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    if (!yaml_get(f->root, "platform"))
        return yaml_file_fail(f, node, "vehicle", "expected a section platform for the vehicle to carry, got none");
    return yaml_load(f, node, "vehicle", &scenario_vehicle_fields, &((struct scenario *)section)->lab.vehicle);
}

/* ---- what is in more than one key */

static const struct scenario_unit *unit_named(const struct scenario *s, const char *name)
{
    for (unsigned i = 0; i < s->unit_count; i++)
        if (strcmp(s->units[i].name, name) == 0) return &s->units[i];
    return NULL;
}

/* The unit that reads the level sensors of a gyro unit: a PSA-2 on the platform that it hears. */
static bool check_level(struct yaml_file *f, const struct yaml_node *units, const struct scenario *s,
                        const struct scenario_unit *u)
{
    if (!u->level[0]) return true;
    const struct scenario_unit *level = unit_named(s, u->level);
    if (!level || level->cfg.type != board_types[0])
        return yaml_file_fail(f, units, "units", "%s: level: expected the name of a PSA-2, got \"%s\"", u->name,
                              u->level);
    if (level->bus != u->bus)
        return yaml_file_fail(f, units, "units",
                              "%s: level: expected a PSA-2 on bus %s, which the gyro unit receives, got %s on %s",
                              u->name, u->bus_name, level->name, level->bus_name);
    return level->cfg.mounting.on == LAB_PLATFORM ||
           yaml_file_fail(f, units, "units", "%s: level: expected a PSA-2 with on: platform, got %s", u->name,
                          level->name);
}

bool scenario_check_platform(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s)
{
    const struct yaml_node *units = yaml_get(root, "units"), *platform = yaml_get(root, "platform");
    const struct scenario_unit *gyro = NULL;
    const bool present = s->lab.platform.present;
    if (!present && s->lab.magnetic.present)
        return yaml_file_fail(f, yaml_get(root, "magnetic"), "magnetic",
                              "expected a section platform, whose vehicle carries the sensor, got none");
    if (present && !s->site.placed)
        return yaml_file_fail(f, platform, "platform", "expected site.latitude_deg, which defines north, got none");
    for (unsigned i = 0; i < s->unit_count; i++) {
        const struct scenario_unit *u = &s->units[i];
        const bool controls = board_has(u->cfg.type, "level");
        if (!present && controls)
            return yaml_file_fail(f, units, "units", "%s: expected a section platform for it to control, got none",
                                  u->name);
        if (controls && gyro)
            return yaml_file_fail(f, units, "units", "expected one gyro unit on the platform, got %s and %s",
                                  gyro->name, u->name);
        if (controls) gyro = u;
        if (controls && !check_level(f, units, s, u)) return false;
    }
    return true;
}

void scenario_bind_level(const struct scenario *s, struct scenario_unit *u)
{
    const struct scenario_unit *level = u->level[0] ? unit_named(s, u->level) : NULL;
    u->cfg.board.level_node = level ? level->cfg.node : 0;
}
