/* PSD-1: when a cycle begins, faults and life. */
#include "psd1_rig.h"

#include <math.h>

static struct rig rig;

enum { FAST_NS = 48400 }; /* a cycle with the built-in host: 400 + 3 x 13600 + 3 x 2400 */

/* ---- set-up ---- */

static void set_up_calibrates_and_cycles_follow(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    /* 100 us, UC1 20 us and edges, 9 output periods, coefficients, a conversion (sources 3.2) */
    assert_in_range(rig.event_ns[PSD1_EV_SETUP_DONE], 9 * 972800, 11 * 972800);
    assert_int_equal(rig.events[PSD1_EV_UC], 4);
    assert_int_equal(rig.b.uc1, 0x220013);
    assert_int_equal(rig.b.uc2, 0x020013);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(rig.b.adc[i].control, 0x020013);
        assert_int_equal(rig.b.adc[i].n.calibrations, 1);
        assert_int_equal(rig.b.zero[i], AD7712_ZERO_IDEAL);
        assert_int_equal(rig.b.full[i], AD7712_FULL_IDEAL);
        assert_int_equal(rig.b.adc[i].n.a0_violations + rig.b.adc[i].n.sclk_violations, 0);
        assert_int_equal(rig.b.adc[i].n.sdata_violations + rig.b.adc[i].n.frame_violations, 0);
        assert_int_equal(rig.b.adc[i].n.dropped + rig.b.adc[i].n.refused, 0);
    }
    rig_run(&rig, 100 * 972800);
    assert_in_range(rig.cycles, 100, 102);
    for (unsigned i = 0; i < rig.cycles; i++) {
        assert_int_equal(rig.cycle[i].seq, i);
        assert_int_equal(rig.cycle[i].t_end_ns - rig.cycle[i].t_a0_ns, FAST_NS);
        assert_int_equal(rig.cycle[i].word[0], 40921); /* 32768 (1 + 2.4882 / 10), rounded */
        assert_int_equal(rig.cycle[i].word[1], 9830);
        assert_int_equal(rig.cycle[i].word[2], 65208);
        assert_int_equal(rig.cycle[i].status, PSD1_CY_READ);
        if (i > 1) assert_int_equal(rig.cycle[i].t_a0_ns - rig.cycle[i - 1].t_a0_ns, 972800);
    }
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(rig.b.adc[i].n.overruns, psd1_lost_before(&rig, i));
        assert_int_equal(rig.b.adc[i].n.stale_reads + rig.b.adc[i].n.over_reads, 0);
    }
    assert_int_equal(rig.b.counters.cycles, rig.cycles);
    assert_int_equal(rig.b.counters.stretched + rig.b.counters.late + rig.b.counters.refused, 0);
    assert_int_equal(rig.b.counters.bus_cycles, 3 * rig.cycles);
}

/* The specimen's errors go away with the calibration; what is left is a rounding of the coefficients. */
static void calibration_takes_out_the_converters_errors(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.adc_offset_sd_v = 5e-3;
    p.adc_gain_sd_ppm = 20000.0;
    rig_up(&rig, &p);
    rig_run(&rig, 10 * 972800);
    for (unsigned i = 0; i < 3; i++) {
        const double want = 32768.0 * (1.0 + rig.volts[i] / 10.0);
        assert_true(fabs(rig.cycle[5].word[i] - want) <= 1.0);
        assert_true(rig.b.zero[i] != AD7712_ZERO_IDEAL && rig.b.full[i] != AD7712_FULL_IDEAL);
    }
}

static void reference_error_scales_the_words(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.vref_sd_ppm = 5000.0;
    rig_up(&rig, &p);
    rig_run(&rig, 10 * 972800);
    assert_true(fabs(rig.b.vref_error) > 1e-4);
    const double want = 32768.0 * (1.0 - 0.7 / (1.0 + rig.b.vref_error));
    assert_true(fabs(rig.cycle[5].word[1] - want) <= 1.0);
}

/* ---- when a cycle begins ---- */

/* DR falls at a multiple of 972.8 us from the converters' start, the cycle at the first rise of 1M25 strictly after. */
static void a_cycle_begins_at_the_rise_after_dr(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.adc_fs = 20;
    rig_up(&rig, &p);
    rig_run(&rig, 30000000);
    for (unsigned i = 2; i < rig.cycles; i++) {
        const int64_t waited_ns = rig.cycle[i].t_a0_ns - rig.cycle[i].t_dr_ns;
        assert_int_equal(rig.cycle[i].t_a0_ns % 800, 0);
        assert_in_range(waited_ns, 1, 800);
    }
}

