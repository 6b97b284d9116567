/* A MAVLink station, a bus with a unit that answers SDO, and what the station has sent. */
#ifndef PSABENCH_TESTS_MAVLINK_RIG_H
#define PSABENCH_TESTS_MAVLINK_RIG_H

#include "rig.h"

#include "base/bits.h"
#include "link/mavlink/mav_station.h"

#include <math.h>
#include <string.h>

enum { SENT_MAX = 512, NODE = 5, UNIT_WORD = 0x2020, UNIT_REAL = 0x2210 };

static struct rig {
    struct sched s;
    struct can_bus bus;
    struct can_hub hub;
    struct links links;
    struct can_node unit, host, ear; /* a unit that answers SDO; another host; the link's own observer */
    bool unit_is_off;
    uint32_t word;     /* object 2020h */
    float real[3];     /* object 2210h:1..3 */
    unsigned requests; /* SDO requests that the unit has got */
    struct mav_station m;
    struct mav_parser parser;
    mavlink_message_t sent[SENT_MAX];
    unsigned count;
    double world_calls;
} r;

static const struct mav_param params[] = {
    {"MAV_IMU_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_IMU_HZ},
    {"MAV_ANGLES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_ANGLES_HZ},
    {"MAV_CODES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = 10000, .index = MAV_OWN_CODES_HZ},
    {"BENCH_VALUE", .bytes = 4, .code = MAV_CODE_REAL, .index = 7},
    {"WORD", .object = true, .writable = true, .index = UNIT_WORD, .bytes = 1, .high = 3},
    {"ZERO_V_X", .object = true, .writable = true, .index = UNIT_REAL, .sub = 1, .bytes = 4, .code = MAV_CODE_REAL,
     .low = -10, .high = 10},
    {"SIXTEEN_CHARS_OK", .object = true, .index = UNIT_WORD, .bytes = 1, .high = 255},
    {"COUNTER", .object = true, .index = 0x2030, .sub = 1, .bytes = 4, .high = 4294967295.0},
};

/* ---- the world around the station */

static inline void answer_sdo(const uint8_t *q, int64_t t_ns)
{
    struct can_msg a = {.id = 0x580 + NODE, .len = 8, .data = {0x60, q[1], q[2], q[3]}};
    const unsigned index = q[1] | (unsigned)q[2] << 8;
    const bool write = q[0] != 0x40;
    uint32_t value = 0;
    if (index == UNIT_WORD && write && q[4] == 3) {
        a.data[0] = 0x80;
        bits_put_le(&a.data[4], 0x08000022, 4);
    } else if (index == UNIT_WORD && write) r.word = q[4];
    else if (index == UNIT_WORD) value = r.word;
    else if (index == UNIT_REAL && write) memcpy(&r.real[q[3] - 1], &q[4], 4);
    else if (index == UNIT_REAL) memcpy(&value, &r.real[q[3] - 1], 4);
    else value = 0xFFFFFFFE;
    if (!write) {
        a.data[0] = index == UNIT_WORD ? 0x4F : 0x43;
        bits_put_le(&a.data[4], value, 4);
    }
    can_send(&r.bus, &r.unit, &a, t_ns);
}

static inline void on_unit_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    if (m->id != 0x600 + NODE || r.unit_is_off) return;
    r.requests++;
    if (m->data[0] != 0x60) answer_sdo(m->data, t_ns); /* 60h: a segment of the other host, left unanswered */
}

static inline void on_ear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    mav_station_frame(&r.m, m, t_ns);
}

static inline void on_send(void *ctx, const uint8_t *frame, size_t n)
{
    unsigned whole = 0;
    (void)ctx;
    for (size_t i = 0; i < n; i++) whole += mav_parse(&r.parser, frame[i], &r.sent[r.count % SENT_MAX]);
    assert_int_equal(whole, 1);
    r.count++;
}

static inline void on_readouts(void *ctx, struct mav_readouts *out, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    *out = (struct mav_readouts){.axes = 2, .table_deg = {10, 270}, .table_dps = {1, 2}, .head = true, .head_deg = 33};
}

static inline void on_world(void *ctx, struct mav_world *out, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    r.world_calls++;
    *out = (struct mav_world){{0.1, 0.2, 0.3}, 50.45, 30.5, 120, -3, 4, 1.5};
}

static inline double on_value(void *ctx, unsigned which, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return which == 7 ? 123.5 : -1;
}

static inline void open_with(double hil_hz)
{
    const struct mav_io io = {
        .send = on_send, .readouts = on_readouts, .world = hil_hz > 0 ? on_world : NULL, .value = on_value};
    const struct mav_cfg cfg = {.sysid = 42,
                                .compid = 7,
                                .autopilot = MAV_AUTOPILOT_GENERIC,
                                .imu_hz = 100,
                                .angles_hz = 10,
                                .hil_hz = hil_hz,
                                .zero_v = {2.5, 2.5, 2.5},
                                .scale_v_per_g = {1, 1, 1},
                                .zero_index = UNIT_REAL,
                                .scale_index = 0x2211,
                                .params = params,
                                .param_count = COUNT(params)};
    r.m.sdo.hub = &r.hub;
    r.m.sdo.node = NODE;
    mav_station_open(&r.m, &cfg, &io, &r.s);
}

static inline void say(const char *text)
{
    (void)text;
}

static inline int fresh(void **state)
{
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    r.hub = (struct can_hub){.bus = &r.bus, .links = &r.links, .say = say};
    r.unit = (struct can_node){.name = "unit", .rx = on_unit_rx};
    r.host = (struct can_node){.name = "host"};
    r.ear = (struct can_node){.name = "ear", .fd = true, .rx = on_ear};
    can_attach(&r.bus, &r.unit);
    can_attach(&r.bus, &r.host);
    open_with(0);
    can_attach(&r.bus, &r.ear);
    r.real[0] = 2.5f;
    return 0;
}

static inline int forget(void **state)
{
    (void)state;
    mav_station_close(&r.m);
    return 0;
}

/* Turns of the loop, a millisecond each. */
static inline void run_ms(unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        mav_station_turn(&r.m, r.s.now_ns);
        sched_run_until(&r.s, r.s.now_ns + 1000000);
    }
}

