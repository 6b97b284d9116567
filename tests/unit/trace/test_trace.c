#include "rig.h"

#include "base/rng.h"
#include "trace/group.h"
#include "trace/line_fault.h"
#include "trace/trace.h"

#include <string.h>

#define HEARD_MAX 4096

struct heard {
    unsigned sig;
    bool level;
    int64_t t_ns;
};

struct ear { /* a sink that writes down what it hears */
    struct trace_sink sink;
    struct heard heard[HEARD_MAX];
    int count;
    int64_t advanced_ns;
};

static struct trace trace;
static struct ear ear, other;

static void hear(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct ear *e = ctx;
    assert_true(e->count < HEARD_MAX);
    e->heard[e->count++] = (struct heard){sig, level, t_ns};
}

static void hear_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, ((struct ear *)ctx)->sink.mask, hear, ctx);
}

static void hear_advance(void *ctx, int64_t t_ns)
{
    ((struct ear *)ctx)->advanced_ns = t_ns;
}

static void listen(struct ear *e, uint64_t mask)
{
    *e = (struct ear){.sink = {.mask = mask, .steps = hear_steps, .advance = hear_advance, .ctx = e}};
    trace_attach(&trace, &e->sink);
}

static int fresh(void **state)
{
    (void)state;
    memset(&trace, 0, sizeof trace);
    trace_add(&trace, "Int", true);
    trace_add(&trace, "Data", false);
    trace_add(&trace, "CLK", false);
    return 0;
}

static void assert_heard(const struct ear *e, const struct heard *want, int count)
{
    assert_int_equal(e->count, count);
    for (int i = 0; i < count; i++) {
        assert_int_equal(e->heard[i].t_ns, want[i].t_ns);
        assert_int_equal(e->heard[i].sig, want[i].sig);
        assert_int_equal(e->heard[i].level, want[i].level);
    }
}

static void signals_are_found_by_name(void **state)
{
    (void)state;
    assert_int_equal(trace_find(&trace, "CLK"), 2);
    assert_int_equal(trace_find(&trace, "Int"), 0);
    assert_int_equal(trace_find(&trace, "clk"), -1);
}

static void edges_come_in_order_of_time_then_of_report(void **state)
{
    (void)state;
    listen(&ear, 7);
    ear.count = 0;
    trace_set(&trace, 2, true, 300);
    trace_set(&trace, 1, true, 100);
    trace_set(&trace, 0, false, 300); /* reported after CLK at the same instant */
    trace_set(&trace, 2, false, 200); /* low already then: no change */
    trace_advance(&trace, 99);
    assert_int_equal(ear.count, 0);
    trace_advance(&trace, 300);
    const struct heard want[] = {{1, true, 100}, {2, true, 300}, {0, false, 300}};
    assert_heard(&ear, want, COUNT(want));
    assert_int_equal(ear.advanced_ns, 300);
    assert_int_equal(trace.late, 0);
}

static void only_real_changes_are_told(void **state)
{
    (void)state;
    listen(&ear, 7);
    ear.count = 0;
    for (int i = 0; i < 10; i++) trace_set(&trace, 1, i >= 5, 10 * i);
    trace_advance(&trace, 1000);
    const struct heard want[] = {{1, true, 50}};
    assert_heard(&ear, want, COUNT(want));
}

static void a_sink_first_hears_the_levels_and_only_its_own_signals(void **state)
{
    (void)state;
    trace_set(&trace, 1, true, 40); /* no observer: kept as the level, nothing pending */
    assert_int_equal(trace.pending_count, 0);
    trace_advance(&trace, 500);
    listen(&ear, 3);
    const struct heard want[] = {{0, true, 500}, {1, true, 500}};
    assert_heard(&ear, want, COUNT(want));
    trace_set(&trace, 2, true, 600);
    trace_advance(&trace, 700);
    assert_int_equal(ear.count, 2);
    listen(&other, 4);
    const struct heard late[] = {{2, true, 700}};
    assert_heard(&other, late, COUNT(late));
}

static void nobody_listening_costs_no_work_and_detaching_keeps_the_levels(void **state)
{
    (void)state;
    assert_false(trace_watched(&trace, UINT64_MAX));
    listen(&ear, 1);
    listen(&other, 6);
    assert_true(trace_watched(&trace, 4));
    trace_set(&trace, 2, true, 800);
    trace_detach(&trace, &other.sink);
    trace_detach(&trace, &other.sink); /* twice is harmless */
    assert_false(trace_watched(&trace, 6));
    trace_set(&trace, 2, false, 850); /* no one's, but an edge of the same line is still on its way */
    trace_set(&trace, 0, false, 900);
    trace_detach(&trace, &ear.sink);
    assert_int_equal(trace.pending_count, 0);
    assert_int_equal(trace.level, 0); /* Int and CLK fell, though no one heard it */
    assert_int_equal(ear.count, 1);
}

