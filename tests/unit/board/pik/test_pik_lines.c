/* What PIK's lines show, and what its bus answers. */
#include "pik_rig.h"

#include "board/pik/internal.h"

static struct rig r;

/* First edge of a line from an index on. */
static unsigned edge_of(unsigned from, unsigned sig, bool level)
{
    while (from < r.edges && !(r.edge[from].sig == sig && r.edge[from].level == level)) from++;
    return from;
}

static unsigned rises_of(unsigned sig, int64_t from_ns, int64_t to_ns)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r.edges; i++)
        n += r.edge[i].sig == sig && r.edge[i].level && r.edge[i].t_ns > from_ns && r.edge[i].t_ns <= to_ns;
    return n;
}

/* A pulse is TCLK long, begins where TCLK / 16 does, comes on the line of its sign, and the counter counts it. */
static void pulses_are_what_the_counters_count(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_init(&r, &p, 1);
    trace_attach(&r.b.base.trace, &r.sink);
    pik_power_up(&r.b, 0);
    r.input[0].v = 3.0;
    r.input[1] = (struct rig_input){.sines = 1, .sine = {{.v = 9.0, .hz = 40.0}}};
    r.input[2].v = -10.0;
    rig_run_until(&r, 101 * INT64_C(1000000));
    const struct pik_reading *last = &r.reading[r.readings - 1];
    for (unsigned i = 0; i < PIK_AXES; i++) {
        assert_int_equal(rises_of(PIK_LINE_FXP + 2 * i, 0, last->t_ns), last->plus[i]);
        assert_int_equal(rises_of(PIK_LINE_FXN + 2 * i, 0, last->t_ns), last->minus[i]);
    }
    assert_true(last->plus[0] > 590 && last->minus[0] == 0 && last->plus[1] > 300 && last->minus[1] > 300);
    for (unsigned sig = PIK_LINE_FXP; sig <= PIK_LINE_FZN; sig++) {
        for (unsigned at = edge_of(0, sig, true); at < r.edges; at = edge_of(at + 1, sig, true)) {
            const unsigned end = edge_of(at, sig, false);
            if (end == r.edges) break;
            assert_in_range(r.edge[end].t_ns - r.edge[at].t_ns, 24999, 25001);
            assert_true(r.edge[at].t_ns % 1562 <= 1 + r.edge[at].t_ns * 2 / 6250); /* 1562.5 ns, rounded down */
        }
    }
}

/* Where a pulse rises the charge has just reached Uc, also between two looks, and at the edge of the band. */
static void a_pulse_rises_where_the_integral_is_at_uc(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    const double uc = p.uc_v / pik_profile_step_v(&p);
    rig_init(&r, &p, 1);
    trace_attach(&r.b.base.trace, &r.sink);
    pik_power_up(&r.b, 0);
    r.input[0] = (struct rig_input){.sines = 1, .sine = {{.v = 10.0, .hz = 397.0}}};
    rig_run_until(&r, NS_PER_S);
    int count = 0, seen = 0;
    for (unsigned i = 0; i < r.edges; i++) {
        const struct rig_edge *e = &r.edge[i];
        if (!e->level || (e->sig != PIK_LINE_FXP && e->sig != PIK_LINE_FXN)) continue;
        const int sign = e->sig == PIK_LINE_FXP ? 1 : -1;
        const double charge = sign * (2000.0 * rig_integral_vs(&r.input[0], e->t_ns) - count);
        if (charge < uc - 0.025 || charge > uc + 1.0 / 32.0 + 0.025)
            fail_msg("pulse %d at %lld ns: %.3f pulses on the capacitor", seen, (long long)e->t_ns, charge);
        count += sign;
        seen++;
    }
    assert_true(seen > 10000);
}

