/* Commands (COMMAND_LONG, COMMAND_INT): each is acknowledged, those that are not in the table as unsupported. */
#include "link/mavlink/mav_station.h"

#include <math.h>
#include <string.h>

struct command {
    uint16_t number;
    uint8_t sysid, compid; /* who asks */
    float p[7];
};

typedef uint8_t command_fn(struct mav_station *s, const struct command *c, int64_t t_ns); /* MAV_RESULT */

/* A message number in a parameter; UINT32_MAX: it is none. */
static uint32_t message_number(float p)
{
    return p >= 0 && p <= 16777215.0f && p == nearbyintf(p) ? (uint32_t)p : UINT32_MAX;
}

static uint8_t request_message(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    const unsigned stream = mav_stream_find(message_number(c->p[0]));
    if (stream == MAV_STREAMS) return MAV_RESULT_UNSUPPORTED;
    return mav_stream_emit(s, stream, t_ns) ? MAV_RESULT_ACCEPTED : MAV_RESULT_TEMPORARILY_REJECTED;
}

/* Microseconds: -1 off, 0 the default. */
static uint8_t set_interval(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    enum { LEAST_US = 100 };
    const float most_us = 1e9f;
    const unsigned stream = mav_stream_find(message_number(c->p[0]));
    const float us = c->p[1];
    if (stream == MAV_STREAMS) return MAV_RESULT_UNSUPPORTED;
    const bool off = us == -1.0f, standard = us == 0.0f;
    if (!off && !standard && !(us >= LEAST_US && us <= most_us)) return MAV_RESULT_DENIED;
    const int64_t ns = off ? -1 : standard ? mav_stream_default_ns(s, stream) : (int64_t)nearbyint((double)us * 1e3);
    return mav_stream_set(s, stream, ns, t_ns) ? MAV_RESULT_ACCEPTED : MAV_RESULT_DENIED;
}

static uint8_t get_interval(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    const uint32_t number = message_number(c->p[0]);
    const unsigned stream = mav_stream_find(number);
    (void)t_ns;
    mavlink_message_interval_t m = {.message_id = (uint16_t)number, .interval_us = 0}; /* 0: not available */
    if (number > UINT16_MAX) return MAV_RESULT_DENIED;
    if (stream < MAV_STREAMS) {
        const int64_t ns = s->stream[stream].interval_ns;
        m.interval_us = ns < 0 ? -1 : ns < 1000 ? 1 : (int32_t)(ns / 1000); /* with each reading: as often as it can */
    }
    mav_send(s, MAV_KIND(MESSAGE_INTERVAL), &m);
    return stream < MAV_STREAMS ? MAV_RESULT_ACCEPTED : MAV_RESULT_UNSUPPORTED;
}

static uint8_t send_capabilities(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    (void)c;
    (void)mav_stream_emit(s, mav_stream_find(MAVLINK_MSG_ID_AUTOPILOT_VERSION), t_ns);
    return MAV_RESULT_ACCEPTED;
}

/* A procedure turns the head and takes minutes: a host's work, not a sensor's. */
static uint8_t refuse_calibration(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    (void)c;
    (void)t_ns;
    mav_text_out(s, MAV_SEVERITY_WARNING, "calibration: run `psabench mavlink`, which answers this command");
    return MAV_RESULT_UNSUPPORTED;
}

static const struct {
    uint16_t number;
    command_fn *run;
} rows[] = {
    {MAV_CMD_REQUEST_MESSAGE, request_message},          {MAV_CMD_SET_MESSAGE_INTERVAL, set_interval},
    {MAV_CMD_GET_MESSAGE_INTERVAL, get_interval},        {MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, send_capabilities},
    {MAV_CMD_PREFLIGHT_CALIBRATION, refuse_calibration},
};

static void run_command(struct mav_station *s, const struct command *c, int64_t t_ns)
{
    mavlink_command_ack_t ack = {.command = c->number,
                                 .result = MAV_RESULT_UNSUPPORTED,
                                 .target_system = c->sysid,
                                 .target_component = c->compid};
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].number == c->number) ack.result = rows[i].run(s, c, t_ns);
    }
    mav_send(s, MAV_KIND(COMMAND_ACK), &ack);
}

static void take_long(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    mavlink_command_long_t in;
    mavlink_msg_command_long_decode(m, &in);
    if (!mav_is_for_us(s, in.target_system, in.target_component)) return;
    const struct command c = {
        in.command, m->sysid, m->compid, {in.param1, in.param2, in.param3, in.param4, in.param5, in.param6, in.param7}};
    run_command(s, &c, t_ns);
}

static void take_int(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    mavlink_command_int_t in;
    mavlink_msg_command_int_decode(m, &in);
    if (!mav_is_for_us(s, in.target_system, in.target_component)) return;
    const struct command c = {
        in.command, m->sysid, m->compid, {in.param1, in.param2, in.param3, in.param4, (float)in.x, (float)in.y, in.z}};
    run_command(s, &c, t_ns);
}

void mav_command_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    if (m->msgid == MAVLINK_MSG_ID_COMMAND_LONG) take_long(s, m, t_ns);
    else take_int(s, m, t_ns);
}
