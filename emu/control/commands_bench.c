/* Commands of the bench as a whole: what an operator may do. No hidden parameter is reported here. */
#include "control/commands.h"
#include "control/describe.h"

#include <math.h>

static enum control_outcome do_time(const struct control_call *call)
{
    struct control_pace p = {0};
    call->bench->sim.pace(call->bench->ctx, &p);
    cJSON_AddNumberToObject(call->result, "t_s", (double)call->t_ns * 1e-9);
    cJSON_AddStringToObject(call->result, "pace", p.name);
    return CONTROL_DONE;
}

static enum control_outcome do_run(const struct control_call *call)
{
    if (call->control->waiting) return control_reject(call->control, "state", "another run is in progress");
    const struct control_value *v = call->v;
    const int64_t for_ns = (int64_t)nearbyint(v[0].real * 1e9);
    const int64_t every_ns = v[4].given ? (int64_t)nearbyint(v[4].real * 1e9) : 1000000;
    const int64_t piece_ns = v[2].given && every_ns < for_ns ? every_ns : for_ns;
    if (!call->bench->sim.run(call->bench->ctx, piece_ns, v[1].count, call->control->error.why))
        return control_failed(call->control, "state");
    call->control->arrival = (struct control_arrival){.active = v[2].given,
                                                      .any = !v[3].given,
                                                      .connection = (uint32_t)v[3].count,
                                                      .rx = v[2].count,
                                                      .piece_ns = piece_ns,
                                                      .piece_end_ns = call->t_ns + piece_ns,
                                                      .end_ns = call->t_ns + for_ns};
    return CONTROL_LATER;
}

static enum control_outcome do_unit_reset(const struct control_call *call)
{
    if (!call->v[0].given && call->bench->units != 1) {
        return control_reject(call->control, "argument", "unit: expected one of %u units, got nothing",
                              call->bench->units);
    }
    const struct unit *u = call->bench->unit[call->v[0].unit];
    u->type->reset(u->board, call->t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_unit_sensors(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    const char *why;
    struct unit *u = b->unit[call->v[0].unit];
    control_settle_inputs(b, call->t_ns);
    if (unit_exchange_sensors(u, (uint32_t)call->v[1].count, call->t_ns, &why)) return CONTROL_DONE;
    return control_reject(call->control, "state", "unit %s: %s", u->cfg.name, why);
}

static enum control_outcome do_frames(const struct control_call *call)
{
    describe_clients(call->bench, call->result);
    return CONTROL_DONE;
}

static enum control_outcome do_counters(const struct control_call *call)
{
    if (call->v[0].given) {
        describe_unit_counters(call->bench, call->v[0].unit, call->result);
        return CONTROL_DONE;
    }
    describe_pace(call->bench, call->result);
    describe_bus(call->bench, call->result, call->t_ns);
    describe_clients(call->bench, call->result);
    cJSON *control = cJSON_AddObjectToObject(call->result, "control");
    cJSON_AddNumberToObject(control, "commands", call->control->commands);
    cJSON_AddNumberToObject(control, "refused", call->control->refused);
    if (call->bench->process.files) call->bench->process.files(call->bench->ctx, call->result);
    cJSON *units = cJSON_AddObjectToObject(call->result, "units");
    for (unsigned i = 0; i < call->bench->units; i++) {
        describe_unit_counters(call->bench, i, cJSON_AddObjectToObject(units, call->bench->unit[i]->cfg.name));
    }
    return CONTROL_DONE;
}

static enum control_outcome do_endpoints(const struct control_call *call)
{
    if (!call->bench->process.endpoints) return control_reject(call->control, "state", "this bench has no endpoints");
    if (!call->bench->process.endpoints(call->bench->ctx, call->result))
        return control_reject(call->control, "machine", "out of memory");
    return CONTROL_DONE;
}

static enum control_outcome do_quit(const struct control_call *call)
{
    call->bench->process.quit(call->bench->ctx);
    return CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"help", "Lists the commands with their arguments.", NULL, .run = describe_commands},
    {"time", "Reads the simulated time and the pace.", NULL, .run = do_time},
    {"run", "Advances the time in step pace; replies when every event up to then has run and all output is delivered to the kernel.",
     CONTROL_ARGS({"for_s", CONTROL_REAL, false, "s", 0, 86400, .what = "simulated time to run"},
      {"after_tx", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "wait until this many frames in all have come from CAN clients, or a client's queue of 128 is full; then run"},
      {"rx", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "end early, at the first whole every_s at which this many frames in all have been delivered to a CAN client"},
      {"client", CONTROL_COUNT, true, NULL, 0, 4294967295.0, .what = "that client's connection number; default: the one that has been on the bus longest"},
      {"every_s", CONTROL_REAL, true, "s", 1e-6, 1, .what = "how often that is looked at, in simulated time; default: 0.001", .def = 0.001}), .run = do_run},
    {"frames", "Reads the frame counters of each CAN client and its connection number (came): delivered, taken (received from it), dropped, overrun (lost in the kernel), refused (rejected).", NULL, .run = do_frames},
    {"counters", "Reads the counters of pace, bus, clients, files, input log and units, or of one unit.", CONTROL_ARGS(CONTROL_UNIT_ARG(true)), .run = do_counters},
    {"units", "Lists the units: name, board type, serial number, CAN node, profile.", NULL, .run = describe_units},
    {"endpoints", "Lists the endpoints as the ready lines do: CAN adapters, instruments, line port, sockets.", NULL, .run = do_endpoints},
    {"unit.reset", "Resets a unit (PSA-2: a pulse on Res).", CONTROL_ARGS(CONTROL_UNIT_ARG(true)), .run = do_unit_reset, .changes = true},
    {"unit.sensors", "Exchanges the quartz sensors of a unit for those of another serial number of its batch, as warm as they are; the board stays.",
     CONTROL_ARGS(CONTROL_UNIT_ARG(false),
      {"serial", CONTROL_COUNT, false, NULL, 1, 4294967295.0, .what = "serial number that the sensors are drawn by, with their noise and their starts"}), .run = do_unit_sensors, .changes = true},
    {"quit", "Terminates the emulator as SIGTERM does.", NULL, .run = do_quit},
};
// clang-format on
const struct control_table commands_bench = {rows, sizeof rows / sizeof *rows};