static void clk_and_latch(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_init(&r, &p, 1);
    trace_attach(&r.b.base.trace, &r.sink);
    pik_power_up(&r.b, 0);
    rig_run_until(&r, 51 * INT64_C(1000000));
    assert_in_range(rises_of(PIK_LINE_CLK, 0, 50000000), 173, 174);
    unsigned at = edge_of(0, PIK_LINE_CLK, true);
    for (unsigned k = 0; k < 100; k++) {
        assert_in_range(r.edge[at].t_ns, k * INT64_C(1000000000) / 3480, k * INT64_C(1000000000) / 3480 + 1);
        const unsigned fall = edge_of(at, PIK_LINE_CLK, false);
        assert_in_range(r.edge[fall].t_ns - r.edge[at].t_ns, 143677, 143679);
        at = edge_of(fall, PIK_LINE_CLK, true);
    }
    at = 0;
    for (unsigned k = 1; k <= 4; k++) {
        at = edge_of(at, PIK_LINE_LATCH, false);
        assert_int_equal(r.edge[at].t_ns, k * INT64_C(10000000));
        at = edge_of(at, PIK_LINE_LATCH, true);
        assert_int_equal(r.edge[at].t_ns, k * INT64_C(10000000) + 10000);
    }
    pik_clock(&r.b, 1000, r.s.now_ns); /* CLK goes on, faster */
    const int64_t from_ns = r.s.now_ns;
    rig_run_until(&r, from_ns + 500 * INT64_C(1000000));
    assert_in_range(rises_of(PIK_LINE_CLK, from_ns, from_ns + 499000000), 1737, 1739);
    pik_power_down(&r.b, r.s.now_ns);
    rig_run_until(&r, r.s.now_ns + 1000000);
    assert_int_equal(r.b.base.trace.level, 0);
}

/* Whoever comes in the middle of a pulse hears that it is under way, and when it ends. */
static void late_listeners_hear_true_levels(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    unsigned within = 0;
    for (unsigned n = 0; n < 60; n++) {
        rig_up(&r, &p, 1);
        r.input[0].v = 7.0;
        r.input[1].v = -5.0;
        rig_run_until(&r, 20000000 + n * 37000);
        trace_attach(&r.b.base.trace, &r.sink);
        rig_run_until(&r, r.s.now_ns + 5000000);
        uint64_t level = 0;
        int64_t rose_ns[2] = {-1, -1};
        for (unsigned i = 0; i < r.edges; i++) {
            const struct rig_edge *e = &r.edge[i];
            if (e->sig != PIK_LINE_FXP && e->sig != PIK_LINE_FYN) continue;
            const unsigned k = e->sig == PIK_LINE_FYN;
            const uint64_t bit = UINT64_C(1) << e->sig;
            if (e->level) rose_ns[k] = e->t_ns;
            else if (level & bit) {
                const int64_t high_ns = e->t_ns - rose_ns[k];
                assert_true(high_ns <= 287357); /* the first may be seen shortened by what was before */
                within += high_ns < 287355;
            }
            level = e->level ? level | bit : level & ~bit;
        }
        assert_true(rose_ns[0] > 20000000 && rose_ns[1] > 20000000);
    }
    assert_true(within > 10);
}

static void a_listener_of_some_lines_and_one_of_others(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    struct trace_sink clk = {.mask = 1u << PIK_LINE_CLK, .steps = rig_steps, .ctx = &r};
    rig_up(&r, &p, 1);
    r.input[0].v = 1.0;
    trace_attach(&r.b.base.trace, &clk);
    rig_run_until(&r, 10000000);
    assert_int_equal(rises_of(PIK_LINE_FXP, 0, 10000000), 0); /* not even known */
    trace_detach(&r.b.base.trace, &clk);
    rig_run_until(&r, 20000000);
    r.edges = 0;
    trace_attach(&r.b.base.trace, &clk);
    rig_run_until(&r, 30000000);
    assert_int_equal(rises_of(PIK_LINE_CLK, 20000000 - TRACE_LAG_NS, 29000000), 368); /* all that the trace can take */
    r.sink.mask = PIK_PULSE_LINES;
    trace_attach(&r.b.base.trace, &r.sink);
    rig_run_until(&r, 40000000);
    trace_detach(&r.b.base.trace, &r.sink);
    rig_run_until(&r, 50000000);
    assert_in_range(rises_of(PIK_LINE_FXP, 30000000, 39700000), 38, 40); /* for each of the two listeners */
}

