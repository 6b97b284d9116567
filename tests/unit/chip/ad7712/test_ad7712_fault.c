/* Faults of the AD7712: stuck pins, a lost SYNC, a clock that runs away, bits that flip. */
#include "ad7712_rig.h"

#define FAST AD7712_CONTROL(0, 0, 0, 1, 0, 19)

static void up(struct rig *r)
{
    power_up(r, &quiet);
    r->v[0] = 0.7;
    write_control(r, FAST);
    await_fall(r);
}

static void fault(struct rig *r, struct chip_fault f)
{
    ad7712_fault(&r->a, &f, r->s.now_ns);
}

/* The pin is stuck and told once; inside, conversions go on, and after the fault the pin says what is. */
static void a_stuck_drdy(void **state)
{
    (void)state;
    for (unsigned high = 0; high < 2; high++) {
        struct rig r;
        up(&r);
        const unsigned n = r.drdy.n;
        fault(&r, (struct chip_fault){.drdy = high ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW});
        assert_int_equal(ad7712_drdy(&r.a), high);
        assert_int_equal(r.drdy.n, n + high);
        const uint32_t conversions = r.a.n.conversions;
        wait_ns(&r, 5 * 19 * MOD_NS);
        assert_int_equal(r.a.n.conversions, conversions + 5);
        assert_int_equal(r.drdy.n, n + high);
        assert_int_equal(ad7712_drdy(&r.a), high);
        assert_int_equal(read_frame(&r, true, 24), r.a.word);
        fault(&r, (struct chip_fault){0});
        assert_true(ad7712_drdy(&r.a));
        assert_int_equal(r.drdy.n, n + 1);
        await_fall(&r);
    }
}

static void a_dead_sdata(void **state)
{
    (void)state;
    for (unsigned high = 0; high < 2; high++) {
        struct rig r;
        up(&r);
        fault(&r, (struct chip_fault){.dout = high ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW});
        assert_int_equal(read_frame(&r, true, 24), high ? 0xFFFFFF : 0);
        assert_true(ad7712_drdy(&r.a));               /* the chip knows nothing of it */
        assert_false(ad7712_sdata(&r.a, r.s.now_ns)); /* not ours in high impedance */
        write_control(&r, FAST | AD7712_CTL_BO);
        assert_int_equal(r.a.control, FAST | AD7712_CTL_BO);
        a0(&r, false);
        rfs(&r, false);
        wait_ns(&r, 400);
        assert_int_equal(ad7712_sdata(&r.a, r.s.now_ns), high);
        const unsigned n = r.sdata.n;
        fault(&r, (struct chip_fault){0});
        assert_int_equal(r.sdata.n, n + high); /* bit 23 of the control word is 0 */
        assert_false(ad7712_sdata(&r.a, r.s.now_ns));
    }
}

static void a_lost_sync(void **state)
{
    (void)state;
    struct rig r;
    up(&r);
    fault(&r, (struct chip_fault){.lost_sync = true});
    const uint32_t restarts = r.a.n.restarts;
    ad7712_sync_pin(&r.a, false, r.s.now_ns);
    await_fall(&r);
    ad7712_sync_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(r.a.n.restarts, restarts);
    ad7712_sync_pin(&r.a, false, r.s.now_ns);
    await_fall(&r);
    const unsigned n = r.drdy.n;
    fault(&r, (struct chip_fault){0}); /* the wire is whole again, and low: DRDY goes high, told once */
    assert_int_equal(r.a.state, AD7712_SYNC_LOW);
    assert_int_equal(r.drdy.n, n + 1);
    fault(&r, (struct chip_fault){.lost_sync = true});
    await_fall(&r);
}

/* From the next edge on the clock is another; what is under way keeps its counts. */
static void a_clock_that_is_off(void **state)
{
    (void)state;
    static const int32_t rows[] = {100, -100, 500000, -500000, 1};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        up(&r);
        const int64_t fall_ns = r.s.now_ns;
        wait_ns(&r, 200000); /* 2000 of 9728 tau have gone by; looks at 1216, 3648 ... */
        r.looks = 0;
        fault(&r, (struct chip_fault){.clock_ppm = rows[i]});
        const double tau_ns = 1e9 / (1e7 + 10.0 * rows[i]);
        near((double)await_fall(&r), (double)fall_ns + 200000 + 7728 * tau_ns, 2.0);
        assert_int_equal(r.look_ns[0], fall_ns + 121600);
        near((double)r.look_ns[1], (double)fall_ns + 200000 + 1648 * tau_ns, 2.0);
        const double next_ns = (double)r.s.now_ns + 9728 * tau_ns;
        near((double)r.drdy.e[r.drdy.n - 2].t_ns, (double)r.s.now_ns - 500 * tau_ns, 2.0);
        near((double)await_fall(&r), next_ns, 2.0);
        near(r.a.word, 8388608 * 1.28, 2);
        fault(&r, (struct chip_fault){0});
        const int64_t back_ns = r.s.now_ns;
        near((double)await_fall(&r), (double)back_ns + 972800, 400.0);
        near((double)ad7712_period_ns(&r.a), 972800, 0);
    }
}

/* Each byte of each register; the chip acts on what it finds. */
static void flipped_bits(void **state)
{
    (void)state;
    for (unsigned reg = 0; reg < AD7712_FLIP_REGS; reg++) {
        for (unsigned bit = 0; bit < 8; bit++) {
            struct rig r;
            up(&r);
            uint32_t was[5] = {r.a.control, r.a.zero[0], r.a.full[0], r.a.zero[1], r.a.full[1]};
            assert_true(ad7712_flip(&r.a, reg, (uint8_t)(1u << bit), r.s.now_ns));
            was[reg / 3] ^= 1u << bit << (8 * (2 - reg % 3));
            const uint32_t now[5] = {r.a.control, r.a.zero[0], r.a.full[0], r.a.zero[1], r.a.full[1]};
            assert_memory_equal(was, now, sizeof was);
        }
    }
    struct rig r;
    up(&r);
    ad7712_flip(&r.a, 0, 0x20, r.s.now_ns); /* MD0: a self-calibration */
    await_fall(&r);
    assert_int_equal(r.a.n.calibrations, 1);
    ad7712_flip(&r.a, 0, 0x01, r.s.now_ns); /* PD */
    assert_int_equal(r.a.state, AD7712_DOWN);
    assert_false(ad7712_flip(&r.a, AD7712_FLIP_REGS, 1, r.s.now_ns));
    ad7712_power_off(&r.a, r.s.now_ns);
    assert_false(ad7712_flip(&r.a, 0, 1, r.s.now_ns));
}

/* Faults outlive power. */
static void faults_outlive_power(void **state)
{
    (void)state;
    struct rig r;
    up(&r);
    fault(&r, (struct chip_fault){.drdy = CHIP_STUCK_HIGH, .clock_ppm = 1000});
    ad7712_power_off(&r.a, r.s.now_ns);
    ad7712_power_up(&r.a, r.s.now_ns);
    const unsigned n = r.drdy.n;
    wait_ns(&r, 100000000);
    assert_int_equal(r.drdy.n, n);
    assert_true(r.a.unread);
    near((double)ad7712_period_ns(&r.a), 325 * 51200 / 1.001, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stuck_drdy),        cmocka_unit_test(a_dead_sdata), cmocka_unit_test(a_lost_sync),
        cmocka_unit_test(a_clock_that_is_off), cmocka_unit_test(flipped_bits), cmocka_unit_test(faults_outlive_power),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
