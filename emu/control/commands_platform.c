/* Commands of the vehicle under the gyro-stabilised platform, and of the gyro unit's panel. */
#include "command/args.h"
#include "control/commands.h"

static bool has_vehicle(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    (void)v;
    return (b->lab && b->lab->platform.cfg.present) ||
           control_reject_in(why, "state", "this scenario has no platform and no vehicle");
}

static struct vehicle *settled_vehicle(const struct control_call *call)
{
    control_settle_inputs(call->bench, call->t_ns);
    return platform_vehicle(&call->bench->lab->platform, call->t_ns);
}

static enum control_outcome do_attitude(const struct control_call *call)
{
    const struct control_value *v = call->v;
    vehicle_attitude(settled_vehicle(call), v[0].real, v[1].real, v[2].real, call->t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_sway(const struct control_call *call)
{
    const struct control_value *v = call->v;
    const struct vehicle_sway sway = {.pitch_arcmin = v[0].real,
                                      .pitch_s = v[1].real,
                                      .roll_arcmin = v[2].real,
                                      .roll_s = v[3].real,
                                      .east_mg = v[4].real,
                                      .east_s = v[5].real,
                                      .north_mg = v[6].real,
                                      .north_s = v[7].real};
    vehicle_sway(settled_vehicle(call), &sway, call->t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_fly(const struct control_call *call)
{
    vehicle_fly(settled_vehicle(call), call->v[0].real, call->v[1].real, call->t_ns);
    return CONTROL_DONE;
}

/* ---- the panel */

static const char *const modes[] = {"off", "level", "hold", "slew", "gyrocompass", "calibrate", "navigate", NULL};

static bool has_modes(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    const struct unit *u = b->unit[v[0].unit];
    return u->type->platform ||
           control_reject_in(why, "state", "unit: expected a gyro unit, got %s, a %s", u->cfg.name, u->type->title);
}

static enum control_outcome do_mode(const struct control_call *call)
{
    struct unit *u = call->bench->unit[call->v[0].unit];
    const char *why = u->type->platform->set_mode(u->board, call->v[1].choice, call->t_ns);
    return why ? control_reject(call->control, "state", "%s", why) : CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"vehicle.attitude", "Sets the mean attitude of the vehicle; it turns at the scenario's rates.",
     CONTROL_ARGS({"heading_deg", CONTROL_REAL, false, "deg", -360, 360, .what = "heading from north, clockwise; turns the shorter way"},
      {"pitch_deg", CONTROL_REAL, false, "deg", -30, 30, .what = "pitch, nose up"},
      {"roll_deg", CONTROL_REAL, false, "deg", -30, 30, .what = "roll, right side down"}), .run = do_attitude, .changes = true, .check = has_vehicle},
    {"vehicle.sway", "Sets the sway of the vehicle about its mean attitude; amplitude or period 0: no sway.",
     CONTROL_ARGS({"pitch_arcmin", CONTROL_REAL, false, "arcmin", 0, 600, .what = "pitch amplitude"},
      {"pitch_s", CONTROL_REAL, false, "s", 0, 1000, .what = "pitch period"},
      {"roll_arcmin", CONTROL_REAL, false, "arcmin", 0, 600, .what = "roll amplitude"},
      {"roll_s", CONTROL_REAL, false, "s", 0, 1000, .what = "roll period"},
      {"east_mg", CONTROL_REAL, true, "mg", 0, 100, .what = "east acceleration amplitude"},
      {"east_s", CONTROL_REAL, true, "s", 0, 1000, .what = "east period"},
      {"north_mg", CONTROL_REAL, true, "mg", 0, 100, .what = "north acceleration amplitude"},
      {"north_s", CONTROL_REAL, true, "s", 0, 1000, .what = "north period"}), .run = do_sway, .changes = true, .check = has_vehicle},
    {"vehicle.fly", "Sets the vehicle's speed and track (its heading); 0 m/s: parked.",
     CONTROL_ARGS({"speed_mps", CONTROL_REAL, false, "m/s", 0, 1000, .what = "ground speed"},
      {"track_deg", CONTROL_REAL, false, "deg", -360, 360, .what = "track from north, clockwise"}), .run = do_fly, .changes = true, .check = has_vehicle},
    {"gyro.mode", "Sets the mode of a gyro unit, as its object 2100h does.",
     CONTROL_ARGS(CONTROL_UNIT_ARG(false), {"mode", CONTROL_CHOICE, .what = "mode of the unit", .choices = modes}), .run = do_mode, .changes = true, .check = has_modes},
};
// clang-format on
const struct control_table commands_platform = {rows, sizeof rows / sizeof *rows};
