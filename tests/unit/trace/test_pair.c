/* Differential pairs: wires at the drivers, receivers' outputs, their delays, open and swapped wires. */
#include "trace/line_fault.h"

#include "rig.h"

#include <string.h>

enum { INT, CLK, INT_A, INT_B, SEEN_MAX = 512 };

struct seen {
    int64_t t_ns;
    uint64_t level;
};

struct bench {
    struct trace t;
    struct line_faults l;
    struct trace_sink sink;
    struct seen seen[SEEN_MAX];
    unsigned n;
};

static struct bench bench;

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct bench *r = ctx;
    for (; n > 0; n--, s++) {
        const uint64_t was = r->n > 0 ? r->seen[r->n - 1].level : 0;
        assert_true(r->n < SEEN_MAX);
        if (r->n > 0) assert_true(s->t_ns >= r->seen[r->n - 1].t_ns);
        r->seen[r->n++] = (struct seen){s->t_ns, trace_after(was, s)};
    }
}

/* Int rests high and leaves by a pair, CLK does not. */
static struct bench *up(int64_t rise_ns, int64_t fall_ns)
{
    struct bench *r = &bench;
    memset(r, 0, sizeof *r);
    (void)trace_add(&r->t, "Int", true);
    (void)trace_add(&r->t, "CLK", false);
    line_faults_init(&r->l, &r->t);
    line_pair_add(&r->l, &(struct pair_cfg){.line = INT, .rise_ns = rise_ns, .fall_ns = fall_ns}, "Int_A", "Int_B");
    return r;
}

static void watch(struct bench *r, uint64_t mask)
{
    r->sink = (struct trace_sink){.mask = mask, .steps = on_steps, .ctx = r};
    trace_attach(&r->t, &r->sink);
}

static bool level_at(const struct bench *r, unsigned sig, int64_t t_ns)
{
    uint64_t level = 0;
    for (unsigned i = 0; i < r->n && r->seen[i].t_ns <= t_ns; i++) level = r->seen[i].level;
    return level >> sig & 1;
}

/* The k-th change of a signal from its first level on. */
static void assert_change(const struct bench *r, unsigned sig, unsigned k, bool level, int64_t t_ns)
{
    for (unsigned i = 1; i < r->n; i++) {
        if (!((r->seen[i].level ^ r->seen[i - 1].level) >> sig & 1) || k-- > 0) continue;
        assert_int_equal(r->seen[i].level >> sig & 1, level);
        assert_int_equal(r->seen[i].t_ns, t_ns);
        return;
    }
    fail_msg("no such change");
}

static unsigned changes(const struct bench *r, unsigned sig)
{
    unsigned n = 0;
    for (unsigned i = 1; i < r->n; i++) n += (unsigned)((r->seen[i].level ^ r->seen[i - 1].level) >> sig & 1);
    return n;
}

static void pulse(struct bench *r, int64_t t_ns, int64_t width_ns)
{
    trace_set(&r->t, INT, false, t_ns);
    trace_set(&r->t, INT, true, t_ns + width_ns);
}

static struct line_fault fault(enum line_fault_kind kind, unsigned line, int64_t from_ns)
{
    return (struct line_fault){
        .kind = kind, .line = line, .from_ns = from_ns, .until_ns = INT64_MAX, .frame_line = INT};
}

static void the_wire_b_is_the_inverse_of_a(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    line_pairs_show(&r->l);
    watch(r, TRACE_FIRST(4));
    pulse(r, 1000, 500);
    trace_set(&r->t, CLK, true, 1200);
    trace_advance(&r->t, 3000);
    assert_int_equal(changes(r, INT_A), 2);
    for (unsigned i = 0; i < r->n; i++) {
        assert_int_equal(r->seen[i].level >> INT_A & 1, r->seen[i].level >> INT & 1);
        assert_int_not_equal(r->seen[i].level >> INT_B & 1, r->seen[i].level >> INT & 1);
    }
    assert_change(r, INT_B, 0, true, 1000);
    assert_change(r, INT_B, 1, false, 1500);
    assert_change(r, CLK, 0, true, 1200);
}

static void without_one_who_looks_at_wires_there_is_no_filter(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    watch(r, TRACE_FIRST(2));
    assert_null(r->t.filter);
    line_pairs_show(&r->l); /* also while somebody watches */
    assert_non_null(r->t.filter);
    trace_advance(&r->t, 100);
    assert_non_null(r->t.filter);
    trace_detach(&r->t, &r->sink);
    assert_null(r->t.filter);
}

static void who_watches_a_wire_has_the_line_computed(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    line_pairs_show(&r->l);
    watch(r, TRACE_BIT(INT_B));
    assert_true(trace_watched(&r->t, TRACE_BIT(INT)));
    assert_false(trace_watched(&r->t, TRACE_BIT(CLK)));
}

static void the_receiver_follows_after_its_delays(void **state)
{
    (void)state;
    struct bench *r = up(20, 35);
    watch(r, TRACE_FIRST(4));
    pulse(r, 1000, 500);
    pulse(r, 2000, 100);
    trace_advance(&r->t, 3000);
    assert_change(r, INT_A, 0, false, 1000);
    assert_change(r, INT, 0, false, 1035);
    assert_change(r, INT_A, 1, true, 1500);
    assert_change(r, INT, 1, true, 1520);
    assert_change(r, INT, 2, false, 2035);
    assert_change(r, INT, 3, true, 2120);
    assert_int_equal(changes(r, INT), 4);
}

