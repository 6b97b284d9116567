#include "link/mavlink/mav_station.h"

#include <string.h>

enum { FTP_NAK = 129, FTP_NOT_FOUND = 10 }; /* opcode and error of the file transfer protocol */

/* ---- what is answered at once */

/* There are no files. A client that asks for its parameters by file goes on to the parameter protocol. */
static void refuse_file(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    enum { SEQ = 0, SESSION = 2, OPCODE = 3, SIZE = 4, REQUEST_OPCODE = 5, OFFSET = 8, DATA = 12 };
    mavlink_file_transfer_protocol_t in, out = {0};
    (void)t_ns;
    mavlink_msg_file_transfer_protocol_decode(m, &in);
    if (!mav_is_for_us(s, in.target_system, in.target_component)) return;
    if (in.payload[OPCODE] >= FTP_NAK - 1) return; /* an answer */
    out.target_system = m->sysid;
    out.target_component = m->compid;
    memcpy(out.payload, in.payload, DATA);
    const unsigned seq = (in.payload[SEQ] | (unsigned)in.payload[SEQ + 1] << 8) + 1;
    out.payload[SEQ] = (uint8_t)seq;
    out.payload[SEQ + 1] = (uint8_t)(seq >> 8);
    out.payload[REQUEST_OPCODE] = in.payload[OPCODE];
    out.payload[OPCODE] = FTP_NAK;
    out.payload[SIZE] = 1;
    out.payload[DATA] = FTP_NOT_FOUND;
    mav_send(s, MAV_KIND(FILE_TRANSFER_PROTOCOL), &out);
}

static void answer_ping(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    mavlink_ping_t p;
    (void)t_ns;
    mavlink_msg_ping_decode(m, &p);
    if (p.target_system || p.target_component) return; /* an answer to another system */
    p.target_system = m->sysid;
    p.target_component = m->compid;
    mav_send(s, MAV_KIND(PING), &p);
}

static void answer_timesync(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    mavlink_timesync_t t;
    mavlink_msg_timesync_decode(m, &t);
    if (t.tc1) return;
    t.tc1 = t_ns + s->cfg.epoch_ns;
    mav_send(s, MAV_KIND(TIMESYNC), &t);
}

void mav_station_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    static const struct {
        uint32_t id;
        void (*take)(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns);
    } rows[] = {
        {MAVLINK_MSG_ID_PARAM_REQUEST_LIST, mav_params_message},
        {MAVLINK_MSG_ID_PARAM_REQUEST_READ, mav_params_message},
        {MAVLINK_MSG_ID_PARAM_SET, mav_params_message},
        {MAVLINK_MSG_ID_COMMAND_LONG, mav_command_message},
        {MAVLINK_MSG_ID_COMMAND_INT, mav_command_message},
        {MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, refuse_file},
        {MAVLINK_MSG_ID_PING, answer_ping},
        {MAVLINK_MSG_ID_TIMESYNC, answer_timesync},
    };
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].id == m->msgid) rows[i].take(s, m, t_ns);
    }
}

void mav_station_open(struct mav_station *s, const struct mav_cfg *cfg, const struct mav_io *io, struct sched *sched)
{
    struct can_hub *hub = s->sdo.hub;
    const uint8_t node = s->sdo.node;
    *s = (struct mav_station){.cfg = *cfg,
                              .io = *io,
                              .sched = sched,
                              .sender = {.sysid = cfg->sysid, .compid = cfg->compid},
                              .sdo = {.hub = hub, .sched = sched, .node = node, .done = mav_params_answer, .ctx = s},
                              .list_at = cfg->param_count};
    mav_sdo_init(&s->sdo);
    mav_streams_open(s);
}

void mav_station_turn(struct mav_station *s, int64_t t_ns)
{
    mav_params_turn(s, t_ns);
    mav_sdo_turn(&s->sdo, t_ns);
}

void mav_station_close(struct mav_station *s)
{
    sched_cancel(s->sched, &s->tick);
    mav_sdo_close(&s->sdo);
}
