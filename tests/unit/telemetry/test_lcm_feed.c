/* What the LCM feed makes of frames on a bus: samples that are not whole, and SDO as CiA 301 has it. */
#include "rig.h"

#include "gen/lcm/psabench_lcm_psa2_reading_t.h"
#include "gen/lcm/psabench_lcm_register_t.h"
#include "telemetry/lcm_feed.h"

#include <string.h>

enum { NODE = 5, XY = 0x185, ZT = 0x285, ANSWER = 0x585, REQUEST = 0x605 };

static struct {
    struct sched s;
    struct can_bus bus;
    struct can_node host, place;
    struct lab lab;
    struct unit unit;
    struct control_bench view;
    struct lcm_feed feed;
    unsigned readings, accesses, frames;
    int32_t x_code, z_code; /* of the latest reading */
    struct lcm_request access;
    int64_t abort_code;
    char name[32];
} r;

static int on_publish(void *lcm, const char *channel, const void *data, unsigned len)
{
    (void)lcm;
    r.frames += strcmp(channel, "PSABENCH_CAN_can0") == 0;
    if (strcmp(channel, "PSABENCH_PSA2_a") == 0) {
        psabench_lcm_psa2_reading_t m;
        assert_int_equal(psabench_lcm_psa2_reading_t_decode(data, 0, (int)len, &m), len);
        r.readings++;
        r.x_code = m.x_code;
        r.z_code = m.z_code;
        psabench_lcm_psa2_reading_t_decode_cleanup(&m);
    }
    if (strcmp(channel, "PSABENCH_REGISTER_a") == 0) {
        psabench_lcm_register_t m;
        assert_int_equal(psabench_lcm_register_t_decode(data, 0, (int)len, &m), len);
        r.accesses++;
        r.access =
            (struct lcm_request){.write = m.write, .index = (uint16_t)m.index, .sub = (uint8_t)m.sub, .value = m.value};
        r.abort_code = m.abort;
        snprintf(r.name, sizeof r.name, "%s", m.name);
        psabench_lcm_register_t_decode_cleanup(&m);
    }
    return 0;
}

static int fresh(void **state)
{
    const struct can_bus_cfg bus = {.data_bitrate_hz = 5000000}; /* ideal */
    const struct lab_cfg lab = lab_default();
    const struct unit_cfg cfg = unit_default("a");
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &bus, &r.s);
    lab_init(&r.lab, &lab, 1);
    unit_init(&r.unit, &cfg, &r.lab, &r.s);
    r.unit.cfg.node = NODE;
    r.host = (struct can_node){.name = "host", .fd = true, .order = CAN_ORDER_FIFO};
    r.place = (struct can_node){.name = "unit"};
    can_attach(&r.bus, &r.host);
    r.view = (struct control_bench){.lab = &r.lab,
                                    .bus = {&r.bus},
                                    .buses = 1,
                                    .unit = {&r.unit},
                                    .unit_name = {"a"},
                                    .node = {&r.place},
                                    .units = 1,
                                    .sched = &r.s};
    r.feed.port.url.kind = LCM_UDPM;
    r.feed.port.udpm.publish = on_publish;
    lcm_feed_start(&r.feed, &r.view, 0, 0);
    can_attach(&r.bus, &r.place); /* the unit gets its power after the feed has begun */
    return 0;
}

static void put(uint32_t id, const char *data, uint8_t len)
{
    struct can_msg m = {.id = id, .len = len};
    memcpy(m.data, data, len);
    assert_int_equal(can_send(&r.bus, &r.host, &m, r.s.now_ns), CAN_OK);
    sched_run_until(&r.s, r.s.now_ns + 1000);
}

/* ---- samples */

static void a_sample_is_published_when_both_halves_have_come_in_order(void **state)
{
    static const struct {
        const char *frames; /* X: PSA2_XY of the number that follows; Z: PSA2_ZT */
        unsigned readings;
        int32_t x, z; /* of the latest */
    } rows[] = {
        {"X1Z2", 1, 1, 2},   {"Z2", 0, 0, 0},       {"X1", 0, 0, 0},   {"Z9X1Z2", 1, 1, 2},     {"X1X3Z4", 1, 3, 4},
        {"X1Z2Z3", 1, 1, 2}, {"X1Z2X3Z4", 2, 3, 4}, {"Z1Z2", 0, 0, 0}, {"X1Z2Z9X5Z6", 2, 5, 6},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        fresh(state);
        for (const char *f = rows[i].frames; *f; f += 2) {
            const char data[8] = {(char)(f[1] - '0')};
            put(*f == 'X' ? XY : ZT, data, 8);
        }
        if (r.readings != rows[i].readings || r.x_code != rows[i].x || r.z_code != rows[i].z)
            fail_msg("%s: %u readings, x %d, z %d", rows[i].frames, r.readings, r.x_code, r.z_code);
    }
}

static void frames_of_another_length_or_node_are_no_samples(void **state)
{
    (void)state;
    put(XY, "\1\0\0\0\0\0\0", 7);
    put(ZT, "\1\0\0\0\0\0\0\0", 8);
    put(XY + 1, "\1\0\0\0\0\0\0\0", 8);
    put(ZT + 1, "\1\0\0\0\0\0\0\0", 8);
    assert_int_equal(r.readings, 0);
    assert_int_equal(r.frames, 4);
}

