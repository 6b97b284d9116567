/* Frames on the bus from the bench itself: a host's part in scenarios without one. */
#include "command/args.h"
#include "control/commands.h"

#include "base/can_text.h"

#include <string.h>

enum { FRAME, BUS };

/* Its number, or control_bench.buses. */
static unsigned bus_of(const struct control_bench *b, const struct control_value *v)
{
    unsigned i = 0;
    if (!v[BUS].given) return 0;
    while (i < b->buses && (!b->bus_name[i] || strcmp(b->bus_name[i], v[BUS].text) != 0)) i++;
    return i;
}

static bool can_be_sent(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    struct can_msg m;
    if (!can_text_get(v[FRAME].text, &m))
        return control_expected(why, "range", "frame", WHY_TEXT(v[FRAME].text),
                                "a frame such as 609#2F00210104, 12345678#R4 or 123##01122");
    const unsigned bus = bus_of(b, v);
    if (bus < b->buses && b->host[bus]) return true;
    return control_expected(why, "range", "bus", v[BUS].given ? WHY_TEXT(v[BUS].text) : "nothing",
                            "a bus of this bench");
}

static enum control_outcome do_send(const struct control_call *call)
{
    const unsigned bus = bus_of(call->bench, call->v);
    struct can_msg m;
    (void)can_text_get(call->v[FRAME].text, &m);
    switch (can_send(call->bench->bus[bus], call->bench->host[bus], &m, call->t_ns)) {
    case CAN_OK:
        return CONTROL_DONE;
    case CAN_FULL:
        return control_reject(call->control, "state", "the queue of %u frames to send is full", CAN_QUEUE_MAX);
    default:
        return control_reject(call->control, "state", "this bus does not carry frames of this format");
    }
}

// clang-format off
static const struct control_command rows[] = {
    {"can.put", "Sends a CAN frame as a host would, in scenarios without a host.",
     CONTROL_ARGS({"frame", CONTROL_TEXT, .what = "cansend notation (can-utils), capital digits: 609#2F00210104"},
      {"bus", CONTROL_NAME, .optional = true, .what = "bus of the scenario; default: the first"}),
     .run = do_send, .changes = true, .check = can_be_sent},
};
// clang-format on
const struct control_table commands_can = {rows, sizeof rows / sizeof *rows};
