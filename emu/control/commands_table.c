/* Commands of the rate table. Axes count from 1, the outermost, as on its panel. */
#include "control/commands.h"

#include <math.h>

static const char *no_table(const struct control_bench *b)
{
    return b->lab && b->lab->table.cfg.axes > 0 ? NULL : "this scenario has no rate table";
}

/* ---- what this table's axes can */

static void axis_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    *min = 1;
    *max = b->lab->table.cfg.axes;
}

static const struct table_axis_cfg *axis_of(const struct control_bench *b, const struct control_value *v)
{
    return v[0].count >= 1 && v[0].count <= b->lab->table.cfg.axes ? &b->lab->table.cfg.axis[v[0].count - 1] : NULL;
}

static void rate_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    const struct table_axis_cfg *a = axis_of(b, v);
    if (!a) return;
    if (*min < 0) *min = -a->rate_max_dps;
    *max = a->rate_max_dps;
}

static void angle_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    const struct table_axis_cfg *a = axis_of(b, v);
    if (!a || (a->angle_min_deg >= 0 && a->angle_max_deg <= 0)) return; /* both 0: without end */
    const double offset_deg = table_offset_deg(&b->lab->table, (unsigned)v[0].count - 1);
    *min = nearbyint((a->angle_min_deg + offset_deg) * 1e9) * 1e-9; /* as one would type it */
    *max = nearbyint((a->angle_max_deg + offset_deg) * 1e9) * 1e-9;
}

/* ---- commands */

static unsigned axis_index(const struct control_call *call)
{
    return (unsigned)call->v[0].count - 1;
}

static void put_shown(cJSON *to, const char *name, double value, bool shown)
{
    if (shown) cJSON_AddNumberToObject(to, name, value);
    else cJSON_AddNullToObject(to, name);
}

static enum control_outcome do_read(const struct control_call *call)
{
    const struct table *t = &call->bench->lab->table;
    const struct table_reading r = table_read(t, axis_index(call), call->t_ns);
    cJSON_AddNumberToObject(call->result, "t_s", (double)call->t_ns / 1e9);
    put_shown(call->result, "angle_deg", r.angle_deg, !t->cfg.coarse);
    put_shown(call->result, "rate_dps", r.rate_dps, !t->cfg.coarse);
    cJSON_AddStringToObject(call->result, "mode", motion_mode_name(r.mode));
    cJSON_AddBoolToObject(call->result, "at_rest", r.at_rest);
    if (r.rest_in_s >= 0) cJSON_AddNumberToObject(call->result, "rest_in_s", r.rest_in_s);
    else cJSON_AddNullToObject(call->result, "rest_in_s"); /* this motion does not end */
    return CONTROL_DONE;
}

/* A log of the readout, which the controller of the table keeps: the same numbers as readings at those instants. */
static bool check_log(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    const struct table *t = &b->lab->table;
    (void)v;
    return !t->cfg.coarse || control_reject_in(why, "state", "this table shows no angles: it is coarse");
}

static bool is_kept(const struct control_call *call, int64_t from_ns, int64_t last_ns)
{
    const int64_t known_ns = table_known_ns(&call->bench->lab->table, axis_index(call));
    if (from_ns >= known_ns && last_ns <= call->t_ns) return true;
    return control_expected(&call->control->error, "range", "from_s", NULL,
                            "instants from %.9g s, where the oldest of the last four motions begins, to now, %.9g s",
                            (double)known_ns / 1e9, (double)call->t_ns / 1e9);
}

static enum control_outcome do_log(const struct control_call *call)
{
    const struct table *t = &call->bench->lab->table;
    const int64_t from_ns = (int64_t)nearbyint(call->v[1].real * 1e9),
                  every_ns = (int64_t)nearbyint(call->v[2].real * 1e9);
    const unsigned count = (unsigned)call->v[3].count;
    if (!check_log(call->bench, call->v, &call->control->error)) return CONTROL_REJECTED;
    if (!is_kept(call, from_ns, from_ns + (int64_t)(count - 1) * every_ns)) return CONTROL_REJECTED;
    cJSON *angles = cJSON_AddArrayToObject(call->result, "angles_deg");
    for (unsigned i = 0; i < count; i++) {
        const struct table_reading r = table_read(t, axis_index(call), from_ns + (int64_t)i * every_ns);
        cJSON_AddItemToArray(angles, cJSON_CreateNumber(r.angle_deg));
    }
    return CONTROL_DONE;
}

/* Motions are tried on a copy, so that one that is rejected leaves no trace; what was before the command is sampled before
 * the copy takes the table's place. */
static enum control_outcome take_motion(const struct control_call *call, const struct table *tried,
                                        enum motion_result r)
{
    const struct table_axis_cfg *a = &tried->cfg.axis[axis_index(call)];
    if (r != MOTION_OK) {
        return control_reject(call->control, "range", "axis %u: %s; it has up to %.6g deg/s and %.6g deg/s^2",
                              axis_index(call) + 1, motion_result_text(r), a->rate_max_dps, a->accel_max_dps2);
    }
    control_settle_inputs(call->bench, call->t_ns);
    call->bench->lab->table = *tried;
    return do_read(call);
}

static enum control_outcome do_position(const struct control_call *call)
{
    struct table t = call->bench->lab->table;
    return take_motion(call, &t, table_position(&t, axis_index(call), call->v[1].real, call->v[2].real, call->t_ns));
}