static void a_stuck_output_shows_on_its_lines(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_init(&r, &p, 1);
    trace_attach(&r.b.base.trace, &r.sink);
    pik_power_up(&r.b, 0);
    r.input[0].v = r.input[1].v = 5.0;
    rig_run_until(&r, 10000000);
    pik_stick(&r.b, 1, &(struct chip_fault){.dout = CHIP_STUCK_HIGH}, r.s.now_ns);
    rig_run_until(&r, 11000000);
    r.edges = 0;
    rig_run_until(&r, 20000000);
    assert_int_equal(edge_of(0, PIK_LINE_FYP, true), r.edges);
    assert_int_equal(edge_of(0, PIK_LINE_FYN, false), r.edges);
    assert_true(r.b.base.trace.level >> PIK_LINE_FYP & 1);
    assert_true(edge_of(0, PIK_LINE_FXP, true) < r.edges);
    pik_stick(&r.b, 1, &(struct chip_fault){.dout = CHIP_FREE}, r.s.now_ns);
    rig_run_until(&r, 30000000);
    assert_true(edge_of(0, PIK_LINE_FYN, false) < r.edges);
    assert_true(rises_of(PIK_LINE_FYP, 20000000, 29000000) > 80);
}

/* ---- bus ---- */

static void registers_hold_what_was_latched(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_up(&r, &p, 1);
    r.input[0].v = 10.0;
    r.input[1].v = -1.0;
    r.input[2].v = 0.5;
    rig_run_until(&r, 4 * NS_PER_S + 5000000); /* X is at 80000: beyond 16 bits */
    const struct pik_reading last = r.reading[r.readings - 1];
    assert_true(last.total[0] > 79000);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        assert_int_equal(rig_bus(&r, false, (uint8_t)(PIK_REG_X + i), 0), (uint16_t)last.total[i]);
        assert_int_equal(rig_bus(&r, false, (uint8_t)(PIK_REG_XP + 2 * i), 0), (uint16_t)last.plus[i]);
        assert_int_equal(rig_bus(&r, false, (uint8_t)(PIK_REG_XN + 2 * i), 0), (uint16_t)last.minus[i]);
    }
    assert_int_equal(rig_bus(&r, false, PIK_REG_SEQ, 0), 400);
    assert_int_equal(rig_bus(&r, false, PIK_REG_STATUS, 0), PIK_ST_NEW);
    assert_int_equal(rig_bus(&r, false, PIK_REG_STATUS, 0), 0);
    assert_int_equal(rig_bus(&r, false, PIK_REG_PERIOD, 0), 100);
    assert_int_equal(r.b.counters.cycles, 13);
    assert_int_equal(r.b.counters.cycles_refused, 0);
}

