/* Registers, power and states of the AD7712: sources 3.1, 3.2, 3.3 over frames of its serial port. */
#include "ad7712_rig.h"

/* 1028 Hz, so that tests are short; 24 bits. */
#define FAST AD7712_CONTROL(0, 0, 0, 1, 0, 19)

static void up(struct rig *r, const struct ad7712_cfg *cfg, uint32_t control)
{
    power_up(r, cfg);
    write_control(r, control);
    await_fall(r);
}

static void power_on_defaults(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    assert_int_equal(r.a.control, 0x000145); /* normal, gain 1, AIN1, 16 bits, bipolar, 60 Hz */
    assert_int_equal(read_frame(&r, false, 24), 0x000145);
    for (unsigned c = 0; c < 2; c++) {
        assert_int_equal(r.a.zero[c], 0x800000);
        assert_int_equal(r.a.full[c], 0x400000);
    }
    assert_true(ad7712_drdy(&r.a));
    near(1e9 / (double)ad7712_period_ns(&r.a), 60.0, 0.1);
    assert_int_equal(await_fall(&r), 3 * ad7712_period_ns(&r.a));
    assert_int_equal(read_frame(&r, true, 16), 0x8000);
}

/* Every bit is stored and comes back, MSB first. MD is kept at 0, 6, 7 and PD at 0 here: they act. */
static void every_bit_of_the_control_word(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    for (unsigned bit = 0; bit < 24; bit++) {
        const uint32_t word = 1u << bit | (bit >= 12 ? 500 : 0);
        if (bit == 16 || bit == 21 || bit == 22 || bit == 23) continue;
        write_control(&r, word);
        assert_int_equal(r.a.control, word);
        assert_int_equal(read_control(&r), word);
    }
    write_control(&r, 0xC00000 | 1000); /* coefficient modes stay */
    assert_int_equal(read_control(&r), 0xC00000 | 1000);
    write_control(&r, 0xE00000 | 1000);
    assert_int_equal(read_control(&r), 0xE00000 | 1000);
    write_control(&r, AD7712_CTL_PD | 1000); /* power-down: the port lives */
    assert_int_equal(read_frame(&r, false, 24), AD7712_CTL_PD | 1000);
    assert_int_equal(breaches(&r), 0);
}

static void fields_mean_what_they_say(void **state)
{
    (void)state;
    assert_int_equal(AD7712_CONTROL(7, 0, 0, 0, 0, 0), AD7712_CTL_MD);
    assert_int_equal(AD7712_CONTROL(0, 7, 0, 0, 0, 0), AD7712_CTL_G);
    assert_int_equal(AD7712_CONTROL(0, 0, 1, 0, 0, 0), AD7712_CTL_CH);
    assert_int_equal(AD7712_CONTROL(0, 0, 0, 1, 0, 0), AD7712_CTL_WL);
    assert_int_equal(AD7712_CONTROL(0, 0, 0, 0, 1, 0), AD7712_CTL_BU);
    assert_int_equal(AD7712_CONTROL(0, 0, 0, 0, 0, 0xFFF), AD7712_CTL_FS);
    /* As a driver writes them in the upper and lower halves of the word. */
    assert_int_equal(AD7712_CONTROL(1, 0, 0, 0, 0, 0) >> 12, 0x200);
    assert_int_equal(AD7712_CTL_WL >> 12, 0x008);
    assert_int_equal(AD7712_CTL_BU >> 12, 0x001);
}

/* +-VREF/gain on AIN1 and AIN2 of the AD7710, +-4 VREF/gain on AIN2 of the AD7712: a quarter of the range up and down. */
static void ranges_by_part_channel_and_gain(void **state)
{
    (void)state;
    for (unsigned part = AD7712_PART_7712; part <= AD7712_PART_7711; part++) {
        for (unsigned channel = 0; channel < 2; channel++) {
            for (unsigned g = 0; g < 8; g++) {
                struct rig r;
                struct ad7712_cfg cfg = quiet;
                cfg.part = (enum ad7712_part)part;
                power_up(&r, &cfg);
                const double full_v = (part == AD7712_PART_7712 && channel ? 10.0 : 2.5) / (1 << g);
                r.v[channel] = 0.25 * full_v;
                write_control(&r, AD7712_CONTROL(0, g, channel, 1, 0, 19));
                await_fall(&r);
                assert_int_equal(read_frame(&r, true, 24), 0xA00000);
                r.v[channel] = -0.25 * full_v;
                for (unsigned i = 0; i < 4; i++) await_fall(&r);
                assert_int_equal(read_frame(&r, true, 24), 0x600000);
                write_control(&r, AD7712_CONTROL(0, g, channel, 1, 1, 19)); /* unipolar: below zero is zero */
                await_fall(&r);
                assert_int_equal(read_frame(&r, true, 24), 0x000000);
                r.v[channel] = 0.25 * full_v;
                for (unsigned i = 0; i < 4; i++) await_fall(&r);
                assert_int_equal(read_frame(&r, true, 24), 0x400000);
            }
        }
    }
}