static void an_edge_behind_the_window_is_counted_and_told_now(void **state)
{
    (void)state;
    listen(&ear, 7);
    trace_advance(&trace, 1000);
    ear.count = 0;
    trace_set(&trace, 1, true, 999);
    trace_advance(&trace, 1100);
    const struct heard want[] = {{1, true, 1000}};
    assert_heard(&ear, want, COUNT(want));
    assert_int_equal(trace.late, 1);
}

static void a_full_window_drops_and_counts(void **state)
{
    (void)state;
    listen(&ear, 7);
    for (unsigned i = 0; i < TRACE_PENDING_MAX + 3; i++) trace_set(&trace, 1, true, 10);
    assert_int_equal(trace.dropped, 3);
    assert_null(trace_room(&trace, 2));
    assert_int_equal(trace.dropped, 5);
    trace_advance(&trace, 10);
    assert_int_equal(trace.pending_count, 0);
}

/* A batch is what its edges one by one are: at one instant in order of the signals' numbers, none that changes nothing. */
static void steps_of_several_signals(void **state)
{
    (void)state;
    listen(&ear, 7);
    ear.count = 0;
    trace_set(&trace, 1, true, 150); /* falls between the steps */
    const struct trace_step steps[] = {{100, 6, 4}, {200, 7, 3}, {200, 4, 4}, {300, 6, 6}};
    trace_steps(&trace, steps, COUNT(steps));
    trace_steps(&trace, steps, 0);
    trace_advance(&trace, 250);
    const struct heard want[] = {{2, true, 100}, {1, true, 150}, {2, false, 200}, {2, true, 200}};
    assert_heard(&ear, want, COUNT(want));
    assert_int_equal(trace.pending_count, 1);
    trace_advance(&trace, 300);
    assert_int_equal(ear.count, 4);
}

static void late_steps_are_told_now(void **state)
{
    (void)state;
    listen(&ear, 7);
    trace_advance(&trace, 1000);
    ear.count = 0;
    trace_steps(&trace, (struct trace_step[]){{999, 4, 4}, {1001, 4, 0}}, 2);
    trace_advance(&trace, 1100);
    const struct heard want[] = {{2, true, 1000}, {2, false, 1001}};
    assert_heard(&ear, want, COUNT(want));
    assert_int_equal(trace.late, 1);
}

/* More reports than fit, never all pending at once: what waits moves to the front of its array. */
static void a_long_run_fits(void **state)
{
    (void)state;
    listen(&ear, 7);
    int64_t t_ns = 0;
    for (unsigned i = 0; i < 3 * TRACE_PENDING_MAX / 8; i++, t_ns += 8) {
        struct trace_step steps[8];
        for (int k = 0; k < 8; k++) steps[k] = (struct trace_step){t_ns + k, 2, k % 2 ? 2 : 0};
        trace_steps(&trace, steps, 8);
        ear.count = 0;
        trace_advance(&trace, t_ns - 4); /* some always wait */
        for (int k = 1; k < ear.count; k++) assert_int_equal(ear.heard[k].t_ns, ear.heard[k - 1].t_ns + 1);
    }
    trace_advance(&trace, t_ns);
    assert_int_equal(trace.dropped, 0);
    assert_int_equal(trace.late, 0);
    assert_int_equal(trace.pending_count, 0);
}

/* Random reports within a window against the definition: stable sort by time, then filter. */
static void random_reports_come_out_sorted(void **state)
{
    (void)state;

    struct rng rng = rng_stream(rig_seed(11), 1, "test");
    static struct heard in[2000];
    bool level[3] = {true, false, false};
    listen(&ear, 7);
    ear.count = 0;
    for (int i = 0; i < 2000; i++) {
        const int64_t base_ns = 20 * i;
        in[i] =
            (struct heard){(unsigned)(rng_u64(&rng) % 3), rng_u64(&rng) & 1, base_ns + (int64_t)(rng_u64(&rng) % 500)};
        trace_set(&trace, in[i].sig, in[i].level, in[i].t_ns);
        trace_advance(&trace, base_ns);
    }
    trace_advance(&trace, INT64_C(1000000));
    for (int i = 1; i < 2000; i++) { /* insertion sort is stable */
        const struct heard e = in[i];
        int j = i;
        for (; j > 0 && in[j - 1].t_ns > e.t_ns; j--) in[j] = in[j - 1];
        in[j] = e;
    }
    int n = 0;
    for (int i = 0; i < 2000; i++) {
        if (level[in[i].sig] == in[i].level) continue;
        level[in[i].sig] = in[i].level;
        assert_true(n < ear.count);
        assert_heard(&(struct ear){.heard = {ear.heard[n]}, .count = 1}, &in[i], 1);
        n++;
    }
    assert_int_equal(n, ear.count);
    assert_int_equal(trace.late, 0);
}

