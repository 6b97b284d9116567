/* A MAVLink link: any bytes of a peer, whole messages of any content, frames on the bus, readings, time. What it sends is whole
 * messages of its own; its SDO requests are to its unit; values stay within their ranges; the truth is asked for only where
 * the user asked for it. */
#include "fuzz.h"

#include "app/mavlink.h"
#include "base/bits.h"

#include <math.h>
#include <string.h>

enum { NODE = 5, SYSID = 42, COMPID = 7, PAYLOAD = 255 };

static const struct mav_param params[] = {
    {"MAV_IMU_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_IMU_HZ},
    {"MAV_ANGLES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_ANGLES_HZ},
    {"MAV_CODES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_CODES_HZ},
    {"BENCH", .bytes = 4, .code = MAV_CODE_REAL},
    {"BYTE", .object = true, .writable = true, .index = 0x2020, .bytes = 1, .high = 3},
    {"SIGNED", .object = true, .writable = true, .index = 0x2021, .bytes = 3, .code = MAV_CODE_SIGNED, .low = -8388608,
     .high = 8388607},
    {"WORD", .object = true, .writable = true, .index = 0x2022, .bytes = 4, .high = 4294967295.0},
    {"ZERO", .object = true, .writable = true, .index = 0x2210, .sub = 1, .bytes = 4, .code = MAV_CODE_REAL, .low = -10,
     .high = 10},
    {"SCALE", .object = true, .writable = true, .index = 0x2211, .sub = 1, .bytes = 4, .code = MAV_CODE_REAL,
     .low = 0.001, .high = 1000},
};
enum { PARAMS = sizeof params / sizeof *params };

static struct world {
    struct sched s;
    struct can_bus bus;
    struct can_hub hub;
    struct links links;
    struct can_node ear, other;
    struct mav_station m;
    struct mav_parser out, in;
    struct mav_sender peer;
    struct psa2_reader psa2;
    bool hil;
} w;

static void on_send(void *ctx, const uint8_t *frame, size_t n)
{
    mavlink_message_t m;
    (void)ctx;
    for (size_t i = 0; i < n; i++) assert(mav_parse(&w.out, frame[i], &m) == (i == n - 1));
    assert(m.sysid == SYSID && m.compid == COMPID);
    if (m.msgid != MAVLINK_MSG_ID_PARAM_VALUE) return;
    mavlink_param_value_t v;
    mavlink_msg_param_value_decode(&m, &v);
    assert(v.param_index < PARAMS && v.param_count == PARAMS);
}

static void on_readouts(void *ctx, struct mav_readouts *out, int64_t t_ns)
{
    (void)ctx;
    *out = (struct mav_readouts){.axes = (unsigned)(t_ns & 3), .table_deg = {1e9, -720, 12}, .head_deg = -400};
}

static void on_world(void *ctx, struct mav_world *out, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    assert(w.hil);
    *out = (struct mav_world){{1, 2, 3}, 90, -180, 30000, 1e6, -1e6, 1e6};
}

static double on_value(void *ctx, unsigned which, int64_t t_ns)
{
    (void)ctx;
    return (double)which + (double)t_ns;
}

static void on_ear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct psa2_reading out[PSA2_READINGS_MAX];
    (void)ctx;
    mav_station_frame(&w.m, m, t_ns);
    const unsigned n = psa2_reading_take(&w.psa2, m, t_ns, out);
    assert(n <= PSA2_READINGS_MAX);
    for (unsigned i = 0; i < n; i++) {
        const struct mav_reading r = mavlink_reading(&out[i]);
        mav_station_reading(&w.m, &r);
    }
}

/* Of the link's: to its unit, an upload or an expedited download. */
static void on_other(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    assert(m->id == 0x600 + NODE && m->len == 8 && m->flags == 0);
    assert(m->data[0] == 0x40 || (m->data[0] & 0xE3) == 0x23);
}

static void say(const char *text)
{
    (void)text;
}

static void open_world(bool hil)
{
    memset(&w, 0, sizeof w);
    sched_init(&w.s);
    can_bus_init(&w.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000, .data_bitrate_hz = 5000000}, &w.s);
    w.hub = (struct can_hub){.bus = &w.bus, .links = &w.links, .say = say};
    w.ear = (struct can_node){.name = "ear", .fd = true, .rx = on_ear};
    w.other = (struct can_node){.name = "other", .fd = true, .order = CAN_ORDER_FIFO, .rx = on_other};
    w.psa2.node = NODE;
    w.hil = hil;
    w.peer = (struct mav_sender){.sysid = 255, .compid = 190};
    const struct mav_io io = {
        .send = on_send, .readouts = on_readouts, .world = hil ? on_world : NULL, .value = on_value};
    const struct mav_cfg cfg = {.sysid = SYSID,
                                .compid = COMPID,
                                .imu_hz = 50,
                                .angles_hz = 10,
                                .hil_hz = hil ? 100 : 0,
                                .scale_v_per_g = {1, 1, 1},
                                .zero_index = 0x2210,
                                .scale_index = 0x2211,
                                .params = params,
                                .param_count = PARAMS};
    w.m.sdo.hub = &w.hub;
    w.m.sdo.node = NODE;
    mav_station_open(&w.m, &cfg, &io, &w.s);
    can_attach(&w.bus, &w.ear);
    can_attach(&w.bus, &w.other);
}

/* ---- operations */

static void hear_byte(uint8_t byte)
{
    mavlink_message_t m;
    if (mav_parse(&w.in, byte, &m)) mav_station_message(&w.m, &m, w.s.now_ns);
}

/* A whole message that the link answers, its content any bytes. */
static void hear_message(struct script *s)
{
    static const struct mav_kind kinds[] = {
        {MAVLINK_MSG_ID_COMMAND_LONG, MAVLINK_MSG_ID_COMMAND_LONG_MIN_LEN, MAVLINK_MSG_ID_COMMAND_LONG_LEN,
         MAVLINK_MSG_ID_COMMAND_LONG_CRC},
        {MAVLINK_MSG_ID_COMMAND_INT, MAVLINK_MSG_ID_COMMAND_INT_MIN_LEN, MAVLINK_MSG_ID_COMMAND_INT_LEN,
         MAVLINK_MSG_ID_COMMAND_INT_CRC},
        {MAVLINK_MSG_ID_PARAM_SET, MAVLINK_MSG_ID_PARAM_SET_MIN_LEN, MAVLINK_MSG_ID_PARAM_SET_LEN,
         MAVLINK_MSG_ID_PARAM_SET_CRC},
        {MAVLINK_MSG_ID_PARAM_REQUEST_READ, MAVLINK_MSG_ID_PARAM_REQUEST_READ_MIN_LEN,
         MAVLINK_MSG_ID_PARAM_REQUEST_READ_LEN, MAVLINK_MSG_ID_PARAM_REQUEST_READ_CRC},
        {MAVLINK_MSG_ID_PARAM_REQUEST_LIST, MAVLINK_MSG_ID_PARAM_REQUEST_LIST_MIN_LEN,
         MAVLINK_MSG_ID_PARAM_REQUEST_LIST_LEN, MAVLINK_MSG_ID_PARAM_REQUEST_LIST_CRC},
        {MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL_MIN_LEN,
         MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL_LEN, MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL_CRC},
        {MAVLINK_MSG_ID_PING, MAVLINK_MSG_ID_PING_MIN_LEN, MAVLINK_MSG_ID_PING_LEN, MAVLINK_MSG_ID_PING_CRC},
        {MAVLINK_MSG_ID_TIMESYNC, MAVLINK_MSG_ID_TIMESYNC_MIN_LEN, MAVLINK_MSG_ID_TIMESYNC_LEN,
         MAVLINK_MSG_ID_TIMESYNC_CRC},
    };
    uint8_t payload[PAYLOAD] = {0}, frame[MAV_FRAME_MAX];
    const struct mav_kind kind = kinds[script_byte(s) % (sizeof kinds / sizeof *kinds)];
    for (unsigned n = script_byte(s), i = 0; i < n && i < kind.len; i++) payload[i] = script_byte(s);
    const size_t n = mav_frame(&w.peer, kind, payload, frame);
    w.in = (struct mav_parser){0};
    for (size_t i = 0; i < n; i++) hear_byte(frame[i]);
}

/* A parameter by its number or name is set to any four bytes, or asked for. */
static void set_parameter(struct script *s)
{
    const uint8_t which = script_byte(s);
    mavlink_param_set_t m = {.target_system = SYSID, .param_type = which & 0x80 ? script_byte(s) : MAV_PARAM_R32};
    const struct mav_param *p = &params[which % PARAMS];
    const uint32_t bits = (uint32_t)script_uint(s, 4);
    memcpy(m.param_id, p->name, strlen(p->name));
    memcpy(&m.param_value, &bits, sizeof bits);
    mavlink_message_t in = {.msgid = MAVLINK_MSG_ID_PARAM_SET, .len = MAVLINK_MSG_ID_PARAM_SET_LEN, .sysid = 1};
    memcpy(_MAV_PAYLOAD_NON_CONST(&in), &m, MAVLINK_MSG_ID_PARAM_SET_LEN);
    mav_station_message(&w.m, &in, w.s.now_ns);
}

static void send_frame(struct script *s)
{
    static const uint16_t ids[] = {0x580, 0x580, 0x600, 0x180, 0x280, 0x380, 0x200, 0x480};
    static const uint8_t lens[] = {8, 8, 8, 8, 8, 8, 16, 64};
    const uint8_t which = script_byte(s) & 7;
    struct can_msg m = {.id = ids[which] + (uint32_t)NODE, .len = lens[which]};
    if (m.len > 8) m.flags = CAN_FD | CAN_BRS;
    for (unsigned n = script_byte(s) % 65, i = 0; i < n && i < m.len; i++) m.data[i] = script_byte(s);
    if (which == 0) { /* an answer to what the link waits for */
        bits_put_le(&m.data[1], w.m.sdo.access.index, 2);
        m.data[3] = w.m.sdo.access.sub;
    }
    (void)can_send(&w.bus, &w.other, &m, w.s.now_ns);
}

static void check(void)
{
    const struct mav_station *m = &w.m;
    assert(m->job_count <= MAV_PARAM_JOBS && m->list_at <= PARAMS);
    assert(!m->busy || !mav_sdo_idle(&m->sdo));
    for (unsigned i = 0; i < MAV_STREAMS; i++) assert(m->stream[i].interval_ns >= -1);
    assert(m->cfg.scale_v_per_g[0] > 0 && isfinite(m->cfg.scale_v_per_g[0]) && isfinite(m->cfg.zero_v[0]));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    open_world(script_byte(&s) & 1);
    while (script_more(&s)) {
        switch (script_byte(&s) & 7) {
        case 0:
            for (unsigned n = script_byte(&s); n > 0 && script_more(&s); n--) hear_byte(script_byte(&s));
            break;
        case 1:
        case 2:
            hear_message(&s);
            break;
        case 3:
            set_parameter(&s);
            break;
        case 4:
        case 5:
            send_frame(&s);
            break;
        default:
            sched_run_until(&w.s, w.s.now_ns + script_span_ns(&s));
            break;
        }
        mav_station_turn(&w.m, w.s.now_ns);
        check();
    }
    sched_run_until(&w.s, w.s.now_ns + 2 * NS_PER_S);
    mav_station_close(&w.m);
    return 0;
}
