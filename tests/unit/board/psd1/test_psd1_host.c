/* PSD-1: who takes its words, over the bus and built in, and what a slow host does to a cycle. */
#include "psd1_rig.h"

static struct rig rig;

enum { FAST_NS = 48400 }; /* a cycle with the built-in host: 400 + 3 x 13600 + 3 x 2400 */

static void a_host_takes_the_words_over_the_bus(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    for (unsigned i = 0; i < 10; i++) {
        assert_int_equal(take(&rig, 0), 40921); /* at the very instant of FL2 */
        assert_int_equal(take(&rig, 300), 9830);
        assert_int_equal(take(&rig, 5000), 65208);
        rig_await(&rig, PSD1_IDLE);
        const struct psd1_cycle *c = &rig.cycle[i];
        assert_int_equal(rig.cycles, i + 1);
        /* FL2 at 14000; strobe 800: its end 14800 is a fall (400 mod 800), the next is 15600 */
        const int64_t y_ns = 400 + 13600 + 1600, z_ns = y_ns + 13600 + 1600;
        assert_int_equal(c->t_end_ns - c->t_a0_ns, z_ns + 13600 + 6400);
        assert_int_equal(c->status, PSD1_CY_READ);
    }
}

/* FL2 ends with the first fall of 1M25 strictly after the strobe: rows of strobe length and when, from FL2 on. */
static void fl2_ends_at_the_fall_after_the_strobe(void **state)
{
    (void)state;
    static const struct {
        int64_t after_ns, strobe_ns, clear_ns;
    } rows[] = {{0, 200, 800}, {0, 799, 800}, {0, 800, 1600}, {0, 801, 1600}, {100, 700, 1600}, {799, 1600, 2400}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct psd1_profile p = no_host();
        rig_up(&rig, &p);
        rig_await(&rig, PSD1_READY);
        const int64_t fl2_ns = rig.b.fl2_ns;
        rig_until(&rig, fl2_ns + rows[i].after_ns);
        assert_int_equal(rig_bus(&rig, false, 0, 0, rows[i].strobe_ns), BOARD_CYCLE_OK);
        assert_int_equal(rig.answered_ns, fl2_ns + rows[i].after_ns + rows[i].strobe_ns);
        assert_true(rig.b.fl2);
        rig_until(&rig, fl2_ns + rows[i].clear_ns - 1);
        assert_int_equal(rig.events[PSD1_EV_RFY], 0);
        rig_until(&rig, fl2_ns + rows[i].clear_ns);
        assert_int_equal(rig.events[PSD1_EV_RFY], 1);
        assert_false(rig.b.fl2);
    }
}

/* The strobe is what the host asks for, and what is refused leaves the word where it is. */
static void refusals_leave_the_word(void **state)
{
    (void)state;
    static const struct {
        bool write;
        uint8_t address;
        uint16_t data;
        int64_t strobe_ns;
        enum board_cycle_result want;
    } rows[] = {
        {false, 1, 0, 0, BOARD_CYCLE_NOT_READY},    {false, 2, 0, 0, BOARD_CYCLE_NOT_READY},
        {false, 0, 0, 199, BOARD_CYCLE_TOO_SHORT},  {true, 0, 1, 0, BOARD_CYCLE_READ_ONLY},
        {true, 3, 1, 0, BOARD_CYCLE_READ_ONLY},     {true, 9, 1, 0, BOARD_CYCLE_READ_ONLY},
        {false, 16, 0, 0, BOARD_CYCLE_NO_ADDRESS},  {true, 255, 0, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, 10, 4, 0, BOARD_CYCLE_BAD_VALUE},    {true, 11, 0xFFFF, 0, BOARD_CYCLE_BAD_VALUE},
        {true, 12, 256, 0, BOARD_CYCLE_BAD_VALUE},  {true, 15, 4, 0, BOARD_CYCLE_BAD_VALUE},
        {true, 14, 0, 0, BOARD_CYCLE_BAD_VALUE},    {true, 14, 5, 0, BOARD_CYCLE_BAD_VALUE},
        {true, 14, 0x13, 0, BOARD_CYCLE_BAD_VALUE}, {true, 14, 0x23, 0, BOARD_CYCLE_BAD_VALUE},
        {true, 14, 0x33, 0, BOARD_CYCLE_BAD_VALUE}, {true, 14, 0x130, 0, BOARD_CYCLE_BAD_VALUE},
        {true, 14, 2, 0, BOARD_CYCLE_BAD_VALUE}, /* the word staged is 0: FS out of range */
        {true, 15, 0, 100, BOARD_CYCLE_TOO_SHORT},
    };
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_READY);
    unsigned refused = 0, too_short = 0;
    for (size_t i = 0; i < COUNT(rows); i++) {
        const enum board_cycle_result r =
            rig_bus(&rig, rows[i].write, rows[i].address, rows[i].data, rows[i].strobe_ns);
        if (r != rows[i].want) fail_msg("row %zu: %d, not %d", i, (int)r, (int)rows[i].want);
        refused++;
        too_short += r == BOARD_CYCLE_TOO_SHORT;
        assert_int_equal(rig.b.counters.refused, refused);
        assert_int_equal(rig.b.counters.too_short, too_short);
        rig_run(&rig, 2000);
        assert_true(rig.b.fl2);
    }
    assert_int_equal(rig_bus(&rig, false, 0, 0, 200), BOARD_CYCLE_OK);
    assert_int_equal(rig.bus.data, 40921);
}

