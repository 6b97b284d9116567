/* ADS1281/ADS1282: continuous synchronisation, STANDBY, power-up, PWDN, MFLAG and pin mode (sources 1.1, 1.6). */
#include "ads1282_rig.h"

#include "base/bits.h"

/* ---- Continuous synchronisation ---- */

static void continuous_sync_pulses_drdy_with_zeros_until_settled(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    wreg(&r, 1, 0xD2);
    ads1282_sync_pin(&r.a, true, at_tclk(&r, r.tclk + 100));
    const int64_t from = r.tclk;
    for (int p = 0; p < 65; p++) {
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + T_DR_1000 + (p - 62) * 4096));
        const uint32_t word = read_bytes(&r, 4);
        assert_int_equal(word != 0, p >= 62);
    }
    assert_int_equal(r.a.count.conversions, 3);
}

/* Sources 1.6: a periodic SYNC of a whole number of data periods within one CLK does not restart; any other does. */
static void only_a_sync_out_of_step_restarts(void **state)
{
    (void)state;
    static const struct {
        int64_t periods, off_tclk;
        bool restarts;
    } rows[] = {{1, 0, false},  {1, 1, false}, {1, -1, false}, {1, 2, true},    {1, -2, true},  {7, 0, false},
                {70, 1, false}, {70, 2, true}, {0, 1, false},  {0, 2000, true}, {3, 2048, true}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        wreg(&r, 1, 0xD2);
        ads1282_sync_pin(&r.a, true, at_tclk(&r, r.tclk + 4096)); /* the first one always restarts */
        const int64_t from = r.tclk;
        assert_int_equal(r.a.count.restarts, 2);
        ads1282_sync_pin(&r.a, false, r.s.now_ns);
        ads1282_sync_pin(&r.a, true, at_tclk(&r, from + rows[k].periods * 4096 + rows[k].off_tclk));
        if (r.a.count.restarts != 2u + rows[k].restarts)
            fail_msg("%d periods and %d tCLK", (int)rows[k].periods, (int)rows[k].off_tclk);
    }
}

/* E2E 621415: C2h, 250 words/s, and 250 Hz from another clock: DOUT stays 0 without end. 20 ppm off here. */
static void a_sync_that_drifts_keeps_dout_at_zero_for_ever(void **state)
{
    (void)state;
    for (int locked = 0; locked < 2; locked++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = 1.0;
        wreg(&r, 1, 0xC2);
        unsigned settled = 0;
        const int64_t from_ns = r.s.now_ns + 1000;
        for (int64_t i = 0; i < 200; i++) {
            const int64_t t_ns = from_ns + i * (locked ? 4000000 : 4000080);
            sched_run_until(&r.s, t_ns);
            ads1282_sync_pin(&r.a, true, t_ns);
            sched_run_until(&r.s, t_ns + 2000000);
            ads1282_sync_pin(&r.a, false, t_ns + 2000000);
            settled += r.a.out >> 32 != 0;
        }
        assert_in_range(settled, locked ? 130 : 0, locked ? 140 : 0);
        assert_in_range(r.a.count.restarts, locked ? 2 : 30, locked ? 2 : 200);
        assert_true(r.falls > 100); /* DRDY goes on; a restart just before a fall skips it */
    }
}

/* ---- STANDBY ---- */

static void standby_keeps_registers_and_wakeup_settles_in_t_dr(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, ADS1282_OFC0, 0x33);
    to_fall(&r);
    SEND(&r, 0x11, 0x02);
    assert_false(r.a.running);
    const unsigned samples = r.samples;
    assert_int_equal(to_fall(&r), 0);
    assert_int_equal(r.samples, samples);
    assert_true(ads1282_drdy(&r.a));
    hex_is(rreg(&r, ADS1282_OFC0), 0x33); /* its third byte, 00h, is a register's clock, no WAKEUP */
    assert_true(r.a.standby);
    ads1282_sync_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(to_fall(&r), 0);
    SEND(&r, 0x10, 0x00);
    const int64_t edge = r.tclk;
    assert_true(r.a.running);
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
    hex_is(read_bytes(&r, 4), 0xFFFFCD01); /* OFC is still there */
}

static void wakeup_while_running_changes_nothing(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x00, 0x01);
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, T_DR_1000));
}

/* ---- Power-up and PWDN ---- */

