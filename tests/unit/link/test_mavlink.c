/* MAVLink below its sockets: frames, parameters and their values, the SDO client, streams, commands; nothing of the OS. */
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

static void answer_sdo(const uint8_t *q, int64_t t_ns)
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

static void on_unit_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    if (m->id != 0x600 + NODE || r.unit_is_off) return;
    r.requests++;
    if (m->data[0] != 0x60) answer_sdo(m->data, t_ns); /* 60h: a segment of the other host, left unanswered */
}

static void on_ear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    mav_station_frame(&r.m, m, t_ns);
}

static void on_send(void *ctx, const uint8_t *frame, size_t n)
{
    unsigned whole = 0;
    (void)ctx;
    for (size_t i = 0; i < n; i++) whole += mav_parse(&r.parser, frame[i], &r.sent[r.count % SENT_MAX]);
    assert_int_equal(whole, 1);
    r.count++;
}

static void on_readouts(void *ctx, struct mav_readouts *out, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    *out = (struct mav_readouts){.axes = 2, .table_deg = {10, 270}, .table_dps = {1, 2}, .head = true, .head_deg = 33};
}

static void on_world(void *ctx, struct mav_world *out, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    r.world_calls++;
    *out = (struct mav_world){{0.1, 0.2, 0.3}, 50.45, 30.5, 120, -3, 4};
}

static double on_value(void *ctx, unsigned which, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return which == 7 ? 123.5 : -1;
}

static void open_with(double hil_hz)
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

static void say(const char *text)
{
    (void)text;
}

static int fresh(void **state)
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

static int forget(void **state)
{
    (void)state;
    mav_station_close(&r.m);
    return 0;
}

/* Turns of the loop, a millisecond each. */
static void run_ms(unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        mav_station_turn(&r.m, r.s.now_ns);
        sched_run_until(&r.s, r.s.now_ns + 1000000);
    }
}

/* A message of a ground station, through bytes and parser. */
static void take(struct mav_kind kind, const void *payload)
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

static unsigned count_of(uint32_t id, unsigned from)
{
    unsigned n = 0;
    for (unsigned i = from; i < r.count; i++) n += r.sent[i % SENT_MAX].msgid == id;
    return n;
}

static mavlink_param_value_t value_of(unsigned from)
{
    mavlink_param_value_t v;
    const mavlink_message_t *m = last(MAVLINK_MSG_ID_PARAM_VALUE, from);
    assert_non_null(m);
    mavlink_msg_param_value_decode(m, &v);
    return v;
}

static void set_param(const char *name, float value, uint8_t type)
{
    mavlink_param_set_t set = {.param_value = value, .target_system = 42, .target_component = 7, .param_type = type};
    memcpy(set.param_id, name, strlen(name));
    take(MAV_KIND(PARAM_SET), &set);
}

static void ask_param(const char *name, int16_t index)
{
    mavlink_param_request_read_t ask = {.param_index = index, .target_system = 42, .target_component = 7};
    memcpy(ask.param_id, name, strlen(name));
    take(MAV_KIND(PARAM_REQUEST_READ), &ask);
}

/* Result of the acknowledgement, which is for the ground station. */
static uint8_t command(uint16_t number, float p1, float p2)
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

static void read_at(int64_t t_ns, double volts)
{
    const struct mav_reading reading = {.t_ns = t_ns, .code = {1, -2, 8388607}, .volts = {volts, 2.5, 3.5}};
    mav_station_reading(&r.m, &reading);
}

/* ---- frames */

