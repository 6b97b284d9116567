#include "can_rig.h"

#include "base/rng.h"
#include "link/can/cannelloni_can.h"
#include "link/can/cannelloni_frame.h"

#include <string.h>

enum { DATAGRAM_MAX = 1472 };

/* ---- single frames, byte by byte */

static const struct {
    const char *what, *bytes;
    size_t size;
    struct can_msg m;
} frames[] = {
#define ROW(what, text, ...)                                                                                           \
    {                                                                                                                  \
        what, text, sizeof(text) - 1, __VA_ARGS__                                                                      \
    }
    ROW("a base frame", "\x00\x00\x05\x85\x03\x01\x02\x03", {.id = 0x585, .len = 3, .data = {1, 2, 3}}),
    ROW("without data", "\x00\x00\x07\xFF\x00", {.id = 0x7FF}),
    ROW("an extended frame", "\x9F\xFF\xFF\xFF\x01\xAA",
        {.id = 0x1FFFFFFF, .flags = CAN_EXT, .len = 1, .data = {0xAA}}),
    ROW("a low extended identifier", "\x80\x00\x00\x01\x00", {.id = 1, .flags = CAN_EXT}),
    ROW("a remote frame", "\x40\x00\x01\x24\x04", {.id = 0x124, .flags = CAN_RTR, .len = 4}),
    ROW("an extended remote frame", "\xC1\x23\x45\x67\x08", {.id = 0x1234567, .flags = CAN_EXT | CAN_RTR, .len = 8}),
    ROW("an error frame", "\x20\x00\x00\x04\x02\x00\x08", {.id = 4, .flags = CAN_ERROR, .len = 2, .data = {0, 8}}),
    ROW("an FD frame", "\x00\x00\x00\x10\x82\x00\x01\x02", {.id = 16, .flags = CAN_FD, .len = 2, .data = {1, 2}}),
    ROW("an FD frame without data", "\x00\x00\x00\x10\x80\x00", {.id = 16, .flags = CAN_FD}),
    ROW("a switched FD frame", "\x80\x00\x00\x10\x81\x01\x55",
        {.id = 16, .flags = CAN_EXT | CAN_FD | CAN_BRS, .len = 1, .data = {0x55}}),
#undef ROW
};

static void a_frame_has_its_bytes_and_no_others(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(frames); i++) {
        const uint8_t *bytes = (const uint8_t *)frames[i].bytes;
        uint8_t out[CANNELLONI_FRAME_MAX];
        struct can_msg m;
        print_message("%s\n", frames[i].what);
        assert_int_equal(cannelloni_put_frame(&frames[i].m, out), frames[i].size);
        assert_memory_equal(out, bytes, frames[i].size);
        assert_int_equal(cannelloni_take_frame(bytes, frames[i].size, &m), frames[i].size);
        assert_same_frame(&m, &frames[i].m);
        for (size_t n = 0; n < frames[i].size; n++) assert_int_equal(cannelloni_take_frame(bytes, n, &m), 0);
    }
}

static void esi_and_flags_of_newer_kernels_are_passed_over(void **state)
{
    struct can_msg m;
    (void)state;
    assert_int_equal(cannelloni_take_frame((const uint8_t *)"\x00\x00\x00\x01\x80\x06", 6, &m), 6);
    assert_int_equal(m.flags, CAN_FD);
    assert_int_equal(cannelloni_take_frame((const uint8_t *)"\x00\x00\x00\x01\x80\x07", 6, &m), 6);
    assert_int_equal(m.flags, CAN_FD | CAN_BRS);
}

static void what_no_can_frame_is_shows_as_such(void **state)
{
    static const struct {
        const char *what, *head;
        size_t size, used;
    } rows[] = {
        {"a base identifier of 12 bits", "\x00\x00\x08\x00\x00", 5, 5},
        {"9 bytes in a classic frame", "\x00\x00\x00\x01\x09", 14, 14},
        {"9 bytes in an FD frame", "\x00\x00\x00\x01\x89\x00", 15, 15},
        {"a remote FD frame", "\x40\x00\x00\x01\x80\x00", 6, 6},
        {"a remote frame of 127 bytes", "\x40\x00\x00\x01\x7F", 5, 5},
        {"65 bytes: no frame at all", "\x00\x00\x00\x01\xC1\x00", 71, 0},
        {"127 bytes: no frame at all", "\x00\x00\x00\x01\x7F", 132, 0},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        uint8_t bytes[200] = {0};
        struct can_msg m;
        memcpy(bytes, rows[i].head, rows[i].size < 6 ? rows[i].size : 6);
        print_message("%s\n", rows[i].what);
        assert_int_equal(cannelloni_take_frame(bytes, rows[i].size, &m), rows[i].used);
        if (rows[i].used) assert_false(can_valid(&m));
    }
}

/* ---- datagrams */