/* n pulses on line 2, line 1 up meanwhile: a run if both were low. */
static void report_pulses(struct trace *t, bool as_run, int64_t t_ns, unsigned n)
{
    struct trace_step *const s = trace_room(t, 2 * n + 2);
    for (unsigned i = 0; i < 2 * n; i++) s[i + 1] = (struct trace_step){t_ns + 5 * i, 4, i % 2 ? 0 : 4};
    s[0] = (struct trace_step){t_ns, 2, 2};
    s[2 * n + 1] = (struct trace_step){t_ns + 10 * n, 2, 0};
    if (as_run) trace_commit_run(t, 2 * n + 2, 6);
    else trace_commit(t, 2 * n + 2);
}

static void runs_are_what_their_steps_are(void **state)
{
    (void)state;
    static struct trace two[2];
    static struct ear heard[2];
    struct rng g = rng_stream(rig_seed(3), 0, "runs");
    uint64_t whole = 0;
    for (int i = 0; i < 2; i++) {
        memset(&two[i], 0, sizeof two[i]);
        for (int k = 0; k < 3; k++) trace_add(&two[i], "line", false);
        heard[i] = (struct ear){.sink = {.mask = 7, .steps = hear_steps, .ctx = &heard[i]}};
        trace_attach(&two[i], &heard[i].sink);
    }
    for (int n = 0; n < 20000; n++) {
        const uint64_t u = rng_u64(&g);
        const int64_t now_ns = 100 * n;
        heard[0].count = heard[1].count = 0;
        for (int i = 0; i < 2; i++) {
            if (u % 3) report_pulses(&two[i], i, now_ns - (int64_t)(u >> 8) % 3 * 60, 1 + (unsigned)(u >> 16) % 12);
            if (u % 5 == 0)
                trace_set(&two[i], u >> 24 & 3 ? 0 : (unsigned)(u >> 26) % 3, u >> 30 & 1,
                          now_ns + (int64_t)(u >> 32) % 90);
            if (u % 7 < 3) trace_advance(&two[i], now_ns - 150 + (int64_t)(u >> 40) % 200);
        }
        whole += two[1].runs;
        for (unsigned k = 0; k < two[1].runs; k++) assert_true(two[1].run[k].at >= two[1].gone);
        assert_heard(&heard[1], heard[0].heard, heard[0].count);
        assert_int_equal(two[0].level, two[1].level);
    }
    assert_int_equal(two[0].runs, 0);
    assert_true(whole > 1000);
}

/* The highest signals are as good as the lowest. */
static void all_signals_are_delivered(void **state)
{
    (void)state;
    static const unsigned look[] = {31, 32, 33, 62, 63};
    memset(&trace, 0, sizeof trace);
    for (unsigned i = 0; i < TRACE_SIGNALS_MAX; i++) assert_int_equal(trace_add(&trace, "line", i == 40), i);
    listen(&ear, TRACE_FIRST(64));
    assert_int_equal(ear.count, 64); /* the levels */
    for (unsigned i = 0; i < 64; i++) assert_int_equal(ear.heard[i].level, i == 40);
    ear.count = 0;
    for (unsigned i = 0; i < COUNT(look); i++) trace_set(&trace, look[i], true, 10 * i);
    trace_set(&trace, 40, false, 100);
    trace_advance(&trace, 100);
    assert_int_equal(ear.count, COUNT(look) + 1);
    for (unsigned i = 0; i < COUNT(look); i++) assert_int_equal(ear.heard[i].sig, look[i]);
    assert_int_equal(ear.heard[COUNT(look)].sig, 40);
    assert_true(trace.level == (TRACE_BIT(31) | TRACE_BIT(32) | TRACE_BIT(33) | TRACE_BIT(62) | TRACE_BIT(63)));
    assert_true(trace_watched(&trace, TRACE_BIT(63)));
    assert_true(TRACE_FIRST(34) == UINT64_C(0x3FFFFFFFF) && TRACE_FIRST(1) == 1);
}