/* A message of a ground station, through bytes and parser. */
static inline void take(struct mav_kind kind, const void *payload)
{
    static struct mav_sender gcs = {.sysid = 255, .compid = 190};
    static struct mav_parser in;
    uint8_t frame[MAV_FRAME_MAX];
    mavlink_message_t m;
    const size_t n = mav_frame(&gcs, kind, payload, frame);
    for (size_t i = 0; i < n; i++)
        if (mav_parse(&in, frame[i], &m)) mav_station_message(&r.m, &m, r.s.now_ns);
}

/* The latest message of a kind since `from`; NULL: none. */
static const mavlink_message_t *last(uint32_t id, unsigned from)
{
    for (unsigned i = r.count; i > from; i--)
        if (r.sent[(i - 1) % SENT_MAX].msgid == id) return &r.sent[(i - 1) % SENT_MAX];
    return NULL;
}

static inline unsigned count_of(uint32_t id, unsigned from)
{
    unsigned n = 0;
    for (unsigned i = from; i < r.count; i++) n += r.sent[i % SENT_MAX].msgid == id;
    return n;
}

static inline mavlink_param_value_t value_of(unsigned from)
{
    mavlink_param_value_t v;
    const mavlink_message_t *m = last(MAVLINK_MSG_ID_PARAM_VALUE, from);
    assert_non_null(m);
    mavlink_msg_param_value_decode(m, &v);
    return v;
}

static inline void set_param(const char *name, float value, uint8_t type)
{
    mavlink_param_set_t set = {.param_value = value, .target_system = 42, .target_component = 7, .param_type = type};
    memcpy(set.param_id, name, strlen(name));
    take(MAV_KIND(PARAM_SET), &set);
}

static inline void ask_param(const char *name, int16_t index)
{
    mavlink_param_request_read_t ask = {.param_index = index, .target_system = 42, .target_component = 7};
    memcpy(ask.param_id, name, strlen(name));
    take(MAV_KIND(PARAM_REQUEST_READ), &ask);
}

/* Result of the acknowledgement, which is for the ground station. */
static inline uint8_t command(uint16_t number, float p1, float p2)
{
    const unsigned from = r.count;
    const mavlink_command_long_t c = {
        .command = number, .param1 = p1, .param2 = p2, .target_system = 42, .target_component = 7};
    mavlink_command_ack_t ack;
    take(MAV_KIND(COMMAND_LONG), &c);
    const mavlink_message_t *m = last(MAVLINK_MSG_ID_COMMAND_ACK, from);
    assert_non_null(m);
    mavlink_msg_command_ack_decode(m, &ack);
    assert_int_equal(ack.command, number);
    assert_int_equal(ack.target_system, 255);
    assert_int_equal(ack.target_component, 190);
    return ack.result;
}

static inline void read_at(int64_t t_ns, double volts)
{
    const struct mav_reading reading = {.t_ns = t_ns, .code = {1, -2, 8388607}, .volts = {volts, 2.5, 3.5}};
    mav_station_reading(&r.m, &reading);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fresh, forget)

#endif
