/* Commands that save the bench, double it, and part the two. */
#include "control/commands.h"

#include "fault/fault.h"

static const char unavailable[] = "not available on this bench";

static enum control_outcome do_snapshot(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    if (!b->process.snapshot) return control_reject(call->control, "state", unavailable);
    const bool done = b->process.snapshot(b->ctx, call->v[0].text, call->result, call->control->error.why);
    return done ? CONTROL_DONE : control_failed(call->control, "state");
}

static enum control_outcome do_fork(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    if (!b->process.fork) return control_reject(call->control, "state", unavailable);
    const struct control_fork f = {.control = call->v[0].text,
                                   .can = call->v[1].given ? call->v[1].text : "none",
                                   .truth = call->v[2].given ? call->v[2].text : NULL,
                                   .seed = call->v[3].given ? &call->v[3].count : NULL};
    const bool done = b->process.fork(b->ctx, &f, call->result, call->control->error.why);
    return done ? CONTROL_DONE : control_failed(call->control, "machine");
}

static enum control_outcome do_reseed(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    const uint64_t seed = call->v[0].count;
    control_settle_inputs(b, call->t_ns);
    lab_reseed(b->lab, seed, call->t_ns);
    for (unsigned i = 0; i < b->units; i++) unit_reseed(b->unit[i], seed, call->t_ns);
    if (b->faults) fault_reseed(b->faults, seed, call->t_ns);
    return CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"snapshot", "Saves the state of the bench to a file for psa-emu --restore.",
     CONTROL_ARGS({"path", CONTROL_TEXT, .what = "file to write; an existing file is replaced"}), .run = do_snapshot},
    {"fork", "Forks the emulator: a child continues from the current state with its own endpoints, until its own quit.",
     CONTROL_ARGS({"control", CONTROL_TEXT, .what = "path of the child's control socket"},
      {"can", CONTROL_TEXT, true, .what = "child's CAN adapters as for --can, separated by spaces; default: none"},
      {"truth", CONTROL_TEXT, true, .what = "path of the child's truth port; default: none"},
      {"seed", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "the child begins with reseed and this seed; default: it has the parent's noise"}), .run = do_fork},
    {"reseed", "Takes noise from another seed from now on; units, instruments, their present state and the list of active faults stay as they are.",
     CONTROL_ARGS({"seed", CONTROL_COUNT, false, NULL, 0, CONTROL_COUNT_MAX, .what = "seed of the noise, of random errors of instruments, of what is random in faults"}),
     .run = do_reseed, .changes = true},
};
// clang-format on
const struct control_table commands_snapshot = {rows, sizeof rows / sizeof *rows};
