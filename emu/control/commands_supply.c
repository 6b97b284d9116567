/* Commands of the laboratory supply. */
#include "control/commands.h"

static const char *no_supply(const struct control_bench *b)
{
    return b->lab && b->lab->supply.cfg.present ? NULL
                                                : "this scenario has no power supply; its boards are always powered";
}

static enum control_outcome do_read(const struct control_call *call)
{
    const struct supply *s = &call->bench->lab->supply;
    cJSON_AddNumberToObject(call->result, "volt_v", s->set_v);
    cJSON_AddNumberToObject(call->result, "measured_v", supply_shown_v(s, call->t_ns));
    cJSON_AddBoolToObject(call->result, "on", s->on);
    cJSON_AddNumberToObject(call->result, "ripple_v", s->ripple_v);
    cJSON_AddNumberToObject(call->result, "ripple_hz", s->ripple_hz);
    return CONTROL_DONE;
}

/* After a command: the boards that it feeds may go off or come back. */
static enum control_outcome put_supply(const struct control_call *call, enum supply_result r)
{
    const struct control_bench *b = call->bench;
    if (r != SUPPLY_OK) return control_reject(call->control, "range", "outside the range of the supply");
    if (b->sim.supply_changed) b->sim.supply_changed(b->ctx, call->t_ns);
    return do_read(call);
}

static enum control_outcome do_set(const struct control_call *call)
{
    control_settle_inputs(call->bench, call->t_ns);
    return put_supply(call, supply_set(&call->bench->lab->supply, call->v[0].real, call->t_ns));
}

static enum control_outcome do_output(const struct control_call *call)
{
    control_settle_inputs(call->bench, call->t_ns);
    supply_output(&call->bench->lab->supply, call->v[0].on, call->t_ns);
    return put_supply(call, SUPPLY_OK);
}

static enum control_outcome do_ripple(const struct control_call *call)
{
    control_settle_inputs(call->bench, call->t_ns);
    return put_supply(call, supply_ripple(&call->bench->lab->supply, call->v[0].real, call->v[1].real, call->t_ns));
}

static enum control_outcome do_reset(const struct control_call *call)
{
    struct supply *s = &call->bench->lab->supply;
    control_settle_inputs(call->bench, call->t_ns);
    supply_ripple(s, s->cfg.ripple_v, s->cfg.ripple_hz > 0 ? s->cfg.ripple_hz : s->cfg.ripple_max_hz, call->t_ns);
    supply_set(s, s->cfg.volt_v, call->t_ns);
    supply_output(s, true, call->t_ns);
    return put_supply(call, SUPPLY_OK);
}

#define OF(m) offsetof(struct lab, supply.cfg.m)

// clang-format off
static const struct control_command rows[] = {
    {"supply.set", "Sets the supply voltage.",
     CONTROL_ARGS({"volt_v", CONTROL_REAL, false, "V", 0, 1000, .what = "output voltage", .def = 12, .lab_max = OF(volt_max_v)}),
     .missing = no_supply, .run = do_set, .changes = true, .scpi = {{"VOLTage", NULL}}},
    {"supply.output", "Switches the supply output.", CONTROL_ARGS({"on", CONTROL_BOOL, .what = "output on"}),
     .missing = no_supply, .run = do_output, .changes = true, .scpi = {{"OUTPut", NULL}}},
    {"supply.ripple", "Adds a sinusoidal ripple to the voltage.",
     CONTROL_ARGS({"amplitude_v", CONTROL_REAL, false, "V", 0, 1000, .what = "ripple amplitude; 0: no ripple", .lab_max = OF(ripple_max_v)},
      {"frequency_hz", CONTROL_REAL, false, "Hz", 1e-3, 1e6, .what = "ripple frequency", .def = 100, .lab_max = OF(ripple_max_hz)}),
     .missing = no_supply, .run = do_ripple, .changes = true, .scpi = {{"RIPPle", NULL}}},
    {"supply.read", "Reads the supply: voltage set and measured, output state, ripple.", NULL, .missing = no_supply, .run = do_read,
     .scpi = {{"VOLTage?", "volt_v"}, {"MEASure:VOLTage?", "measured_v"}, {"OUTPut?", "on"}, {"RIPPle?", "ripple_v,ripple_hz"}}},
    {"supply.reset", "Restores voltage and ripple of power-on, output on.", NULL, .missing = no_supply, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_supply = {rows, sizeof rows / sizeof *rows};