static void codes_scale_with_the_reference(void **state)
{
    (void)state;
    struct rig r;
    struct ad7712_cfg cfg = quiet;
    cfg.vref_v = 2.0;
    power_up(&r, &cfg);
    r.v[0] = 0.5;
    write_control(&r, FAST);
    await_fall(&r);
    assert_int_equal(read_frame(&r, true, 24), 0xA00000);
}

/* 16 bits: the upper 16 of 24, cut off. */
static void sixteen_bits_are_the_upper_ones(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST & ~AD7712_CTL_WL);
    r.v[0] = 1.2345;
    for (unsigned i = 0; i < 4; i++) await_fall(&r);
    const uint32_t whole = r.a.word;
    assert_true((whole & 0xFF) >= 0x80); /* rounding would show */
    assert_int_equal(read_frame(&r, true, 16), whole >> 8);
    assert_int_equal(r.a.n.over_reads, 0);
    write_control(&r, FAST); /* the word length is that of the moment of reading */
    await_fall(&r);
    assert_int_equal(read_frame(&r, true, 24), whole);
}

/* 5 % of headroom in modulator and filter: a path with a gain of 0.97 reads inputs up to 1.05 / 0.97 after calibration. */
static void inputs_beyond_full_scale(void **state)
{
    (void)state;
    struct rig r;
    struct ad7712_cfg cfg = quiet;
    cfg.gain_error[0] = -0.1;
    up(&r, &cfg, AD7712_CONTROL(1, 0, 0, 1, 0, 19)); /* self-calibration: 2.5 V is full scale again */
    static const struct {
        double v;
        uint32_t word;
        bool clipped, overload;
    } rows[] = {{2.49, 0xFF7CED, false, false},
                {2.6, 0xFFFFFF, true, false},
                {3.0, 0xFFFFFF, true, true},
                {-2.6, 0, true, false},
                {-3.0, 0, true, true}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        r.v[0] = rows[i].v;
        for (unsigned k = 0; k < 4; k++) await_fall(&r);
        const struct ad7712_counters was = r.a.n;
        await_fall(&r);
        near(r.a.word, rows[i].word, 3);
        assert_int_equal(r.a.n.clipped - was.clipped, rows[i].clipped);
        assert_int_equal(r.a.n.overloads - was.overloads, rows[i].overload ? 4 : 0);
    }
}

/* What lies between full scale and 105 % is not lost in the filter: with a zero of 4 % taken off it is inside the codes. */
static void headroom_is_five_percent(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    static const struct {
        double x, seen;
    } rows[] = {{1.02, 0.92}, {1.049, 0.949}, {1.06, 0.95}, {2.0, 0.95}};
    r.a.zero[0] = AD7712_ZERO_IDEAL + 419430; /* 0.1 */
    for (unsigned i = 0; i < COUNT(rows); i++) {
        r.v[0] = 2.5 * rows[i].x;
        for (unsigned k = 0; k < 4; k++) await_fall(&r);
        near(r.a.word / 8388608.0 - 1.0, rows[i].seen, 1e-6);
    }
    r.v[0] = NAN; /* a broken source is an overload, not a crash */
    for (unsigned k = 0; k < 4; k++) await_fall(&r);
    near(r.a.word / 8388608.0 - 1.0, 0.95, 1e-6);
}

