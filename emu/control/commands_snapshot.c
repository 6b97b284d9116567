/* Commands that save the bench or double it. */
#include "control/commands.h"

static enum control_outcome reject_unavailable(struct control *c)
{
    return control_reject(c, "state", "not available on this bench");
}

static enum control_outcome do_snapshot(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)t_ns;
    if (!c->bench->process.snapshot) return reject_unavailable(c);
    c->error.code = "state";
    return c->bench->process.snapshot(c->bench->ctx, v[0].text, result, c->error.why) ? CONTROL_DONE : CONTROL_REJECTED;
}

static enum control_outcome do_fork(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)t_ns;
    if (!c->bench->process.fork) return reject_unavailable(c);
    const struct control_fork f = {
        .control = v[0].text, .can = v[1].given ? v[1].text : "none", .truth = v[2].given ? v[2].text : NULL};
    c->error.code = "machine";
    return c->bench->process.fork(c->bench->ctx, &f, result, c->error.why) ? CONTROL_DONE : CONTROL_REJECTED;
}

// clang-format off
static const struct control_command rows[] = {
    {"snapshot", "Saves the state of the bench to a file for psa-emu --restore.",
     CONTROL_ARGS({"path", CONTROL_TEXT, .what = "file to write; an existing file is replaced"}), .run = do_snapshot},
    {"fork", "Forks the emulator: a child continues from the current state with its own endpoints, until its own quit.",
     CONTROL_ARGS({"control", CONTROL_TEXT, .what = "path of the child's control socket"},
      {"can", CONTROL_TEXT, true, .what = "child's CAN adapters as for --can, separated by spaces; default: none"},
      {"truth", CONTROL_TEXT, true, .what = "path of the child's truth port; default: none"}), .run = do_fork},
};
// clang-format on
const struct control_table commands_snapshot = {rows, sizeof rows / sizeof *rows};