static void a_word_is_taken_once(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_READY);
    const unsigned strobes = rig.events[PSD1_EV_STROBE];
    assert_int_equal(rig_bus(&rig, false, 0, 0, 200), BOARD_CYCLE_OK);
    assert_true(rig.b.fl2);
    assert_int_equal(rig_bus(&rig, false, 0, 0, 0), BOARD_CYCLE_NOT_READY); /* though FL2 is active */
    assert_int_equal(rig.events[PSD1_EV_STROBE], strobes + 1);
}

/* One cycle at a time; OFF without power and in reset, also for one under way. */
static void the_bus_takes_one_cycle_at_a_time(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_init(&rig, &p, 0.0);
    assert_int_equal(rig_bus(&rig, false, 3, 0, 0), BOARD_CYCLE_OFF);
    psd1_power_up(&rig.b, 0);
    assert_int_equal(rig_bus(&rig, false, 3, 0, 0), BOARD_CYCLE_OFF);
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_READY);
    rig.bus = (struct board_cycle){.address = 3, .done = rig_done, .ctx = &rig};
    rig.answered = false;
    assert_int_equal(psd1_bus.submit(&rig.b.base, &rig.bus, rig.s.now_ns), BOARD_CYCLE_OK);
    struct board_cycle second = rig.bus;
    assert_int_equal(psd1_bus.submit(&rig.b.base, &second, rig.s.now_ns), BOARD_CYCLE_BUSY);
    psd1_reset(&rig.b, rig.s.now_ns);
    assert_true(rig.answered);
    assert_int_equal(rig.result, BOARD_CYCLE_OFF);
}

/* While the built-in host strobes, another client's cycle waits; while another client is on the bus, the host waits. */
static void the_built_in_host_shares_the_bus(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_STROBE_END);
    const int64_t begin_ns = rig.s.now_ns;
    assert_int_equal(rig_bus(&rig, false, 3, 0, 0), BOARD_CYCLE_OK);
    assert_int_equal(rig.answered_ns, begin_ns + 1600);
    rig_await(&rig, PSD1_STROBE_END);
    assert_int_equal(rig_bus(&rig, false, 0, 0, 0), BOARD_CYCLE_TAKEN); /* told when its turn comes */
    rig_await(&rig, PSD1_READY);
    const int64_t fl2_ns = rig.b.fl2_ns;
    assert_int_equal(rig_bus(&rig, false, 3, 0, 3000), BOARD_CYCLE_OK);
    rig_await(&rig, PSD1_CLEAR);
    assert_int_equal(rig.event_ns[PSD1_EV_STROBE], fl2_ns + 3000);
    rig_run(&rig, 972800);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[2], 65208);
}

