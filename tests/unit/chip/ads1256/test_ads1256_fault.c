/* Faults of the ADS1256 at its pins, in its clock and its registers. */
#include "ads1256_rig.h"

static struct rig rig;

enum { RATE_100 = 0x82, PERIOD_100_NS = 10000000 };

static void set(struct rig *r, struct chip_fault f)
{
    ads1256_fault(&r->a, &f, r->s.now_ns);
}

/* At 100 SPS, one word seen. */
static struct rig *up(void)
{
    struct rig *r = &rig;
    rig_up(r, &quiet);
    r->v[0] = 1.0;
    set_rate(r, RATE_100);
    await_fall(r);
    return r;
}

static void a_stuck_drdy_moves_to_its_level_and_stays_there(void **state)
{
    (void)state;
    struct rig *r = up();
    const unsigned edges = r->edges;
    set(r, (struct chip_fault){.drdy = CHIP_STUCK_HIGH});
    assert_int_equal(r->edges, edges + 1);
    assert_true(r->edge[edges].level);
    assert_true(ads1256_drdy(&r->a));
    const uint32_t conversions = r->a.n.conversions;
    wait_ns(r, 5 * PERIOD_100_NS);
    assert_int_equal(r->edges, edges + 1);
    assert_int_equal(r->a.n.conversions, conversions + 5);
    assert_int_equal(rreg(r, ADS1256_STATUS) & ADS1256_STATUS_DRDY, 0); /* the register bit is not the pin */
    set(r, (struct chip_fault){.drdy = CHIP_STUCK_LOW});
    assert_int_equal(r->edges, edges + 2);
    wait_ns(r, 5 * PERIOD_100_NS);
    assert_int_equal(r->edges, edges + 2);
    assert_false(ads1256_drdy(&r->a));
    set(r, (struct chip_fault){.drdy = CHIP_FREE});
    await_fall(r);
    assert_int_equal(r->edges, edges + 4);
}

static void a_dead_dout_reads_as_its_level_by_bytes_and_pins(void **state)
{
    (void)state;
    struct rig *r = up();
    set(r, (struct chip_fault){.dout = CHIP_STUCK_HIGH});
    assert_int_equal(rdata(r), -1);
    assert_int_equal(rreg(r, ADS1256_DRATE), 0xFF);
    assert_true(ads1256_dout(&r->a)); /* with CS high, too */
    ads1256_cs_pin(&r->a, true, r->s.now_ns);
    assert_true(ads1256_dout(&r->a));
    ads1256_cs_pin(&r->a, false, r->s.now_ns);
    set(r, (struct chip_fault){.dout = CHIP_STUCK_LOW});
    assert_false(ads1256_dout(&r->a));
    assert_int_equal(rdata(r), 0);
    assert_int_equal(rreg(r, ADS1256_DRATE), 0x00);
    set(r, (struct chip_fault){.dout = CHIP_FREE});
    assert_int_equal(rreg(r, ADS1256_DRATE), RATE_100);
    wait_ns(r, PERIOD_100_NS);
    near(rdata(r) / 8388608.0, 0.2, 1e-4); /* 1 V of 5 V */
}

static void sync_is_not_heard(void **state)
{
    (void)state;
    struct rig *r = up();
    set(r, (struct chip_fault){.lost_sync = true});
    const uint32_t restarts = r->a.n.restarts, downs = r->a.n.power_downs;
    const unsigned edges = r->edges;
    ads1256_sync_pin(&r->a, false, r->s.now_ns);
    wait_ns(r, 2000);
    ads1256_sync_pin(&r->a, true, r->s.now_ns);
    command(r, 0xFC);
    command(r, 0xFF);
    assert_int_equal(r->a.n.restarts, restarts);
    wait_ns(r, PERIOD_100_NS);
    assert_true(r->edges > edges);
    ads1256_sync_pin(&r->a, false, r->s.now_ns);
    wait_ns(r, 30 * PERIOD_100_NS); /* long enough for power-down */
    assert_int_equal(r->a.n.power_downs, downs);
    set(r, (struct chip_fault){.lost_sync = false});
    ads1256_sync_pin(&r->a, true, r->s.now_ns);
    ads1256_sync_pin(&r->a, false, r->s.now_ns);
    wait_ns(r, 2000);
    ads1256_sync_pin(&r->a, true, r->s.now_ns);
    assert_int_equal(r->a.n.restarts, restarts + 1);
}

/* The wire breaks while SYNC/PDWN is low: a pull-up lets the chip go on. */
static void a_wire_that_breaks_in_a_pulse_ends_it(void **state)
{
    (void)state;
    struct rig *r = up();
    ads1256_sync_pin(&r->a, false, r->s.now_ns);
    wait_ns(r, 2000);
    set(r, (struct chip_fault){.lost_sync = true});
    const int64_t at_ns = r->s.now_ns;
    near((double)(await_fall(r) - at_ns), (double)ads1256_settle_ns(&r->a), 200.0);
}

