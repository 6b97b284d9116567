/* Frames of the AD7712's serial port: order and edges, rules of DRDY, A0, RFS and TFS (sources 3.1, 3.4). */
#include "ad7712_up.h"

/* The first bit is there before any SCLK, at most 4 tau after RFS; the next at most 2 tau + 20 ns after the fall; none changes
 * with the rise; high impedance after RFS. */
static void data_change_with_rfs_and_the_falls_of_sclk(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    const uint32_t word = r.a.word;
    a0(&r, true);
    const int64_t rfs_ns = r.s.now_ns;
    assert_false(ad7712_sdata_driven(&r.a, rfs_ns));
    rfs(&r, false);
    assert_false(ad7712_sdata_driven(&r.a, rfs_ns + 299));
    assert_true(ad7712_sdata_driven(&r.a, rfs_ns + 300));
    assert_int_equal(ad7712_sdata(&r.a, rfs_ns + 300), word >> 23);
    wait_ns(&r, FIRST_NS);
    for (unsigned i = 0; i < 24; i++) {
        const int64_t rise_ns = r.s.now_ns;
        assert_int_equal(pulse(&r), word >> (23 - i) & 1);
        const int64_t fall_ns = r.s.now_ns;
        assert_int_equal(fall_ns - rise_ns, HIGH_NS);
        assert_int_equal(ad7712_sdata(&r.a, fall_ns + 99), word >> (23 - i) & 1);
        assert_int_equal(ad7712_sdata(&r.a, fall_ns + 100), i < 23 ? word >> (22 - i) & 1 : 0);
        wait_ns(&r, SCLK_NS - HIGH_NS);
    }
    rfs(&r, true);
    const int64_t up_ns = r.s.now_ns;
    assert_true(ad7712_sdata_driven(&r.a, up_ns + 199));
    assert_false(ad7712_sdata_driven(&r.a, up_ns + 200));
    for (unsigned i = 0; i < r.sdata.n; i++) assert_true((r.sdata.e[i].t_ns - rfs_ns - 300) % 100 == 0);
    assert_int_equal(breaches(&r), 0);
}

/* A bit that comes at the very fall of SCLK is there until the next one comes. */
static void a_bit_at_the_fall_is_still_a_bit(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    assert_int_equal(r.a.word >> 22, 2); /* 10b */
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, 100);
    pulse(&r); /* too early: falls 400 ns later */
    wait_ns(&r, 400);
    rfs(&r, true);
    wait_ns(&r, 1000);
    a0(&r, false);
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, 100);
    ad7712_sclk_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 200);
    ad7712_sclk_pin(&r.a, false, r.s.now_ns); /* 300 ns after RFS */
    assert_true(ad7712_sdata(&r.a, r.s.now_ns) && ad7712_sdata(&r.a, r.s.now_ns + 99));
    assert_false(ad7712_sdata(&r.a, r.s.now_ns + 100));
}

/* A word that comes between the last bit and the rise of DRDY keeps it low. */
static void a_word_right_behind_a_read_keeps_drdy_low(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    const int64_t next_ns = r.s.now_ns + 19 * MOD_NS;
    ad7712_a0_pin(&r.a, true, r.s.now_ns);
    const int64_t last_fall_ns = next_ns - 50;
    wait_until(&r, next_ns - 60000); /* before DRDY would go high for the update */
    rfs(&r, false);
    wait_until(&r, last_fall_ns - 23 * SCLK_NS - HIGH_NS);
    const uint32_t word = r.a.word;
    assert_int_equal(pulses(&r, 24), word);
    assert_int_equal(r.s.now_ns, last_fall_ns);
    wait_ns(&r, 20);
    rfs(&r, true);
    const unsigned n = r.drdy.n;
    wait_ns(&r, 10000);
    assert_int_equal(r.a.n.conversions, 2);
    assert_int_equal(r.a.n.overruns, 0);
    assert_true(r.a.unread && !ad7712_drdy(&r.a));
    assert_int_equal(r.drdy.n, n);
}