/* No one gets a word before the built-in host, not even in the time from FL2 to its strobe. */
static void words_are_the_built_in_hosts_alone(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    for (uint8_t axis = 0; axis < 3; axis++) {
        rig_await(&rig, PSD1_READY);
        assert_int_equal(rig.b.axis, axis);
        const unsigned strobes = rig.events[PSD1_EV_STROBE];
        const int64_t fl2_ns = rig.b.fl2_ns;
        assert_int_equal(rig_bus(&rig, false, axis, 0, 0), BOARD_CYCLE_TAKEN);
        rig_await(&rig, PSD1_CLEAR);
        assert_int_equal(rig.events[PSD1_EV_STROBE], strobes + 1);
        assert_int_equal(rig.event_ns[PSD1_EV_STROBE], fl2_ns + 1000); /* the refused strobe has ended at 800 */
    }
    rig_await(&rig, PSD1_IDLE);
    assert_int_equal(rig.cycle[rig.cycles - 1].status, PSD1_CY_READ);
    assert_int_equal(rig.b.counters.refused, 3);
}

/* The cycle stretches, conversions are lost, all is counted, and it goes on as if nothing had been. */
static void a_host_that_is_late_stretches_the_cycle(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    (void)take(&rig, 0);
    (void)take(&rig, 10 * 972800);
    (void)take(&rig, 0);
    rig_await(&rig, PSD1_START);
    assert_int_equal(rig.cycle[0].status, PSD1_CY_READ | PSD1_CY_OVERRUN | PSD1_CY_LATE | PSD1_CY_MIXED);
    assert_int_equal(rig.b.counters.late, 1);
    assert_int_equal(rig.b.counters.stretched, 1);
    /* ten conversions of X and Y have come, none of them read yet but the last; Z's word was replaced ten times */
    assert_int_equal(rig.b.counters.lost_x, 9);
    assert_int_equal(rig.b.counters.lost_y, 9);
    assert_int_equal(rig.b.counters.lost_z, 10);
    /* X's word waits: the next begins at once; what is lost is reported once */
    assert_int_equal(rig.b.due_ns - rig.cycle[0].t_end_ns, 400);
    for (unsigned i = 0; i < 3; i++) (void)take(&rig, 0);
    rig_await(&rig, PSD1_IDLE);
    assert_int_equal(rig.cycle[1].status, PSD1_CY_READ);
    rig_await(&rig, PSD1_READY);
    rig_run(&rig, 5 * 972800);
    psd1_reset(&rig.b, rig.s.now_ns);
    for (unsigned i = 0; i < 3; i++) (void)take(&rig, 0);
    rig_await(&rig, PSD1_IDLE);
    assert_int_equal(rig.cycle[2].status, PSD1_CY_READ);
}

static void a_host_that_never_comes_hangs_nothing(void **state)
{
    (void)state;
    const struct psd1_profile p = no_host();
    rig_up(&rig, &p);
    rig_run(&rig, 2000000000);
    assert_int_equal(rig.cycles, 0);
    assert_int_equal(rig.b.phase, PSD1_READY);
    assert_int_equal(rig.faults, 0);
    assert_in_range(rig.b.adc[0].n.overruns, 2050, 2056);
    assert_int_equal(take(&rig, 0), 40921);
    assert_int_equal(rig.b.counters.late, 1);
}

static void late_begins_after_late_ns(void **state)
{
    (void)state;
    for (int64_t more_ns = 0; more_ns < 2; more_ns++) {
        const struct psd1_profile p = no_host();
        rig_up(&rig, &p);
        rig_await(&rig, PSD1_READY);
        rig_until(&rig, rig.b.fl2_ns + 20000 + more_ns);
        (void)rig_read(&rig, 0);
        assert_int_equal(rig.b.counters.late, more_ns);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_host_takes_the_words_over_the_bus),
        cmocka_unit_test(fl2_ends_at_the_fall_after_the_strobe),
        cmocka_unit_test(refusals_leave_the_word),
        cmocka_unit_test(the_bus_takes_one_cycle_at_a_time),
        cmocka_unit_test(the_built_in_host_shares_the_bus),
        cmocka_unit_test(a_word_is_taken_once),
        cmocka_unit_test(words_are_the_built_in_hosts_alone),
        cmocka_unit_test(a_host_that_is_late_stretches_the_cycle),
        cmocka_unit_test(a_host_that_never_comes_hangs_nothing),
        cmocka_unit_test(late_begins_after_late_ns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
