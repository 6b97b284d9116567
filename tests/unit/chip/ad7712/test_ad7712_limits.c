/* Frames of the AD7712's serial port: limits, self-clocking (sources 3.4). */
#include "ad7712_up.h"

/* ---- limits: at the limit nothing, one ns beyond one count; lenient what was meant, strict ones and lost writes ---- */

struct read_limit {
    const char *name;
    int64_t a0_ns, low_ns, high_ns, last_ns; /* A0 to RFS; SCLK low and high of each pulse; last fall to RFS */
    uint32_t a0, sclk, frame;                /* counted */
};

static void limits_of_a_read(void **state)
{
    (void)state;
    static const struct read_limit rows[] = {
        {"typical", 400, 400, 400, 500, 0, 0, 0},     {"A0 min", 200, 400, 400, 500, 0, 0, 0},
        {"A0 late", 199, 400, 400, 500, 1, 0, 0},     {"period min", 400, 250, 250, 500, 0, 0, 0},
        {"fast", 400, 249, 250, 500, 0, 15, 0},       {"high min", 400, 400, 200, 500, 0, 0, 0},
        {"high short", 400, 400, 199, 500, 0, 16, 0}, {"low min", 400, 200, 400, 500, 0, 0, 0},
        {"low short", 400, 199, 400, 500, 0, 15, 0},  {"RFS min", 400, 400, 400, 10, 0, 0, 0},
        {"RFS early", 400, 400, 400, 9, 0, 0, 1},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned strict = 0; strict < 2; strict++) {
            struct rig r;
            struct ad7712_cfg cfg = quiet;
            cfg.strict_timing = strict;
            up(&r, &cfg, FAST & ~AD7712_CTL_WL);
            ad7712_a0_pin(&r.a, true, r.s.now_ns);
            wait_ns(&r, rows[i].a0_ns);
            rfs(&r, false);
            wait_ns(&r, FIRST_NS);
            uint32_t got = 0;
            for (unsigned k = 0; k < 16; k++) {
                if (k) wait_ns(&r, rows[i].low_ns);
                ad7712_sclk_pin(&r.a, true, r.s.now_ns);
                got = got << 1 | ad7712_sdata(&r.a, r.s.now_ns);
                wait_ns(&r, rows[i].high_ns);
                ad7712_sclk_pin(&r.a, false, r.s.now_ns);
            }
            wait_ns(&r, rows[i].last_ns);
            rfs(&r, true);
            const struct ad7712_counters *n = &r.a.n;
            if (n->a0_violations != rows[i].a0 || n->sclk_violations != rows[i].sclk ||
                n->frame_violations != rows[i].frame)
                fail_msg("%s: %u %u %u", rows[i].name, n->a0_violations, n->sclk_violations, n->frame_violations);
            if (strict && rows[i].a0) assert_int_equal(got, 0xFFFF);
            else if (strict && rows[i].sclk) assert_int_equal(got & 0x3FFF, 0x3FFF);
            else assert_int_equal(got, r.a.word >> 8);
        }
    }
}

struct write_limit {
    const char *name;
    int64_t setup_ns, high_ns, hold_ns, last_ns; /* data to rise, high, rise to change, last fall to TFS */
    uint32_t sdata, sclk, frame;
};