static void strobe_period_and_clear(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_up(&r, &p, 1);
    r.input[0].v = r.input[1].v = 5.0;
    (void)rig_bus(&r, true, PIK_REG_PERIOD, 0);
    rig_run_until(&r, 100 * INT64_C(1000000));
    assert_int_equal(r.readings, 0);
    (void)rig_bus(&r, true, PIK_REG_LATCH, 0);
    assert_int_equal(r.readings, 1);
    assert_int_equal(r.reading[0].t_ns, 100001000); /* at the end of the strobe */
    assert_in_range(r.reading[0].total[0], 999, 1000);
    assert_int_equal(r.b.counters.strobes, 1);
    assert_in_range(rig_bus(&r, false, PIK_REG_XP + 2, 0), 999, 1000);
    (void)rig_bus(&r, true, PIK_REG_CLEAR, 2);
    for (uint8_t axis = 0; axis < 2; axis++) { /* what was latched of the cleared channel reads 0, too */
        const uint8_t latched[] = {PIK_REG_X + axis, (uint8_t)(PIK_REG_XP + 2 * axis)};
        for (unsigned i = 0; i < COUNT(latched); i++)
            assert_in_range(rig_bus(&r, false, latched[i], 0), axis ? 0 : 999, axis ? 0 : 1000);
    }
    rig_run_until(&r, 150 * INT64_C(1000000));
    (void)rig_bus(&r, true, PIK_REG_LATCH, 0xFFFF);
    assert_in_range(r.reading[1].total[0], 1499, 1501);
    assert_in_range(r.reading[1].increment[0], 499, 501);
    assert_in_range(r.reading[1].total[1], 499, 501);
    assert_in_range(r.reading[1].increment[1], 499, 501);
    assert_int_equal(r.reading[1].plus[1], r.reading[1].total[1]);
    (void)rig_bus(&r, true, PIK_REG_PERIOD, 20);
    rig_run_until(&r, r.s.now_ns + 10 * INT64_C(1000000));
    assert_int_equal(r.readings, 7);
    pik_reset(&r.b, r.s.now_ns);
    assert_int_equal(rig_bus(&r, false, PIK_REG_PERIOD, 0), 100);
    assert_int_equal(rig_submit(&r, false, PIK_REG_X, 0, 0), BOARD_CYCLE_NOT_READY);
}

static void refusals(void **state)
{
    (void)state;
    static const struct {
        bool write;
        uint8_t address;
        uint16_t data;
        int64_t strobe_ns;
        enum board_cycle_result result;
    } rows[] = {
        {false, PIK_REG_X, 0, 0, BOARD_CYCLE_NOT_READY},
        {false, PIK_REG_SEQ, 0, 0, BOARD_CYCLE_NOT_READY},
        {false, PIK_REG_STATUS, 0, 0, BOARD_CYCLE_OK},
        {false, PIK_REG_PERIOD, 0, 0, BOARD_CYCLE_OK},
        {false, 14, 0, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, 15, 0, 0, BOARD_CYCLE_NO_ADDRESS},
        {true, PIK_REG_X, 0, 0, BOARD_CYCLE_READ_ONLY},
        {true, PIK_REG_STATUS, 0, 0, BOARD_CYCLE_READ_ONLY},
        {false, PIK_REG_LATCH, 0, 0, BOARD_CYCLE_WRITE_ONLY},
        {false, PIK_REG_CLEAR, 0, 0, BOARD_CYCLE_WRITE_ONLY},
        {false, PIK_REG_STATUS, 0, 199, BOARD_CYCLE_TOO_SHORT},
        {false, PIK_REG_STATUS, 0, 200, BOARD_CYCLE_OK},
        {true, PIK_REG_CLEAR, 8, 0, BOARD_CYCLE_BAD_VALUE},
        {true, PIK_REG_CLEAR, 7, 0, BOARD_CYCLE_OK},
        {true, PIK_REG_PERIOD, 1, 0, BOARD_CYCLE_BAD_VALUE},
        {true, PIK_REG_PERIOD, 2, 0, BOARD_CYCLE_OK},
        {true, PIK_REG_PERIOD, 15872, 0, BOARD_CYCLE_BAD_VALUE}, /* 32768 pulses would wrap */
        {true, PIK_REG_PERIOD, 15871, 0, BOARD_CYCLE_OK},
    };
    const struct pik_profile p = rig_pik6();
    rig_init(&r, &p, 1);
    assert_int_equal(rig_submit(&r, false, PIK_REG_STATUS, 0, 0), BOARD_CYCLE_OFF);
    pik_power_up(&r.b, 0);
    unsigned ok = 0;
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const enum board_cycle_result result =
            rig_submit(&r, rows[i].write, rows[i].address, rows[i].data, rows[i].strobe_ns);
        if (result != rows[i].result) fail_msg("row %u: %d", i, result);
        rig_run_until(&r, r.s.now_ns + 2000);
        assert_int_equal(r.answered, result == BOARD_CYCLE_OK);
        ok += r.answered;
    }
    assert_int_equal(r.b.counters.cycles, ok);
    assert_int_equal(r.b.counters.cycles_refused, COUNT(rows) - ok + 1);
}

