#include "telemetry/lcm_register.h"

#include "gen/lcm/psabench_lcm_register_t.h"
#include "gen/object_names.h"
#include "telemetry/lcm_board.h"

#include <string.h>

enum { SDO_ANSWER = 0x580, SDO_REQUEST = 0x600 }; /* identifiers at node 0 */
enum { REQUEST_WRITE = 1, REQUEST_READ = 2 };     /* bits 7..5 of byte 0 */
enum { ANSWER_READ = 2, ANSWER_WRITE = 3, ANSWER_ABORT = 4, EXPEDITED = 2, SIZED = 1 };

static uint32_t get_le(const uint8_t *at, unsigned bytes)
{
    uint32_t v = 0;
    for (unsigned i = bytes; i-- > 0;) v = v << 8 | at[i];
    return v;
}

/* Of an expedited transfer; its size is in bits 3 and 2 where bit 0 says so. */
static uint32_t value_of(const struct can_msg *m)
{
    const uint8_t command = m->data[0];
    return get_le(m->data + 4, command & SIZED ? 4u - (command >> 2 & 3u) : 4u);
}

static void take_request(struct lcm_request *r, const struct can_msg *m)
{
    const unsigned kind = m->data[0] >> 5;
    const bool write = kind == REQUEST_WRITE && m->data[0] & EXPEDITED;
    *r = (struct lcm_request){.waits = write || kind == REQUEST_READ,
                              .write = write,
                              .index = (uint16_t)get_le(m->data + 1, 2),
                              .sub = m->data[3],
                              .value = write ? value_of(m) : 0};
}

static const struct object_name *name_of(const char *board, uint16_t index, uint8_t sub)
{
    static const struct object_name unknown = {.address = -1, .object = "", .entry = ""};
    for (const struct object_names *b = object_names; b->board; b++) {
        if (strcmp(b->board, board) != 0) continue;
        for (unsigned i = 0; i < b->count; i++)
            if (b->row[i].index == index && b->row[i].sub == sub) return &b->row[i];
    }
    return &unknown;
}

static void send_access(struct lcm_feed *f, struct lcm_unit *u, int64_t value, uint32_t abort_code, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    const struct lcm_request *r = &u->request;
    const struct object_name *name = name_of(u->unit->type->name, r->index, r->sub);
    const psabench_lcm_register_t access = {.t_ns = t_ns,
                                            .epoch_ns = f->epoch_ns,
                                            .unit = lcm_text(u->name),
                                            .object = lcm_text(name->object),
                                            .name = lcm_text(name->entry),
                                            .address = name->address,
                                            .index = r->index,
                                            .sub = r->sub,
                                            .write = r->write,
                                            .value = value,
                                            .abort = abort_code};
    lcm_feed_send(f, u->registers, out, psabench_lcm_register_t_encode(out, 0, sizeof out, &access), t_ns);
}

static void take_answer(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    struct lcm_request *r = &u->request;
    const unsigned kind = m->data[0] >> 5;
    if (!r->waits || r->index != get_le(m->data + 1, 2) || r->sub != m->data[3]) return;
    r->waits = false;
    if (kind == ANSWER_ABORT) send_access(f, u, 0, get_le(m->data + 4, 4), t_ns);
    else if (kind == ANSWER_WRITE && r->write) send_access(f, u, r->value, 0, t_ns);
    else if (kind == ANSWER_READ && !r->write && m->data[0] & EXPEDITED) send_access(f, u, value_of(m), 0, t_ns);
}

void lcm_register_take(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    const uint32_t base = m->id & ~UINT32_C(0x7F);
    if (m->len != 8) return;
    if (base == SDO_REQUEST) take_request(&u->request, m);
    if (base == SDO_ANSWER) take_answer(f, u, m, t_ns);
}
