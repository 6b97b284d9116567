#include "can_rig.h"

#include "base/can/bits.h"
#include "base/rng.h"
#include "link/can/slcan.h"

#include <string.h>

static const struct {
    const char *line;
    enum slcan_err err;
    struct can_msg m;
} rows[] = {
    /* Lawicel manual: tiiildd, Tiiiiiiiildd, riiil, Riiiiiiiil */
    {"t4563112233", SLCAN_OK, {.id = 0x456, .len = 3, .data = {0x11, 0x22, 0x33}}},
    {"t0000", SLCAN_OK, {.id = 0, .len = 0}},
    {"t7FF80011223344556677", SLCAN_OK, {.id = 0x7FF, .len = 8, .data = {0, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77}}},
    {"t7ff1ab", SLCAN_OK, {.id = 0x7FF, .len = 1, .data = {0xAB}}}, /* lower case is read, too */
    {"T000000002AABB", SLCAN_OK, {.id = 0, .flags = CAN_EXT, .len = 2, .data = {0xAA, 0xBB}}},
    {"T1FFFFFFF100", SLCAN_OK, {.id = 0x1FFFFFFF, .flags = CAN_EXT, .len = 1, .data = {0}}},
    {"r1234", SLCAN_OK, {.id = 0x123, .flags = CAN_RTR, .len = 4}},
    {"R1FFFFFFF8", SLCAN_OK, {.id = 0x1FFFFFFF, .flags = CAN_RTR | CAN_EXT, .len = 8}},
    /* CANable 2.0: d D FD, b B FD with bit rate switch; DLC 9 = 12 bytes */
    {"d12300", SLCAN_LONG, {0}},
    {"d1230", SLCAN_OK, {.id = 0x123, .flags = CAN_FD, .len = 0}},
    {"b2059000102030405060708090A0B",
     SLCAN_OK,
     {.id = 0x205, .flags = CAN_FD | CAN_BRS, .len = 12, .data = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}}},
    {"D0000001188442211000AABBCCD", SLCAN_LONG, {0}},
    {"D0000001188442211000AABBCC",
     SLCAN_OK,
     {.id = 0x11, .flags = CAN_FD | CAN_EXT, .len = 8, .data = {0x84, 0x42, 0x21, 0x10, 0x00, 0xAA, 0xBB, 0xCC}}},
    {"D0000001188442211000AABBC", SLCAN_SHORT, {0}},
    {"B1FFFFFFF17F", SLCAN_OK, {.id = 0x1FFFFFFF, .flags = CAN_FD | CAN_BRS | CAN_EXT, .len = 1, .data = {0x7F}}},
    /* refusals */
    {"", SLCAN_NO_FRAME, {0}},
    {"O", SLCAN_NO_FRAME, {0}},
    {"S8", SLCAN_NO_FRAME, {0}},
    {"\xff\x01", SLCAN_NO_FRAME, {0}},
    {"t", SLCAN_SHORT, {0}},
    {"t123", SLCAN_SHORT, {0}},
    {"t1231", SLCAN_SHORT, {0}}, /* truncated payload must not be completed from an earlier line */
    {"t12312", SLCAN_SHORT, {0}},
    {"t1231234", SLCAN_LONG, {0}},
    {"T1231AA", SLCAN_SHORT, {0}},
    {"r123400", SLCAN_LONG, {0}}, /* a remote frame has no data */
    {"tG231AA", SLCAN_DIGIT, {0}},
    {"t123X", SLCAN_DIGIT, {0}},
    {"t1231A ", SLCAN_DIGIT, {0}},
    {"t8001AA", SLCAN_ID, {0}},
    {"T200000001AA", SLCAN_ID, {0}},
    {"t1239000102030405060708", SLCAN_DLC, {0}},
    {"r123F", SLCAN_DLC, {0}},
};

static void lines_are_read_as_the_manuals_say(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct can_msg m = {.id = 99, .len = 1, .data = {0xEE}};
        const struct can_msg before = m;
        const enum slcan_err err = slcan_decode(rows[i].line, strlen(rows[i].line), &m);
        assert_int_equal(err, rows[i].err);
        assert_same_frame(&m, err ? &before : &rows[i].m);
    }
}

