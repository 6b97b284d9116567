/* Cycles on the parallel bus of a board that has one. */
#include "command/args.h"
#include "control/commands.h"

enum { UNIT, ADDRESS, READ_STROBE, DATA = READ_STROBE, WRITE_STROBE };

#define PATIENCE_NS (10 * NS_PER_S) /* simulated; a strobe is a second at most */

static const char *const codes[] = {
    [BOARD_CYCLE_NO_ADDRESS] = "address",
    [BOARD_CYCLE_READ_ONLY] = "read_only",
    [BOARD_CYCLE_WRITE_ONLY] = "write_only",
    [BOARD_CYCLE_NOT_READY] = "not_ready",
    [BOARD_CYCLE_TOO_SHORT] = "too_short",
    [BOARD_CYCLE_BUSY] = "busy",
    [BOARD_CYCLE_BAD_VALUE] = "value",
    [BOARD_CYCLE_TAKEN] = "taken",
    [BOARD_CYCLE_OFF] = "off",
};

static enum control_outcome refuse_cycle(struct control *c, const struct control_cycle *k, enum board_cycle_result r)
{
    char why[BOARD_CYCLE_WHY_MAX];
    const struct unit *u = c->bench->unit[k->unit];
    board_cycle_why(u->type->bus, u->board, &k->cycle, r, why);
    return control_refuse(c, codes[r], "%s: %s", c->bench->unit_name[k->unit], why);
}

enum control_outcome control_cycle_result(struct control *c, const struct control_cycle *k, cJSON *result)
{
    const struct board_bus *bus = c->bench->unit[k->unit]->type->bus;
    if (!k->over) return control_refuse(c, "state", "the cycle has not come to its end");
    if (k->result != BOARD_CYCLE_OK) return refuse_cycle(c, k, k->result);
    const char *name = bus->name(k->cycle.address);
    if (name) cJSON_AddStringToObject(result, "name", name);
    cJSON_AddNumberToObject(result, "data", k->cycle.data);
    cJSON_AddNumberToObject(result, "ended_s", (double)k->ended_ns * 1e-9);
    return CONTROL_DONE;
}

static void on_done(void *ctx, struct board_cycle *cycle, enum board_cycle_result r, int64_t t_ns)
{
    struct control_cycle *k = ctx;
    (void)cycle;
    k->over = true;
    k->result = r;
    k->ended_ns = t_ns;
    control_cycle_over(k->control, k, t_ns);
}

static struct control_cycle *room(struct control *c)
{
    for (unsigned i = 0; i < CONTROL_CYCLES_MAX; i++) {
        if (!c->cycle[i].control) return &c->cycle[i];
    }
    return NULL;
}

static enum control_outcome submit(struct control *c, struct control_cycle *k, int64_t t_ns)
{
    const struct control_bench *b = c->bench;
    const struct unit *u = b->unit[k->unit];
    const enum board_cycle_result r = u->type->bus->submit(u->board, &k->cycle, t_ns);
    if (r != BOARD_CYCLE_OK) {
        k->control = NULL;
        return refuse_cycle(c, k, r);
    }
    c->started = k;
    if (k->client && control_by_step(b) && !b->run(b->ctx, PATIENCE_NS, 0, c->refusal.why)) {
        c->refusal.code = "state";
        k->client = NULL; /* it goes its way, nobody waits */
        return CONTROL_REFUSED;
    }
    return CONTROL_LATER;
}

static enum control_outcome do_cycle(struct control *c, const struct control_value *v, bool write, int64_t t_ns)
{
    const struct control_value *strobe = &v[write ? WRITE_STROBE : READ_STROBE];
    struct control_cycle *k = room(c);
    if (!k) return control_refuse(c, "state", "%u cycles are under way", CONTROL_CYCLES_MAX);
    if (c->waiting && c->client) return control_refuse(c, "state", "another run is under way");
    *k = (struct control_cycle){.control = c, .client = c->client, .unit = v[UNIT].unit};
    k->cycle = (struct board_cycle){.write = write,
                                    .address = (uint8_t)v[ADDRESS].count,
                                    .data = write ? (uint16_t)v[DATA].count : 0,
                                    .strobe_ns = strobe->given ? (int64_t)strobe->count : 0,
                                    .done = on_done,
                                    .ctx = k};
    return submit(c, k, t_ns);
}

static enum control_outcome do_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    return do_cycle(c, v, false, t_ns);
}

static enum control_outcome do_write(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)result;
    return do_cycle(c, v, true, t_ns);
}

static bool has_bus(const struct control_bench *b, const struct control_value *v, struct control_refusal *why)
{
    const struct board_type *t = b->unit[v[UNIT].unit]->type;
    if (t->bus) return true;
    return control_refuse_in(why, "range", "unit: %s is a %s, which has no parallel bus", b->unit_name[v[UNIT].unit],
                             t->title);
}

// clang-format off
#define STROBE {"strobe_ns", CONTROL_COUNT, true, "ns", 1, 1e9, .what = "length of the strobe; else the one of the board's profile"}
#define WHERE CONTROL_UNIT_ARG(false), {"address", CONTROL_COUNT, false, NULL, 0, 15, .what = "A3..A0"}

static const struct control_command rows[] = {
    {"bus.read", "One read cycle on the parallel bus of a board; the answer comes when the cycle is done, for which time moves in step pace.",
     {WHERE, STROBE}, .run = do_read, .changes = true, .check = has_bus},
    {"bus.write", "One write cycle, likewise.",
     {WHERE, {"data", CONTROL_COUNT, false, NULL, 0, 65535, .what = "word to write"}, STROBE}, .run = do_write, .changes = true, .check = has_bus},
};
// clang-format on
const struct control_table commands_bus = {rows, sizeof rows / sizeof *rows};