static void a_frame_comes_out_of_its_parser_as_it_went_in(void **state)
{
    (void)state;
    struct mav_sender s = {.sysid = 9, .compid = 200, .seq = 255};
    struct mav_parser p = {0};
    uint8_t frame[MAV_FRAME_MAX];
    mavlink_message_t m;
    const mavlink_psabench_accel_t in = {
        .time_usec = 0x123456789, .volts = {1.5, -2.25, 1e-300}, .code = {-8388608, 8388607, 0}, .seq = 7, .status = 3};
    mavlink_psabench_accel_t out;
    const size_t n = mav_frame(&s, MAV_KIND(PSABENCH_ACCEL), &in, frame);
    assert_int_equal(s.seq, 0);
    for (size_t i = 0; i < n; i++) assert_int_equal(mav_parse(&p, frame[i], &m), i == n - 1);
    assert_int_equal(m.sysid, 9);
    assert_int_equal(m.compid, 200);
    assert_int_equal(m.seq, 255);
    mavlink_msg_psabench_accel_decode(&m, &out);
    assert_memory_equal(&in, &out, MAVLINK_MSG_ID_PSABENCH_ACCEL_LEN);
}

static void a_flipped_bit_is_counted_and_the_next_frame_is_whole(void **state)
{
    (void)state;
    struct mav_sender s = {.sysid = 1, .compid = 1};
    struct mav_parser p = {0};
    uint8_t frame[MAV_FRAME_MAX];
    mavlink_message_t m;
    const mavlink_heartbeat_t beat = {.type = 1, .autopilot = 2, .mavlink_version = 3};
    for (unsigned bad = 0; bad < 2; bad++) {
        const size_t n = mav_frame(&s, MAV_KIND(HEARTBEAT), &beat, frame);
        if (!bad) frame[12] ^= 0x10;
        for (size_t i = 0; i < n; i++) (void)mav_parse(&p, frame[i], &m);
    }
    assert_int_equal(p.malformed, 1);
    assert_int_equal(p.received, 1);
}

static void names_are_printable_whatever_came(void **state)
{
    (void)state;
    char out[5];
    mav_text(out, "ab\x01\xff", 4);
    assert_string_equal(out, "ab??");
    mav_text(out, "a\0zz", 4);
    assert_string_equal(out, "a");
}

/* ---- values of parameters */

static void numbers_travel_exactly_and_32_bit_integers_bytewise(void **state)
{
    (void)state;
    static const struct {
        struct mav_param p;
        double value;
        uint8_t type;
    } rows[] = {
        {{.bytes = 1}, 255, MAV_PARAM_R32},
        {{.bytes = 3, .code = MAV_CODE_SIGNED}, -8388608, MAV_PARAM_R32},
        {{.bytes = 3}, 16777215, MAV_PARAM_R32},
        {{.bytes = 4}, 4294967295.0, MAV_PARAM_U32},
        {{.bytes = 4}, 16777217, MAV_PARAM_U32},
        {{.bytes = 4, .code = MAV_CODE_SIGNED}, -2147483648.0, MAV_PARAM_I32},
        {{.bytes = 4, .code = MAV_CODE_SIGNED}, -1, MAV_PARAM_I32},
        {{.bytes = 4, .code = MAV_CODE_REAL}, -0.5, MAV_PARAM_R32},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct mav_param *p = &rows[i].p;
        double back = 0;
        assert_int_equal(mav_param_type(p), rows[i].type);
        assert_true(mav_param_value(p, rows[i].type, mav_param_wire(p, rows[i].value), &back));
        assert_true(back == rows[i].value);
        assert_true(mav_param_number(p, mav_param_raw(p, rows[i].value)) == rows[i].value);
    }
}

static void what_is_no_value_of_a_parameter_is_refused(void **state)
{
    (void)state;
    const struct mav_param whole = {.bytes = 1}, real = {.bytes = 4, .code = MAV_CODE_REAL};
    double v;
    assert_false(mav_param_value(&whole, MAV_PARAM_R32, 1.5f, &v));
    assert_false(mav_param_value(&whole, MAV_PARAM_R32, NAN, &v));
    assert_false(mav_param_value(&real, MAV_PARAM_R32, INFINITY, &v));
    assert_false(mav_param_value(&real, 2, 1.0f, &v));  /* INT8 */
    assert_false(mav_param_value(&real, 10, 1.0f, &v)); /* REAL64 */
    assert_true(mav_param_value(&whole, MAV_PARAM_R32, 3.0f, &v) && v == 3);
}

