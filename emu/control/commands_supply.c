/* Commands of the laboratory supply. */
#include "control/commands.h"

static bool has_supply(const struct control_bench *b)
{
    return b->lab && b->lab->supply.cfg.present;
}

static void volt_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    (void)min;
    if (has_supply(b)) *max = b->lab->supply.cfg.volt_max_v;
}

static void ripple_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    (void)min;
    if (has_supply(b)) *max = b->lab->supply.cfg.ripple_max_v;
}

static void frequency_limits(const struct control_bench *b, const struct control_value *v, double *min, double *max)
{
    (void)v;
    (void)min;
    if (has_supply(b)) *max = b->lab->supply.cfg.ripple_max_hz;
}

static void add_supply(const struct control *c, cJSON *result, int64_t t_ns)
{
    const struct supply *s = &c->bench->lab->supply;
    cJSON_AddNumberToObject(result, "volt_v", s->set_v);
    cJSON_AddNumberToObject(result, "measured_v", supply_shown_v(s, t_ns));
    cJSON_AddBoolToObject(result, "on", s->on);
    cJSON_AddNumberToObject(result, "ripple_v", s->ripple_v);
    cJSON_AddNumberToObject(result, "ripple_hz", s->ripple_hz);
}

static enum control_outcome no_supply(struct control *c)
{
    return control_reject(c, "state", "this scenario has no power supply; its boards are always powered");
}

/* After a command: the boards that it feeds may go off or come back. */
static enum control_outcome put_supply(struct control *c, enum supply_result r, cJSON *result, int64_t t_ns)
{
    if (r != SUPPLY_OK) return control_reject(c, "range", "outside the range of the supply");
    if (c->bench->sim.supply_changed) c->bench->sim.supply_changed(c->bench->ctx, t_ns);
    add_supply(c, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_set(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_supply(c->bench)) return no_supply(c);
    control_settle_inputs(c->bench, t_ns);
    return put_supply(c, supply_set(&c->bench->lab->supply, v[0].real, t_ns), result, t_ns);
}

static enum control_outcome do_output(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_supply(c->bench)) return no_supply(c);
    control_settle_inputs(c->bench, t_ns);
    supply_output(&c->bench->lab->supply, v[0].on, t_ns);
    return put_supply(c, SUPPLY_OK, result, t_ns);
}

static enum control_outcome do_ripple(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!has_supply(c->bench)) return no_supply(c);
    control_settle_inputs(c->bench, t_ns);
    return put_supply(c, supply_ripple(&c->bench->lab->supply, v[0].real, v[1].real, t_ns), result, t_ns);
}

static enum control_outcome do_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    if (!has_supply(c->bench)) return no_supply(c);
    add_supply(c, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_reset(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    if (!has_supply(c->bench)) return no_supply(c);
    struct supply *s = &c->bench->lab->supply;
    control_settle_inputs(c->bench, t_ns);
    supply_ripple(s, s->cfg.ripple_v, s->cfg.ripple_hz > 0 ? s->cfg.ripple_hz : s->cfg.ripple_max_hz, t_ns);
    supply_set(s, s->cfg.volt_v, t_ns);
    supply_output(s, true, t_ns);
    return put_supply(c, SUPPLY_OK, result, t_ns);
}

// clang-format off
static const struct control_command rows[] = {
    {"supply.set", "Sets the supply voltage.",
     CONTROL_ARGS({"volt_v", CONTROL_REAL, false, "V", 0, 1000, .what = "output voltage", .def = 12, .limits = volt_limits}),
     .run = do_set, .changes = true, .scpi = {{"VOLTage", NULL}}},
    {"supply.output", "Switches the supply output.", CONTROL_ARGS({"on", CONTROL_BOOL, .what = "output on"}),
     .run = do_output, .changes = true, .scpi = {{"OUTPut", NULL}}},
    {"supply.ripple", "Adds a sinusoidal ripple to the voltage.",
     CONTROL_ARGS({"amplitude_v", CONTROL_REAL, false, "V", 0, 1000, .what = "ripple amplitude; 0: no ripple", .limits = ripple_limits},
      {"frequency_hz", CONTROL_REAL, false, "Hz", 1e-3, 1e6, .what = "ripple frequency", .def = 100, .limits = frequency_limits}),
     .run = do_ripple, .changes = true, .scpi = {{"RIPPle", NULL}}},
    {"supply.read", "Reads the supply: voltage set and measured, output state, ripple.", NULL, .run = do_read,
     .scpi = {{"VOLTage?", "volt_v"}, {"MEASure:VOLTage?", "measured_v"}, {"OUTPut?", "on"}, {"RIPPle?", "ripple_v,ripple_hz"}}},
    {"supply.reset", "Restores voltage and ripple of power-on, output on.", NULL, .run = do_reset, .changes = true, .scpi = {{"*RST", NULL}}},
};
// clang-format on
const struct control_table commands_supply = {rows, sizeof rows / sizeof *rows};
