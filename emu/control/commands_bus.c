/* Traffic from the bench itself: cycles on the parallel bus of a board that has one; frames on CAN, a host's part in
 * scenarios without one. */
#include "command/args.h"
#include "control/commands.h"

#include "base/can/text.h"

#include <string.h>

/* ---- cycles */

enum { UNIT, ADDRESS, READ_STROBE, DATA = READ_STROBE, WRITE_STROBE };

#define TIMEOUT_NS (10 * NS_PER_S) /* simulated; a strobe is a second at most */

static enum control_outcome submit_cycle(struct control *c, struct control_cycle *k, int64_t t_ns)
{
    const struct control_bench *b = c->bench;
    const struct unit *u = b->unit[k->unit];
    const enum board_cycle_result r = u->type->bus->submit(u->board, &k->cycle, t_ns);
    if (r != BOARD_CYCLE_OK) {
        k->control = NULL;
        return control_cycle_reject(c, k, r);
    }
    c->started = k;
    if (k->client && control_by_step(b) && !b->sim.run(b->ctx, TIMEOUT_NS, 0, c->error.why)) {
        k->client = NULL; /* it goes its way, no client waits */
        return control_failed(c, "state");
    }
    return CONTROL_LATER;
}

static enum control_outcome start_cycle(const struct control_call *call, bool write)
{
    struct control *c = call->control;
    const struct control_value *v = call->v, *strobe = &v[write ? WRITE_STROBE : READ_STROBE];
    struct control_cycle *k = control_cycle_free(c);
    if (!k) return control_reject(c, "state", "expected up to %u cycles in progress", CONTROL_CYCLES_MAX);
    if (c->waiting && c->client) return control_reject(c, "state", "another run is in progress");
    *k = (struct control_cycle){.control = c, .client = c->client, .unit = v[UNIT].unit};
    k->cycle = (struct board_cycle){.write = write,
                                    .address = (uint8_t)v[ADDRESS].count,
                                    .data = write ? (uint16_t)v[DATA].count : 0,
                                    .strobe_ns = strobe->given ? (int64_t)strobe->count : 0,
                                    .done = control_cycle_done,
                                    .ctx = k};
    return submit_cycle(c, k, call->t_ns);
}

static enum control_outcome do_read(const struct control_call *call)
{
    return start_cycle(call, false);
}

static enum control_outcome do_write(const struct control_call *call)
{
    return start_cycle(call, true);
}

static bool has_bus(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    const struct board_type *t = b->unit[v[UNIT].unit]->type;
    if (t->bus) return true;
    return control_reject_in(why, "range", "unit: expected a board with a parallel bus, got %s, a %s",
                             b->unit_name[v[UNIT].unit], t->title);
}

/* ---- frames */

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
#define STROBE {"strobe_ns", CONTROL_COUNT, true, "ns", 1, 1e9, .what = "strobe length; default: the profile's"}
#define WHERE CONTROL_UNIT_ARG(false), {"address", CONTROL_COUNT, false, NULL, 0, 15, .what = "address on A3..A0"}

static const struct control_command rows[] = {
    {"bus.read", "Makes one read cycle on the parallel bus of a board; replies at the end of the cycle; step pace advances the time until then.",
     CONTROL_ARGS(WHERE, STROBE), .run = do_read, .changes = true, .check = has_bus},
    {"bus.write", "Makes one write cycle on the parallel bus of a board; see bus.read.",
     CONTROL_ARGS(WHERE, {"data", CONTROL_COUNT, false, NULL, 0, 65535, .what = "word to write"}, STROBE), .run = do_write, .changes = true, .check = has_bus},
    {"can.put", "Sends a CAN frame as a host would, in scenarios without a host.",
     CONTROL_ARGS({"frame", CONTROL_TEXT, .what = "cansend notation (can-utils), capital digits: 609#2F00210104"},
      {"bus", CONTROL_NAME, .optional = true, .what = "bus of the scenario; default: the first"}),
     .run = do_send, .changes = true, .check = can_be_sent},
};
// clang-format on
const struct control_table commands_bus = {rows, sizeof rows / sizeof *rows};