static void every_kind_of_frame_survives_the_round_trip(void **state)
{
    (void)state;
    static const uint8_t kinds[] = {0, CAN_RTR, CAN_FD, CAN_FD | CAN_BRS};
    struct rng r = rng_stream(rig_seed(1), 0, "slcan");
    for (int i = 0; i < 20000; i++) {
        const uint8_t ext = rng_u64(&r) & 1 ? CAN_EXT : 0;
        const struct can_msg m = random_frame(&r, (uint8_t)(kinds[rng_u64(&r) % COUNT(kinds)] | ext));
        char line[SLCAN_LINE_MAX];
        struct can_msg back;
        const size_t n = slcan_encode(&m, line, sizeof line);
        assert_true(n > 0);
        assert_int_equal(slcan_decode(line, n, &back), SLCAN_OK);
        assert_same_frame(&back, &m);
    }
}

static void a_frame_that_does_not_fit_writes_nothing(void **state)
{
    (void)state;
    const struct can_msg m = {.id = 0x123, .len = 2, .data = {1, 2}};
    char line[16];
    memset(line, '?', sizeof line);
    assert_int_equal(slcan_encode(&m, line, 8), 0);
    assert_int_equal(line[0], '?');
    assert_int_equal(slcan_encode(&m, line, 9), 9);
    assert_memory_equal(line, "t12320102?", 10);
}

static void what_is_no_frame_has_no_text(void **state)
{
    (void)state;
    static const struct can_msg bad[] = {
        {.id = 0x800, .len = 1},
        {.id = 1, .len = 9},
        {.id = 1, .flags = CAN_FD, .len = 9},
        {.id = 1, .flags = CAN_ERROR, .len = 8},
    };
    char line[SLCAN_LINE_MAX];
    for (size_t i = 0; i < COUNT(bad); i++) assert_int_equal(slcan_encode(&bad[i], line, sizeof line), 0);
}

static void random_bytes_are_refused_or_round_trip(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(2), 0, "slcan");
    for (int i = 0; i < 200000; i++) {
        char line[24], again[SLCAN_LINE_MAX];
        const size_t n = rng_u64(&r) % sizeof line;
        for (size_t k = 0; k < n; k++) line[k] = "tTrRdDbB0123456789AFaf\r\n"[rng_u64(&r) % 24];
        struct can_msg m;
        if (slcan_decode(line, n, &m)) continue;
        assert_true(can_valid(&m));
        assert_int_equal(slcan_encode(&m, again, sizeof again), n);
    }
}

static void dlc_and_length_follow_the_fd_table(void **state)
{
    (void)state;
    static const uint8_t len[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64}; /* ISO 11898-1 */
    for (uint8_t dlc = 0; dlc < 16; dlc++) {
        char line[5 + 2 * 64 + 1];
        struct can_msg m;
        (void)snprintf(line, sizeof line, "d123%X%0*d", dlc, 2 * len[dlc], 0);
        assert_int_equal(slcan_decode(line, 5u + 2u * len[dlc], &m), SLCAN_OK);
        assert_int_equal(m.len, len[dlc]);
        assert_int_equal(can_dlc(len[dlc]), dlc);
    }
    assert_int_equal(can_dlc(9), 9); /* the next larger one */
}

static void status_bits_show_the_controller_state(void **state)
{
    (void)state;
    static const struct {
        uint32_t id;
        uint8_t controller, status;
    } status_rows[] = {
        {CAN_CLASS_PROTOCOL | CAN_CLASS_BUS_ERROR, 0, 0x80},
        {CAN_CLASS_CONTROLLER, CAN_CONTROLLER_RX_WARNING, 0x04},
        {CAN_CLASS_CONTROLLER, CAN_CONTROLLER_TX_WARNING, 0x04},
        {CAN_CLASS_CONTROLLER, CAN_CONTROLLER_RX_PASSIVE, 0x20},
        {CAN_CLASS_CONTROLLER, CAN_CONTROLLER_TX_PASSIVE, 0x20},
        {CAN_CLASS_CONTROLLER, CAN_CONTROLLER_ACTIVE, 0x00},
        {CAN_CLASS_BUS_OFF, 0, 0x20},
        {CAN_CLASS_RESTARTED, CAN_CONTROLLER_ACTIVE, 0x20},
    };
    for (size_t i = 0; i < COUNT(status_rows); i++) {
        const struct can_msg m = {
            .id = status_rows[i].id, .flags = CAN_ERROR, .len = 8, .data = {0, status_rows[i].controller}};
        assert_int_equal(slcan_error_status(&m), status_rows[i].status);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_read_as_the_manuals_say),
        cmocka_unit_test(every_kind_of_frame_survives_the_round_trip),
        cmocka_unit_test(a_frame_that_does_not_fit_writes_nothing),
        cmocka_unit_test(what_is_no_frame_has_no_text),
        cmocka_unit_test(random_bytes_are_refused_or_round_trip),
        cmocka_unit_test(dlc_and_length_follow_the_fd_table),
        cmocka_unit_test(status_bits_show_the_controller_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
