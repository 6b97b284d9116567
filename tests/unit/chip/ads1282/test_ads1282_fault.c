/* Faults of the ADS1282 at its pins, in its clock and its registers. */
#include "ads1282_rig.h"

enum { PERIOD_NS = 1000000 };

static struct rig rig;

static void set(struct rig *r, struct chip_fault f)
{
    ads1282_fault(&r->a, &f, r->s.now_ns);
}

static void a_stuck_drdy_moves_to_its_level_and_stays_there(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    to_fall(r);
    const unsigned falls = r->falls, rises = r->rises;
    set(r, (struct chip_fault){.drdy = CHIP_STUCK_HIGH});
    assert_int_equal(r->rises, rises + 1);
    assert_true(ads1282_drdy(&r->a));
    sched_run_until(&r->s, r->s.now_ns + 10 * PERIOD_NS);
    assert_int_equal(r->falls, falls);
    const uint32_t conversions = r->a.count.conversions;
    assert_true(conversions >= 10); /* inside all goes on */
    set(r, (struct chip_fault){.drdy = CHIP_STUCK_LOW});
    assert_int_equal(r->falls, falls + 1);
    sched_run_until(&r->s, r->s.now_ns + 10 * PERIOD_NS);
    assert_int_equal(r->falls, falls + 1);
    assert_int_equal(r->rises, rises + 1);
    set(r, (struct chip_fault){.drdy = CHIP_FREE});
    const int64_t fall_ns = to_fall(r);
    assert_true(fall_ns > 0);
    assert_int_equal((fall_ns - clk_edge_ns(&r->clk, T_DR_1000)) % PERIOD_NS, 0); /* on the old grid */
}

static void a_dead_dout_reads_as_its_level_by_bytes_bits_and_pins(void **state)
{
    (void)state;
    struct rig *r = &rig;
    for (enum bus bus = BYTES; bus <= PINS; bus++) {
        powered(r, &quiet);
        r->bus = bus;
        r->v = 0.4;
        settled_word(r);
        set(r, (struct chip_fault){.dout = CHIP_STUCK_HIGH});
        to_fall(r);
        hex_is(read_bytes(r, 4), 0xFFFFFFFF);
        to_fall(r);
        SEND(r, 0x11);
        hex_is(rreg(r, ADS1282_CONFIG0), 0xFF);
        SEND(r, 0x10);
        set(r, (struct chip_fault){.dout = CHIP_STUCK_LOW});
        to_fall(r);
        hex_is(read_bytes(r, 4), 0x00000000);
        set(r, (struct chip_fault){.dout = CHIP_FREE});
        to_fall(r);
        near(fraction(read_bytes(r, 4)), 0.4 / 2.5, 1e-4);
    }
}

static void a_read_at_one_go_is_not_taken_while_dout_is_dead(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    settled_word(r);
    to_fall(r);
    spi_first(&r->a.spi, r->s.now_ns + 1000);
    assert_true(ads1282_only_shifts(&r->a));
    set(r, (struct chip_fault){.dout = CHIP_STUCK_HIGH});
    assert_false(ads1282_only_shifts(&r->a));
}

static void dout_gets_stuck_in_the_middle_of_a_word(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    r->v = 0.4;
    settled_word(r);
    to_fall(r);
    assert_int_not_equal(byte(r, 0), 0xFF);
    set(r, (struct chip_fault){.dout = CHIP_STUCK_HIGH});
    hex_is(read_bytes(r, 3), 0xFFFFFF);
}

static void sync_is_not_heard(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    for (int i = 0; i < 3; i++) to_fall(r);
    set(r, (struct chip_fault){.lost_sync = true});
    const uint32_t restarts = r->a.count.restarts;
    ads1282_sync_pin(&r->a, true, r->s.now_ns);
    ads1282_sync_pin(&r->a, false, r->s.now_ns + 1000);
    SEND(r, 0x04);
    assert_int_equal(r->a.count.restarts, restarts);
    const int64_t before_ns = r->fall_ns;
    assert_int_equal(to_fall(r), before_ns + PERIOD_NS);
    set(r, (struct chip_fault){.lost_sync = false});
    ads1282_sync_pin(&r->a, true, r->s.now_ns);
    assert_int_equal(r->a.count.restarts, restarts + 1);
}