/* ---- streams */

static void a_heartbeat_a_second_and_readouts_at_their_rate(void **state)
{
    (void)state;
    mavlink_heartbeat_t beat;
    mavlink_attitude_t a;
    run_ms(2999);
    assert_int_equal(count_of(MAVLINK_MSG_ID_HEARTBEAT, 0), 3); /* at 0, 1 and 2 s */
    assert_int_equal(count_of(MAVLINK_MSG_ID_ATTITUDE, 0), 30);
    assert_int_equal(count_of(MAVLINK_MSG_ID_PSABENCH_LINK, 0), 3);
    assert_int_equal(count_of(MAVLINK_MSG_ID_HIL_SENSOR, 0), 0);
    mavlink_msg_heartbeat_decode(last(MAVLINK_MSG_ID_HEARTBEAT, 0), &beat);
    assert_int_equal(beat.autopilot, MAV_AUTOPILOT_GENERIC);
    mavlink_msg_attitude_decode(last(MAVLINK_MSG_ID_ATTITUDE, 0), &a);
    assert_int_equal(a.time_boot_ms, 2900);
    assert_true(fabsf(a.pitch - 0.17453292f) < 1e-6f);
    assert_true(fabsf(a.yaw + 1.5707963f) < 1e-6f); /* 270 degrees, wrapped */
}

static void readings_go_out_exactly_and_the_imu_at_its_rate(void **state)
{
    (void)state;
    mavlink_highres_imu_t imu;
    mavlink_psabench_accel_t exact;
    for (unsigned i = 0; i < 1000; i++) read_at((int64_t)i * 1000000, 2.75);
    assert_int_equal(r.m.counters.readings, 1000);
    assert_int_equal(r.m.counters.sent, 1000 + 100);
    mavlink_msg_highres_imu_decode(last(MAVLINK_MSG_ID_HIGHRES_IMU, 0), &imu);
    assert_true(imu.time_usec == 990000);
    assert_true(imu.xacc == (float)(-0.25 * MAV_G_MPS2)); /* specific force */
    assert_true(imu.zacc == (float)-MAV_G_MPS2);
    assert_int_equal(imu.fields_updated, 7);
    mavlink_msg_psabench_accel_decode(last(MAVLINK_MSG_ID_PSABENCH_ACCEL, 0), &exact);
    assert_int_equal(exact.code[2], 8388607);
    assert_true(exact.volts[0] == 2.75 && exact.accel_mps2[0] == 0.25 * MAV_G_MPS2);
    assert_int_equal(exact.seq, 999);
}

static void hil_messages_need_the_users_word(void **state)
{
    (void)state;
    assert_int_equal(command(MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_HIL_SENSOR, 10000), MAV_RESULT_DENIED);
    assert_int_equal(command(MAV_CMD_REQUEST_MESSAGE, MAVLINK_MSG_ID_HIL_GPS, 0), MAV_RESULT_TEMPORARILY_REJECTED);
    run_ms(100);
    assert_true(r.world_calls == 0);
    mav_station_close(&r.m);
    open_with(200);
    read_at(0, 2.5);
    const unsigned from = r.count;
    run_ms(1000);
    mavlink_hil_sensor_t hil;
    mavlink_hil_gps_t gps;
    assert_in_range(count_of(MAVLINK_MSG_ID_HIL_SENSOR, from), 199, 201);
    assert_in_range(count_of(MAVLINK_MSG_ID_HIL_GPS, from), 4, 6);
    mavlink_msg_hil_sensor_decode(last(MAVLINK_MSG_ID_HIL_SENSOR, from), &hil);
    assert_true(hil.ygyro == 0.2f && fabsf(hil.abs_pressure - 998.9f) < 0.2f);
    mavlink_msg_hil_gps_decode(last(MAVLINK_MSG_ID_HIL_GPS, from), &gps);
    assert_int_equal(gps.lat, 504500000);
    assert_int_equal(gps.vel, 500);
    assert_int_equal(gps.vn, -300);
    assert_int_equal(gps.cog, 12686);
}

