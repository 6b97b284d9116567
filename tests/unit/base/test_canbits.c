#include "base/can/bits.h"
#include "base/rng.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

/* Not a single stuff bit but the fixed ones of an FD frame's stuff count and CRC. */
static struct can_bits least_bits(uint8_t flags, uint8_t len)
{
    const unsigned head = flags & CAN_EXT ? 33 : 14, tail = 1 + 1 + 1 + 7 + 3;
    const unsigned data = flags & CAN_RTR ? 0 : 8u * len;
    if (!(flags & CAN_FD)) return (struct can_bits){head + (flags & CAN_EXT ? 2 : 1) + 4 + data + 15 + tail, 0};
    const unsigned crc = len > 16 ? 25 + 7 : 21 + 6; /* stuff count, CRC, and the fixed stuff bits */
    const unsigned nominal = head + 3 + tail, fast = 5 + data + crc;
    return flags & CAN_BRS ? (struct can_bits){nominal, fast} : (struct can_bits){nominal + fast, 0};
}

/* Figures of sources can 3.1: worst-case stuffing and no stuffing, 1 Mbit/s, FD data phase 5 Mbit/s. */
static void bounds_are_the_figures_engineers_quote(void **state)
{
    (void)state;
    static const struct {
        uint8_t flags, len;
        unsigned least_us, worst_us; /* rounded */
    } row[] = {
        {0, 8, 111, 135},
        {CAN_EXT, 8, 131, 160},
        {CAN_FD | CAN_BRS, 8, 49, 57},
        {CAN_FD | CAN_BRS, 12, 56, 65},
        {CAN_FD | CAN_BRS, 16, 62, 73},
        {CAN_FD | CAN_BRS, 20, 69, 82},
        {CAN_FD | CAN_BRS, 32, 89, 106},
        {CAN_FD | CAN_BRS, 64, 140, 170},
    };
    const struct can_bus_cfg bus = {.bitrate_hz = 1000000, .data_bitrate_hz = 5000000};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const int64_t least_ns = can_bits_ns(least_bits(row[i].flags, row[i].len), &bus);
        const int64_t worst_ns = can_bits_ns(can_bits_worst(row[i].flags, row[i].len), &bus);
        assert_int_equal((least_ns + 500) / 1000, row[i].least_us);
        assert_int_equal((worst_ns + 500) / 1000, row[i].worst_us);
    }
}

/* Counted by hand, or by the bit-string model in tests/py/link/test_canbits.py. */
static void known_frames_have_known_lengths(void **state)
{
    (void)state;
    static const struct {
        struct can_msg m;
        unsigned nominal, data;
    } row[] = {
        /* SOF to CRC are 34 zeros: a stuff bit after every five */
        {{.id = 0, .len = 0}, 34 + 6 + 13, 0},
        /* RTR IDE r0 and the first three bits of the DLC are six zeros; one more run in the CRC */
        {{.id = 0x555, .len = 1, .data = {0x55}}, 42 + 2 + 13, 0},
        {{.id = 0x009, .len = 0}, 52, 0}, /* the CRC ends in five equal bits: one more after it */
        {{.id = 0x185, .len = 8}, 124, 0},
        {{.id = 0x1555, .flags = CAN_EXT}, 72, 0},
        /* FD with BRS and no run of five: 17 bits to BRS, 13 from the CRC delimiter on; ESI, DLC, data, count and CRC */
        {{.id = 0x2AA, .flags = CAN_FD | CAN_BRS, .len = 8, .data = {0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55}},
         17 + 13,
         5 + 64 + 27},
        {{.id = 0x205, .flags = CAN_FD | CAN_BRS, .len = 16}, 31, 185},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const struct can_bits n = can_bits_exact(&row[i].m);
        assert_int_equal(n.data, row[i].data);
        assert_int_equal(n.nominal, row[i].nominal);
    }
}

static struct can_msg any_frame(struct rng *r)
{
    static const uint8_t fd_len[] = {0, 1, 5, 8, 12, 16, 20, 24, 32, 48, 64};
    static const uint8_t form[] = {0, CAN_EXT, CAN_RTR, CAN_FD, CAN_FD | CAN_BRS, CAN_FD | CAN_BRS | CAN_EXT};
    struct can_msg m = {.flags = form[rng_u64(r) % 6]};
    m.id = (uint32_t)rng_u64(r) & (m.flags & CAN_EXT ? 0x1FFFFFFFu : 0x7FFu);
    m.len = m.flags & CAN_FD ? fd_len[rng_u64(r) % 11] : (uint8_t)(rng_u64(r) % 9);
    const bool sparse = rng_u64(r) & 1; /* long runs, many stuff bits */
    for (unsigned i = 0; i < m.len; i++) m.data[i] = (uint8_t)(sparse ? (rng_u64(r) & 1 ? 0xF0 : 0) : rng_u64(r));
    return m;
}

static void exact_length_lies_within_the_bounds(void **state)
{
    (void)state;
    const char *env = getenv("TEST_SEED");
    const uint64_t seed = env ? strtoull(env, NULL, 0) : 1;
    print_message("TEST_SEED=%llu\n", (unsigned long long)seed);
    struct rng r = rng_stream(seed, 0, "canbits");
    for (int i = 0; i < 20000; i++) {
        const struct can_msg m = any_frame(&r);
        assert_true(can_valid(&m));
        const struct can_bits n = can_bits_exact(&m);
        const struct can_bits least = least_bits(m.flags, m.len);
        const struct can_bits worst = can_bits_worst(m.flags, m.len);
        assert_in_range(n.nominal + n.data, least.nominal + least.data, worst.nominal + worst.data);
        assert_in_range(n.nominal, least.nominal, worst.nominal);
    }
}

static void length_codes_are_those_of_the_dlc_field(void **state)
{
    (void)state;
    static const struct {
        uint8_t len, dlc;
    } row[] = {{0, 0}, {8, 8}, {12, 9}, {16, 10}, {20, 11}, {24, 12}, {32, 13}, {48, 14}, {64, 15}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) assert_int_equal(can_dlc(row[i].len), row[i].dlc);
}

static void an_ideal_bus_takes_no_time(void **state)
{
    (void)state;
    const struct can_bus_cfg bus = {.bitrate_hz = 0, .data_bitrate_hz = 5000000};
    const struct can_msg m = {.id = 1, .len = 8};
    assert_int_equal(can_frame_ns(&bus, &m), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_are_the_figures_engineers_quote),
        cmocka_unit_test(known_frames_have_known_lengths),
        cmocka_unit_test(exact_length_lies_within_the_bounds),
        cmocka_unit_test(length_codes_are_those_of_the_dlc_field),
        cmocka_unit_test(an_ideal_bus_takes_no_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
