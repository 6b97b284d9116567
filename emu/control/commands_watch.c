/* Commands that look on: events, levels, recordings. */
#include "command/events.h"
#include "control/commands.h"

#include <math.h>

static enum control_outcome from_bench(struct control *c, bool done)
{
    if (done) return CONTROL_DONE;
    c->error.code = "state";
    return CONTROL_REJECTED;
}

static bool check_until(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    unsigned event;
    return control_event_find(b, v[1].unit, "event", v[0].text, &event, why);
}

static enum control_outcome do_until(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    (void)t_ns;
    const struct control_bench *b = c->bench;
    const uint64_t count = v[2].given ? v[2].count : 1;
    const double limit_s = v[3].given ? v[3].real : 60.0;
    unsigned event;
    if (c->waiting) return control_reject(c, "state", "another run is in progress");
    if (!control_event_find(b, v[1].unit, "event", v[0].text, &event, &c->error)) return CONTROL_REJECTED;
    if (!b->sim.run(b->ctx, (int64_t)nearbyint(limit_s * 1e9), v[4].count, c->error.why)) return from_bench(c, false);
    control_watch_until(c, event, v[1].unit, count);
    return CONTROL_LATER;
}

static enum control_outcome do_subscribe(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    const double every_s = v[1].given ? v[1].real : 0.1;
    if (!c->bench->process.push) return control_reject(c, "state", "no subscriptions on this bench");
    if (control_subscribe(c, c->client, (enum control_topic)v[0].choice, (int64_t)nearbyint(every_s * 1e9), t_ns)) {
        return CONTROL_DONE;
    }
    return control_reject(c, "state", "expected up to %u subscriptions", CONTROL_SUBS_MAX);
}

static enum control_outcome do_unsubscribe(struct control *c, const struct control_value *v, cJSON *result,
                                           int64_t t_ns)
{
    (void)result;
    (void)t_ns;
    if (v[0].given) control_unsubscribe(c, c->client, (enum control_topic)v[0].choice);
    else control_gone(c, c->client);
    return CONTROL_DONE;
}

static enum control_outcome do_lines(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!c->bench->units) return control_reject(c, "state", "this bench has no unit");
    const uint64_t level = control_lines(c, v[0].unit, t_ns);
    cJSON *lines = cJSON_AddObjectToObject(result, "lines");
    const struct board_type *type = c->bench->unit[v[0].unit]->type;
    for (unsigned i = 0; i < type->line_count; i++) {
        cJSON_AddNumberToObject(lines, type->lines[i].name, (double)(level >> i & 1));
    }
    return CONTROL_DONE;
}

static enum control_outcome do_vcd_start(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    const struct control_bench *b = c->bench;
    (void)result;
    (void)t_ns;
    if (!b->recording.start || !b->units) return control_reject(c, "state", "no recordings on this bench");
    return from_bench(c, b->recording.start(b->ctx, v[0].text, v[1].unit, c->error.why));
}

static enum control_outcome do_vcd_stop(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    (void)t_ns;
    if (!c->bench->recording.stop) return control_reject(c, "state", "no recording");
    return from_bench(c, c->bench->recording.stop(c->bench->ctx, c->error.why));
}

static enum control_outcome do_vcd_flush(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    (void)result;
    (void)t_ns;
    return from_bench(c, c->bench->recording.flush(c->bench->ctx, c->error.why));
}

// clang-format off
#define FIRST_UNIT {"unit", CONTROL_UNIT, true, .what = "unit; default: the first"}

static const struct control_command rows[] = {
    {"run.until", "Runs until an event of a board; returns whether it was reached and the number of events seen.",
     CONTROL_ARGS({"event", CONTROL_EVENT, .what = "event of the unit's board"}, FIRST_UNIT,
      {"count", CONTROL_COUNT, true, NULL, 1, CONTROL_COUNT_MAX, .what = "number of events to wait for; default: 1", .def = 1},
      {"limit_s", CONTROL_REAL, true, "s", 0, 86400, .what = "timeout; default: 60", .def = 60},
      {"after_tx", CONTROL_COUNT, true, NULL, 0, CONTROL_COUNT_MAX, .what = "as in run"}), .run = do_until, .check = check_until},
    {"subscribe", "Subscribes this client to events, faults or status.",
     CONTROL_ARGS({"what", CONTROL_CHOICE, .what = "topic", .choices = control_topics},
      {"every_s", CONTROL_REAL, true, "s", 1e-3, 3600, .what = "interval of status in simulated time; default: 0.1", .def = 0.1}), .run = do_subscribe},
    {"unsubscribe", "Ends this client's subscription to one topic, or to all.",
     CONTROL_ARGS({"what", CONTROL_CHOICE, true, .what = "topic", .choices = control_topics}), .run = do_unsubscribe},
    {"lines", "Reads the levels of a unit's lines; with a line fault, those of 0.2 ms ago.", CONTROL_ARGS(FIRST_UNIT), .run = do_lines},
    {"vcd.start", "Starts recording the lines of a unit to a VCD file. A converter word or STEP pulse that is in progress at the start is not recorded.",
     CONTROL_ARGS({"path", CONTROL_TEXT, .what = "file to write; an existing file is replaced"}, FIRST_UNIT), .run = do_vcd_start},
    {"vcd.stop", "Stops the recording; it ends 0.2 ms before now, since later edges are not final.", NULL, .run = do_vcd_stop},
    {"vcd.flush", "Flushes the recording to the VCD file with a closing time (in the first 0.2 ms: the header only).", NULL, .run = do_vcd_flush},
};
// clang-format on
const struct control_table commands_watch = {rows, sizeof rows / sizeof *rows};