/* ---- many traces */

static struct trace_group group;

static int fresh_group(void **state)
{
    fresh(state);
    group = (struct trace_group){0};
    trace.group = &group;
    return 0;
}

static void a_trace_without_sinks_sleeps_and_catches_up(void **state)
{
    (void)state;
    trace_advance_group(&group, 5000);
    trace_set(&trace, 1, true, 4000);
    assert_int_equal(trace.done_ns, 0); /* not visited */
    listen(&ear, 7);
    assert_int_equal(trace.done_ns, 5000);
    assert_heard(&ear, (const struct heard[]){{0, true, 5000}, {1, true, 5000}, {2, false, 5000}}, 3);
    assert_int_equal(group.changes, 1);
    trace_set(&trace, 2, true, 6000);
    trace_advance_group(&group, 7000);
    assert_int_equal(ear.count, 4);
    assert_int_equal(ear.advanced_ns, 7000);
    trace_detach(&trace, &ear.sink);
    assert_int_equal(group.changes, 2);
    trace_advance_group(&group, 8000);
    trace_advance_group(&group, 9000);
    assert_int_equal(trace.done_ns, 8000); /* asleep again */
    assert_null(group.awake);
    trace_wake(&trace);
    assert_int_equal(trace.done_ns, 9000);
}

static void pending_steps_and_filters_keep_a_trace_awake(void **state)
{
    (void)state;
    static struct line_faults faults;
    trace_advance_group(&group, 1000);
    trace_steps(&trace, &(struct trace_step){3000, 1, 0}, 1); /* without a sink */
    assert_int_equal(trace.late, 0);
    trace_advance_group(&group, 2000);
    assert_int_equal(trace.level & 1, 1);
    trace_advance_group(&group, 3000);
    assert_int_equal(trace.level & 1, 0);
    assert_null(group.awake);
    trace_advance_group(&group, 4000);
    line_faults_init(&faults, &trace);
    const struct line_fault f = {.kind = LINE_STUCK_LOW, .line = 0, .from_ns = 4000, .until_ns = 6000};
    assert_int_not_equal(line_fault_add(&faults, &f), 0);
    assert_int_equal(faults.done_ns, 4000);
    for (int64_t t_ns = 5000; t_ns <= 8000; t_ns += 1000) trace_advance_group(&group, t_ns);
    assert_null(trace.filter); /* it has come to its end by itself */
    assert_null(group.awake);
}

static int64_t report_nothing(void *ctx, int64_t t_ns)
{
    (void)ctx;
    return t_ns;
}

static void a_source_that_reports_stays_awake_once_it_was(void **state)
{
    (void)state;
    trace.source = (struct trace_source){.report = report_nothing};
    trace_advance_group(&group, 1000);
    assert_int_equal(trace.done_ns, 0);
    listen(&ear, 1);
    trace_detach(&trace, &ear.sink);
    trace_advance_group(&group, 2000);
    trace_advance_group(&group, 3000);
    assert_int_equal(trace.done_ns, 3000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(signals_are_found_by_name, fresh),
        cmocka_unit_test_setup(edges_come_in_order_of_time_then_of_report, fresh),
        cmocka_unit_test_setup(only_real_changes_are_told, fresh),
        cmocka_unit_test_setup(a_sink_first_hears_the_levels_and_only_its_own_signals, fresh),
        cmocka_unit_test_setup(nobody_listening_costs_no_work_and_detaching_keeps_the_levels, fresh),
        cmocka_unit_test_setup(an_edge_behind_the_window_is_counted_and_told_now, fresh),
        cmocka_unit_test_setup(a_full_window_drops_and_counts, fresh),
        cmocka_unit_test_setup(steps_of_several_signals, fresh),
        cmocka_unit_test_setup(late_steps_are_told_now, fresh),
        cmocka_unit_test_setup(a_long_run_fits, fresh),
        cmocka_unit_test_setup(random_reports_come_out_sorted, fresh),
        cmocka_unit_test_setup(a_trace_without_sinks_sleeps_and_catches_up, fresh_group),
        cmocka_unit_test_setup(pending_steps_and_filters_keep_a_trace_awake, fresh_group),
        cmocka_unit_test_setup(a_source_that_reports_stays_awake_once_it_was, fresh_group),
        cmocka_unit_test(runs_are_what_their_steps_are),
        cmocka_unit_test(all_signals_are_delivered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
