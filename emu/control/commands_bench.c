/* Commands of the bench as a whole: what an operator may do. No hidden parameter is reported here. */
#include "control/commands.h"
#include "control/describe.h"

#include <math.h>

static enum control_outcome do_help(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)t_ns;
    describe_commands(c, result);
    return CONTROL_DONE;
}

static enum control_outcome do_time(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    struct control_pace p = {0};
    (void)v;
    c->bench->sim.pace(c->bench->ctx, &p);
    cJSON_AddNumberToObject(result, "t_s", (double)t_ns * 1e-9);
    cJSON_AddStringToObject(result, "pace", p.name);
    return CONTROL_DONE;
}

static enum control_outcome do_run(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    (void)t_ns;
    if (c->waiting) return control_reject(c, "state", "another run is in progress");
    const int64_t for_ns = (int64_t)nearbyint(v[0].real * 1e9);
    if (c->bench->sim.run(c->bench->ctx, for_ns, v[1].count, c->error.why)) return CONTROL_LATER;
    c->error.code = "state";
    return CONTROL_REJECTED;
}

static enum control_outcome do_units(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)t_ns;
    describe_units(c->bench, result);
    return CONTROL_DONE;
}

static enum control_outcome do_unit_reset(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    if (!v[0].given && c->bench->units != 1) {
        return control_reject(c, "argument", "unit: expected one of %u units, got nothing", c->bench->units);
    }
    const struct unit *u = c->bench->unit[v[0].unit];
    u->type->reset(u->board, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_frames(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)t_ns;
    describe_clients(c->bench, result);
    return CONTROL_DONE;
}

static enum control_outcome do_counters(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (v[0].given) {
        describe_unit_counters(c->bench, v[0].unit, result);
        return CONTROL_DONE;
    }
    describe_pace(c->bench, result);
    describe_bus(c->bench, result, t_ns);
    describe_clients(c->bench, result);
    cJSON *control = cJSON_AddObjectToObject(result, "control");
    cJSON_AddNumberToObject(control, "commands", c->commands);
    cJSON_AddNumberToObject(control, "refused", c->refused);
    cJSON *units = cJSON_AddObjectToObject(result, "units");
    for (unsigned i = 0; i < c->bench->units; i++) {
        describe_unit_counters(c->bench, i, cJSON_AddObjectToObject(units, c->bench->unit[i]->cfg.name));
    }
    return CONTROL_DONE;
}

static enum control_outcome do_endpoints(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)t_ns;
    if (!c->bench->process.endpoints) return control_reject(c, "state", "this bench has no endpoints");
    if (!c->bench->process.endpoints(c->bench->ctx, result)) return control_reject(c, "machine", "out of memory");
    return CONTROL_DONE;
}

static enum control_outcome do_quit(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    (void)t_ns;
    c->bench->process.quit(c->bench->ctx);
    return CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"help", "Lists the commands with their arguments.", NULL, .run = do_help},
    {"time", "Reads the simulated time and the pace.", NULL, .run = do_time},
    {"run", "Advances the time in step pace; replies when every event up to then has run and all output is delivered to the kernel.",
     CONTROL_ARGS({"for_s", CONTROL_REAL, false, "s", 0, 86400, .what = "simulated time to run"},
      {"after_tx", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "wait until this many frames in all have come from CAN clients, or a client's queue of 128 is full; then run"}), .run = do_run},
    {"frames", "Reads the frame counters of each CAN client and its connection number (came): delivered, taken (received from it), dropped, overrun (lost in the kernel), refused (rejected).", NULL, .run = do_frames},
    {"counters", "Reads the counters of pace, bus, clients and units, or of one unit.", CONTROL_ARGS(CONTROL_UNIT_ARG(true)), .run = do_counters},
    {"units", "Lists the units: name, board type, serial number, CAN node, profile.", NULL, .run = do_units},
    {"endpoints", "Lists the endpoints as the ready lines do: CAN adapters, instruments, line port, sockets.", NULL, .run = do_endpoints},
    {"unit.reset", "Resets a unit (PSA-2: a pulse on Res).", CONTROL_ARGS(CONTROL_UNIT_ARG(true)), .run = do_unit_reset, .changes = true},
    {"quit", "Terminates the emulator as SIGTERM does.", NULL, .run = do_quit},
};
// clang-format on
const struct control_table commands_bench = {rows, sizeof rows / sizeof *rows};