static void a_sample_is_that_of_its_unit_among_a_thousand(void **state)
{
    enum { LAST = CONTROL_UNITS_MAX - 1 };
    (void)state;
    lcm_feed_stop(&r.feed);
    for (unsigned i = 0; i < LAST; i++) {
        r.view.unit[i] = &r.unit;
        r.view.unit_name[i] = "b";
        r.view.node[i] = NULL;
    }
    r.view.units = CONTROL_UNITS_MAX;
    r.view.unit[LAST] = &r.unit;
    r.view.unit_name[LAST] = "a";
    r.view.node[LAST] = &r.place;
    lcm_feed_start(&r.feed, &r.view, 0, 0);
    put(XY, "\1\0\0\0\0\0\0\0", 8);
    put(ZT, "\2\0\0\0\0\0\0\0", 8);
    assert_int_equal(r.readings, 1);
    assert_int_equal(r.z_code, 2);
}

/* ---- SDO: request and answer, 8 bytes each */

static void numbers_have_as_many_bytes_as_the_command_says(void **state)
{
    static const struct {
        const char *request, *answer;
        bool write;
        uint16_t index;
        uint8_t sub;
        int64_t value, abort_code;
        const char *name;
    } rows[] = {
        {"\x40\x00\x20\x02\0\0\0\0", "\x4F\x00\x20\x02\x56\xAA\xBB\xCC", false, 0x2000, 2, 0x56, 0, "CONFIG0"},
        {"\x40\x17\x10\x00\0\0\0\0", "\x4B\x17\x10\x00\x34\x12\xBB\xCC", false, 0x1017, 0, 0x1234, 0,
         "Producer heartbeat time"},
        {"\x40\x18\x10\x02\0\0\0\0", "\x43\x18\x10\x02\x32\x41\x53\xF0", false, 0x1018, 2, 0xF0534132, 0,
         "Product code"},
        {"\x40\x00\x20\x02\0\0\0\0", "\x42\x00\x20\x02\x01\x02\x03\x04", false, 0x2000, 2, 0x04030201, 0, "CONFIG0"},
        {"\x2F\x00\x20\x03\x09\xAA\xBB\xCC", "\x60\x00\x20\x03\0\0\0\0", true, 0x2000, 3, 9, 0, "CONFIG1"},
        {"\x2F\x00\x20\x01\x09\0\0\0", "\x80\x00\x20\x01\x02\x00\x01\x06", true, 0x2000, 1, 0, 0x06010002, "ID"},
        {"\x40\x00\x50\x00\0\0\0\0", "\x80\x00\x50\x00\x00\x00\x02\x06", false, 0x5000, 0, 0, 0x06020000, ""},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        put(REQUEST, rows[i].request, 8);
        put(ANSWER, rows[i].answer, 8);
        assert_int_equal(r.accesses, i + 1);
        assert_int_equal(r.access.write, rows[i].write);
        assert_int_equal(r.access.index, rows[i].index);
        assert_int_equal(r.access.sub, rows[i].sub);
        assert_int_equal(r.access.value, rows[i].value);
        assert_int_equal(r.abort_code, rows[i].abort_code);
        assert_string_equal(r.name, rows[i].name);
    }
}

static void an_answer_without_its_request_is_no_access(void **state)
{
    static const struct {
        const char *request, *answer;
        uint8_t len;
    } rows[] = {
        {"\x40\x00\x20\x02\0\0\0\0", "\x4F\x00\x20\x03\x56\0\0\0", 8},   /* another sub-index */
        {"\x40\x00\x20\x02\0\0\0\0", "\x4F\x01\x20\x02\x56\0\0\0", 8},   /* another object */
        {"\x40\x00\x20\x02\0\0\0\0", "\x4F\x00\x20\x02\x56\0\0", 7},     /* too short */
        {"\x40\x00\x20\x02\0\0\0\0", "\x60\x00\x20\x02\0\0\0\0", 8},     /* of a write */
        {"\x2F\x00\x20\x02\x01\0\0\0", "\x4F\x00\x20\x02\x01\0\0\0", 8}, /* of a read */
        {"\x40\x08\x10\x00\0\0\0\0", "\x41\x08\x10\x00\x05\0\0\0", 8},   /* a text, in segments */
        {"\x21\x08\x10\x00\x05\0\0\0", "\x60\x08\x10\x00\0\0\0\0", 8},
        {"\x60\x00\x20\x02\0\0\0\0", "\x60\x00\x20\x02\0\0\0\0", 8}, /* a segment */
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        put(REQUEST, rows[i].request, 8);
        put(ANSWER, rows[i].answer, rows[i].len);
        if (r.accesses) fail_msg("row %zu is taken for an access", i);
    }
    put(REQUEST, rows[0].request, 8);
    put(ANSWER, "\x4F\x00\x20\x02\x56\0\0\0", 8);
    put(ANSWER, "\x4F\x00\x20\x02\x56\0\0\0", 8); /* once more */
    assert_int_equal(r.accesses, 1);
}

static void a_stopped_feed_publishes_nothing(void **state)
{
    (void)state;
    lcm_feed_stop(&r.feed);
    put(XY, "\1\0\0\0\0\0\0\0", 8);
    sched_run_until(&r.s, NS_PER_S);
    assert_int_equal(r.frames, 0);
    lcm_feed_stop(&r.feed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sample_is_published_when_both_halves_have_come_in_order),
        cmocka_unit_test_setup(a_sample_is_that_of_its_unit_among_a_thousand, fresh),
        cmocka_unit_test_setup(frames_of_another_length_or_node_are_no_samples, fresh),
        cmocka_unit_test_setup(numbers_have_as_many_bytes_as_the_command_says, fresh),
        cmocka_unit_test_setup(an_answer_without_its_request_is_no_access, fresh),
        cmocka_unit_test_setup(a_stopped_feed_publishes_nothing, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