static void each_condition_alone_holds_the_cycle_back(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    for (unsigned flags = 0; flags < 4; flags++) {
        rig_up(&rig, &p);
        rig_await(&rig, PSD1_IDLE);
        psd1_flags(&rig.b, flags & 1, flags & 2, rig.s.now_ns);
        const unsigned before = rig.cycles;
        rig_run(&rig, 20 * 972800);
        if (flags == 3) assert_in_range(rig.cycles, before + 19, before + 21);
        else assert_int_equal(rig.cycles, before);
        if (flags == 3) continue;
        assert_int_equal(rig.b.counters.lost_x, psd1_lost_before(&rig, 0));
        psd1_flags(&rig.b, true, true, rig.s.now_ns);
        rig_run(&rig, 972800);
        assert_in_range(rig.cycles, before + 1, before + 2);
        assert_int_equal(rig.cycle[before].status & PSD1_CY_OVERRUN, PSD1_CY_OVERRUN);
        assert_in_range(rig.b.counters.lost_x, 17, 22);
    }
}

/* A flip-flop samples what was there before the edge: a change at its very instant is one edge late. */
static void a_change_at_the_instant_of_the_rise_is_late(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_IDLE);
    psd1_flags(&rig.b, false, true, rig.s.now_ns);
    const int64_t rise_ns = rig.b.dr_ns / 800 * 800 + 800 * 1300; /* DR has fallen again by then */
    rig_until(&rig, rise_ns);
    assert_false(rig.b.dr);
    const unsigned a0 = rig.events[PSD1_EV_A0];
    psd1_flags(&rig.b, true, true, rise_ns);
    rig_until(&rig, rise_ns + 799);
    assert_int_equal(rig.events[PSD1_EV_A0], a0);
    rig_until(&rig, rise_ns + 800);
    assert_int_equal(rig.events[PSD1_EV_A0], a0 + 1);
    /* off before the edge: no cycle; off at the edge, even if it is reported first: it still begins */
    for (int64_t early_ns = 0; early_ns < 2; early_ns++) {
        rig_up(&rig, &p);
        rig_run(&rig, 5000000);
        rig_await(&rig, PSD1_IDLE);
        const int64_t due_ns = rig.b.latest.t_a0_ns + 972800;
        const unsigned before = rig.events[PSD1_EV_A0];
        sched_at(&rig.s, &rig.stopper, due_ns - early_ns); /* before the board has armed anything */
        rig_until(&rig, due_ns + 2000);
        assert_int_equal(rig.events[PSD1_EV_A0], before + !early_ns);
    }
}

static void flags_do_not_stop_a_cycle_that_runs(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_RF_RISE);
    const unsigned before = rig.cycles;
    psd1_flags(&rig.b, false, false, rig.s.now_ns);
    rig_run(&rig, 3000000);
    assert_int_equal(rig.cycles, before + 1);
}

static void dr_of_three(void **state)
{
    (void)state;
    static const struct {
        int dr;
        const char *clock; /* which converter is slower */
        unsigned slow;
    } rows[] = {{PSD1_DR_X, "y", 1}, {PSD1_DR_ALL, "y", 1}, {PSD1_DR_ANY, "z", 2}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct psd1_profile p = rig_exact();
        p.dr = rows[i].dr;
        rig_up(&rig, &p);
        rig_run(&rig, 20 * 972800);
        assert_in_range(rig.cycles, 19, 22);
        const struct chip_fault slow = {.clock_ppm = -100000};
        ad7712_fault(&rig.b.adc[rows[i].slow], &slow, rig.s.now_ns);
        const unsigned before = rig.cycles;
        rig_run(&rig, 90 * 972800);
        const unsigned n = rig.cycles - before;
        if (rows[i].dr == PSD1_DR_X) assert_in_range(n, 89, 91);
        if (rows[i].dr == PSD1_DR_ALL) assert_in_range(n, 78, 83); /* nine tenths */
        if (rows[i].dr == PSD1_DR_ANY) assert_true(n > 91);        /* whoever is first */
    }
}

/* ---- profile's open questions ---- */

static void a0_may_fall_where_rfz_rises(void **state)
{
    (void)state;
    for (int early = 0; early < 2; early++) {
        struct psd1_profile p = no_host();
        p.a0_release = early ? PSD1_A0_RFZ : PSD1_A0_FL2;
        rig_up(&rig, &p);
        rig_await(&rig, PSD1_READY);
        rig_watch(&rig, TRACE_BIT(PSD1_LINE_A0));
        const unsigned before = rig.b.base.trace.level & 1;
        (void)take(&rig, 0);
        (void)take(&rig, 0);
        rig_await(&rig, PSD1_READY);
        rig_run(&rig, 5000);
        trace_advance(&rig.b.base.trace, rig.s.now_ns);
        assert_int_equal(before, 1);
        assert_int_equal(rig.edges, early);
        if (early) assert_int_equal(rig.edge[0].t_ns, rig.b.fl2_ns);
    }
}

/* ---- faults and life ---- */

