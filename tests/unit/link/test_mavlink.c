/* MAVLink below its sockets: frames, values of parameters, streams, commands; nothing of the OS. */
#include "mavlink_rig.h"

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
    assert_int_equal(gps.vd, 150);
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
