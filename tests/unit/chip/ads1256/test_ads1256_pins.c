/* Edges of SCLK, DIN and DOUT of the ADS1256 (sources 2.4): limits, high impedance, the reset pattern, pins against bytes. */
#include "ads1256_pins_rig.h"
#include "base/rng.h"

static void up(struct rig *r, const struct ads1256_cfg *cfg)
{
    power_up_all(r, cfg);
    await_fall(r);
    set_rate(r, 0x82);
}

static void commands_and_words_over_the_pins(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    r.v[0] = 1.0;
    pin_xfer(&r, 0x51); /* MUX = 03h, what was 01h */
    pin_xfer(&r, 0x00);
    pin_xfer(&r, 0x03);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_MUX), 0x03);
    wait_ns(&r, T11_NS);
    pin_xfer(&r, 0x11);
    pin_xfer(&r, 0x01);
    wait_ns(&r, T6_NS);
    assert_int_equal(pin_xfer(&r, 0), 0x03);
    assert_int_equal(pin_xfer(&r, 0), 0x20);
    await_fall(&r);
    await_fall(&r);
    pin_xfer(&r, 0x01);
    wait_ns(&r, T6_NS);
    assert_int_equal(pin_xfer(&r, 0), 0x19); /* 1 V of 5 V: 199999h */
    assert_int_equal(pin_xfer(&r, 0), 0x99);
    assert_false(ads1256_drdy(&r.a));
    assert_int_equal(pin_xfer(&r, 0), 0x99);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(r.edge[r.edges - 1].t_ns, r.s.now_ns);
    assert_int_equal(r.a.n.sclk_violations + r.a.n.din_violations + r.a.n.gap_violations, 0);
}

static void dout_changes_with_the_rise_and_never_with_the_fall(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    pin_xfer(&r, 0x1A); /* FSC2 = 3Ah of 100 SPS */
    pin_xfer(&r, 0x00);
    wait_ns(&r, T6_NS);
    assert_false(r.a.pins.driven);
    for (int b = 7; b >= 0; b--) {
        ads1256_sclk_pin(&r.a, true, r.s.now_ns); /* t7 at most 50 ns, t8 at least 0: at once */
        assert_true(r.a.pins.driven);
        assert_int_equal(ads1256_dout(&r.a), 0x3A >> b & 1);
        assert_int_equal(r.dout, ads1256_dout(&r.a)); /* told as well */
        wait_ns(&r, 300);
        ads1256_sclk_pin(&r.a, false, r.s.now_ns);
        assert_int_equal(ads1256_dout(&r.a), 0x3A >> b & 1);
        wait_ns(&r, 300);
    }
}

/* T9: high impedance 6 .. 10 tau after the last falling edge of a read, at once when CS rises; reads low. */
static void dout_is_released_after_the_last_bit(void **state)
{
    (void)state;
    for (unsigned by_cs = 0; by_cs < 2; by_cs++) {
        struct rig r;
        up(&r, &quiet);
        wreg(&r, ADS1256_OFC0, 0xFF);
        pin_xfer(&r, 0x15);
        pin_xfer(&r, 0x00);
        wait_ns(&r, T6_NS);
        assert_false(r.dout);
        assert_int_equal(pin_xfer(&r, 0), 0xFF);
        assert_true(ads1256_dout(&r.a) && r.a.pins.driven);
        wait_ns(&r, tau_ns(6));
        assert_true(ads1256_dout(&r.a) && r.dout);
        if (by_cs) ads1256_cs_pin(&r.a, true, r.s.now_ns);
        else wait_ns(&r, tau_ns(4) + 2);
        assert_false(ads1256_dout(&r.a) || r.a.pins.driven || r.dout);
        assert_int_equal(r.dout_calls, 2);
    }
}

static void dout_stays_driven_between_the_bytes_of_a_word(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    pin_xfer(&r, 0x01);
    wait_ns(&r, T6_NS);
    for (int i = 0; i < 3; i++) {
        pin_xfer(&r, 0);
        wait_ns(&r, tau_ns(20));
        assert_int_equal(r.a.pins.driven, i < 2);
    }
    pin_xfer(&r, 0x00); /* no data without a command */
    assert_false(r.a.pins.driven);
}

/* One SCLK pulse and the low time after it. */
static void pulse(struct rig *r, int64_t high_ns, int64_t low_ns)
{
    ads1256_sclk_pin(&r->a, true, r->s.now_ns);
    wait_ns(r, high_ns);
    ads1256_sclk_pin(&r->a, false, r->s.now_ns);
    wait_ns(r, low_ns);
}