static void limits_of_a_write(void **state)
{
    (void)state;
    static const struct write_limit rows[] = {
        {"typical", 400, 400, 400, 500, 0, 0, 0},    {"set-up 0", 0, 400, 400, 500, 0, 0, 0},
        {"set-up min", 0, 200, 200, 500, 0, 0, 0},   {"set-up short", 0, 199, 199, 500, 24, 24, 0},
        {"hold min", 400, 400, 30, 500, 0, 0, 0},    {"next bit early", 400, 400, 250, 500, 0, 0, 0},
        {"hold short", 400, 400, 29, 500, 24, 0, 0}, {"TFS min", 400, 400, 400, 400, 0, 0, 0},
        {"TFS early", 400, 400, 400, 399, 0, 0, 1},
    };
    const uint32_t word =
        AD7712_CONTROL(6, 5, 0, 1, 0, 0x2AA) | 0x6000; /* with the other one its changes are each bit's */
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned strict = 0; strict < 2; strict++) {
            struct rig r;
            struct ad7712_cfg cfg = quiet;
            cfg.strict_timing = strict;
            power_up(&r, &cfg);
            a0(&r, false);
            tfs(&r, false);
            for (unsigned k = 0; k < 24; k++) {
                const bool bit = word >> (23 - k) & 1;
                ad7712_sdata_pin(&r.a, !bit, r.s.now_ns); /* so that each bit is a change at its time */
                wait_ns(&r, 600 - rows[i].setup_ns);
                ad7712_sdata_pin(&r.a, bit, r.s.now_ns);
                wait_ns(&r, rows[i].setup_ns);
                ad7712_sclk_pin(&r.a, true, r.s.now_ns);
                wait_ns(&r, rows[i].hold_ns);
                if (rows[i].hold_ns < rows[i].high_ns) ad7712_sdata_pin(&r.a, !bit, r.s.now_ns);
                wait_ns(&r, rows[i].high_ns - rows[i].hold_ns);
                ad7712_sclk_pin(&r.a, false, r.s.now_ns);
            }
            wait_ns(&r, rows[i].last_ns);
            tfs(&r, true);
            wait_ns(&r, 1000);
            const struct ad7712_counters *n = &r.a.n;
            if (n->sdata_violations != rows[i].sdata || n->sclk_violations != rows[i].sclk ||
                n->frame_violations != rows[i].frame)
                fail_msg("%s: %u %u %u", rows[i].name, n->sdata_violations, n->sclk_violations, n->frame_violations);
            const bool lost = strict && breaches(&r);
            assert_int_equal(r.a.control, lost ? AD7712_CTL_RESET : word);
            assert_int_equal(n->dropped, lost);
        }
    }
}

static void a0_must_not_move_inside_a_frame(void **state)
{
    (void)state;
    for (unsigned strict = 0; strict < 2; strict++) {
        struct rig r;
        struct ad7712_cfg cfg = quiet;
        cfg.strict_timing = strict;
        up(&r, &cfg, FAST);
        a0(&r, true);
        rfs(&r, false);
        wait_ns(&r, FIRST_NS);
        const uint32_t first = pulses(&r, 12);
        ad7712_a0_pin(&r.a, false, r.s.now_ns); /* the frame's source stays */
        wait_ns(&r, 400);
        const uint32_t got = first << 12 | pulses(&r, 12);
        assert_int_equal(got, strict ? (r.a.word & 0xFFF000) | (r.a.word & 0x800) | 0x7FF : r.a.word);
        assert_int_equal(r.a.n.a0_violations, 1);
        wait_ns(&r, LAST_NS);
        rfs(&r, true);
    }
}

/* TFS low, then A0, then SCLK: the first SCLK decides. It is a breach, and lost where the chip is strict. */
static void a0_may_follow_tfs_until_the_first_sclk(void **state)
{
    (void)state;
    static const struct {
        bool to;
        uint32_t refused;
    } rows[] = {{false, 0}, {true, 1}};
    const uint32_t word = FAST | AD7712_CTL_BO;
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned strict = 0; strict < 2; strict++) {
            struct rig r;
            struct ad7712_cfg cfg = quiet;
            cfg.strict_timing = strict;
            up(&r, &cfg, FAST);
            a0(&r, !rows[i].to);
            tfs(&r, false);
            ad7712_a0_pin(&r.a, rows[i].to, r.s.now_ns);
            write_bits(&r, word >> 23, 1);
            ad7712_a0_pin(&r.a, !rows[i].to, r.s.now_ns); /* too late */
            write_bits(&r, word & 0x7FFFFF, 23);
            wait_ns(&r, LAST_NS);
            tfs(&r, true);
            wait_ns(&r, 1000);
            const bool lost = strict || rows[i].to;
            assert_int_equal(r.a.control, lost ? FAST : word);
            assert_int_equal(r.a.n.a0_violations, 2);
            assert_int_equal(r.a.n.refused, rows[i].refused);
            assert_int_equal(r.a.n.dropped, strict && !rows[i].to);
        }
    }
}

/* Pulses outside of frames, and an SCLK that is high when the frame begins, shift nothing. */
static void pulses_outside_of_frames_do_nothing(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    pulses(&r, 7);
    wait_ns(&r, 400);
    ad7712_sclk_pin(&r.a, true, r.s.now_ns);
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, 400);
    ad7712_sclk_pin(&r.a, false, r.s.now_ns);
    wait_ns(&r, 400);
    assert_int_equal(pulses(&r, 24), r.a.word);
    assert_int_equal(r.a.n.over_reads + r.a.n.over_writes, 0);
    wait_ns(&r, LAST_NS);
    rfs(&r, true);
    a0(&r, false);
    ad7712_sclk_pin(&r.a, true, r.s.now_ns);
    wait_ns(&r, 10);
    tfs(&r, false);
    ad7712_sdata_pin(&r.a, !r.a.port.sdata, r.s.now_ns); /* within 30 ns of a rise that took no bit */
    wait_ns(&r, 400);
    ad7712_sclk_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(breaches(&r), 0);
}

