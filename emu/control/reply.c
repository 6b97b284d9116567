#include "command/utf8.h"
#include "control/internal.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static const char *print_reply(struct control *c, cJSON *reply)
{
    static const char too_long[] = "{\"ok\":false,\"error\":{\"code\":\"machine\",\"text\":\"reply too long\"}}";
    if (!cJSON_PrintPreallocated(reply, c->reply, (int)sizeof c->reply, 0)) memcpy(c->reply, too_long, sizeof too_long);
    cJSON_Delete(reply);
    return c->reply;
}

/* What has been delivered to each CAN client so far, by its number: the barrier of a host that drives several. */
static void add_rx(const struct control *c, cJSON *reply)
{
    struct control_client k;
    char number[16];
    cJSON_AddNumberToObject(reply, "can_rx", (double)c->bench->clients.can_rx(c->bench->ctx));
    cJSON *rx = cJSON_AddObjectToObject(reply, "rx");
    for (unsigned i = 0; c->bench->clients.nth(c->bench->ctx, i, &k); i++) {
        snprintf(number, sizeof number, "%" PRIu32, k.connection);
        cJSON_AddNumberToObject(rx, number, (double)k.delivered);
    }
}

const char *control_reply(struct control *c, cJSON *id, bool ok, cJSON *result, int64_t t_ns)
{
    cJSON *reply = cJSON_CreateObject();
    cJSON_AddItemToObject(reply, "id", id ? id : cJSON_CreateNull());
    cJSON_AddBoolToObject(reply, "ok", ok);
    cJSON_AddNumberToObject(reply, "t_ns", (double)t_ns);
    add_rx(c, reply);
    if (ok) {
        cJSON_AddItemToObject(reply, "result", result ? result : cJSON_CreateObject());
        return print_reply(c, reply);
    }
    cJSON_Delete(result);
    c->refused++;
    utf8_clean(c->error.why); /* a name in it may have been cut within a character */
    cJSON *error = cJSON_AddObjectToObject(reply, "error");
    cJSON_AddStringToObject(error, "code", c->error.code);
    cJSON_AddStringToObject(error, "text", c->error.why);
    return print_reply(c, reply);
}