/* Two pulses in the middle of a byte, the second one judged: period, high and low at their limits and one ns beyond. */
static void sclk_limits_are_counted(void **state)
{
    (void)state;
    const int64_t data_ns = tau_ns(256 * 60); /* a period at 500 SPS */
    const struct {
        const char *name;
        int64_t high_ns, low_ns, next_high_ns;
        uint32_t counted;
    } rows[] = {
        {"t1 min", 260, 260, 260, 0},
        {"t1 short", 260, 259, 260, 1},
        {"t2L min", 400, 200, 260, 0},
        {"t2L short", 400, 199, 260, 1},
        {"t2H min", 200, 400, 260, 0},
        {"t2H short", 199, 400, 260, 1},
        {"t1 max", 1000, 10 * data_ns - 1000, 260, 0},
        {"t1 long", 1000, 10 * data_ns - 999, 260, 1},
        {"t2H max", 9 * data_ns, 400, 260, 0},
        {"t2H long", 9 * data_ns + 1, 400, 260, 1},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        up(&r, &quiet);
        set_rate(&r, 0x92);
        pulse(&r, 300, 300);
        pulse(&r, rows[i].high_ns, rows[i].low_ns);
        pulse(&r, rows[i].next_high_ns, 300);
        if (r.a.n.sclk_violations != rows[i].counted) fail_msg("%s: %u", rows[i].name, r.a.n.sclk_violations);
        assert_int_equal(r.a.spi.bits, 3); /* lenient: every pulse is a bit */
    }
}

static void between_commands_sclk_may_rest(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    pin_xfer(&r, 0x53);
    wait_ns(&r, INT64_C(1000000000));
    pin_xfer(&r, 0x00);
    wait_ns(&r, INT64_C(1000000000));
    pin_xfer(&r, 0x92);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0x92);
    assert_int_equal(r.a.n.sclk_violations, 0);
}

static void strict_chip_misses_pulses_and_forgets_slow_bytes(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.strict_bus = true;
    static const struct {
        int64_t high_ns, low_ns;
        unsigned bits;
    } rows[] = {{260, 260, 3}, {260, 259, 2}, {199, 400, 2}, {400, 199, 2}, {260, 20100000, 1}, {18100000, 400, 1}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        up(&r, &cfg);
        set_rate(&r, 0x92);
        xfer(&r, 0x51);
        pulse(&r, 300, 300);
        pulse(&r, rows[i].high_ns, rows[i].low_ns);
        pulse(&r, 300, 300);
        if (r.a.spi.bits != rows[i].bits) fail_msg("row %u: %u bits", i, r.a.spi.bits);
        assert_int_equal(r.a.n.dropped, i >= 4); /* the WREG whose second byte stopped */
        assert_int_equal(r.a.port, i >= 4 ? ADS1256_OPCODE : ADS1256_COUNT);
        assert_int_equal(r.a.n.sclk_violations, i > 0);
    }
}

/* DIN changes set_up_ns before the falling edge of each bit and hold_ns after it. */
static uint8_t shifted_in(bool strict, int64_t set_up_ns, int64_t hold_ns, uint32_t *counted)
{
    struct ads1256_cfg cfg = quiet;
    cfg.strict_bus = strict;
    struct rig r;
    up(&r, &cfg);
    xfer(&r, 0x51);
    xfer(&r, 0x00);
    const uint8_t mosi = 0xA5;
    for (int b = 7; b >= 0; b--) {
        ads1256_din_pin(&r.a, !(mosi >> b & 1), r.s.now_ns);
        ads1256_sclk_pin(&r.a, true, r.s.now_ns);
        wait_ns(&r, 300);
        ads1256_din_pin(&r.a, mosi >> b & 1, r.s.now_ns);
        wait_ns(&r, set_up_ns);
        ads1256_sclk_pin(&r.a, false, r.s.now_ns);
        wait_ns(&r, hold_ns);
        ads1256_din_pin(&r.a, !(mosi >> b & 1), r.s.now_ns);
        wait_ns(&r, 300);
    }
    *counted = r.a.n.din_violations;
    return reg_peek(&r.a.regs, ADS1256_MUX);
}

static void set_up_and_hold_of_din_are_judged(void **state)
{
    (void)state;
    static const struct {
        bool strict;
        int64_t set_up_ns, hold_ns;
        uint32_t counted;
        uint8_t mux;
    } rows[] = {
        {false, 50, 50, 0, 0xA5}, {false, 49, 50, 8, 0xA5}, {false, 50, 49, 8, 0xA5},
        {true, 50, 50, 0, 0xA5},  {true, 49, 50, 8, 0x5A}, /* the level before the change */
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        uint32_t counted = 0;
        assert_int_equal(shifted_in(rows[i].strict, rows[i].set_up_ns, rows[i].hold_ns, &counted), rows[i].mux);
        assert_int_equal(counted, rows[i].counted);
    }
}