static void filter_codes_out_of_range_are_counted(void **state)
{
    (void)state;
    static const struct {
        unsigned fs, acts;
        uint32_t counted;
    } rows[] = {{0, 19, 1}, {18, 19, 1}, {19, 19, 0}, {2000, 2000, 0}, {2001, 2000, 1}, {4095, 2000, 1}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        power_up(&r, &quiet);
        write_control(&r, rows[i].fs);
        assert_int_equal(r.a.n.bad_fs, rows[i].counted);
        assert_int_equal(read_control(&r), rows[i].fs);
        assert_int_equal(ad7712_period_ns(&r.a), rows[i].acts * 51200);
        const int64_t first = await_fall(&r);
        assert_int_equal(await_fall(&r) - first, rows[i].acts * 51200);
    }
}

/* Bit 14: a current source on the AD7710, two on the AD7711, nothing on the AD7712, which counts it. */
static void bit_14_by_part(void **state)
{
    (void)state;
    static const double amps[] = {0.0, 20e-6, 200e-6, 400e-6};
    for (unsigned part = AD7712_PART_7712; part <= AD7712_PART_7711A; part++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.part = (enum ad7712_part)part;
        up(&r, &cfg, FAST);
        near(ad7712_iout_a(&r.a), 0.0, 0.0);
        write_control(&r, FAST | AD7712_CTL_B14);
        near(ad7712_iout_a(&r.a), amps[part], 0.0);
        assert_int_equal(r.a.n.bad_bit, part == AD7712_PART_7712);
        assert_int_equal(read_control(&r), FAST | AD7712_CTL_B14);
    }
}

static void an_ad7711a_has_one_input(void **state)
{
    (void)state;
    struct rig r;
    struct ad7712_cfg cfg = quiet;
    cfg.part = AD7712_PART_7711A;
    power_up(&r, &cfg);
    r.v[0] = r.v[1] = 1.0;
    write_control(&r, FAST | AD7712_CTL_CH);
    await_fall(&r);
    assert_int_equal(r.a.word, 0x800000);
    assert_int_equal(r.a.n.bad_channel, 12);
    write_control(&r, FAST);
    await_fall(&r);
    assert_true(r.a.word > 0xB00000);
}

/* Three periods after the rise of SYNC; parts that share it are in step whatever they did before. */
static void sync_holds_the_filter_and_aligns_parts(void **state)
{
    (void)state;
    struct rig r, q;
    up(&r, &quiet, FAST);
    up(&q, &quiet, FAST);
    wait_until(&q, r.s.now_ns + 333333);
    write_control(&q, FAST);
    wait_until(&r, 30000000);
    wait_until(&q, 30000000);
    struct rig *const both[] = {&r, &q};
    for (unsigned i = 0; i < 2; i++) {
        ad7712_sync_pin(&both[i]->a, false, 30000000);
        assert_true(ad7712_drdy(&both[i]->a));
        const unsigned n = both[i]->drdy.n;
        assert_int_equal(read_frame(both[i], false, 24), FAST); /* no word waits any more */
        wait_until(both[i], 40000050);
        assert_int_equal(both[i]->drdy.n, n);
        ad7712_sync_pin(&both[i]->a, true, 40000050); /* the next edge of CLKIN counts: 40000100 */
        assert_int_equal(await_fall(both[i]), 40000100 + 3 * 972800);
        assert_int_equal(await_fall(both[i]), 40000100 + 4 * 972800);
    }
}

static void writes_while_sync_is_low_wait_for_it(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    ad7712_sync_pin(&r.a, false, r.s.now_ns);
    write_control(&r, AD7712_CONTROL(1, 0, 0, 1, 0, 39));
    wait_ns(&r, 50000000);
    assert_int_equal(r.a.n.calibrations, 0);
    const int64_t t_ns = r.s.now_ns + 99 - (r.s.now_ns + 99) % 100;
    ad7712_sync_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(await_fall(&r), t_ns + 9 * 39 * MOD_NS);
    assert_int_equal(r.a.n.calibrations, 1);
}

/* STANDBY low: nothing runs, the port is deaf; registers live on, conversions begin again with its rise. */
static void standby_stops_all_and_keeps_the_registers(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    r.a.zero[0] = 0x812345;
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, FIRST_NS);
    pulses(&r, 5);
    ad7712_standby_pin(&r.a, false, r.s.now_ns);
    assert_false(ad7712_sdata_driven(&r.a, r.s.now_ns));
    rfs(&r, true);
    wait_ns(&r, 0);
    r.sdata.n = 0;
    assert_true(ad7712_drdy(&r.a));
    assert_int_equal(r.a.n.power_downs, 1);
    const unsigned n = r.drdy.n;
    write_control(&r, 0x000555);
    assert_int_equal(read_frame(&r, false, 24), 0);
    assert_int_equal(r.sdata.n, 0);
    wait_until(&r, 50000000);
    assert_int_equal(r.drdy.n, n);
    ad7712_standby_pin(&r.a, true, 50000000);
    assert_int_equal(await_fall(&r), 50000000 + 3 * 972800);
    assert_int_equal(read_control(&r), FAST);
    assert_int_equal(r.a.zero[0], 0x812345);
}

