/* Commands of the thermal chamber. */
#include "control/commands.h"

static const char *no_chamber(const struct control_bench *b)
{
    return b->lab && b->lab->chamber.cfg.present ? NULL : "this scenario has no thermal chamber";
}

static void ramp_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    *min = CHAMBER_RAMP_MIN_K_PER_MIN;
    *max = chamber_ramp_max_k_per_min(&b->lab->chamber);
}

static enum control_outcome do_read(const struct control_call *call)
{
    const struct chamber *k = &call->bench->lab->chamber;
    const bool stable = chamber_stable(k, call->t_ns);
    const int64_t stable_in_ns = stable ? 0 : chamber_stable_ns(k) - call->t_ns;
    cJSON_AddNumberToObject(call->result, "temp_degc", chamber_shown_degc(k, call->t_ns));
    cJSON_AddNumberToObject(call->result, "set_degc", k->set_degc);
    cJSON_AddNumberToObject(call->result, "ramp_k_per_min", k->ramp_k_per_min);
    cJSON_AddBoolToObject(call->result, "stable", stable);
    cJSON_AddNumberToObject(call->result, "stable_in_s", (double)stable_in_ns * 1e-9);
    return CONTROL_DONE;
}

static enum control_outcome do_set(const struct control_call *call)
{
    const double degc = call->v[0].real;
    control_settle_inputs(call->bench, call->t_ns);
    if (chamber_set(&call->bench->lab->chamber, degc, call->t_ns) == CHAMBER_OK) return do_read(call);
    return control_reject(call->control, "range",
                          "temp_degc: expected a temperature that the chamber reaches, got %.10g", degc);
}

static enum control_outcome do_ramp(const struct control_call *call)
{
    struct chamber *k = &call->bench->lab->chamber;
    const double ramp = call->v[0].real;
    control_settle_inputs(call->bench, call->t_ns);
    if (chamber_ramp(k, ramp, call->t_ns) == CHAMBER_OK) return do_read(call);
    return control_reject(call->control, "range", "ramp_k_per_min: expected above 0, up to %.10g K/min, got %.10g",
                          chamber_ramp_max_k_per_min(k), ramp);
}

/* The chamber limits its ramp by itself; the greater limit removes the set one. */
static enum control_outcome do_reset(const struct control_call *call)
{
    struct chamber *k = &call->bench->lab->chamber;
    const double most = chamber_ramp_max_k_per_min(k), ramp = k->cfg.ramp_k_per_min;
    control_settle_inputs(call->bench, call->t_ns);
    chamber_ramp(k, ramp > 0 && ramp < most ? ramp : most, call->t_ns);
    chamber_set(k, k->cfg.start_degc, call->t_ns);
    return do_read(call);
}

#define OF(m) offsetof(struct lab, chamber.cfg.m)

// clang-format off
static const struct control_command rows[] = {
    {"chamber.set", "Sets the temperature set point; the air follows at the current ramp.",
     CONTROL_ARGS({"temp_degc", CONTROL_REAL, false, "degC", -200, 300, .what = "set point", .def = 25, .lab_min = OF(min_degc), .lab_max = OF(max_degc)}),
     .missing = no_chamber, .run = do_set, .changes = true, .scpi = {{"TEMPerature", NULL}}},
    {"chamber.ramp", "Sets the ramp, the limit of the rate of change.",
     CONTROL_ARGS({"ramp_k_per_min", CONTROL_REAL, false, "K/min", 1e-6, 1000, .what = "rate of change, heating and cooling", .def = 1, .limits = ramp_limits}),
     .missing = no_chamber, .run = do_ramp, .changes = true, .scpi = {{"RAMP", NULL}}},
    {"chamber.read", "Reads the chamber: measured air temperature, set point, ramp, stable or not, time until stable.", NULL,
     .missing = no_chamber, .run = do_read, .scpi = {{"TEMPerature?", "temp_degc"}, {"TEMPerature:SETPoint?", "set_degc"}, {"RAMP?", "ramp_k_per_min"},
                              {"STABle?", "stable"}}},
    {"chamber.reset", "Restores set point and ramp of power-on.", NULL, .missing = no_chamber, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_chamber = {rows, sizeof rows / sizeof *rows};
