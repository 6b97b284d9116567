/* ADS1281/ADS1282: DRDY, reading in both modes, tears, a slipped clock (sources 1.4, 1.5). */
#include "ads1282_rig.h"
#include "base/rng.h"

static void drdy_is_high_while_settling(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    at_tclk(&r, T_DR_1000 - 1);
    assert_int_equal(r.falls + r.rises, 0);
    assert_true(ads1282_drdy(&r.a));
    at_tclk(&r, T_DR_1000);
    assert_false(ads1282_drdy(&r.a));
}

static void an_unread_word_pulses_drdy_for_4_tclk_and_is_an_overrun(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    for (int i = 0; i < 4; i++) to_fall(&r);
    assert_int_equal(r.rises, 3);
    assert_int_equal(r.rise_ns, clk_edge_ns(&r.clk, T_DR_1000 + 3 * 4096 - 4));
    assert_int_equal(r.fall_ns, clk_edge_ns(&r.clk, T_DR_1000 + 3 * 4096));
    assert_int_equal(r.a.count.overruns, 3);
}

static void drdy_rises_at_the_first_sclk_fall_of_a_read(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    for (int i = 0; i < 3; i++) {
        to_fall(&r);
        const int64_t from = r.tclk;
        read_bytes(&r, 4);
        assert_int_equal(r.rise_ns, clk_edge_ns(&r.clk, from + 24 + BIT_TCLK / 2));
        assert_int_equal(r.rises, i + 1);
    }
    assert_int_equal(r.a.count.overruns, 0);
    assert_int_equal(r.a.count.torn_reads, 0);
}

static void reading_24_bits_is_allowed_and_more_than_32_gives_zeros(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    const uint32_t word = settled_word(&r);
    hex_is(read_bytes(&r, 4), 0);
    for (int i = 0; i < 3; i++) {
        to_fall(&r);
        hex_is(read_bytes(&r, 3), word >> 8);
    }
    assert_int_equal(r.a.count.torn_reads, 0);
}

/* 24 bits whose last rise comes 256 tCLK before the update were given up: the next word begins at bit 31. Four clocks later they
 * are a read under way, and it tears. */
static void an_unfinished_read_is_given_up_after_256_tclk(void **state)
{
    (void)state;
    for (int64_t rest_tclk = 252; rest_tclk <= 256; rest_tclk += 4) {
        struct rig r;
        powered(&r, &quiet);
        r.v = 1.0;
        const uint32_t word = settled_word(&r);
        to_fall(&r);
        const int64_t fall_tclk = r.tclk;
        hex_is(read_bytes(&r, 3), word >> 8);
        const int64_t read_tclk = clk_count_at(&r.clk, r.a.sclk_ns) - fall_tclk;
        to_fall(&r);
        at_tclk(&r, fall_tclk + 2 * 4096 - rest_tclk - read_tclk);
        hex_is(read_bytes(&r, 3), word >> 8);
        to_fall(&r);
        const bool torn = rest_tclk < 256;
        assert_int_equal(r.a.count.torn_reads, torn);
        hex_is(read_bytes(&r, 1), torn ? word & 0xFF : word >> 24);
    }
}

static void a_late_read_gets_the_newest_word_whole(void **state)
{
    (void)state;
    struct rig r;
    struct rig ref;
    powered(&r, &quiet);
    powered(&ref, &quiet);
    r.ramp_v_per_s = ref.ramp_v_per_s = 5.0;
    for (int i = 0; i < 3; i++) to_fall(&r), to_fall(&ref);
    at_tclk(&r, r.tclk + 3500); /* most of a period later */
    const uint32_t word = read_bytes(&ref, 4);
    hex_is(read_bytes(&r, 4), word);
    assert_int_equal(r.a.count.overruns, 2);
    assert_int_equal(r.a.count.torn_reads, 0);
}