/* T12, t14, t15 high, t13 low between them, in tau; ns too short or too long. Sources 2.4. */
static const struct {
    int64_t high_tau[3], low_tau;
    int off_ns;
    bool resets;
} patterns[] = {
    {{307, 550, 1050}, 5, 1, true}, /* as the vendor's example does, rounded up */
    {{300, 550, 1050}, 5, 1, true},    {{500, 750, 1250}, 5, 0, true},
    {{400, 650, 1150}, 5, -2, false}, /* low too short */
    {{300, 600, 1100}, 50, -1, false}, {{500, 600, 1100}, 50, 1, false},
    {{400, 550, 1100}, 50, -1, false}, {{400, 750, 1100}, 50, 1, false},
    {{400, 600, 1050}, 50, -1, false}, {{400, 600, 1250}, 50, 1, false},
    {{600, 400, 1100}, 50, 0, false},
};

static void send_pattern(struct rig *r, unsigned i, int off_ns)
{
    for (unsigned k = 0; k < 3; k++)
        pulse(r, tau_ns(patterns[i].high_tau[k]) + off_ns, tau_ns(patterns[i].low_tau) + off_ns);
}

static void reset_pattern_within_its_limits_resets(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(patterns); i++) {
        struct rig r;
        up(&r, &quiet);
        wreg(&r, ADS1256_ADCON, 0x43);
        const int off_ns = patterns[i].off_ns;
        send_pattern(&r, i, off_ns);
        const bool reset = reg_peek(&r.a.regs, ADS1256_DRATE) == 0xF0;
        if (reset != patterns[i].resets) fail_msg("row %u", i);
        if (!reset) continue;
        assert_int_equal(reg_peek(&r.a.regs, ADS1256_ADCON), 0x20); /* CLK too (E0) */
        assert_int_equal(r.a.mode, ADS1256_CALIBRATING);
        const int64_t end_ns = r.s.now_ns - tau_ns(patterns[i].low_tau) - off_ns;
        near((double)(await_fall(&r) - end_ns) * 1e-3, 596.0, 0.3);
        assert_int_equal(rreg(&r, ADS1256_DRATE), 0xF0); /* the bits are aligned */
        assert_int_equal(r.a.n.bad_opcodes, 0);
    }
}

/* A pulse that does not go on may be the first of a pattern; CS high and other traffic break it off. */
static void reset_pattern_begins_anew_and_needs_cs(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    pulse(&r, tau_ns(400), tau_ns(50));
    send_pattern(&r, 0, 1);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0xF0);
    up(&r, &quiet);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    send_pattern(&r, 0, 1);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0x82);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    pulse(&r, tau_ns(400), tau_ns(50));
    pulse(&r, tau_ns(600), tau_ns(50));
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    pulse(&r, tau_ns(1100), tau_ns(50));
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_DRATE), 0x82);
    assert_int_equal(rreg(&r, ADS1256_DRATE) == 0x82, false); /* one bit is in the shifter: CS aligns it */
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x82);
}

/* T3, CS low to the first SCLK, is 0; and CS may fall while SCLK is high, whose fall still takes a bit. */
static void cs_may_fall_with_sclk(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    ads1256_sclk_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 300);
    ads1256_sclk_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(r.a.spi.bits, 1);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    ads1256_sclk_pin(&r.a, true, r.s.now_ns + 300);
    wait_ns(&r, 600);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    ads1256_sclk_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(r.a.spi.bits, 1);
    assert_int_equal(r.a.first_ns, r.s.now_ns); /* the byte's first edge */
}

/* With CS high nothing on the bus is judged, and nothing of what was before lives on. */
static void cs_high_forgets_the_bus(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.strict_bus = true;
    struct rig r;
    up(&r, &cfg);
    pulse(&r, 260, 200);
    pulse(&r, 260, 260); /* too soon, not seen */
    assert_int_equal(r.a.n.sclk_violations, 1);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    for (unsigned i = 0; i < 10; i++) {
        pulse(&r, 100, 10);
        ads1256_din_pin(&r.a, i & 1, r.s.now_ns);
        wait_ns(&r, 10);
    }
    ads1256_sclk_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 600);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    ads1256_sclk_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(r.a.spi.bits, 1);
    assert_int_equal(r.a.n.sclk_violations + r.a.n.din_violations, 1);
}

static void cs_high_leaves_no_event_behind(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    command(&r, 0xFD); /* standby: nothing else is due */
    pin_xfer(&r, 0x15);
    pin_xfer(&r, 0x00);
    wait_ns(&r, T6_NS);
    pin_xfer(&r, 0);
    assert_true(sched_next_ns(&r.s) != SCHED_NEVER); /* high impedance in 8 tau */
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
}

/* One of the other pins moves between two bytes. SYNC/PDWN does not stay low long enough to power down: a chip that stops in
 * the middle of a byte is where pins know more than bytes. */