/* 1000 ppm slow: 4091904 Hz; a data period is 4096 tCLK. */
static void a_slow_clock_stretches_what_comes_and_nothing_that_was(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    const int64_t first_ns = to_fall(r);
    const int64_t at_ns = first_ns + PERIOD_NS / 2;
    sched_run_until(&r->s, at_ns);
    set(r, (struct chip_fault){.clock_ppm = -1000});
    assert_int_equal(r->a.clk.hz, 4091904);
    assert_in_range(at_ns - r->last_sample_ns, 0,
                    31249); /* the input up to now by the old clock, 32 samples a period */
    assert_in_range(r->a.next.t_ns - at_ns, 1, 31250 + 32);
    assert_int_equal(r->a.next.t_ns, clk_edge_ns(&r->a.clk, r->a.next.k));
    assert_int_equal(ads1282_period_ns(&r->a), clk_span_ns(4091904, 4096));
    const int64_t second_ns = to_fall(r);
    near((double)(second_ns - r->rise_ns), 4.0 / 4091904.0 * 1e9, 1.0); /* no one has read */
    near((double)(second_ns - first_ns), PERIOD_NS / 2 + PERIOD_NS / 2 * 4096000.0 / 4091904.0, 2.0);
    int64_t last_ns = second_ns;
    for (int i = 0; i < 1000; i++) last_ns = to_fall(r);
    near((double)(last_ns - second_ns), 1000.0 * PERIOD_NS * 4096000.0 / 4091904.0, 2.0);
    assert_int_equal(r->last_sample_ns <= last_ns, 1);
    r->v = 0.4;
    near(fraction(settled_word(r)), 0.4 / 2.5, 1e-4);
    set(r, (struct chip_fault){.clock_ppm = 0});
    const int64_t fast_ns = to_fall(r);
    assert_int_equal(ads1282_period_ns(&r->a), PERIOD_NS);
    near((double)(to_fall(r) - fast_ns), PERIOD_NS, 1.0);
}

static void a_fast_clock_keeps_its_rate_through_restarts_and_power(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    sched_run_until(&r->s, 500000);
    const int64_t due_ns = r->a.due.due_ns;
    set(r, (struct chip_fault){.clock_ppm = 500000}); /* in data period 0 */
    near((double)(r->a.due.due_ns - r->s.now_ns), (double)(due_ns - r->s.now_ns) / 1.5, 300.0);
    const int64_t first_ns = to_fall(r);
    near((double)(first_ns - 500000), ((double)T_DR_1000 / 4.096e6 * 1e9 - 500000.0) / 1.5, 300.0);
    near((double)(to_fall(r) - first_ns), PERIOD_NS / 1.5, 2.0);
    ads1282_sync_pin(&r->a, true, r->s.now_ns);
    const int64_t sync_ns = r->s.now_ns;
    near((double)(to_fall(r) - sync_ns), (double)T_DR_1000 / 4.096e6 / 1.5 * 1e9, 300.0);
    ads1282_power_off(&r->a, r->s.now_ns);
    ads1282_power_up(&r->a, r->s.now_ns);
    const int64_t up_ns = r->s.now_ns;
    near((double)(to_fall(r) - up_ns), (double)T_DR_1000 / 4.096e6 / 1.5 * 1e9, 300.0);
}