static void pd_stops_conversions_and_leaves_the_port(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    write_control(&r, FAST | AD7712_CTL_PD);
    assert_true(ad7712_drdy(&r.a));
    const unsigned n = r.drdy.n;
    wait_ns(&r, 20000000);
    assert_int_equal(r.drdy.n, n);
    assert_int_equal(read_control(&r), FAST | AD7712_CTL_PD);
    write_control(&r, FAST);
    const int64_t start_ns = r.a.port.fall_ns + 4 * TAU_NS; /* the load; all edges here lie on CLKIN's */
    assert_int_equal(await_fall(&r), start_ns + 3 * 972800);
    assert_int_equal(r.a.n.power_downs, 1);
    assert_int_equal(read_frame(&r, true, 24), 0x800000);
    write_control(&r, FAST | AD7712_CTL_PD); /* a calibration that ends it begins once */
    const uint32_t restarts = r.a.n.restarts;
    write_control(&r, FAST | 0x200000);
    assert_int_equal(await_fall(&r), r.a.port.fall_ns + 4 * TAU_NS + 9 * 972800);
    assert_int_equal(r.a.n.restarts, restarts + 1);
}

static void power_off_forgets_all(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    r.a.zero[1] = 1;
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, FIRST_NS);
    pulses(&r, 5);
    const uint32_t conversions = r.a.n.conversions;
    ad7712_power_off(&r.a, r.s.now_ns);
    assert_true(ad7712_drdy(&r.a));
    assert_false(ad7712_sdata_driven(&r.a, r.s.now_ns));
    const unsigned n = r.drdy.n;
    wait_ns(&r, 10000000);
    assert_int_equal(r.drdy.n, n);
    assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
    assert_int_equal(r.a.n.conversions, conversions);
    rfs(&r, true);
    ad7712_power_up(&r.a, r.s.now_ns);
    assert_int_equal(r.a.control, AD7712_CTL_RESET);
    assert_int_equal(r.a.zero[1], AD7712_ZERO_IDEAL);
    await_fall(&r);
    assert_int_equal(read_frame(&r, true, 16), 0x8000);
}

static void the_same_seed_gives_the_same_words(void **state)
{
    (void)state;
    struct ad7712_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    uint32_t word[3][20];
    for (unsigned i = 0; i < 3; i++) {
        struct rig r;
        power_up_seeded(&r, &cfg, i == 2 ? 8 : 7);
        write_control(&r, FAST);
        for (unsigned k = 0; k < 20; k++) {
            await_fall(&r);
            word[i][k] = r.a.word;
        }
    }
    assert_memory_equal(word[0], word[1], sizeof word[0]);
    assert_memory_not_equal(word[0], word[2], sizeof word[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(power_on_defaults),
        cmocka_unit_test(every_bit_of_the_control_word),
        cmocka_unit_test(fields_mean_what_they_say),
        cmocka_unit_test(ranges_by_part_channel_and_gain),
        cmocka_unit_test(codes_scale_with_the_reference),
        cmocka_unit_test(sixteen_bits_are_the_upper_ones),
        cmocka_unit_test(inputs_beyond_full_scale),
        cmocka_unit_test(headroom_is_five_percent),
        cmocka_unit_test(filter_codes_out_of_range_are_counted),
        cmocka_unit_test(bit_14_by_part),
        cmocka_unit_test(an_ad7711a_has_one_input),
        cmocka_unit_test(sync_holds_the_filter_and_aligns_parts),
        cmocka_unit_test(writes_while_sync_is_low_wait_for_it),
        cmocka_unit_test(standby_stops_all_and_keeps_the_registers),
        cmocka_unit_test(pd_stops_conversions_and_leaves_the_port),
        cmocka_unit_test(power_off_forgets_all),
        cmocka_unit_test(the_same_seed_gives_the_same_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