/* ---- commands */

static void each_command_is_answered(void **state)
{
    (void)state;
    static const struct {
        uint16_t number;
        float p1, p2;
        uint8_t result;
    } rows[] = {
        {MAV_CMD_REQUEST_MESSAGE, MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, MAV_RESULT_ACCEPTED},
        {MAV_CMD_REQUEST_MESSAGE, MAVLINK_MSG_ID_HIGHRES_IMU, 0, MAV_RESULT_TEMPORARILY_REJECTED}, /* no reading yet */
        {MAV_CMD_REQUEST_MESSAGE, MAVLINK_MSG_ID_RC_CHANNELS, 0, MAV_RESULT_UNSUPPORTED},
        {MAV_CMD_REQUEST_MESSAGE, NAN, 0, MAV_RESULT_UNSUPPORTED},
        {MAV_CMD_REQUEST_MESSAGE, 1e30f, 0, MAV_RESULT_UNSUPPORTED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_ATTITUDE, 20000, MAV_RESULT_ACCEPTED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_ATTITUDE, -1, MAV_RESULT_ACCEPTED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_ATTITUDE, NAN, MAV_RESULT_DENIED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_ATTITUDE, 1, MAV_RESULT_DENIED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_ATTITUDE, -2, MAV_RESULT_DENIED},
        {MAV_CMD_SET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_HEARTBEAT, -1, MAV_RESULT_DENIED},
        {MAV_CMD_GET_MESSAGE_INTERVAL, MAVLINK_MSG_ID_HEARTBEAT, 0, MAV_RESULT_ACCEPTED},
        {MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, MAV_RESULT_UNSUPPORTED},
        {MAV_CMD_COMPONENT_ARM_DISARM, 1, 0, MAV_RESULT_UNSUPPORTED},
    };
    for (unsigned i = 0; i < COUNT(rows); i++)
        assert_int_equal(command(rows[i].number, rows[i].p1, rows[i].p2), rows[i].result);
    mavlink_statustext_t text;
    mavlink_msg_statustext_decode(last(MAVLINK_MSG_ID_STATUSTEXT, 0), &text); /* the second chunk */
    assert_int_equal(text.chunk_seq, 1);
}

static void a_command_for_another_system_is_let_by(void **state)
{
    (void)state;
    const mavlink_command_long_t other = {
        .command = MAV_CMD_REQUEST_MESSAGE, .target_system = 43, .target_component = 7};
    const mavlink_command_long_t all = {.command = MAV_CMD_REQUEST_MESSAGE};
    take(MAV_KIND(COMMAND_LONG), &other);
    assert_int_equal(r.count, 0);
    take(MAV_KIND(COMMAND_LONG), &all);
    assert_int_equal(count_of(MAVLINK_MSG_ID_COMMAND_ACK, 0), 1);
}

static void files_are_refused_at_once(void **state)
{
    (void)state;
    mavlink_file_transfer_protocol_t q = {.target_system = 42, .payload = {0xFF, 0xFF, 3, 4}}, a;
    take(MAV_KIND(FILE_TRANSFER_PROTOCOL), &q);
    mavlink_msg_file_transfer_protocol_decode(last(MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, 0), &a);
    static const uint8_t expected[13] = {0, 0, 3, 129, 1, 4, 0, 0, 0, 0, 0, 0, 10};
    assert_memory_equal(a.payload, expected, sizeof expected);
    assert_int_equal(a.target_system, 255);
    q.payload[3] = 128; /* an answer is not answered */
    take(MAV_KIND(FILE_TRANSFER_PROTOCOL), &q);
    assert_int_equal(count_of(MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, 0), 1);
}

/* ---- parameters of the unit */