static void move_pins(struct ads1256 *a, uint64_t x, int64_t t_ns)
{
    const unsigned what = (unsigned)(x >> 56);
    if (!a->sync && t_ns - a->pin_low_ns > 100000) ads1256_sync_pin(a, true, t_ns);
    else if (what < 8) ads1256_cs_pin(a, !a->cs, t_ns);
    else if (what < 12) ads1256_sync_pin(a, !a->sync, t_ns);
    else if (what == 12) ads1256_reset_pin(a, !a->reset, t_ns);
    else if (what < 16) ads1256_gpio_pin(a, what & 3, x >> 20 & 1, t_ns);
    else if (what < 60) {
        ads1256_cs_pin(a, false, t_ns);
        ads1256_reset_pin(a, true, t_ns);
    }
}

static void assert_same(const struct rig *byte, const struct rig *pin)
{
    const uint32_t *of_bytes = &byte->a.n.conversions;
    const uint32_t *of_pins = &pin->a.n.conversions;
    for (unsigned k = 0; k < sizeof byte->a.n / sizeof *of_bytes; k++) assert_int_equal(of_bytes[k], of_pins[k]);
    assert_memory_equal(byte->a.value, pin->a.value, ADS1256_REGS);
    assert_int_equal(byte->edges, pin->edges);
    for (unsigned k = 0; k < byte->edges; k++) assert_int_equal(byte->edge[k].t_ns, pin->edge[k].t_ns);
    assert_int_equal(byte->gpio_calls, pin->gpio_calls);
}

/* Random traffic with CS, SYNC, RESET and D0..D3, once by pins and once by bytes: the same answers, words, DRDY edges,
 * counters and registers. */
static void pins_and_bytes_drive_the_same_chip(void **state)
{
    (void)state;
    struct rng traffic = rng_stream(rig_seed(11), 0, "traffic");
    static const uint8_t likely[] = {0x00, 0x01, 0x03, 0x0F, 0x10, 0x50, 0x53, 0x82, 0xF0,
                                     0xF3, 0xF4, 0xFC, 0xFD, 0xFE, 0x92, 0x04, 0x54, 0x00};
    for (unsigned strict = 0; strict < 2; strict++) {
        struct rig byte, pin;
        struct ads1256_cfg cfg = quiet;
        cfg.noise_scale = 1.0;
        cfg.strict_bus = cfg.strict_timing = cfg.strict_cs = strict;
        power_up_all(&byte, &cfg);
        power_up_all(&pin, &cfg);
        for (unsigned i = 0; i < 9; i++) byte.v[i] = pin.v[i] = 0.3 * i;
        for (unsigned i = 0; i < 20000; i++) {
            const uint64_t x = rng_u64(&traffic);
            const uint8_t mosi = x & 1 ? likely[(x >> 8) % COUNT(likely)] : (uint8_t)(x >> 16);
            const bool long_pause = byte.a.sync && (x >> 24) % 16 == 0;
            const int64_t pause_ns = (int64_t)((x >> 32) % (long_pause ? 3000000 : 9000));
            wait_ns(&byte, pause_ns);
            wait_ns(&pin, pause_ns);
            move_pins(&byte.a, x, byte.s.now_ns);
            move_pins(&pin.a, x, pin.s.now_ns);
            assert_int_equal(xfer(&byte, mosi), pin_xfer(&pin, mosi));
            assert_int_equal(byte.s.now_ns, pin.s.now_ns);
            assert_int_equal(byte.a.word, pin.a.word);
        }
        assert_same(&byte, &pin);
        assert_int_equal(pin.a.n.sclk_violations + pin.a.n.din_violations, 0);
        assert_true(byte.a.n.conversions > 1000 && byte.a.n.calibrations > 100 && byte.a.n.torn_reads > 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_and_words_over_the_pins),
        cmocka_unit_test(dout_changes_with_the_rise_and_never_with_the_fall),
        cmocka_unit_test(dout_is_released_after_the_last_bit),
        cmocka_unit_test(dout_stays_driven_between_the_bytes_of_a_word),
        cmocka_unit_test(sclk_limits_are_counted),
        cmocka_unit_test(between_commands_sclk_may_rest),
        cmocka_unit_test(strict_chip_misses_pulses_and_forgets_slow_bytes),
        cmocka_unit_test(set_up_and_hold_of_din_are_judged),
        cmocka_unit_test(reset_pattern_within_its_limits_resets),
        cmocka_unit_test(reset_pattern_begins_anew_and_needs_cs),
        cmocka_unit_test(cs_may_fall_with_sclk),
        cmocka_unit_test(cs_high_forgets_the_bus),
        cmocka_unit_test(cs_high_leaves_no_event_behind),
        cmocka_unit_test(pins_and_bytes_drive_the_same_chip),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
