/* Parameters of a unit over MAVLink: lists, writes, the SDO client among other hosts. */
#include "mavlink_rig.h"

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

int main(void)
{
    const struct CMUnitTest tests[] = {
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