/* Reads n bits, the next conversion ends, reads on. */
static uint32_t torn(struct rig *r, unsigned bits_before)
{
    uint32_t word = 0;
    at_tclk(r, T_DR_1000 + 66 * 4096 - 4 * (int64_t)bits_before - 2); /* the fall is 2 tCLK after the last rise */
    for (unsigned i = 0; i < 32; i++) {
        const int64_t t_ns = at_tclk(r, r->tclk + 4);
        word = (word << 1) | spi_miso(&r->a.spi);
        spi_sample(&r->a.spi, false, t_ns);
        if (i % 8 == 0) spi_first(&r->a.spi, t_ns + 488);
    }
    return word;
}

static void a_read_across_a_conversion_tears_at_its_bit(void **state)
{
    (void)state;
    uint32_t old_word = 0;
    uint32_t new_word = 0;
    struct rig r;
    powered(&r, &quiet);
    r.ramp_v_per_s = 20.0;
    while (r.falls < 67) {
        to_fall(&r);
        old_word = new_word;
        new_word = read_bytes(&r, 4);
    }
    assert_true((old_word ^ new_word) > 0xFFFFFF);
    for (unsigned bits = 1; bits < 32; bits++) {
        powered(&r, &quiet);
        r.ramp_v_per_s = 20.0;
        while (r.falls < 66) to_fall(&r);
        const uint32_t low = UINT32_MAX >> bits;
        hex_is(torn(&r, bits), (old_word & ~low) | (new_word & low));
        assert_int_equal(r.a.count.torn_reads, 1);
    }
}

static void a_read_by_bytes_tears_at_its_byte(void **state)
{
    (void)state;
    struct rig r;
    struct rig ref;
    powered(&r, &quiet);
    powered(&ref, &quiet);
    r.ramp_v_per_s = ref.ramp_v_per_s = 20.0;
    while (r.falls < 66) to_fall(&r), to_fall(&ref);
    const uint32_t old_word = read_bytes(&ref, 4);
    to_fall(&ref);
    const uint32_t new_word = read_bytes(&ref, 4);
    at_tclk(&r, r.tclk + 4096 - 60);
    uint32_t word = byte(&r, 0);
    word = word << 24 | read_bytes(&r, 3);
    assert_int_equal(r.falls, 67);
    hex_is(word, (old_word & 0xFF000000) | (new_word & 0xFFFFFF));
    assert_int_equal(r.a.count.torn_reads, 1);
}

/* Where inside the byte the conversion ended, a bus of bytes cannot tell: the whole byte is new. */
static void a_byte_across_a_conversion_is_new_and_counted(void **state)
{
    (void)state;
    struct rig r;
    struct rig ref;
    powered(&r, &quiet);
    powered(&ref, &quiet);
    r.ramp_v_per_s = ref.ramp_v_per_s = 20.0;
    while (r.falls < 66) {
        to_fall(&r);
        to_fall(&ref);
    }
    to_fall(&ref);
    at_tclk(&r, r.tclk + 4096 - 24 - 10);
    hex_is(read_bytes(&r, 4), read_bytes(&ref, 4));
    assert_int_equal(r.falls, 67);
    assert_int_equal(r.a.count.torn_reads, 1);
}

static void writing_while_data_are_shifted_out_disturbs_neither(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = -0.3;
    const uint32_t word = settled_word(&r);
    to_fall(&r);
    uint32_t got = byte(&r, 0x48);
    got = got << 8 | byte(&r, 0x00);
    got = got << 8 | byte(&r, 0x5A);
    got = got << 8 | byte(&r, 0x00);
    hex_is(got, word);
    hex_is(reg_peek(&r.a.regs, ADS1282_FSC0), 0x5A);
}

