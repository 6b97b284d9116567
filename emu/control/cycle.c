#include "control/internal.h"

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

enum control_outcome control_cycle_reject(struct control *c, const struct control_cycle *k, enum board_cycle_result r)
{
    char why[BOARD_CYCLE_WHY_MAX];
    const struct unit *u = c->bench->unit[k->unit];
    board_cycle_why(u->type->bus, u->board, &k->cycle, r, why);
    return control_reject(c, codes[r], "%s: %s", c->bench->unit_name[k->unit], why);
}

static enum control_outcome put_result(struct control *c, const struct control_cycle *k, cJSON *result)
{
    const struct board_bus *bus = c->bench->unit[k->unit]->type->bus;
    if (!k->over) return control_reject(c, "state", "the cycle did not complete");
    if (k->result != BOARD_CYCLE_OK) return control_cycle_reject(c, k, k->result);
    const char *name = board_bus_name(bus, k->cycle.address);
    if (name) cJSON_AddStringToObject(result, "name", name);
    cJSON_AddNumberToObject(result, "data", k->cycle.data);
    cJSON_AddNumberToObject(result, "ended_s", (double)k->ended_ns * 1e-9);
    return CONTROL_DONE;
}

const char *control_cycle_reply(struct control *c, struct control_cycle *k, cJSON *id, int64_t t_ns)
{
    cJSON *result = cJSON_CreateObject();
    const enum control_outcome outcome = put_result(c, k, result);
    k->client = NULL;
    k->id = NULL;
    if (k->over) k->control = NULL;
    return control_reply(c, id, outcome == CONTROL_DONE, result, t_ns);
}

static void end_cycle(struct control *c, struct control_cycle *k, int64_t t_ns)
{
    if (c->waiting && c->running == k) {
        c->bench->sim.run_stop(c->bench->ctx); /* answered with the run */
    } else if (k->client) {
        void *client = k->client;
        c->bench->process.reply(c->bench->ctx, client, control_cycle_reply(c, k, k->id, t_ns));
    } else {
        k->control = NULL;
    }
}

void control_cycle_done(void *ctx, struct board_cycle *cycle, enum board_cycle_result r, int64_t t_ns)
{
    struct control_cycle *k = ctx;
    (void)cycle;
    k->over = true;
    k->result = r;
    k->ended_ns = t_ns;
    end_cycle(k->control, k, t_ns);
}

struct control_cycle *control_cycle_free(struct control *c)
{
    for (unsigned i = 0; i < CONTROL_CYCLES_MAX; i++) {
        if (!c->cycle[i].control) return &c->cycle[i];
    }
    return NULL;
}

void control_cycles_forget(struct control *c, const void *client)
{
    for (unsigned i = 0; i < CONTROL_CYCLES_MAX; i++) {
        struct control_cycle *k = &c->cycle[i];
        if (!k->control || (client && k->client != client)) continue;
        cJSON_Delete(k->id);
        k->id = NULL;
        k->client = NULL;
    }
}