/* Delays are the owner's. */
static void delays_can_be_set(void **state)
{
    (void)state;
    struct rig r;
    struct ad7712_cfg cfg = quiet;
    cfg.rfs_access_ns = 390;
    cfg.bit_access_ns = 210;
    cfg.drdy_rise_ns = 55;
    up(&r, &cfg, FAST);
    a0(&r, true);
    const int64_t rfs_ns = r.s.now_ns;
    rfs(&r, false);
    assert_false(ad7712_sdata_driven(&r.a, rfs_ns + 389));
    assert_true(ad7712_sdata_driven(&r.a, rfs_ns + 390));
    wait_ns(&r, FIRST_NS);
    const bool first = pulse(&r);
    assert_int_equal(ad7712_sdata(&r.a, r.s.now_ns + 209), first);
    assert_int_equal(ad7712_sdata(&r.a, r.s.now_ns + 210), r.a.word >> 22 & 1);
    wait_ns(&r, 400);
    pulses(&r, 23);
    wait_ns(&r, LAST_NS);
    assert_int_equal(r.drdy.e[r.drdy.n - 1].t_ns, r.a.port.fall_ns + 55);
}

/* DRDY rises tau after the last fall of a whole word of 16 or 24 bits, not after one bit less, and not after control words. */
static void drdy_rises_with_the_last_bit_of_a_word(void **state)
{
    (void)state;
    static const struct {
        uint32_t wl;
        unsigned bits;
    } rows[] = {{0, 16}, {AD7712_CTL_WL, 24}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        up(&r, &quiet, (FAST & ~AD7712_CTL_WL) | rows[i].wl);
        a0(&r, true);
        rfs(&r, false);
        wait_ns(&r, FIRST_NS);
        pulses(&r, rows[i].bits - 1);
        wait_ns(&r, SCLK_NS - HIGH_NS);
        assert_false(ad7712_drdy(&r.a));
        pulse(&r);
        wait_ns(&r, 99);
        assert_false(ad7712_drdy(&r.a));
        wait_ns(&r, 1);
        assert_true(ad7712_drdy(&r.a));
        assert_false(r.a.unread);
        wait_ns(&r, 300);
        assert_int_equal(pulses(&r, 4), 0); /* after the last bit: low, counted */
        assert_int_equal(r.a.n.over_reads, 4);
        rfs(&r, true);
        const int64_t next_ns = await_fall(&r); /* a new word, as if nothing had been */
        read_frame(&r, false, rows[i].bits);
        assert_int_equal(r.a.n.blocked_reads, 1);
        read_frame(&r, false, 24);
        assert_true(r.s.now_ns - next_ns < 100000);
        assert_int_equal(r.drdy.n, 4);
    }
}

/* The rule of the waiting word: with A0 low the first read gives the data, the next the control register. */
static void a_waiting_word_comes_before_the_control_register(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    const uint32_t word = r.a.word;
    assert_int_equal(read_frame(&r, false, 24), word);
    assert_int_equal(r.a.n.blocked_reads, 1);
    assert_true(ad7712_drdy(&r.a));
    assert_int_equal(read_frame(&r, false, 24), FAST);
    assert_int_equal(read_frame(&r, false, 24), FAST);
    assert_int_equal(r.a.n.blocked_reads, 1);
    await_fall(&r);
    write_control(&r, FAST | AD7712_CTL_BO); /* writes are not held up */
    assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
    assert_int_equal(read_frame(&r, true, 24), word);
    assert_int_equal(read_frame(&r, false, 24), FAST | AD7712_CTL_BO);
    /* Also half read: the rest of the word is still to come. */
    await_fall(&r);
    read_frame(&r, true, 8);
    assert_int_equal(read_frame(&r, false, 24), word);
    assert_int_equal(read_frame(&r, false, 24), FAST | AD7712_CTL_BO);
}