static void sdatac_silences_dout_and_rdata_asks_for_one_word(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 0.7;
    const uint32_t word = settled_word(&r);
    SEND(&r, 0x11);
    to_fall(&r); /* DRDY goes on */
    hex_is(read_bytes(&r, 4), 0);
    assert_false(ads1282_drdy(&r.a)); /* SCLK without data does not raise it */
    at_tclk(&r, r.tclk + 1000);
    SEND(&r, 0x12);
    assert_true(ads1282_drdy(&r.a));
    hex_is(read_bytes(&r, 1), 0);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), word);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), 0); /* one RDATA, one word */
    SEND(&r, 0x10);
    to_fall(&r);
    hex_is(read_bytes(&r, 4), word);
    assert_int_equal(r.a.count.overruns, 64 - 1);
}

static void registers_read_in_rdatac_are_refused_and_data_win(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 0.7;
    const uint32_t word = settled_word(&r);
    to_fall(&r);
    uint32_t got = byte(&r, 0x21);
    got = got << 8 | byte(&r, 0x00);
    hex_is(got << 16 | read_bytes(&r, 2), word);
    assert_int_equal(r.a.count.refused, 1);
}

static void a_stray_clock_garbles_commands_until_sclk_rests_64_periods(void **state)
{
    (void)state;
    for (int periods = 63; periods <= 64; periods++) {
        struct rig r;
        powered(&r, &quiet);
        r.bus = BITS;
        r.v = 1.1;
        const uint32_t word = settled_word(&r);
        spi_sample(&r.a.spi, true, r.s.now_ns);
        spi_first(&r.a.spi, r.s.now_ns);
        to_fall(&r);
        hex_is(read_bytes(&r, 4), word); /* the output register does not care */
        for (int i = 0; i < periods; i++) to_fall(&r);
        wreg(&r, ADS1282_HPF0, 0x77);
        hex_is(reg_peek(&r.a.regs, ADS1282_HPF0), periods < 64 ? 0x32 : 0x77);
        assert_int_equal(r.a.count.realigned, periods < 64 ? 0 : 1);
    }
}

static void a_half_command_is_dropped_after_64_periods(void **state)
{
    (void)state;
    for (int periods = 63; periods <= 64; periods++) {
        struct rig r;
        powered(&r, &quiet);
        to_fall(&r);
        SEND(&r, 0x43, 0x00);
        for (int i = 0; i < periods; i++) to_fall(&r);
        SEND(&r, 0x11); /* data of the old WREG, or SDATAC */
        assert_int_equal(r.a.rdatac, periods < 64);
        hex_is(reg_peek(&r.a.regs, ADS1282_HPF0), periods < 64 ? 0x11 : 0x32);
    }
}

/* ---- A word at one go ---- */

/* n zeros without a gap; at one go where the rig's master may. Returns how often it could. */
static unsigned read_zeros(struct rig *r, uint8_t *out, unsigned n, bool at_once)
{
    const int64_t first = r->tclk + r->gap_tclk;
    const int64_t end_ns = clk_edge_ns(&r->clk, first + (8 * n - 1) * BIT_TCLK);
    spi_first(&r->a.spi, at_tclk(r, first + BIT_TCLK / 2));
    if (at_once && sched_next_ns(&r->s) > end_ns && ads1282_only_shifts(&r->a)) {
        ads1282_shift(&r->a, out, n, at_tclk(r, first + (8 * n - 1) * BIT_TCLK));
        assert_int_equal(r->s.now_ns, end_ns);
        return 1;
    }
    for (unsigned i = 0; i < n; i++) {
        if (i > 0) spi_first(&r->a.spi, at_tclk(r, first + 8 * i * BIT_TCLK + BIT_TCLK / 2));
        out[i] = spi_byte(&r->a.spi, 0, at_tclk(r, first + (8 * i + 7) * BIT_TCLK));
    }
    return 0;
}