/* As far off as before, by the new clock. */
static void assert_moved(const struct rig *r, const struct sched_ev *ev, int64_t was_ns, double slow)
{
    assert_true(ev->queued);
    near((double)(ev->due_ns - r->s.now_ns), (double)(was_ns - r->s.now_ns) * slow, 200.0);
}

static void a_slow_clock_stretches_what_comes(void **state)
{
    (void)state;
    struct rig *r = up();
    const int64_t first_ns = await_fall(r);
    wait_ns(r, PERIOD_100_NS / 2);
    const int64_t cell_ns = r->a.cell_ev.due_ns, pulse_ns = r->a.pulse_ev.due_ns;
    set(r, (struct chip_fault){.clock_ppm = -1000});
    const double slow = 7680000.0 / (7680000 - 7680);
    assert_moved(r, &r->a.cell_ev, cell_ns, slow);
    assert_moved(r, &r->a.pulse_ev, pulse_ns, slow);
    const int64_t second_ns = await_fall(r);
    near((double)(second_ns - first_ns), PERIOD_100_NS / 2 * (1.0 + slow), 200.0);
    int64_t last_ns = second_ns;
    for (int i = 0; i < 100; i++) last_ns = await_fall(r);
    near((double)(last_ns - second_ns), 100.0 * PERIOD_100_NS * slow, 2.0);
    near(rdata(r) / 8388608.0, 0.2, 1e-4);
    set(r, (struct chip_fault){.clock_ppm = 0});
    last_ns = await_fall(r);
    near((double)(await_fall(r) - last_ns), PERIOD_100_NS, 1.0);
}

static void the_clock_may_change_in_a_calibration(void **state)
{
    (void)state;
    struct rig *r = up();
    await_fall(r);
    xfer(r, 0xF0);
    const int64_t from_ns = r->s.now_ns;
    const int64_t cal_ns = await_fall(r) - from_ns;
    xfer(r, 0xF0);
    const int64_t at_ns = r->s.now_ns, stored_ns = r->a.cal_ev.due_ns;
    set(r, (struct chip_fault){.clock_ppm = -100000});
    assert_moved(r, &r->a.cal_ev, stored_ns, 1.0 / 0.9);
    near((double)(await_fall(r) - at_ns), (double)cal_ns / 0.9, 2000.0);
}

static void a_flipped_bit_is_there_and_acts(void **state)
{
    (void)state;
    struct rig *r = up();
    await_fall(r);
    const int fsc2 = rreg(r, ADS1256_FSC2);
    assert_true(reg_flip(&r->a.regs, ADS1256_FSC2, 0x20, r->s.now_ns));
    await_fall(r);
    near(rdata(r) / 8388608.0, 0.2 * ((fsc2 ^ 0x20) + 0.5) / (fsc2 + 0.5), 2e-3);
    assert_true(reg_flip(&r->a.regs, ADS1256_STATUS, 0x10, r->s.now_ns)); /* ID, read-only */
    assert_int_equal(rreg(r, ADS1256_STATUS) >> 4, 0x2);
    assert_true(reg_flip(&r->a.regs, ADS1256_DRATE, RATE_100 ^ 0xA1, r->s.now_ns)); /* 1000 SPS */
    await_fall(r);
    int64_t was_ns = await_fall(r);
    near((double)(await_fall(r) - was_ns), 1000000.0, 200.0);
    assert_false(reg_flip(&r->a.regs, ADS1256_REGS, 0x01, r->s.now_ns));
}

static void without_power_everything_is_forgotten_but_the_counters(void **state)
{
    (void)state;
    struct rig *r = up();
    const uint32_t conversions = r->a.n.conversions;
    ads1256_power_off(&r->a, r->s.now_ns);
    assert_true(ads1256_drdy(&r->a));
    const unsigned edges = r->edges;
    wait_ns(r, 100000000);
    assert_int_equal(r->edges, edges);
    assert_int_equal(r->a.n.conversions, conversions);
    assert_int_equal(rreg(r, ADS1256_DRATE), ADS1256_DOUT_IDLE);
    ads1256_power_up(&r->a, r->s.now_ns);
    await_fall(r);
    assert_int_equal(rreg(r, ADS1256_DRATE), 0xF0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stuck_drdy_moves_to_its_level_and_stays_there),
        cmocka_unit_test(a_dead_dout_reads_as_its_level_by_bytes_and_pins),
        cmocka_unit_test(sync_is_not_heard),
        cmocka_unit_test(a_wire_that_breaks_in_a_pulse_ends_it),
        cmocka_unit_test(a_slow_clock_stretches_what_comes),
        cmocka_unit_test(the_clock_may_change_in_a_calibration),
        cmocka_unit_test(a_flipped_bit_is_there_and_acts),
        cmocka_unit_test(without_power_everything_is_forgotten_but_the_counters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