static void a_cycle_takes_its_strobe_and_ends_with_the_power(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_init(&r, &p, 1);
    trace_attach(&r.b.base.trace, &r.sink);
    pik_power_up(&r.b, 0);
    rig_run_until(&r, 1000000);
    assert_int_equal(rig_submit(&r, true, PIK_REG_CLEAR, 0, 5000), BOARD_CYCLE_OK);
    struct board_cycle second = r.cycle;
    assert_int_equal(pik_bus.submit(&r.b.base, &second, r.s.now_ns), BOARD_CYCLE_BUSY);
    rig_run_until(&r, 1004999);
    assert_false(r.answered);
    rig_run_until(&r, 1005000);
    assert_true(r.answered);
    assert_int_equal(r.answered_ns, 1005000);
    rig_run_until(&r, 2000000);
    assert_int_equal(r.edge[edge_of(0, PIK_LINE_CS, false)].t_ns, 1000000);
    assert_int_equal(r.edge[edge_of(0, PIK_LINE_RW, false)].t_ns, 1000000);
    const unsigned fell = edge_of(0, PIK_LINE_CS, false);
    assert_int_equal(r.edge[edge_of(fell, PIK_LINE_CS, true)].t_ns, 1005000);
    assert_int_equal(rig_submit(&r, false, PIK_REG_STATUS, 0, 5000), BOARD_CYCLE_OK);
    pik_reset(&r.b, r.s.now_ns);
    assert_true(r.answered && r.result == BOARD_CYCLE_OFF);
    assert_int_equal(rig_submit(&r, false, PIK_REG_STATUS, 0, 5000), BOARD_CYCLE_OK);
    rig_run_until(&r, r.s.now_ns + 1000);
    pik_power_down(&r.b, r.s.now_ns);
    assert_true(r.answered && r.result == BOARD_CYCLE_OFF);
    r.answered = false;
    rig_run_until(&r, r.s.now_ns + 100000);
    assert_false(r.answered);
    assert_int_equal(r.b.counters.cycles, 1);
    assert_int_equal(r.b.counters.cycles_refused, 3);
    for (unsigned i = fell + 1; i < r.edges; i++)
        assert_true(r.edge[i].sig != PIK_LINE_RW || r.edge[i].t_ns <= 1005000 || r.edge[i].t_ns > 2000000);
}

static void names_of_registers(void **state)
{
    (void)state;
    assert_string_equal(board_bus_name(&pik_bus, PIK_REG_ZN), "ZN");
    assert_string_equal(board_bus_name(&pik_bus, PIK_REG_CLEAR), "CLEAR");
    assert_null(board_bus_name(&pik_bus, PIK_REGISTERS));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pulses_are_what_the_counters_count),
        cmocka_unit_test(a_pulse_rises_where_the_integral_is_at_uc),
        cmocka_unit_test(clk_and_latch),
        cmocka_unit_test(late_listeners_hear_true_levels),
        cmocka_unit_test(a_listener_of_some_lines_and_one_of_others),
        cmocka_unit_test(a_stuck_output_shows_on_its_lines),
        cmocka_unit_test(registers_hold_what_was_latched),
        cmocka_unit_test(strobe_period_and_clear),
        cmocka_unit_test(refusals),
        cmocka_unit_test(a_cycle_takes_its_strobe_and_ends_with_the_power),
        cmocka_unit_test(names_of_registers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
