#include "can_rig.h"

#include "base/rng.h"
#include "link/can/udp_can.h"
#include "link/can/udp_frame.h"

#include <string.h>

static const struct {
    const char *what, *bytes;
    size_t size;
    bool good;
    struct can_msg m;
} rows[] = {
#define ROW(what, text, good, ...)                                                                                     \
    {                                                                                                                  \
        what, text, sizeof(text) - 1, good, __VA_ARGS__                                                                \
    }
    /* what is absent has the defaults of can.Message */
    ROW("an empty map", "\x80", true, {.flags = CAN_EXT}),
    ROW("an identifier of 32 bits",
        "\x81\xae"
        "arbitration_id"
        "\xce\x1f\xff\xff\xff",
        true, {.id = 0x1FFFFFFF, .flags = CAN_EXT}),
    ROW("data say the length",
        "\x82\xae"
        "is_extended_id"
        "\xc2\xa4"
        "data"
        "\xc4\x02\x01\x02",
        true, {.len = 2, .data = {1, 2}}),
    ROW("a time that is an integer",
        "\x81\xa9"
        "timestamp"
        "\xd3\x00\x00\x00\x00\x00\x00\x00\x05",
        true, {.flags = CAN_EXT}),
    ROW("a remote frame",
        "\x82\xaf"
        "is_remote_frame"
        "\xc3\xa3"
        "dlc"
        "\x04",
        true, {.flags = CAN_EXT | CAN_RTR, .len = 4}),
    ROW("the later of two values",
        "\x82\xa3"
        "dlc"
        "\x04\xa3"
        "dlc"
        "\x00",
        true, {.flags = CAN_EXT}),
    /* refusals */
    ROW("nothing", "", false, {0}),
    ROW("no map", "\xc0", false, {0}),
    ROW("a map that is cut short", "\x81", false, {0}),
    ROW("a key that is cut short",
        "\x81\xa9"
        "time",
        false, {0}),
    ROW("bytes behind the map", "\x80\x00", false, {0}),
    ROW("an unknown key",
        "\x81\xa1"
        "x"
        "\x00",
        false, {0}),
    ROW("a key that begins like one",
        "\x81\xa2"
        "dl"
        "\x00",
        false, {0}),
    ROW("a list",
        "\x81\xa7"
        "channel"
        "\x90",
        false, {0}),
    ROW("an extension",
        "\x81\xa7"
        "channel"
        "\xd4\x00\x00",
        false, {0}),
    ROW("an identifier of 30 bits",
        "\x81\xae"
        "arbitration_id"
        "\xce\x20\x00\x00\x00",
        false, {0}),
    ROW("a negative identifier",
        "\x81\xae"
        "arbitration_id"
        "\xd0\xff",
        false, {0}),
    ROW("an identifier that is true",
        "\x81\xae"
        "arbitration_id"
        "\xc3",
        false, {0}),
    ROW("a base identifier of 12 bits",
        "\x82\xae"
        "is_extended_id"
        "\xc2\xae"
        "arbitration_id"
        "\xcd\x08\x00",
        false, {0}),
    ROW("a flag that is 1",
        "\x81\xa5"
        "is_fd"
        "\x01",
        false, {0}),
    ROW("a length without data",
        "\x81\xa3"
        "dlc"
        "\x04",
        false, {0}),
    ROW("data longer than their datagram",
        "\x81\xa4"
        "data"
        "\xc6\xff\xff\xff\xff\x00",
        false, {0}),
    ROW("9 bytes in a classic frame",
        "\x81\xa4"
        "data"
        "\xc4\x09"
        "123456789",
        false, {0}),
    ROW("9 bytes in an FD frame",
        "\x82\xa5"
        "is_fd"
        "\xc3\xa4"
        "data"
        "\xc4\x09"
        "123456789",
        false, {0}),
    ROW("data in a remote frame",
        "\x82\xaf"
        "is_remote_frame"
        "\xc3\xa4"
        "data"
        "\xc4\x01"
        "1",
        false, {0}),
    ROW("a remote FD frame",
        "\x82\xaf"
        "is_remote_frame"
        "\xc3\xa5"
        "is_fd"
        "\xc3",
        false, {0}),
    ROW("an error frame",
        "\x81\xae"
        "is_error_frame"
        "\xc3",
        false, {0}),
    ROW("a switched classic frame",
        "\x81\xae"
        "bitrate_switch"
        "\xc3",
        false, {0}),
#undef ROW
};

static void datagrams_are_read_as_python_can_reads_them(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct can_msg m = {.id = 0x555};
        print_message("%s\n", rows[i].what);
        assert_int_equal(udp_frame_decode((const uint8_t *)rows[i].bytes, rows[i].size, &m), rows[i].good);
        if (rows[i].good) assert_same_frame(&m, &rows[i].m);
        else assert_int_equal(m.id, 0x555);
    }
}

static void every_kind_of_frame_survives_the_round_trip(void **state)
{
    static const uint8_t flags[] = {0, CAN_EXT, CAN_RTR, CAN_EXT | CAN_RTR, CAN_FD, CAN_FD | CAN_BRS | CAN_EXT};
    struct rng r = rng_stream(rig_seed(1), 0, "udp");
    (void)state;
    for (unsigned i = 0; i < 6000; i++) {
        const struct can_msg m = random_frame(&r, flags[i % sizeof flags]);
        uint8_t bytes[UDP_FRAME_MAX];
        struct can_msg back;
        const size_t n = udp_frame_encode(&m, 1.5, i & 1 ? "can0" : NULL, bytes);
        assert_in_range(n, 150, UDP_FRAME_MAX);
        assert_true(udp_frame_decode(bytes, n, &back));
        assert_same_frame(&back, &m);
        assert_false(udp_frame_decode(bytes, n - 1 - rng_u64(&r) % (n - 1), &back)); /* cut short */
    }
}

static void groups_are_those_of_this_machine_s_administration(void **state)
{
    static const char *const good[] = {UDP_CAN_GROUP, "239.0.0.1", "239.255.255.255:1",
                                       "ff15::1",     "[ff02::1]", "[ff15:7079:7468:6f6e:6465:6d6f:6d63:6173]:65535"};
    static const char *const bad[] = {"",
                                      "224.0.0.1",
                                      "127.0.0.1",
                                      "239.1.1",
                                      "239.1.1.1:",
                                      "239.1.1.1:0",
                                      "239.1.1.1:65536",
                                      "239.1.1.1:1x",
                                      "fe80::1",
                                      "[ff15::1",
                                      "[ff15::1]1",
                                      "localhost",
                                      "239.74.163.2 ",
                                      "239.1.1.1:-1",
                                      "ff15:0000:0000:0000:0000:0000:0000:0000:0000:0000:0000:0001"};
    struct sockaddr_storage a;
    (void)state;
    for (size_t i = 0; i < COUNT(good); i++) assert_true(udp_can_group(good[i], &a));
    for (size_t i = 0; i < COUNT(bad); i++) assert_false(udp_can_group(bad[i], &a));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(datagrams_are_read_as_python_can_reads_them),
        cmocka_unit_test(every_kind_of_frame_survives_the_round_trip),
        cmocka_unit_test(groups_are_those_of_this_machine_s_administration),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