/* ---- self-clocking ---- */

/* 24 (16) falls and rises: the first fall 4 tau after RFS, low 3/2 tau, high 1/2; data valid at the rises. */
static void self_clocking_reads(void **state)
{
    (void)state;
    static const unsigned widths[] = {16, 24};
    for (unsigned w = 0; w < 2; w++) {
        struct rig r;
        up(&r, &quiet, widths[w] == 24 ? FAST : FAST & ~AD7712_CTL_WL);
        ad7712_mode_pin(&r.a, true, r.s.now_ns);
        assert_true(ad7712_sclk(&r.a));
        a0(&r, true);
        const int64_t rfs_ns = r.s.now_ns;
        rfs(&r, false);
        wait_ns(&r, 10000);
        assert_int_equal(r.sclk.n, 2 * widths[w]);
        uint32_t got = 0;
        for (unsigned i = 0; i < r.sclk.n; i++) {
            assert_int_equal(r.sclk.e[i].level, i % 2);
            assert_int_equal(r.sclk.e[i].t_ns, rfs_ns + 400 + i / 2 * 200 + (i % 2 ? 150 : 0));
            if (i % 2 == 0) continue;
            bool level = false; /* of SDATA at the rise */
            for (unsigned k = 0; k < r.sdata.n; k++) {
                if (r.sdata.e[k].t_ns <= r.sclk.e[i].t_ns) level = r.sdata.e[k].level;
            }
            got = got << 1 | level;
        }
        assert_int_equal(got, r.a.word >> (24 - widths[w]));
        assert_true(ad7712_drdy(&r.a));
        assert_true(ad7712_sclk(&r.a));
        ad7712_sclk_pin(&r.a, true, r.s.now_ns); /* the host's SCLK is not looked at */
        ad7712_sclk_pin(&r.a, false, r.s.now_ns);
        assert_int_equal(r.a.n.over_reads + breaches(&r), 0);
        rfs(&r, true);
    }
}

static void self_clocking_writes(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    ad7712_mode_pin(&r.a, true, r.s.now_ns);
    a0(&r, false);
    const uint32_t word = FAST | AD7712_CTL_BO;
    tfs(&r, false);
    for (unsigned i = 0; i < 24; i++) {
        while (ad7712_sclk(&r.a)) wait_ns(&r, 10); /* falls: a new bit, taken with the rise */
        ad7712_sdata_pin(&r.a, word >> (23 - i) & 1, r.s.now_ns);
        while (!ad7712_sclk(&r.a)) wait_ns(&r, 10);
    }
    wait_ns(&r, 1000);
    tfs(&r, true);
    assert_int_equal(r.a.control, word);
    assert_int_equal(r.sclk.n, 48);
    assert_int_equal(r.a.n.dropped + r.a.n.over_writes + breaches(&r), 0);
}

/* RFS high stops it at once, and what is left of the word is read in the next frame; a change of MODE ends the frame. */
static void a_cut_self_clocked_frame(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet, FAST);
    ad7712_mode_pin(&r.a, true, r.s.now_ns);
    a0(&r, true);
    rfs(&r, false);
    wait_ns(&r, 400 + 5 * 200 + 100); /* in the sixth low */
    rfs(&r, true);
    assert_true(ad7712_sclk(&r.a));
    const unsigned n = r.sclk.n;
    wait_ns(&r, 5000);
    assert_int_equal(r.sclk.n, n);
    assert_false(ad7712_drdy(&r.a));
    rfs(&r, false);
    wait_ns(&r, 2000);
    ad7712_mode_pin(&r.a, false, r.s.now_ns);
    assert_false(ad7712_sdata_driven(&r.a, r.s.now_ns));
    assert_true(ad7712_sclk(&r.a));
    wait_ns(&r, 5000);
    rfs(&r, true);
    assert_int_equal(read_frame(&r, true, 24), r.a.word);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_of_a_read),
        cmocka_unit_test(limits_of_a_write),
        cmocka_unit_test(a0_must_not_move_inside_a_frame),
        cmocka_unit_test(a0_may_follow_tfs_until_the_first_sclk),
        cmocka_unit_test(pulses_outside_of_frames_do_nothing),
        cmocka_unit_test(self_clocking_reads),
        cmocka_unit_test(self_clocking_writes),
        cmocka_unit_test(a_cut_self_clocked_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