/* A fall that takes 15 ns longer than the rise after it eats lows of up to 15 ns. */
static void a_pulse_shorter_than_the_skew_is_lost(void **state)
{
    (void)state;
    struct bench *r = up(20, 35);
    watch(r, TRACE_FIRST(4));
    pulse(r, 1000, 15);
    pulse(r, 2000, 16);
    trace_advance(&r->t, 3000);
    assert_int_equal(changes(r, INT_A), 4);
    assert_int_equal(changes(r, INT), 2);
    assert_change(r, INT, 0, false, 2035);
    assert_change(r, INT, 1, true, 2036);
}

/* Pieces of time end within a delay: nothing is lost or early. */
static void delays_do_not_depend_on_the_pieces_of_time(void **state)
{
    (void)state;
    struct bench *r = up(500, 500);
    watch(r, TRACE_FIRST(4));
    pulse(r, 1000, 100);
    for (int64_t t_ns = 0; t_ns <= 3000; t_ns += 7) trace_advance(&r->t, t_ns);
    assert_int_equal(changes(r, INT), 2);
    assert_change(r, INT, 0, false, 1500);
    assert_change(r, INT, 1, true, 1600);
}

/* Of pulses too fast for a receiver some are lost, never a half. */
static void too_many_edges_lose_whole_pulses(void **state)
{
    (void)state;
    struct bench *r = up(1000, 1000);
    watch(r, TRACE_FIRST(4));
    for (int i = 0; i < 100; i++) pulse(r, 1000 + 8 * i, 4);
    trace_advance(&r->t, 5000);
    assert_int_equal(changes(r, INT_A), 200);
    assert_true(changes(r, INT) < 200 && changes(r, INT) >= PAIR_EDGES && changes(r, INT) % 2 == 0);
    assert_true(level_at(r, INT, 5000));
}

static void an_open_pair_reads_high_and_its_drivers_go_on(void **state)
{
    (void)state;
    struct bench *r = up(20, 20);
    watch(r, TRACE_FIRST(4));
    const struct line_fault f = fault(LINE_OPEN, INT, 1100);
    const uint32_t id = line_fault_add(&r->l, &f);
    pulse(r, 1000, 500); /* cut at 1100 */
    pulse(r, 2000, 500);
    trace_advance(&r->t, 3000);
    assert_change(r, INT, 0, false, 1020);
    assert_change(r, INT, 1, true, 1120);
    assert_int_equal(changes(r, INT), 2);
    assert_int_equal(changes(r, INT_A), 4);
    assert_int_equal(changes(r, INT_B), 4);
    line_fault_end(&r->l, id, 4000);
    pulse(r, 4500, 100);
    trace_advance(&r->t, 6000);
    assert_change(r, INT, 2, false, 4520);
    assert_non_null(r->t.filter); /* the delay stays */
}

static void an_open_pair_wins_over_other_faults(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    const struct line_fault stuck = fault(LINE_STUCK_LOW, INT, 100), open = fault(LINE_OPEN, INT, 200);
    line_pairs_show(&r->l);
    watch(r, TRACE_FIRST(4));
    (void)line_fault_add(&r->l, &stuck);
    (void)line_fault_add(&r->l, &open);
    trace_advance(&r->t, 1000);
    assert_false(level_at(r, INT, 150));
    assert_true(level_at(r, INT, 250));
    assert_false(level_at(r, INT_A, 250)); /* at the driver it is stuck as ever */
    assert_true(level_at(r, INT_B, 250));
}

static void swapped_wires_invert_the_receiver_alone(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    line_pairs_show(&r->l);
    watch(r, TRACE_FIRST(4));
    const struct line_fault f = fault(LINE_INVERTED, INT, 100);
    (void)line_fault_add(&r->l, &f);
    pulse(r, 1000, 500);
    trace_advance(&r->t, 2000);
    assert_change(r, INT, 0, false, 100);
    assert_change(r, INT, 1, true, 1000);
    assert_change(r, INT, 2, false, 1500);
    assert_change(r, INT_A, 0, false, 1000);
    assert_change(r, INT_A, 1, true, 1500);
}

static void pairs_are_known(void **state)
{
    (void)state;
    struct bench *r = up(0, 0);
    assert_true(line_has_pair(&r->l, INT));
    assert_false(line_has_pair(&r->l, CLK));
    assert_int_equal(trace_find(&r->t, "Int_A"), INT_A);
    assert_int_equal(trace_find(&r->t, "Int_B"), INT_B);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_wire_b_is_the_inverse_of_a),
        cmocka_unit_test(without_one_who_looks_at_wires_there_is_no_filter),
        cmocka_unit_test(who_watches_a_wire_has_the_line_computed),
        cmocka_unit_test(the_receiver_follows_after_its_delays),
        cmocka_unit_test(a_pulse_shorter_than_the_skew_is_lost),
        cmocka_unit_test(delays_do_not_depend_on_the_pieces_of_time),
        cmocka_unit_test(too_many_edges_lose_whole_pulses),
        cmocka_unit_test(an_open_pair_reads_high_and_its_drivers_go_on),
        cmocka_unit_test(an_open_pair_wins_over_other_faults),
        cmocka_unit_test(swapped_wires_invert_the_receiver_alone),
        cmocka_unit_test(pairs_are_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
