/* Commands of the truth port: hidden parameters, for graders alone. */
#include "control/commands.h"
#include "control/describe.h"

static enum control_outcome do_help(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)t_ns;
    describe_commands(c, result);
    return CONTROL_DONE;
}

static enum control_outcome do_truth(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    describe_truth(c->bench, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_state(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    describe_state(c->bench, v[0].unit, result, t_ns);
    return CONTROL_DONE;
}

static const struct control_command rows[] = {
    {"help", "Lists the commands with their arguments.", NULL, .run = do_help},
    {"truth", "Reads the hidden parameters of the bench, for graders after the estimate.", NULL, .run = do_truth},
    {"truth.state",
     "Reads the true state now: angles, rates, temperatures, supply, and the kinematics and sensor outputs of a unit.",
     CONTROL_ARGS({"unit", CONTROL_UNIT, true, .what = "unit; default: the first"}), .run = do_state},
};
const struct control_table commands_truth = {rows, sizeof rows / sizeof *rows};