static void a_list_has_every_parameter_once_in_order(void **state)
{
    (void)state;
    const mavlink_param_request_list_t list = {.target_system = 42, .target_component = 7};
    take(MAV_KIND(PARAM_REQUEST_LIST), &list);
    run_ms(50);
    unsigned next = 0;
    for (unsigned i = 0; i < r.count; i++) {
        mavlink_param_value_t v;
        if (r.sent[i].msgid != MAVLINK_MSG_ID_PARAM_VALUE) continue;
        mavlink_msg_param_value_decode(&r.sent[i], &v);
        assert_int_equal(v.param_index, next++);
        assert_int_equal(v.param_count, COUNT(params));
    }
    assert_int_equal(next, COUNT(params));
}

static void a_name_of_sixteen_characters_is_found(void **state)
{
    (void)state;
    r.word = 2;
    ask_param("SIXTEEN_CHARS_OK", -1);
    run_ms(5);
    const mavlink_param_value_t v = value_of(0);
    assert_memory_equal(v.param_id, "SIXTEEN_CHARS_OK", 16);
    assert_true(v.param_value == 2.0f);
    ask_param("", 7);
    run_ms(5);
    const mavlink_param_value_t counter = value_of(0);
    uint32_t bits;
    memcpy(&bits, &counter.param_value, 4);
    assert_int_equal(bits, 0xFFFFFFFE);
    assert_int_equal(counter.param_type, MAV_PARAM_U32);
}

static void a_write_goes_to_the_unit_and_is_read_back(void **state)
{
    (void)state;
    set_param("WORD", 2, MAV_PARAM_R32);
    run_ms(10);
    assert_int_equal(r.word, 2);
    assert_true(value_of(0).param_value == 2.0f);
    assert_int_equal(r.requests, 2);
}

static void what_the_unit_or_the_range_rejects_leaves_the_value(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        float value;
        uint8_t type;
    } rows[] = {
        {"WORD", 3, MAV_PARAM_R32},    /* the unit aborts */
        {"WORD", 4, MAV_PARAM_R32},    /* above its limit */
        {"WORD", 0.5f, MAV_PARAM_R32}, /* no integer */
        {"WORD", NAN, MAV_PARAM_R32},
        {"WORD", 1, 1},                         /* UINT8: not its type */
        {"SIXTEEN_CHARS_OK", 1, MAV_PARAM_R32}, /* read-only */
    };
    r.word = 1;
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const unsigned from = r.count;
        set_param(rows[i].name, rows[i].value, rows[i].type);
        run_ms(10);
        assert_int_equal(r.word, 1);
        assert_true(value_of(from).param_value == 1.0f);
        assert_non_null(last(MAVLINK_MSG_ID_STATUSTEXT, from));
        assert_int_equal(r.m.counters.params_refused, i + 1);
    }
}

static void rates_are_parameters_too(void **state)
{
    (void)state;
    set_param("MAV_ANGLES_HZ", 0, MAV_PARAM_R32);
    set_param("MAV_IMU_HZ", 25, MAV_PARAM_R32);
    set_param("MAV_IMU_HZ", 1e-40f, MAV_PARAM_R32); /* an interval that no clock can hold */
    run_ms(2);
    assert_true(value_of(0).param_value == 25.0f);
    const unsigned from = r.count;
    run_ms(500);
    assert_int_equal(count_of(MAVLINK_MSG_ID_ATTITUDE, from), 0);
    ask_param("BENCH_VALUE", -1);
    run_ms(1);
    assert_true(value_of(from).param_value == 123.5f);
}

static void a_scale_that_another_host_writes_is_followed(void **state)
{
    (void)state;
    struct can_msg m = {.id = 0x600 + NODE, .len = 8, .data = {0x23, 0x10, 0x22, 1}};
    const float zero = 2.0f;
    memcpy(&m.data[4], &zero, 4);
    can_send(&r.bus, &r.host, &m, 0);
    run_ms(2);
    read_at(0, 2.75);
    assert_true(r.m.accel_mps2[0] == 0.75 * MAV_G_MPS2);
    set_param("ZERO_V_X", 2.25f, MAV_PARAM_R32);
    run_ms(10);
    read_at(0, 2.75);
    assert_true(r.m.accel_mps2[0] == 0.5 * MAV_G_MPS2);
}