static size_t take_all(const uint8_t *bytes, size_t size, unsigned count, const struct can_msg *want)
{
    size_t at = CANNELLONI_HEADER;
    for (unsigned i = 0; i < count; i++) {
        struct can_msg m;
        at += cannelloni_take_frame(bytes + at, size - at, &m);
        assert_same_frame(&m, &want[i]);
    }
    return at;
}

/* Cut short anywhere, with a byte more, or with another count it is none. */
static void assert_only_whole(uint8_t *bytes, size_t size, unsigned count)
{
    uint8_t seq = 77;
    unsigned n = 78;
    for (size_t cut = 0; cut < size; cut++) assert_false(cannelloni_check(bytes, cut, &seq, &n));
    assert_false(cannelloni_check(bytes, size + 1, &seq, &n));
    for (int d = -1; d <= 1; d += 2) {
        const uint16_t other = (uint16_t)(count + (unsigned)d);
        bytes[3] = (uint8_t)(other >> 8);
        bytes[4] = (uint8_t)other;
        assert_false(cannelloni_check(bytes, size, &seq, &n));
    }
    assert_int_equal(seq, 77);
    assert_int_equal(n, 78);
}

static void datagrams_of_frames_of_every_kind_come_through(void **state)
{
    static const uint8_t flags[] = {0, CAN_EXT, CAN_RTR, CAN_EXT | CAN_RTR, CAN_FD, CAN_FD | CAN_BRS | CAN_EXT};
    struct rng r = rng_stream(rig_seed(1), 0, "cannelloni");
    (void)state;
    for (unsigned k = 0; k < 300; k++) {
        uint8_t bytes[DATAGRAM_MAX + 1] = {0}, seq;
        struct can_msg m[300];
        unsigned count = 0, got;
        size_t n = CANNELLONI_HEADER;
        const unsigned wanted = 1 + (unsigned)(rng_u64(&r) % 40);
        while (count < wanted && n + CANNELLONI_FRAME_MAX <= DATAGRAM_MAX) {
            m[count] = random_frame(&r, flags[rng_u64(&r) % sizeof flags]);
            n += cannelloni_put_frame(&m[count++], bytes + n);
        }
        cannelloni_put_header((uint8_t)k, (uint16_t)count, bytes);
        assert_true(cannelloni_check(bytes, n, &seq, &got));
        assert_int_equal(seq, (uint8_t)k);
        assert_int_equal(got, count);
        assert_int_equal(take_all(bytes, n, count, m), n);
        assert_only_whole(bytes, n, count);
    }
}

static void headers_of_other_kinds_are_refused(void **state)
{
    uint8_t bytes[CANNELLONI_HEADER], seq;
    unsigned count;
    (void)state;
    cannelloni_put_header(200, 0, bytes);
    assert_memory_equal(bytes, "\x02\x00\xC8\x00\x00", 5);
    assert_true(cannelloni_check(bytes, 5, &seq, &count)); /* an empty datagram */
    assert_true(seq == 200 && count == 0);
    cannelloni_put_header(0, 0x1234, bytes);
    assert_memory_equal(bytes + 3, "\x12\x34", 2);
    for (unsigned i = 0; i < 2; i++) {
        for (unsigned v = 0; v < 256; v++) {
            cannelloni_put_header(0, 0, bytes);
            bytes[i] = (uint8_t)v;
            assert_int_equal(cannelloni_check(bytes, 5, &seq, &count), v == (i ? 0 : 2));
        }
    }
}

/* ---- ports */

static void a_tunnel_has_two_ports(void **state)
{
    static const struct {
        const char *text;
        uint16_t own, peer; /* peer 0: refused */
    } rows[] = {
        {"", 20000, 20001}, {"0", 0, 20001},     {"30000", 30000, 20001}, {"0:7", 0, 7}, {"65535:1", 65535, 1},
        {"7:7", 0, 0},      {"20001", 0, 0},     {"1:0", 0, 0},           {"1:", 0, 0},  {":1", 0, 0},
        {"1:2:3", 0, 0},    {"65536", 0, 0},     {"1:65536", 0, 0},       {"00", 0, 0},  {"-1", 0, 0},
        {"1 ", 0, 0},       {"localhost", 0, 0}, {"127.0.0.1:1", 0, 0},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct cannelloni_ports p = {5, 6};
        print_message("\"%s\"\n", rows[i].text);
        assert_int_equal(cannelloni_can_ports(rows[i].text, &p), rows[i].peer != 0);
        assert_int_equal(p.own, rows[i].peer ? rows[i].own : 5);
        assert_int_equal(p.peer, rows[i].peer ? rows[i].peer : 6);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_frame_has_its_bytes_and_no_others),
        cmocka_unit_test(esi_and_flags_of_newer_kernels_are_passed_over),
        cmocka_unit_test(what_no_can_frame_is_shows_as_such),
        cmocka_unit_test(datagrams_of_frames_of_every_kind_come_through),
        cmocka_unit_test(headers_of_other_kinds_are_refused),
        cmocka_unit_test(a_tunnel_has_two_ports),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