/* Whatever the chip is in the middle of: a command, a lost byte, a byte out of step, STANDBY, reset. */
static void before_the_read(struct rig *r, uint64_t u)
{
    static const uint8_t bytes[] = {0x11, 0x10, 0x12, 0x21, 0x43, 0x00, 0x20, 0x53};
    static const int gaps[] = {24, 30, 4};
    r->gap_tclk = gaps[(u >> 16) % COUNT(gaps)];
    if (u % 3 == 0) byte(r, bytes[(u >> 8) % sizeof bytes]);
    if (u % 5 == 0) at_tclk(r, r->tclk + (int64_t)(u >> 32) % 5000);
    if (u % 41 == 0) spi_sample(&r->a.spi, u >> 20 & 1, at_tclk(r, r->tclk + 30));
    if (u % 211 == 0) at_tclk(r, r->tclk + 64 * 4096);
    if (u % 997 == 0) byte(r, 0x02);
    if (u % 1009 == 0) ads1282_reset_pin(&r->a, false, at_tclk(r, r->tclk + 30));
    else if (u % 29 == 0) ads1282_reset_pin(&r->a, true, at_tclk(r, r->tclk + 30));
}

static void a_read_at_one_go_is_one_by_bytes(void **state)
{
    (void)state;
    static struct rig r[2];
    const uint64_t seed = rig_seed(7);
    unsigned at_once[2] = {0};
    for (unsigned strict = 0; strict < 2; strict++) {
        struct ads1282_cfg cfg = quiet;
        struct rng g = rng_stream(seed, strict, "bus");
        cfg.strict_gap = strict;
        for (unsigned i = 0; i < 2; i++) {
            powered(&r[i], &cfg);
            r[i].ramp_v_per_s = 1.0;
        }
        for (unsigned n = 0; n < 8000; n++) {
            uint8_t out[2][6];
            const uint64_t u = rng_u64(&g);
            const unsigned bytes = 1 + (unsigned)(u >> 50) % 6;
            for (unsigned i = 0; i < 2; i++) {
                before_the_read(&r[i], u);
                at_once[i] += read_zeros(&r[i], out[i], bytes, i);
            }
            assert_memory_equal(out[0], out[1], bytes);
            const struct ads1282 *const x = &r[0].a, *const y = &r[1].a;
            assert_true(x->rise_ns == y->rise_ns && x->sclk_ns == y->sclk_ns && x->in_byte == y->in_byte);
            assert_true(x->spi.sent == y->spi.sent && x->out_index == y->out_index);
            assert_int_equal(r[0].rises, r[1].rises);
            assert_int_equal(r[0].rise_ns, r[1].rise_ns);
            assert_memory_equal(&r[0].a.count, &r[1].a.count, sizeof r[0].a.count);
        }
        assert_memory_equal(r[0].a.reg_value, r[1].a.reg_value, ADS1282_REGS);
        assert_true(r[0].a.count.conversions > 100 && r[0].a.count.torn_reads > 0);
    }
    assert_true(at_once[1] > 1000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(drdy_is_high_while_settling),
        cmocka_unit_test(an_unread_word_pulses_drdy_for_4_tclk_and_is_an_overrun),
        cmocka_unit_test(drdy_rises_at_the_first_sclk_fall_of_a_read),
        cmocka_unit_test(reading_24_bits_is_allowed_and_more_than_32_gives_zeros),
        cmocka_unit_test(an_unfinished_read_is_given_up_after_256_tclk),
        cmocka_unit_test(a_late_read_gets_the_newest_word_whole),
        cmocka_unit_test(a_read_across_a_conversion_tears_at_its_bit),
        cmocka_unit_test(a_read_by_bytes_tears_at_its_byte),
        cmocka_unit_test(a_byte_across_a_conversion_is_new_and_counted),
        cmocka_unit_test(writing_while_data_are_shifted_out_disturbs_neither),
        cmocka_unit_test(sdatac_silences_dout_and_rdata_asks_for_one_word),
        cmocka_unit_test(registers_read_in_rdatac_are_refused_and_data_win),
        cmocka_unit_test(a_stray_clock_garbles_commands_until_sclk_rests_64_periods),
        cmocka_unit_test(a_half_command_is_dropped_after_64_periods),
        cmocka_unit_test(a_read_at_one_go_is_one_by_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
