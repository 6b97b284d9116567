/* Commands that look on: events, levels, recordings. */
#include "command/events.h"
#include "control/commands.h"

#include <math.h>

#define VCD_LIMIT_MB 1000.0 /* some three minutes of a PSA-2 */

static bool check_until(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    unsigned event;
    return control_event_find(b, v[1].unit, "event", v[0].text, &event, why);
}

static enum control_outcome do_until(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    const uint64_t count = call->v[2].given ? call->v[2].count : 1;
    const double limit_s = call->v[3].given ? call->v[3].real : 60.0;
    unsigned event;
    if (call->control->waiting) return control_reject(call->control, "state", "another run is in progress");
    if (!control_event_find(b, call->v[1].unit, "event", call->v[0].text, &event, &call->control->error))
        return CONTROL_REJECTED;
    if (!b->sim.run(b->ctx, (int64_t)nearbyint(limit_s * 1e9), call->v[4].count, call->control->error.why))
        return control_failed(call->control, "state");
    control_watch_until(call->control, event, call->v[1].unit, count);
    return CONTROL_LATER;
}

static enum control_outcome do_subscribe(const struct control_call *call)
{
    const double every_s = call->v[1].given ? call->v[1].real : 0.1;
    if (!call->bench->process.push) return control_reject(call->control, "state", "no subscriptions on this bench");
    if (control_subscribe(call->control, call->control->client, (enum control_topic)call->v[0].choice,
                          (int64_t)nearbyint(every_s * 1e9), call->t_ns)) {
        return CONTROL_DONE;
    }
    return control_reject(call->control, "state", "expected up to %u subscriptions", CONTROL_SUBS_MAX);
}

static enum control_outcome do_unsubscribe(const struct control_call *call)
{
    if (call->v[0].given)
        control_unsubscribe(call->control, call->control->client, (enum control_topic)call->v[0].choice);
    else control_gone(call->control, call->control->client);
    return CONTROL_DONE;
}

static enum control_outcome do_lines(const struct control_call *call)
{
    if (!call->bench->units) return control_reject(call->control, "state", "this bench has no unit");
    const uint64_t level = control_lines(call->control, call->v[0].unit, call->t_ns);
    cJSON *lines = cJSON_AddObjectToObject(call->result, "lines");
    const struct board_type *type = call->bench->unit[call->v[0].unit]->type;
    for (unsigned i = 0; i < type->line_count; i++) {
        cJSON_AddNumberToObject(lines, type->lines[i].name, (double)(level >> i & 1));
    }
    return CONTROL_DONE;
}

static enum control_outcome do_vcd_start(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    if (!b->recording.start || !b->units) return control_reject(call->control, "state", "no recordings on this bench");
    const double limit_mb = call->v[2].given ? call->v[2].real : VCD_LIMIT_MB;
    const bool wires = call->v[3].given && call->v[3].on;
    const bool done = b->recording.start(b->ctx, call->v[0].text, call->v[1].unit, wires, (uint64_t)(limit_mb * 1e6),
                                         call->control->error.why);
    return done ? CONTROL_DONE : control_failed(call->control, "state");
}

static enum control_outcome do_vcd_stop(const struct control_call *call)
{
    if (!call->bench->recording.stop) return control_reject(call->control, "state", "no recording");
    const bool done = call->bench->recording.stop(call->bench->ctx, call->control->error.why);
    return done ? CONTROL_DONE : control_failed(call->control, "state");
}

static enum control_outcome do_vcd_flush(const struct control_call *call)
{
    const bool done = call->bench->recording.flush(call->bench->ctx, call->control->error.why);
    return done ? CONTROL_DONE : control_failed(call->control, "state");
}

// clang-format off
#define FIRST_UNIT {"unit", CONTROL_UNIT, true, .what = "unit; default: the first"}

static const struct control_command rows[] = {
    {"run.until", "Runs until an event of a board; returns whether it was reached and the number of events seen.",
     CONTROL_ARGS({"event", CONTROL_EVENT, .what = "event of the unit's board"}, FIRST_UNIT,
      {"count", CONTROL_COUNT, true, NULL, 1, CONTROL_COUNT_MAX, .what = "number of events to wait for; default: 1", .def = 1},
      {"limit_s", CONTROL_REAL, true, "s", 0, 86400, .what = "timeout; default: 60", .def = 60},
      {"after_tx", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "as in run"}), .run = do_until, .check = check_until},
    {"subscribe", "Subscribes this client to events, faults, status, or ends of files.",
     CONTROL_ARGS({"what", CONTROL_CHOICE, .what = "topic", .choices = control_topics},
      {"every_s", CONTROL_REAL, true, "s", 1e-3, 3600, .what = "interval of status in simulated time; default: 0.1", .def = 0.1}), .run = do_subscribe},
    {"unsubscribe", "Ends this client's subscription to one topic, or to all.",
     CONTROL_ARGS({"what", CONTROL_CHOICE, true, .what = "topic", .choices = control_topics}), .run = do_unsubscribe},
    {"lines", "Reads the levels of a unit's lines; with a line fault, those of 0.2 ms ago.", CONTROL_ARGS(FIRST_UNIT), .run = do_lines},
    {"vcd.start", "Starts recording the lines of a unit to a VCD file. A converter word or STEP pulse that is in progress at the start is not recorded.",
     CONTROL_ARGS({"path", CONTROL_TEXT, .what = "file to write; an existing file is replaced"}, FIRST_UNIT,
      {"limit_mb", CONTROL_REAL, true, "MB", 0.1, 1e6, .what = "size at which the recording ends; default: 1000", .def = VCD_LIMIT_MB},
      {"pairs", CONTROL_BOOL, true, .what = "with the wires A and B of differential lines; default: as --pairs says"}), .run = do_vcd_start},
    {"vcd.stop", "Stops the recording; it ends 0.2 ms before now, since later edges are not final.", NULL, .run = do_vcd_stop},
    {"vcd.flush", "Flushes the recording to the VCD file with a closing time (in the first 0.2 ms: the header only).", NULL, .run = do_vcd_flush},
};
// clang-format on
const struct control_table commands_watch = {rows, sizeof rows / sizeof *rows};