static void power_up_takes_65536_tclk_before_t_dr(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.power_up_tclk = 65536;
    struct rig r;
    powered(&r, &cfg);
    at_tclk(&r, 65535);
    wreg(&r, 1, 0x56); /* the 8th rise comes 2 bytes later: after the internal reset, which ate the first ones */
    powered(&r, &cfg);
    at_tclk(&r, 65000);
    wreg(&r, 1, 0x56);
    hex_is(reg_peek(&r.a.regs, 1), 0x52);
    ads1282_reset_pin(&r.a, false, r.s.now_ns);
    ads1282_reset_pin(&r.a, true, r.s.now_ns + 1000);
    assert_false(r.a.running);
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 65536 + T_DR_1000));
}

static void reset_held_beyond_power_up_counts_from_its_rise(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.power_up_tclk = 65536;
    struct rig r;
    unpowered(&r, &cfg, 1);
    ads1282_reset_pin(&r.a, false, 0);
    ads1282_power_up(&r.a, 0);
    ads1282_reset_pin(&r.a, true, at_tclk(&r, 70000));
    assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 70000 + T_DR_1000));
}

static void pwdn_forgets_everything_and_its_rise_is_a_power_up(void **state)
{
    (void)state;
    for (int64_t wake = 0; wake <= 65536; wake += 65536) {
        struct ads1282_cfg cfg = quiet;
        cfg.power_up_tclk = (uint32_t)wake;
        struct rig r;
        powered(&r, &cfg);
        to_fall(&r);
        SEND(&r, 0x11, 0x41, 0x00, 0x56);
        to_fall(&r);
        ads1282_pwdn_pin(&r.a, false, at_tclk(&r, r.tclk + 100));
        assert_true(ads1282_drdy(&r.a));
        assert_false(r.a.running);
        const unsigned samples = r.samples;
        wreg(&r, ADS1282_OFC0, 0x33);
        ads1282_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(to_fall(&r), 0);
        assert_int_equal(r.samples, samples);
        ads1282_pwdn_pin(&r.a, true, at_tclk(&r, clk_count_at(&r.clk, r.s.now_ns)));
        hex_is(reg_peek(&r.a.regs, 1), 0x52);
        hex_is(reg_peek(&r.a.regs, ADS1282_OFC0), 0);
        assert_true(r.a.rdatac);
        const int64_t from = r.tclk;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, from + wake + T_DR_1000));
    }
}

/* ---- MFLAG ---- */

/* Blocks of 128 tCLK at 1000 words/s, sampled at their middles, from tCLK 112 on. */
static void mflag_is_high_while_the_newest_sample_is_at_full_scale(void **state)
{
    (void)state;
    static const struct {
        double v;
        bool want;
    } rows[] = {{0.0, false}, {2.4999999, false},  {2.5, true},  {2.6, true},
                {9.0, true},  {-2.4999999, false}, {-2.5, true}, {-3.0, true}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        for (int chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++) {
            struct rig r;
            struct ads1282_cfg cfg = quiet;
            cfg.chain = (enum ads1282_chain)chain;
            wired(&r, &cfg, 1, (struct ads1282_io){.mflag = mflag});
            ads1282_power_up(&r.a, 0);
            at_tclk(&r, 300000);
            r.v = rows[k].v;
            at_tclk(&r, 305000);
            assert_int_equal(r.mflag, rows[k].want);
            assert_int_equal(ads1282_mflag(&r.a), rows[k].want);
            r.v = 0.0;
            at_tclk(&r, 310000);
            assert_int_equal(r.mflags, rows[k].want ? 2 : 0);
        }
    }
}

static void mflag_moves_at_the_sample_that_sees_it(void **state)
{
    (void)state;
    struct rig r;
    wired(&r, &quiet, 1, (struct ads1282_io){.mflag = mflag});
    ads1282_power_up(&r.a, 0);
    at_tclk(&r, 112 + 128 * 50);
    r.v = 3.0;
    at_tclk(&r, 112 + 128 * 51 - 1);
    assert_int_equal(r.mflags, 0);
    at_tclk(&r, 112 + 128 * 51 + 1);
    assert_int_equal(r.mflag_ns, clk_edge_ns(&r.clk, 112 + 128 * 51));
    SEND(&r, 0x02); /* STANDBY: nothing compares any more */
    assert_false(r.mflag);
    assert_false(ads1282_mflag(&r.a));
    r.v = 0.0;
    SEND(&r, 0x00);
    at_tclk(&r, r.tclk + 1000);
    assert_int_equal(r.mflags, 2);
}