static void dr_that_never_comes_is_told(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_run(&rig, 10000000);
    const struct chip_fault stuck = {.drdy = CHIP_STUCK_HIGH}, none = {.drdy = CHIP_FREE};
    ad7712_fault(&rig.b.adc[0], &stuck, rig.s.now_ns);
    rig_run(&rig, 100000000);
    assert_int_equal(rig.faults, 0); /* 100 ms and the settling time */
    rig_run(&rig, 20000000);
    assert_int_equal(rig.faults, 1);
    assert_int_equal(rig.fault[0], PSD1_FAULT_DR);
    rig_run(&rig, 1000000000);
    assert_int_equal(rig.faults, 1);
    assert_int_equal(rig.b.counters.timeouts, 1);
    struct psd1_request q;
    assert_int_equal(command(&rig, &q, PSD1_CMD_UC2, 0x020013), BOARD_CYCLE_NOT_READY);
    assert_int_equal(rig.b.counters.timeouts, 2);
    const unsigned before = rig.cycles;
    ad7712_fault(&rig.b.adc[0], &none, rig.s.now_ns);
    rig_run(&rig, 10000000);
    assert_int_equal(rig.faults, 2);
    assert_int_equal(rig.fault[1], 0);
    assert_true(rig.cycles > before + 8);
}

static void frozen_words_repeat(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_run(&rig, 5000000);
    rig.b.base.faults = PSD1_FAULT_FROZEN_WORDS;
    rig.volts[0] = 0.0;
    rig_run(&rig, 10000000);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[0], 40921);
    rig.b.base.faults = 0;
    rig_run(&rig, 2000000);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[0], 32768);
}

static void limits_are_marked(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig.volts[1] = -10.4;
    rig_run(&rig, 10000000);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[1], 0);
    assert_int_equal(rig.cycle[rig.cycles - 1].status, PSD1_CY_READ | PSD1_CY_CLIP);
    rig.volts[1] = 10.4;
    rig_run(&rig, 10000000);
    assert_int_equal(rig.cycle[rig.cycles - 1].word[1], 0xFFFF);
    assert_int_equal(rig.cycle[rig.cycles - 1].status, PSD1_CY_READ | PSD1_CY_CLIP);
}

/* In every phase: a reset, or the supply for a while. What was under way ends, then the board comes up again. */
static void resets_and_power_cuts_in_every_phase(void **state)
{
    (void)state;
    for (unsigned phase = PSD1_IN_RESET; phase < PSD1_PHASES; phase++) {
        for (unsigned cut = 0; cut < 2; cut++) {
            struct psd1_profile p = rig_exact();
            rig_init(&rig, &p, 0.0);
            rig_watch(&rig, TRACE_FIRST(PSD1_LINES));
            psd1_power_up(&rig.b, 0);
            rig_await(&rig, (enum psd1_phase)phase);
            if (rig.b.frame.active) rig_until(&rig, rig.b.frame.t_ns + 4900); /* SCLK high, SDAT in a word of ones */
            const bool cycle = phase >= PSD1_RF_FALL && phase <= PSD1_CLEAR;
            if (cut) psd1_power_down(&rig.b, rig.s.now_ns);
            else psd1_reset(&rig.b, rig.s.now_ns);
            assert_int_equal(rig.b.counters.cut, cycle);
            assert_int_equal(rig.b.counters.resets, !cut);
            trace_advance(&rig.b.base.trace, rig.s.now_ns);
            const uint64_t steady = ~TRACE_BIT(PSD1_LINE_CLK) & ~TRACE_BIT(PSD1_LINE_DR);
            uint64_t rest = 0;
            for (unsigned i = 0; i < PSD1_LINES && !cut; i++) rest |= (uint64_t)psd1_lines[i].level << i;
            assert_true((rig.b.base.trace.level & steady) == (rest & steady));
            rig.cycles = 0;
            rig_run(&rig, 5000000);
            if (cut) assert_int_equal(rig.cycles, 0);
            if (cut) psd1_power_up(&rig.b, rig.s.now_ns);
            rig_run(&rig, 20000000);
            assert_true(rig.cycles > 4);
            assert_int_equal(rig.cycle[0].seq, 0);
            assert_int_equal(rig.cycle[rig.cycles - 1].word[1], 9830);
            assert_int_equal(rig.b.base.trace.late + rig.b.base.trace.dropped, 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(set_up_calibrates_and_cycles_follow),
        cmocka_unit_test(calibration_takes_out_the_converters_errors),
        cmocka_unit_test(reference_error_scales_the_words),
        cmocka_unit_test(a_cycle_begins_at_the_rise_after_dr),
        cmocka_unit_test(each_condition_alone_holds_the_cycle_back),
        cmocka_unit_test(a_change_at_the_instant_of_the_rise_is_late),
        cmocka_unit_test(flags_do_not_stop_a_cycle_that_runs),
        cmocka_unit_test(dr_of_three),
        cmocka_unit_test(a0_may_fall_where_rfz_rises),
        cmocka_unit_test(dr_that_never_comes_is_told),
        cmocka_unit_test(frozen_words_repeat),
        cmocka_unit_test(limits_are_marked),
        cmocka_unit_test(resets_and_power_cuts_in_every_phase),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
