/* Commands of the rate table. Axes count from 1, the outermost, as on its panel. */
#include "control/commands.h"

#include <math.h>

static bool has_table(const struct control_bench *b)
{
    return b->lab && b->lab->table.cfg.axes > 0;
}

/* ---- what this table's axes can */

static void axis_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    if (!has_table(b)) return; /* the handler says so */
    *min = 1;
    *max = b->lab->table.cfg.axes;
}

static const struct table_axis_cfg *axis_of(const struct control_bench *b, const struct control_value *v)
{
    return has_table(b) && v[0].count >= 1 && v[0].count <= b->lab->table.cfg.axes
               ? &b->lab->table.cfg.axis[v[0].count - 1]
               : NULL;
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

static void add_axis(const struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    const struct table_reading r = table_read(&c->bench->lab->table, (unsigned)v[0].count - 1, t_ns);
    cJSON_AddNumberToObject(result, "angle_deg", r.angle_deg);
    cJSON_AddNumberToObject(result, "rate_dps", r.rate_dps);
    cJSON_AddStringToObject(result, "mode", motion_mode_name(r.mode));
    cJSON_AddBoolToObject(result, "at_rest", r.at_rest);
    if (r.rest_in_s >= 0) cJSON_AddNumberToObject(result, "rest_in_s", r.rest_in_s);
    else cJSON_AddNullToObject(result, "rest_in_s"); /* this motion does not end */
}

static enum control_outcome no_table(struct control *c)
{
    return control_reject(c, "state", "this scenario has no rate table");
}

static enum control_outcome reject_motion(struct control *c, enum motion_result r, const struct control_value *v)
{
    const struct table_axis_cfg *a = axis_of(c->bench, v);
    return control_reject(c, "range", "axis %u: %s; it has up to %.6g deg/s and %.6g deg/s^2", (unsigned)v[0].count,
                          motion_result_text(r), a ? a->rate_max_dps : 0.0, a ? a->accel_max_dps2 : 0.0);
}

/* Motions are tried on a copy, so that one that is rejected leaves no trace; what was before the command is sampled before
 * the copy takes the table's place. */
static enum control_outcome take_motion(struct control *c, const struct table *tried, enum motion_result r,
                                        const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (r != MOTION_OK) return reject_motion(c, r, v);
    control_settle_inputs(c->bench, t_ns);
    c->bench->lab->table = *tried;
    add_axis(c, v, result, t_ns);
    return CONTROL_DONE;
}

static unsigned axis_index(const struct control_value *v)
{
    return (unsigned)v[0].count - 1;
}

static enum control_outcome do_position(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_position(&t, axis_index(v), v[1].real, v[2].real, t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_rate(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_rate(&t, axis_index(v), v[1].real, t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_sine(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_sine(&t, axis_index(v), v[1].real, v[2].real, t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_profile(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    if (v[1].n != v[2].n)
        return control_reject(c, "range", "rates_dps: expected %u rates, one for each time, got %u", v[1].n, v[2].n);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_profile(&t, axis_index(v), v[1].reals, v[2].reals, v[1].n, t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_stop(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_stop(&t, axis_index(v), t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_zero(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    struct table t = c->bench->lab->table;
    const enum motion_result r = table_zero(&t, axis_index(v), v[1].real, t_ns);
    return take_motion(c, &t, r, v, result, t_ns);
}

static enum control_outcome do_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_table(c->bench)) return no_table(c);
    add_axis(c, v, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_reset(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    if (!has_table(c->bench)) return no_table(c);
    control_settle_inputs(c->bench, t_ns);
    for (unsigned i = 0; i < c->bench->lab->table.cfg.axes; i++) table_stop(&c->bench->lab->table, i, t_ns);
    return CONTROL_DONE;
}

// clang-format off
#define AXIS {"axis", CONTROL_COUNT, false, NULL, 1, TABLE_AXES_MAX, .what = "axis number; 1 is the outermost", .def = 1, .limits = axis_limits}

static const struct control_command rows[] = {
    {"table.position", "Turns an axis to a readout angle and holds it.",
     CONTROL_ARGS(AXIS, {"angle_deg", CONTROL_REAL, false, "deg", -3.6e6, 3.6e6, .what = "target angle", .limits = angle_limits},
      {"rate_dps", CONTROL_REAL, true, "deg/s", 0, 1e5, .what = "maximum rate; 0: as fast as possible", .limits = rate_limits}),
     .run = do_position, .changes = true, .scpi = {{"AXIS#:POSition", NULL}}},
    {"table.rate", "Turns an axis at a constant rate until the next command.",
     CONTROL_ARGS(AXIS, {"rate_dps", CONTROL_REAL, false, "deg/s", -1e5, 1e5, .what = "angular rate", .limits = rate_limits}),
     .run = do_rate, .changes = true, .scpi = {{"AXIS#:RATE", NULL}}},
    {"table.sine", "Oscillates an axis about the angle at which it would stop.",
     CONTROL_ARGS(AXIS, {"amplitude_deg", CONTROL_REAL, false, "deg", 0, 360, .what = "amplitude"},
      {"frequency_hz", CONTROL_REAL, false, "Hz", 0, 1000, .what = "frequency"}),
     .run = do_sine, .changes = true, .scpi = {{"AXIS#:SINE", NULL}}},
    {"table.profile", "Runs an axis through a profile of rates; the last rate continues.",
     CONTROL_ARGS(AXIS, {"times_s", CONTROL_REALS, false, "s", 0, 1e6, .what = "start times from now, ascending"},
      {"rates_dps", CONTROL_REALS, false, "deg/s", -1e5, 1e5, .what = "angular rates, one for each time", .limits = rate_limits}),
     .run = do_profile, .changes = true, .scpi = {{"AXIS#:PROFile", NULL}}},
    {"table.stop", "Brings an axis to rest.", CONTROL_ARGS(AXIS), .run = do_stop, .changes = true, .scpi = {{"AXIS#:STOP", NULL}}},
    {"table.zero", "Sets the readout of an axis at its present position.",
     CONTROL_ARGS(AXIS, {"angle_deg", CONTROL_REAL, false, "deg", -360, 360, .what = "readout angle"}),
     .run = do_zero, .changes = true, .scpi = {{"AXIS#:ZERO", NULL}}},
    {"table.read", "Reads an axis: angle, rate, mode, at rest or not, time until rest (null: never).", CONTROL_ARGS(AXIS), .run = do_read,
     .scpi = {{"AXIS#:POSition?", "angle_deg"}, {"AXIS#:RATE?", "rate_dps"}, {"AXIS#:MODE?", "mode"}, {"AXIS#:REST?", "at_rest"}}},
    {"table.reset", "Brings all axes to rest.", NULL, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_table = {rows, sizeof rows / sizeof *rows};
