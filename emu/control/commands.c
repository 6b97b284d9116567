/* The commands of the control socket: what an operator of the bench may do. No hidden parameter is told here. */
#include "control/control.h"
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
    c->bench->pace(c->bench->ctx, &p);
    cJSON_AddNumberToObject(result, "t_s", (double)t_ns * 1e-9);
    cJSON_AddStringToObject(result, "pace", p.name);
    return CONTROL_DONE;
}

static enum control_outcome do_run(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    (void)t_ns;
    if (c->waiting) return control_refuse(c, "state", "another run is under way");
    const int64_t for_ns = (int64_t)nearbyint(v[0].real * 1e9);
    if (!c->bench->run(c->bench->ctx, for_ns, v[1].count, c->why)) {
        c->code = "state";
        return CONTROL_REFUSED;
    }
    return CONTROL_LATER;
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
        return control_refuse(c, "argument", "unit is missing: there are %u units", c->bench->units);
    }
    psa2_reset(&c->bench->unit[v[0].unit]->board, t_ns);
    return CONTROL_DONE;
}

static void add_head(const struct head *h, cJSON *result, int64_t t_ns)
{
    const bool rest = head_at_rest(h, t_ns);
    cJSON_AddNumberToObject(result, "angle_deg", head_read_deg(h, t_ns));
    cJSON_AddStringToObject(result, "face", head_face_name(h->face));
    cJSON_AddBoolToObject(result, "at_rest", rest);
    cJSON_AddNumberToObject(result, "rest_in_s", rest ? 0.0 : (double)(head_rest_ns(h) - t_ns) * 1e-9);
}

/* The converters take their inputs in blocks: what was before the change must be sampled before it. */
static void settle_inputs(const struct control_bench *b, int64_t t_ns)
{
    for (unsigned i = 0; i < b->units; i++) psa2_sample_until(&b->unit[i]->board, t_ns);
}

static enum control_outcome do_head_turn(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!head_at_rest(c->bench->head, t_ns)) {
        return control_refuse(c, "state", "the head is turning, at rest in %.3f s",
                              (double)(head_rest_ns(c->bench->head) - t_ns) * 1e-9);
    }
    settle_inputs(c->bench, t_ns);
    head_turn(c->bench->head, v[0].real, t_ns);
    add_head(c->bench->head, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_head_mount(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!head_at_rest(c->bench->head, t_ns)) return control_refuse(c, "state", "the head is turning");
    settle_inputs(c->bench, t_ns);
    head_mount(c->bench->head, v[0].face, t_ns);
    add_head(c->bench->head, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_head_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    add_head(c->bench->head, result, t_ns);
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

static enum control_outcome do_vcd_flush(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    (void)t_ns;
    c->code = "state";
    return c->bench->vcd_flush(c->bench->ctx, c->why) ? CONTROL_DONE : CONTROL_REFUSED;
}

static enum control_outcome do_quit(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    (void)t_ns;
    c->bench->quit(c->bench->ctx);
    return CONTROL_DONE;
}

#define UNIT_ARG(is_optional)                                                                                          \
    {                                                                                                                  \
        "unit", CONTROL_UNIT, is_optional, 0, 0, "name of a unit of the scenario"                                      \
    }

// clang-format off
const struct control_command control_commands[] = {
    {"help", "Lists the commands with their arguments.", {{0}}, do_help},
    {"time", "Tells the simulated time and the pace.", {{0}}, do_time},
    {"run", "Moves the time in step pace; the answer comes when everything due has run and all output is with the kernel.",
     {{"for_s", CONTROL_REAL, false, 0, 86400, "simulated seconds"},
      {"after_tx", CONTROL_COUNT, true, 0, 9007199254740991.0, "start once this many frames have been taken from CAN clients"}}, do_run},
    {"frames", "Counts the CAN frames of each client: delivered to it, taken from it, dropped, lost in the kernel, refused.", {{0}}, do_frames},
    {"counters", "Tells the counters of pace, bus, clients and units; with a unit, that unit's alone.", {UNIT_ARG(true)}, do_counters},
    {"units", "Lists the units: name, serial number, CAN node, board profile.", {{0}}, do_units},
    {"unit.reset", "Pulses Res of a unit.", {UNIT_ARG(true)}, do_unit_reset},
    {"head.turn", "Turns the dividing head; it takes the scenario's turn_s.",
     {{"angle_deg", CONTROL_REAL, false, -3600, 3600, "degrees on the head's scale"}}, do_head_turn},
    {"head.mount", "Puts the units on the head's mount with another face.",
     {{"face", CONTROL_FACE, false, 0, 0, "direct, reversed, side or side_reversed"}}, do_head_mount},
    {"head.read", "Reads the head's scale.", {{0}}, do_head_read},
    {"vcd.flush", "Writes to the VCD file what has been recorded so far, with a closing time.", {{0}}, do_vcd_flush},
    {"quit", "Ends the emulator as SIGTERM does.", {{0}}, do_quit},
};
// clang-format on
const unsigned control_command_count = sizeof control_commands / sizeof *control_commands;

/* ---- the truth port */

static enum control_outcome do_truth(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    describe_truth(c->bench, result, t_ns);
    return CONTROL_DONE;
}

const struct control_command control_truth[] = {
    {"help", "Lists the commands with their arguments.", {{0}}, do_help},
    {"truth", "Tells the hidden parameters of the bench: for graders, after the estimate is made.", {{0}}, do_truth},
};
const unsigned control_truth_count = sizeof control_truth / sizeof *control_truth;