static void an_access_waits_for_another_host_and_then_goes_on(void **state)
{
    (void)state;
    const struct can_msg segment = {.id = 0x600 + NODE, .len = 8, .data = {0x60}}; /* of an upload: never answered */
    can_send(&r.bus, &r.host, &segment, 0);
    run_ms(1);
    ask_param("WORD", -1);
    run_ms(900);
    assert_int_equal(r.requests, 1);
    run_ms(200); /* a second after the other's last word */
    assert_int_equal(r.requests, 2);
    assert_non_null(last(MAVLINK_MSG_ID_PARAM_VALUE, 0));
}

static void an_answer_about_another_object_is_not_ours(void **state)
{
    (void)state;
    struct can_msg a = {.id = 0x580 + NODE, .len = 8, .data = {0x43, 0x10, 0x22, 2}};
    r.unit_is_off = true; /* the test answers */
    ask_param("ZERO_V_X", -1);
    run_ms(2);
    can_send(&r.bus, &r.host, &a, r.s.now_ns);
    run_ms(2);
    assert_null(last(MAVLINK_MSG_ID_PARAM_VALUE, 0));
    a.data[3] = 1;
    can_send(&r.bus, &r.host, &a, r.s.now_ns);
    run_ms(2);
    assert_non_null(last(MAVLINK_MSG_ID_PARAM_VALUE, 0));
}

static void a_unit_that_is_off_ends_the_list(void **state)
{
    (void)state;
    const mavlink_param_request_list_t list = {.target_system = 42, .target_component = 7};
    r.unit_is_off = true;
    take(MAV_KIND(PARAM_REQUEST_LIST), &list);
    run_ms(3500);
    assert_int_equal(r.m.sdo.timeouts, 1);
    assert_int_equal(count_of(MAVLINK_MSG_ID_PARAM_VALUE, 0), 5); /* those of link and bench, and NaN */
    assert_true(isnan(value_of(0).param_value));
    r.unit_is_off = false;
    const unsigned from = r.count;
    ask_param("WORD", -1);
    run_ms(5);
    assert_non_null(last(MAVLINK_MSG_ID_PARAM_VALUE, from));
}

static void more_requests_than_there_is_room_for_are_counted(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 100; i++) ask_param("WORD", -1);
    run_ms(200);
    assert_int_equal(count_of(MAVLINK_MSG_ID_PARAM_VALUE, 0), MAV_PARAM_JOBS);
    assert_int_equal(r.m.counters.jobs_dropped, 100 - MAV_PARAM_JOBS);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fresh, forget)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_frame_comes_out_of_its_parser_as_it_went_in),
        TEST(a_flipped_bit_is_counted_and_the_next_frame_is_whole),
        TEST(names_are_printable_whatever_came),
        TEST(numbers_travel_exactly_and_32_bit_integers_bytewise),
        TEST(what_is_no_value_of_a_parameter_is_refused),
        TEST(a_heartbeat_a_second_and_readouts_at_their_rate),
        TEST(readings_go_out_exactly_and_the_imu_at_its_rate),
        TEST(hil_messages_need_the_users_word),
        TEST(each_command_is_answered),
        TEST(a_command_for_another_system_is_let_by),
        TEST(files_are_refused_at_once),
        TEST(a_list_has_every_parameter_once_in_order),
        TEST(a_name_of_sixteen_characters_is_found),
        TEST(a_write_goes_to_the_unit_and_is_read_back),
        TEST(what_the_unit_or_the_range_rejects_leaves_the_value),
        TEST(rates_are_parameters_too),
        TEST(a_scale_that_another_host_writes_is_followed),
        TEST(an_access_waits_for_another_host_and_then_goes_on),
        TEST(an_answer_about_another_object_is_not_ours),
        TEST(a_unit_that_is_off_ends_the_list),
        TEST(more_requests_than_there_is_room_for_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
