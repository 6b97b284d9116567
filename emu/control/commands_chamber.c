/* Commands of the thermal chamber. */
#include "control/commands.h"

static bool has_chamber(const struct control_bench *b)
{
    return b->lab && b->lab->chamber.cfg.present;
}

static void temp_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    if (!has_chamber(b)) return;
    *min = b->lab->chamber.cfg.min_degc;
    *max = b->lab->chamber.cfg.max_degc;
}

static void ramp_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    if (!has_chamber(b)) return;
    *min = CHAMBER_RAMP_MIN_K_PER_MIN;
    *max = chamber_ramp_max_k_per_min(&b->lab->chamber);
}

static enum control_outcome put_chamber(struct control *c, cJSON *result, int64_t t_ns)
{
    const struct chamber *k = &c->bench->lab->chamber;
    const bool stable = chamber_stable(k, t_ns);
    cJSON_AddNumberToObject(result, "temp_degc", chamber_shown_degc(k, t_ns));
    cJSON_AddNumberToObject(result, "set_degc", k->set_degc);
    cJSON_AddNumberToObject(result, "ramp_k_per_min", k->ramp_k_per_min);
    cJSON_AddBoolToObject(result, "stable", stable);
    cJSON_AddNumberToObject(result, "stable_in_s", stable ? 0.0 : (double)(chamber_stable_ns(k) - t_ns) * 1e-9);
    return CONTROL_DONE;
}

static enum control_outcome no_chamber(struct control *c)
{
    return control_reject(c, "state", "this scenario has no thermal chamber");
}

static enum control_outcome do_set(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_chamber(c->bench)) return no_chamber(c);
    control_settle_inputs(c->bench, t_ns);
    if (chamber_set(&c->bench->lab->chamber, v[0].real, t_ns) == CHAMBER_OK) return put_chamber(c, result, t_ns);
    return control_reject(c, "range", "temp_degc: expected a temperature that the chamber reaches, got %.10g",
                          v[0].real);
}

static enum control_outcome do_ramp(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_chamber(c->bench)) return no_chamber(c);
    control_settle_inputs(c->bench, t_ns);
    if (chamber_ramp(&c->bench->lab->chamber, v[0].real, t_ns) == CHAMBER_OK) return put_chamber(c, result, t_ns);
    return control_reject(c, "range", "ramp_k_per_min: expected above 0, up to %.10g K/min, got %.10g",
                          chamber_ramp_max_k_per_min(&c->bench->lab->chamber), v[0].real);
}

static enum control_outcome do_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    return has_chamber(c->bench) ? put_chamber(c, result, t_ns) : no_chamber(c);
}

/* The chamber limits its ramp by itself; the greater limit removes the set one. */
static enum control_outcome do_reset(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    if (!has_chamber(c->bench)) return no_chamber(c);
    struct chamber *k = &c->bench->lab->chamber;
    const double most = chamber_ramp_max_k_per_min(k), ramp = k->cfg.ramp_k_per_min;
    control_settle_inputs(c->bench, t_ns);
    chamber_ramp(k, ramp > 0 && ramp < most ? ramp : most, t_ns);
    chamber_set(k, k->cfg.start_degc, t_ns);
    return put_chamber(c, result, t_ns);
}

// clang-format off
static const struct control_command rows[] = {
    {"chamber.set", "Sets the temperature set point; the air follows at the current ramp.",
     CONTROL_ARGS({"temp_degc", CONTROL_REAL, false, "degC", -200, 300, .what = "set point", .def = 25, .limits = temp_limits}),
     .run = do_set, .changes = true, .scpi = {{"TEMPerature", NULL}}},
    {"chamber.ramp", "Sets the ramp, the limit of the rate of change.",
     CONTROL_ARGS({"ramp_k_per_min", CONTROL_REAL, false, "K/min", 1e-6, 1000, .what = "rate of change, heating and cooling", .def = 1, .limits = ramp_limits}),
     .run = do_ramp, .changes = true, .scpi = {{"RAMP", NULL}}},
    {"chamber.read", "Reads the chamber: measured air temperature, set point, ramp, stable or not, time until stable.", NULL,
     .run = do_read, .scpi = {{"TEMPerature?", "temp_degc"}, {"TEMPerature:SETPoint?", "set_degc"}, {"RAMP?", "ramp_k_per_min"},
                              {"STABle?", "stable"}}},
    {"chamber.reset", "Restores set point and ramp of power-on.", NULL, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_chamber = {rows, sizeof rows / sizeof *rows};
