#include "link/mavlink/mav_sdo.h"

#include "base/bits.h"

#include <stdio.h>
#include <string.h>

/* CiA 301, 7.2.4.3: command bytes. */
enum {
    CS_MASK = 0xE0,
    REQUEST_DOWNLOAD = 0x20,
    REQUEST_UPLOAD = 0x40,
    ANSWER_UPLOAD = 0x40,
    ANSWER_DOWNLOAD = 0x60,
    ANSWER_UPLOAD_SEGMENT = 0x00,
    ANSWER_DOWNLOAD_SEGMENT = 0x20,
    ABORT = 0x80,
    EXPEDITED = 0x02,
    LAST_SEGMENT = 0x01,
    SDO_ANSWER = 0x580,
    SDO_REQUEST = 0x600
};
#define OTHER_NS NS_PER_S /* without an answer the other host's access is over */

static void end_access(struct mav_sdo *s, uint32_t abort, uint32_t raw, int64_t t_ns)
{
    sched_cancel(s->sched, &s->ev);
    s->state = MAV_SDO_IDLE;
    s->aborts += abort && abort != MAV_SDO_NO_ANSWER;
    s->done(s->ctx, abort, raw, t_ns);
}

static void send_request(struct mav_sdo *s, int64_t t_ns)
{
    if (!s->client.up) can_hub_join(s->hub, &s->client);
    s->state = MAV_SDO_SENT;
    sched_at(s->sched, &s->ev, t_ns + MAV_SDO_TIMEOUT_NS);
    (void)can_hub_send(s->hub, &s->client, &s->request, t_ns); /* a full queue: the access times out */
}

void mav_sdo_turn(struct mav_sdo *s, int64_t t_ns)
{
    if (s->state != MAV_SDO_WAITING) return;
    if (t_ns >= s->busy_until_ns) send_request(s, t_ns);
    else sched_at(s->sched, &s->ev, s->busy_until_ns); /* the loop wakes up, and a turn follows */
}

static void on_due(void *ctx, int64_t t_ns)
{
    struct mav_sdo *s = ctx;
    if (s->state != MAV_SDO_SENT) return;
    s->timeouts++;
    end_access(s, MAV_SDO_NO_ANSWER, 0, t_ns);
}

void mav_sdo_init(struct mav_sdo *s)
{
    memset(&s->client, 0, sizeof s->client);
    s->client.adapter = "mavlink";
    snprintf(s->client.name, sizeof s->client.name, "node %u", s->node);
    s->client.node = (struct can_node){.order = CAN_ORDER_FIFO};
    s->state = MAV_SDO_IDLE;
    s->busy_until_ns = 0;
    s->timeouts = s->aborts = 0;
    sched_ev(&s->ev, on_due, s);
}

void mav_sdo_begin(struct mav_sdo *s, const struct mav_access *a)
{
    const unsigned unused = 4u - a->bytes;
    s->access = *a;
    s->request = (struct can_msg){.id = SDO_REQUEST + (uint32_t)s->node, .len = 8};
    uint8_t *d = s->request.data;
    d[0] = a->write ? (uint8_t)(REQUEST_DOWNLOAD | unused << 2 | 3u) : REQUEST_UPLOAD; /* expedited, with its length */
    bits_put_le(&d[1], a->index, 2);
    d[3] = a->sub;
    if (a->write) bits_put_le(&d[4], a->raw, a->bytes);
    s->state = MAV_SDO_WAITING;
}

static bool is_answer(const struct mav_sdo *s, const uint8_t *d)
{
    const unsigned want = s->access.write ? ANSWER_DOWNLOAD : ANSWER_UPLOAD;
    const unsigned cs = d[0] & CS_MASK;
    return s->state == MAV_SDO_SENT && (cs == want || cs == ABORT) && bits_get_le(&d[1], 2) == s->access.index &&
           d[3] == s->access.sub;
}

static void take_answer(struct mav_sdo *s, const uint8_t *d, int64_t t_ns)
{
    const uint32_t data = (uint32_t)bits_get_le(&d[4], 4);
    const bool abort = (d[0] & CS_MASK) == ABORT;
    if (abort) end_access(s, data ? data : MAV_SDO_NO_ANSWER, 0, t_ns);
    else if (s->access.write || d[0] & EXPEDITED) end_access(s, 0, data, t_ns);
    else end_access(s, MAV_SDO_NO_ANSWER, 0, t_ns); /* longer than any parameter: its segments are not fetched */
}

/* Whether the unit's answer to another host leaves a transfer open. */
static bool goes_on(const struct mav_sdo *s, const uint8_t *d)
{
    switch (d[0] & CS_MASK) {
    case ANSWER_UPLOAD:
        return !(d[0] & EXPEDITED);
    case ANSWER_UPLOAD_SEGMENT:
        return !(d[0] & LAST_SEGMENT);
    case ANSWER_DOWNLOAD:
    case ANSWER_DOWNLOAD_SEGMENT:
        return !s->other_last;
    default:
        return false;
    }
}

static void note_other_request(struct mav_sdo *s, const uint8_t *d, int64_t t_ns)
{
    const unsigned cs = d[0] & CS_MASK;
    s->other_last = cs == REQUEST_DOWNLOAD ? (d[0] & EXPEDITED) != 0 : (d[0] & LAST_SEGMENT) != 0;
    s->busy_until_ns = cs == ABORT ? t_ns : t_ns + OTHER_NS;
}

static void note_other_answer(struct mav_sdo *s, const uint8_t *d, int64_t t_ns)
{
    s->busy_until_ns = goes_on(s, d) ? t_ns + OTHER_NS : t_ns;
}

void mav_sdo_frame(struct mav_sdo *s, const struct can_msg *m, int64_t t_ns)
{
    if (m->flags || m->len != 8) return;
    if (m->id == SDO_REQUEST + (uint32_t)s->node) {
        const bool own = s->state == MAV_SDO_SENT && memcmp(m->data, s->request.data, 8) == 0;
        if (!own) note_other_request(s, m->data, t_ns);
    } else if (m->id == SDO_ANSWER + (uint32_t)s->node) {
        if (is_answer(s, m->data)) take_answer(s, m->data, t_ns);
        else note_other_answer(s, m->data, t_ns);
    }
}

void mav_sdo_close(struct mav_sdo *s)
{
    sched_cancel(s->sched, &s->ev);
    can_hub_leave(s->hub, &s->client);
    s->state = MAV_SDO_IDLE;
}