/* While RFS is low the output register stays; the conversion that ends then is lost and counted, DRDY does not move. */
static void words_that_come_while_rfs_is_low_are_lost(void **state)
{
    (void)state;
    for (unsigned read_first = 0; read_first < 2; read_first++) {
        struct rig r;
        up(&r, &quiet, FAST);
        const uint32_t word = r.a.word;
        r.v[0] = -0.7;
        a0(&r, true);
        rfs(&r, false);
        wait_ns(&r, FIRST_NS);
        uint32_t got = 0;
        if (read_first) got = pulses(&r, 24);
        wait_ns(&r, 5 * 19 * MOD_NS);
        assert_int_equal(r.a.n.lost_words, 5);
        assert_int_equal(r.a.n.conversions, 1);
        assert_int_equal(r.a.n.overruns, 0);
        assert_int_equal(r.drdy.n, read_first ? 2 : 1);
        if (!read_first) got = pulses(&r, 24);
        assert_int_equal(got, word);
        wait_ns(&r, LAST_NS);
        rfs(&r, true);
        await_fall(&r);
        near(read_frame(&r, true, 24), 8388608 * (1.0 - 0.28), 2);
    }
}

/* RFS may go high between the bytes of a word; the read goes on where it was. A new word in between begins again: torn. */
static void rfs_may_rise_between_bytes(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    const uint32_t word = r.a.word;
    uint32_t got = 0;
    for (unsigned i = 0; i < 3; i++) got = got << 8 | read_frame(&r, true, 8);
    assert_int_equal(got, word);
    assert_true(ad7712_drdy(&r.a));
    await_fall(&r);
    assert_int_equal(read_frame(&r, true, 8), word >> 16);
    r.v[0] = -1.0;
    for (unsigned i = 0; i < 4; i++) await_fall(&r);
    assert_int_equal(r.a.n.torn_reads, 1);
    assert_int_equal(read_frame(&r, true, 24), r.a.word);
    assert_int_equal(breaches(&r), 0);
}

/* A frame of the other kind, or A0, gives up the rest of an interrupted read. */
static void what_ends_an_interrupted_read(void **state)
{
    (void)state;
    for (unsigned by_write = 0; by_write < 2; by_write++) {
        struct rig r;
        up(&r, &quiet, FAST);
        read_frame(&r, true, 8);
        if (by_write) write_control(&r, FAST);
        else a0(&r, false);
        assert_int_equal(read_frame(&r, true, 24), r.a.word);
    }
}

static void reads_while_drdy_is_high(void **state)
{
    (void)state;
    for (unsigned strict = 0; strict < 2; strict++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.strict_drdy = strict;
        up(&r, &cfg, FAST);
        const uint32_t word = read_frame(&r, true, 24);
        assert_int_equal(word, r.a.word);
        assert_int_equal(r.a.n.stale_reads, 0);
        assert_int_equal(read_frame(&r, true, 24), strict ? 0xFFFFFF : word); /* the old word again */
        assert_int_equal(r.a.n.stale_reads, 1);
        assert_int_equal(read_frame(&r, false, 24), FAST); /* the control word has no DRDY */
        assert_int_equal(r.a.n.stale_reads, 1);
        await_fall(&r);
        wait_until(&r, r.s.now_ns + 19 * MOD_NS - 45000); /* in the pulse before the next word */
        assert_true(ad7712_drdy(&r.a));
        assert_int_equal(read_frame(&r, true, 24), strict ? 0xFFFFFF : word);
        assert_int_equal(r.a.n.stale_reads, 2);
        assert_true(ad7712_drdy(&r.a));
        await_fall(&r);
    }
}