static enum control_outcome do_rate(const struct control_call *call)
{
    struct table t = call->bench->lab->table;
    return take_motion(call, &t, table_rate(&t, axis_index(call), call->v[1].real, call->t_ns));
}

static enum control_outcome do_sine(const struct control_call *call)
{
    struct table t = call->bench->lab->table;
    return take_motion(call, &t, table_sine(&t, axis_index(call), call->v[1].real, call->v[2].real, call->t_ns));
}

static enum control_outcome do_profile(const struct control_call *call)
{
    const struct control_value *times = &call->v[1], *rates = &call->v[2];
    struct table t = call->bench->lab->table;
    if (times->n != rates->n)
        return control_reject(call->control, "range", "rates_dps: expected %u rates, one for each time, got %u",
                              times->n, rates->n);
    return take_motion(call, &t, table_profile(&t, axis_index(call), times->reals, rates->reals, times->n, call->t_ns));
}

static enum control_outcome do_stop(const struct control_call *call)
{
    struct table t = call->bench->lab->table;
    return take_motion(call, &t, table_stop(&t, axis_index(call), call->t_ns));
}

static enum control_outcome do_zero(const struct control_call *call)
{
    struct table t = call->bench->lab->table;
    return take_motion(call, &t, table_zero(&t, axis_index(call), call->v[1].real, call->t_ns));
}

static enum control_outcome do_reset(const struct control_call *call)
{
    struct table *t = &call->bench->lab->table;
    control_settle_inputs(call->bench, call->t_ns);
    for (unsigned i = 0; i < t->cfg.axes; i++) table_stop(t, i, call->t_ns);
    return CONTROL_DONE;
}

// clang-format off
#define AXIS {"axis", CONTROL_COUNT, false, NULL, 1, TABLE_AXES_MAX, .what = "axis number; 1 is the outermost", .def = 1, .limits = axis_limits}

static const struct control_command rows[] = {
    {"table.position", "Turns an axis to a readout angle and holds it.",
     CONTROL_ARGS(AXIS, {"angle_deg", CONTROL_REAL, false, "deg", -3.6e6, 3.6e6, .what = "target angle", .limits = angle_limits},
      {"rate_dps", CONTROL_REAL, true, "deg/s", 0, 1e5, .what = "maximum rate; 0: as fast as possible", .limits = rate_limits}),
     .missing = no_table, .run = do_position, .changes = true, .scpi = {{"AXIS#:POSition", NULL}}},
    {"table.rate", "Turns an axis at a constant rate until the next command.",
     CONTROL_ARGS(AXIS, {"rate_dps", CONTROL_REAL, false, "deg/s", -1e5, 1e5, .what = "angular rate", .limits = rate_limits}),
     .missing = no_table, .run = do_rate, .changes = true, .scpi = {{"AXIS#:RATE", NULL}}},
    {"table.sine", "Oscillates an axis about the angle at which it would stop.",
     CONTROL_ARGS(AXIS, {"amplitude_deg", CONTROL_REAL, false, "deg", 0, 360, .what = "amplitude"},
      {"frequency_hz", CONTROL_REAL, false, "Hz", 0, 1000, .what = "frequency"}),
     .missing = no_table, .run = do_sine, .changes = true, .scpi = {{"AXIS#:SINE", NULL}}},
    {"table.profile", "Runs an axis through a profile of rates; the last rate continues.",
     CONTROL_ARGS(AXIS, {"times_s", CONTROL_REALS, false, "s", 0, 1e6, .what = "start times from now, ascending"},
      {"rates_dps", CONTROL_REALS, false, "deg/s", -1e5, 1e5, .what = "angular rates, one for each time", .limits = rate_limits}),
     .missing = no_table, .run = do_profile, .changes = true, .scpi = {{"AXIS#:PROFile", NULL}}},
    {"table.stop", "Brings an axis to rest.", CONTROL_ARGS(AXIS), .missing = no_table, .run = do_stop, .changes = true, .scpi = {{"AXIS#:STOP", NULL}}},
    {"table.zero", "Sets the readout of an axis at its present position.",
     CONTROL_ARGS(AXIS, {"angle_deg", CONTROL_REAL, false, "deg", -360, 360, .what = "readout angle"}),
     .missing = no_table, .run = do_zero, .changes = true, .scpi = {{"AXIS#:ZERO", NULL}}},
    {"table.log", "Reads an axis's log: angles of the readout at past instants, back to its last four motions.",
     CONTROL_ARGS(AXIS, {"from_s", CONTROL_REAL, false, "s", 0, 1e9, .what = "first instant, time of the bench"},
      {"every_s", CONTROL_REAL, false, "s", 1e-6, 3600, .what = "interval"},
      {"count", CONTROL_COUNT, false, NULL, 1, 400, .what = "number of angles"}),
     .missing = no_table, .check = check_log, .run = do_log, .scpi = {{"AXIS#:LOG?", "angles_deg"}}},
    {"table.read", "Reads an axis: time of the reading, angle, rate, mode, at rest or not, time until rest (null: never). A coarse table shows no angle and no rate (null).", CONTROL_ARGS(AXIS), .missing = no_table, .run = do_read,
     .scpi = {{"AXIS#:POSition?", "angle_deg"}, {"AXIS#:RATE?", "rate_dps"}, {"AXIS#:MODE?", "mode"}, {"AXIS#:REST?", "at_rest"}, {"AXIS#:STAMped?", "t_s,angle_deg"}}},
    {"table.reset", "Brings all axes to rest.", NULL, .missing = no_table, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_table = {rows, sizeof rows / sizeof *rows};