static void watching_mflag_changes_no_word(void **state)
{
    (void)state;
    struct rig r[2];
    struct ads1282_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    for (int watched = 0; watched < 2; watched++) {
        wired(&r[watched], &cfg, 9, (struct ads1282_io){.mflag = watched ? mflag : NULL});
        ads1282_power_up(&r[watched].a, 0);
        r[watched].ramp_v_per_s = 10.0;
    }
    for (int i = 0; i < 300; i++) {
        assert_int_equal(to_fall(&r[0]), to_fall(&r[1]));
        hex_is(read_bytes(&r[0], 4), read_bytes(&r[1], 4));
    }
    assert_int_equal(r[1].mflags, 1);
}

/* ---- Pin mode ---- */

static void mode_pins_choose_rate_phase_and_high_pass(void **state)
{
    (void)state;
    for (unsigned code = 0; code < 16; code++) {
        const struct ads1282_mode_pins pins = {(uint8_t)(code & 3), code & 4, code & 8, false};
        struct ads1282_cfg cfg = quiet;
        cfg.part = ADS1282_PART_1281;
        cfg.pin_mode = true;
        struct rig r;
        powered(&r, &cfg);
        r.v = 1.0;
        ads1282_mode_pins(&r.a, &pins, at_tclk(&r, 1000));
        const int64_t n = 128 >> pins.dr;
        const bool changed = code != 0;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, 1000 * changed + 8061 * n + n / 2 + 468));
        const double first = fraction(read_bytes(&r, 4));
        assert_int_equal(to_fall(&r) - clk_edge_ns(&r.clk, 1000 * changed + 8061 * n + n / 2 + 468 + 128 * n), 0);
        const double next = fraction(read_bytes(&r, 4));
        near(next / first, pins.high_pass ? 0.987596 : 1.0, 1e-6);
        const double dc = pins.minimum_phase ? 1.000169 : 1.0000287;
        if (!pins.high_pass) near(first, 0.4 * dc, 1e-7);
        assert_int_equal(r.a.count.restarts, changed);
    }
}

static void in_pin_mode_commands_do_nothing_and_words_come_always(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.part = ADS1282_PART_1281;
    cfg.pin_mode = true;
    struct rig r;
    powered(&r, &cfg);
    r.bus = PINS;
    r.v = -1.5;
    const uint32_t word = settled_word(&r);
    for (unsigned code = 0; code < 256; code += 4) {
        to_fall(&r);
        uint32_t got = 0;
        for (unsigned i = 0; i < 4; i++) got = got << 8 | byte(&r, (uint8_t)(code + i));
        hex_is(got, word);
    }
    assert_int_equal(r.a.count.restarts + r.a.count.refused + r.a.count.bad_opcodes + r.a.count.gap_violations, 0);
    const uint8_t reset[ADS1282_REGS] = {0x00, 0x52, 0x08, 0x32, 0x03, 0, 0, 0, 0, 0, 0x40};
    assert_memory_equal(r.a.reg_value, reset, sizeof reset);
}

static void continuous_sync_by_its_mode_pin(void **state)
{
    (void)state;
    struct ads1282_cfg cfg = quiet;
    cfg.part = ADS1282_PART_1281;
    cfg.pin_mode = true;
    struct rig r;
    powered(&r, &cfg);
    const struct ads1282_mode_pins pins = {2, false, false, true};
    ads1282_mode_pins(&r.a, &pins, at_tclk(&r, 1000));
    assert_int_equal(to_fall(&r),
                     clk_edge_ns(&r.clk, 1000 + T_DR_1000 - 62 * 4096)); /* DRDY toggles from the first period */
    ads1282_mode_pins(&r.a, &pins, r.s.now_ns);
    assert_int_equal(r.a.count.restarts, 1); /* the same again is no change */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(continuous_sync_pulses_drdy_with_zeros_until_settled),
        cmocka_unit_test(only_a_sync_out_of_step_restarts),
        cmocka_unit_test(a_sync_that_drifts_keeps_dout_at_zero_for_ever),
        cmocka_unit_test(standby_keeps_registers_and_wakeup_settles_in_t_dr),
        cmocka_unit_test(wakeup_while_running_changes_nothing),
        cmocka_unit_test(power_up_takes_65536_tclk_before_t_dr),
        cmocka_unit_test(reset_held_beyond_power_up_counts_from_its_rise),
        cmocka_unit_test(pwdn_forgets_everything_and_its_rise_is_a_power_up),
        cmocka_unit_test(mflag_is_high_while_the_newest_sample_is_at_full_scale),
        cmocka_unit_test(mflag_moves_at_the_sample_that_sees_it),
        cmocka_unit_test(watching_mflag_changes_no_word),
        cmocka_unit_test(mode_pins_choose_rate_phase_and_high_pass),
        cmocka_unit_test(in_pin_mode_commands_do_nothing_and_words_come_always),
        cmocka_unit_test(continuous_sync_by_its_mode_pin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