/* All kinds of chain and modes go on over a change of the clock. */
static void each_chain_survives_a_change_of_its_clock(void **state)
{
    (void)state;
    struct rig *r = &rig;
    static const uint8_t config0[] = {0x52, 0x51, 0x53, 0xD2};
    for (enum ads1282_chain chain = ADS1282_CHAIN_EXACT; chain <= ADS1282_CHAIN_DIRECT; chain++)
        for (unsigned k = 0; k < sizeof config0; k++) {
            struct ads1282_cfg cfg = quiet;
            cfg.chain = chain;
            powered(r, &cfg);
            at_tclk(r, 1000);
            wreg(r, ADS1282_CONFIG0, config0[k]);
            r->v = 0.4;
            for (int i = 0; i < 70; i++) to_fall(r);
            set(r, (struct chip_fault){.clock_ppm = -20000});
            for (int i = 0; i < 5; i++) assert_true(to_fall(r) > 0);
            set(r, (struct chip_fault){.clock_ppm = 20000});
            for (int i = 0; i < 5; i++) assert_true(to_fall(r) > 0);
            assert_int_equal(r->a.count.torn_reads, 0);
        }
}

static void a_flipped_bit_is_there_and_acts(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    r->v = 0.4;
    settled_word(r);
    assert_true(reg_flip(&r->a.regs, ADS1282_OFC2, 0x10, r->s.now_ns)); /* 2^20 of 2^23 */
    to_fall(r);
    near(fraction(read_bytes(r, 4)), 0.4 / 2.5 - 0.125, 2e-3);
    assert_true(reg_flip(&r->a.regs, ADS1282_ID, 0x01, r->s.now_ns)); /* read-only for the bus */
    to_fall(r);
    SEND(r, 0x11);
    hex_is(rreg(r, ADS1282_ID), 0x01);
    const uint32_t restarts = r->a.count.restarts;
    assert_true(reg_flip(&r->a.regs, ADS1282_CONFIG0, 0x08, r->s.now_ns));
    assert_int_equal(r->a.count.restarts, restarts + 1);
    assert_int_equal(ads1282_period_ns(&r->a), PERIOD_NS / 2);
    assert_false(reg_flip(&r->a.regs, ADS1282_REGS, 0x01, r->s.now_ns));
}

static void without_power_everything_is_forgotten_but_the_counters(void **state)
{
    (void)state;
    struct rig *r = &rig;
    powered(r, &quiet);
    at_tclk(r, 1000);
    wreg(r, ADS1282_OFC0, 0x55);
    SEND(r, 0x11);
    for (int i = 0; i < 3; i++) to_fall(r);
    const uint32_t conversions = r->a.count.conversions;
    ads1282_power_off(&r->a, r->s.now_ns);
    assert_true(ads1282_drdy(&r->a));
    assert_false(r->a.running);
    const unsigned falls = r->falls, samples = r->samples;
    sched_run_until(&r->s, r->s.now_ns + 100000000);
    assert_int_equal(r->falls, falls);
    assert_int_equal(r->samples, samples); /* the input is not looked at */
    r->tclk = clk_count_at(&r->clk, r->s.now_ns);
    hex_is(byte(r, 0x11), 0x00); /* and the port is dead */
    assert_int_equal(r->a.count.conversions, conversions);
    ads1282_power_up(&r->a, r->s.now_ns);
    const int64_t up_ns = r->s.now_ns;
    near((double)(to_fall(r) - up_ns), (double)T_DR_1000 / 4.096e6 * 1e9, 300.0);
    hex_is(r->a.reg_value[ADS1282_OFC0], 0x00);
    assert_true(r->a.rdatac);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stuck_drdy_moves_to_its_level_and_stays_there),
        cmocka_unit_test(a_dead_dout_reads_as_its_level_by_bytes_bits_and_pins),
        cmocka_unit_test(a_read_at_one_go_is_not_taken_while_dout_is_dead),
        cmocka_unit_test(dout_gets_stuck_in_the_middle_of_a_word),
        cmocka_unit_test(sync_is_not_heard),
        cmocka_unit_test(a_slow_clock_stretches_what_comes_and_nothing_that_was),
        cmocka_unit_test(a_fast_clock_keeps_its_rate_through_restarts_and_power),
        cmocka_unit_test(each_chain_survives_a_change_of_its_clock),
        cmocka_unit_test(a_flipped_bit_is_there_and_acts),
        cmocka_unit_test(without_power_everything_is_forgotten_but_the_counters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