/* Less than 24 bits change nothing; more are ignored; with A0 high there is nothing to write but in the coefficient modes. */
static void writes_are_of_24_bits(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    write_frame(&r, false, 0x7FFFFF, 23);
    assert_int_equal(r.a.control, FAST);
    assert_int_equal(r.a.n.dropped, 1);
    write_frame(&r, false, 0, 0);
    assert_int_equal(r.a.n.dropped, 2);
    a0(&r, false);
    tfs(&r, false);
    write_bits(&r, FAST | AD7712_CTL_BO, 24);
    write_bits(&r, 0x5, 3);
    wait_ns(&r, LAST_NS);
    tfs(&r, true);
    assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
    assert_int_equal(r.a.n.over_writes, 3);
    write_frame(&r, true, 0x123456, 24);
    assert_int_equal(r.a.n.refused, 1);
    assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
    assert_int_equal(r.a.zero[0], AD7712_ZERO_IDEAL);
    assert_int_equal(r.a.full[0], AD7712_FULL_IDEAL);
    assert_int_equal(r.a.n.dropped, 2);
    assert_int_equal(breaches(&r), 0);
}

/* The word acts 4 tau after the last fall of SCLK, not before, whether TFS is still low or not. */
static void a_write_acts_4_tau_after_its_last_bit(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    a0(&r, false);
    tfs(&r, false);
    write_bits(&r, FAST | AD7712_CTL_BO, 24);
    wait_ns(&r, 399);
    assert_int_equal(r.a.control, FAST);
    wait_ns(&r, 1);
    assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
}

static void rfs_and_tfs_together_are_refused(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    a0(&r, true);
    rfs(&r, false);
    tfs(&r, false); /* the read goes on */
    wait_ns(&r, FIRST_NS);
    assert_int_equal(pulses(&r, 24), r.a.word);
    tfs(&r, true);
    rfs(&r, true);
    assert_int_equal(r.a.n.refused, 1);
    wait_ns(&r, 1000);
    a0(&r, false);
    tfs(&r, false);
    rfs(&r, false); /* so does the write */
    write_bits(&r, FAST | AD7712_CTL_BO, 24);
    assert_false(ad7712_sdata_driven(&r.a, r.s.now_ns));
    rfs(&r, true);
    wait_ns(&r, LAST_NS);
    tfs(&r, true);
    assert_int_equal(r.a.n.refused, 2);
    assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
}

/* TFS tied to A0: writes go to the control register, reads give the data. */
static void tfs_tied_to_a0(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet);
    r.v[0] = 0.7;
    a0(&r, true);
    ad7712_a0_pin(&r.a, false, r.s.now_ns);
    tfs(&r, false);
    write_bits(&r, FAST, 24);
    wait_ns(&r, LAST_NS);
    tfs(&r, true);
    ad7712_a0_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(r.a.control, FAST);
    await_fall(&r);
    rfs(&r, false);
    wait_ns(&r, FIRST_NS);
    near(pulses(&r, 24), 8388608 * 1.28, 2);
    assert_int_equal(breaches(&r) + r.a.n.refused, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(data_change_with_rfs_and_the_falls_of_sclk),
        cmocka_unit_test(a_bit_at_the_fall_is_still_a_bit),
        cmocka_unit_test(a_word_right_behind_a_read_keeps_drdy_low),
        cmocka_unit_test(delays_can_be_set),
        cmocka_unit_test(drdy_rises_with_the_last_bit_of_a_word),
        cmocka_unit_test(a_waiting_word_comes_before_the_control_register),
        cmocka_unit_test(words_that_come_while_rfs_is_low_are_lost),
        cmocka_unit_test(rfs_may_rise_between_bytes),
        cmocka_unit_test(what_ends_an_interrupted_read),
        cmocka_unit_test(reads_while_drdy_is_high),
        cmocka_unit_test(writes_are_of_24_bits),
        cmocka_unit_test(a_write_acts_4_tau_after_its_last_bit),
        cmocka_unit_test(rfs_and_tfs_together_are_refused),
        cmocka_unit_test(tfs_tied_to_a0),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
