/* Faults of lines: what a watcher sees of a trace whose filter bends some of it. */
#include "base/rng.h"
#include "trace/line_fault.h"

#include "rig.h"

#include <string.h>

enum { INT, CLK, OTHER, SEEN_MAX = 4096 };

struct seen {
    int64_t t_ns;
    unsigned sig;
    bool level;
};

struct bench {
    struct trace t;
    struct line_faults l;
    struct trace_sink sink;
    struct seen seen[SEEN_MAX];
    unsigned n;
    uint64_t level; /* as heard */
    int64_t last_ns;
};

static struct bench bench;

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct bench *r = ctx;
    for (; n > 0; n--, s++) {
        assert_true(s->t_ns >= r->last_ns); /* in order of time */
        assert_true(s->lines == TRACE_FIRST(r->t.count) ||
                    ((r->level ^ s->level) & s->lines) == s->lines); /* real changes, but for the first news */
        r->last_ns = s->t_ns;
        r->level = (r->level & ~s->lines) | (s->level & s->lines);
        for (unsigned sig = 0; sig < r->t.count; sig++)
            if (s->lines >> sig & 1 && r->n < SEEN_MAX)
                r->seen[r->n++] = (struct seen){s->t_ns, sig, s->level >> sig & 1};
    }
}

/* Int rests high, the others low. */
static struct bench *up(void)
{
    struct bench *r = &bench;
    memset(r, 0, sizeof *r);
    memset(&r->t, 0, sizeof r->t);
    (void)trace_add(&r->t, "Int", true);
    (void)trace_add(&r->t, "CLK", false);
    (void)trace_add(&r->t, "Other", false);
    line_faults_init(&r->l, &r->t);
    r->sink = (struct trace_sink){.mask = 7, .steps = on_steps, .ctx = r};
    trace_attach(&r->t, &r->sink);
    r->n = 0;
    return r;
}

/* A frame from t_ns on: Int low for 1000 ns, in it four pulses of CLK of 50 ns every 100 ns from +100 on. */
static void frame(struct bench *r, int64_t t_ns)
{
    trace_set(&r->t, INT, false, t_ns);
    for (int i = 0; i < 4; i++) {
        trace_set(&r->t, CLK, true, t_ns + 100 + 100 * i);
        trace_set(&r->t, CLK, false, t_ns + 150 + 100 * i);
    }
    trace_set(&r->t, INT, true, t_ns + 1000);
}

static struct line_fault fault(enum line_fault_kind kind, unsigned line)
{
    return (struct line_fault){.kind = kind,
                               .line = line,
                               .from_ns = 0,
                               .until_ns = INT64_MAX,
                               .frame_line = INT,
                               .rng = rng_stream(1, 1, "f")};
}

static unsigned count(const struct bench *r, unsigned sig)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->n; i++) n += r->seen[i].sig == sig;
    return n;
}

/* The k-th change of a signal, from 0. */
static void assert_change(const struct bench *r, unsigned sig, unsigned k, bool level, int64_t t_ns)
{
    for (unsigned i = 0; i < r->n; i++) {
        if (r->seen[i].sig != sig || k-- > 0) continue;
        assert_int_equal(r->seen[i].level, level);
        assert_int_equal(r->seen[i].t_ns, t_ns);
        return;
    }
    fail_msg("no such change");
}

static void a_stuck_line_does_not_move_and_then_follows_again(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_STUCK_LOW, INT);
    f.from_ns = 500;
    const uint32_t id = line_fault_add(&r->l, &f);
    assert_true(id > 0);
    frame(r, 1000);
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, INT), 1);
    assert_change(r, INT, 0, false, 500);
    assert_int_equal(count(r, CLK), 8); /* the others as ever */
    line_fault_end(&r->l, id, 4000);
    frame(r, 5000);
    trace_advance(&r->t, 9000);
    assert_change(r, INT, 1, true, 4000);
    assert_change(r, INT, 2, false, 5000);
    assert_change(r, INT, 3, true, 6000);
    assert_null(r->t.filter);
    struct line_fault high = fault(LINE_STUCK_HIGH, CLK);
    high.from_ns = 9000;
    high.until_ns = 9500; /* ends of itself */
    (void)line_fault_add(&r->l, &high);
    trace_advance(&r->t, 9600);
    assert_change(r, CLK, 16, true, 9000);
    assert_change(r, CLK, 17, false, 9500);
    assert_null(r->t.filter);
}

static void a_fault_begins_between_steps_not_yet_delivered(void **state)
{
    (void)state;
    struct bench *r = up();
    frame(r, 1000); /* known, and not delivered before the fault comes */
    struct line_fault f = fault(LINE_STUCK_LOW, CLK);
    f.from_ns = 1220;
    (void)line_fault_add(&r->l, &f);
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, CLK), 4);
    assert_change(r, CLK, 3, false, 1220);
}

static void swapped_wires_turn_the_level_round(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_INVERTED, CLK);
    (void)line_fault_add(&r->l, &f);
    frame(r, 1000);
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, CLK), 9);
    assert_change(r, CLK, 0, true, 0);
    assert_change(r, CLK, 1, false, 1100);
    assert_change(r, CLK, 8, true, 1450);
}

static void a_glitch_is_one_pulse_of_its_width(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_GLITCH, INT), g = fault(LINE_GLITCH, CLK);
    f.from_ns = 500;
    f.width_ns = 20;
    g.from_ns = 1120; /* over the fall of the first pulse */
    g.width_ns = 60;
    (void)line_fault_add(&r->l, &f);
    (void)line_fault_add(&r->l, &g);
    frame(r, 1000);
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, INT), 4);
    assert_change(r, INT, 0, false, 500);
    assert_change(r, INT, 1, true, 520);
    assert_change(r, CLK, 1, false, 1120);
    assert_change(r, CLK, 2, true, 1150);
    assert_change(r, CLK, 3, false, 1180);
    assert_change(r, CLK, 4, true, 1200);
    assert_null(r->t.filter);
}

/* It begins where the line falls of itself, and ends where it rises: nothing is to be seen, no pulse without width. */
static void what_happens_at_one_instant_is_one_change(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_GLITCH, CLK);
    f.from_ns = 1150;
    f.width_ns = 50;
    (void)line_fault_add(&r->l, &f);
    frame(r, 1000);
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, CLK), 6);
    assert_change(r, CLK, 0, true, 1100);
    assert_change(r, CLK, 1, false, 1250);
}

static void the_nth_pulse_of_each_frame_is_missing(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_MISSING_PULSE, CLK);
    f.pulse = 2;
    (void)line_fault_add(&r->l, &f);
    frame(r, 1000);
    frame(r, 5000);
    trace_advance(&r->t, 9000);
    assert_int_equal(count(r, CLK), 12);
    assert_change(r, CLK, 1, false, 1150);
    assert_change(r, CLK, 2, true, 1300);
    assert_change(r, CLK, 7, false, 5150);
    assert_change(r, CLK, 8, true, 5300);
    assert_int_equal(count(r, INT), 4);
}

static void a_pulse_too_many_follows_the_nth_of_each_frame(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_EXTRA_PULSE, CLK);
    f.pulse = 4;
    f.width_ns = 15;
    (void)line_fault_add(&r->l, &f);
    frame(r, 1000);
    frame(r, 5000);
    trace_advance(&r->t, 9000);
    assert_int_equal(count(r, CLK), 20);
    assert_change(r, CLK, 7, false, 1450);
    assert_change(r, CLK, 8, true, 1465);
    assert_change(r, CLK, 9, false, 1480);
    assert_change(r, CLK, 18, true, 5465);
}

/* 1000 expected in 10 ms at 100 kHz, less what the pulses' own width takes: 10 ms / (10 us + 10 ns). */
static void noise_has_its_rate_and_width_and_a_seed_the_same_pulses(void **state)
{
    (void)state;
    int64_t first_ns[2] = {0, 0};
    unsigned pulses[2];
    for (int k = 0; k < 2; k++) {
        struct bench *r = up();
        struct line_fault f = fault(LINE_NOISE, OTHER);
        f.rate_hz = 100000.0;
        f.width_ns = 10;
        (void)line_fault_add(&r->l, &f);
        for (int i = 1; i <= 100; i++) trace_advance(&r->t, i * (k ? 100000 : 37000)); /* however it is looked at */
        trace_advance(&r->t, 10000000);
        pulses[k] = count(r, OTHER) / 2;
        first_ns[k] = r->seen[0].t_ns;
        for (unsigned i = 0; i + 1 < r->n; i += 2) {
            assert_true(r->seen[i].level);
            assert_int_equal(r->seen[i + 1].t_ns - r->seen[i].t_ns, 10);
        }
    }
    assert_in_range(pulses[0], 880, 1120); /* 4 standard deviations */
    assert_int_equal(pulses[0], pulses[1]);
    assert_int_equal(first_ns[0], first_ns[1]);
}

/* Three seeds on their way at once, each from its own instant, whether or not the edges before it have been computed. */
static void another_seed_counts_from_its_instant_however_it_is_looked_at(void **state)
{
    (void)state;
    static int64_t at_ns[3][512];
    unsigned n[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        struct bench *r = up();
        struct line_fault f = fault(LINE_NOISE, OTHER);
        f.rate_hz = 100000.0;
        f.width_ns = 10;
        const uint32_t id = line_fault_add(&r->l, &f);
        for (int64_t t_ns = 1000000; t_ns <= 1100000 && k < 2; t_ns += 50000) {
            if (k) trace_advance(&r->t, t_ns);
            line_fault_reseed(&r->l, id, 7 + (uint64_t)(t_ns / 50000 % 2), t_ns);
        }
        trace_advance(&r->t, 2000000);
        for (unsigned i = 0; i < r->n && n[k] < 512; i++) at_ns[k][n[k]++] = r->seen[i].t_ns;
    }
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(at_ns[0], at_ns[1], n[0] * sizeof **at_ns);
    assert_true(n[0] != n[2] || memcmp(at_ns[0], at_ns[2], n[0] * sizeof **at_ns) != 0);
    for (unsigned i = 0; at_ns[2][i] < 1000000; i++) assert_int_equal(at_ns[0][i], at_ns[2][i]);
}

static void who_listens_late_hears_the_faulty_levels(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_STUCK_LOW, INT);
    trace_detach(&r->t, &r->sink);
    (void)line_fault_add(&r->l, &f);
    trace_set(&r->t, OTHER, true, 500); /* no observer */
    trace_advance(&r->t, 1000);
    assert_int_equal(r->n, 0);
    trace_attach(&r->t, &r->sink);
    assert_int_equal(r->level & 7, 1u << OTHER);
    trace_set(&r->t, OTHER, false, 2000);
    trace_advance(&r->t, 3000);
    assert_int_equal(r->level & 7, 0);
}

/* No one listens, so that the lines move without a step; a fault of one of them must not hide where the others are. */
static void who_listens_late_hears_where_healthy_lines_are(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_STUCK_LOW, OTHER);
    trace_detach(&r->t, &r->sink);
    assert_int_equal(line_fault_add(&r->l, &f), 1);
    trace_advance(&r->t, 1000);
    trace_set(&r->t, CLK, true, 1500);
    trace_attach(&r->t, &r->sink);
    assert_int_equal(r->level, TRACE_BIT(INT) | TRACE_BIT(CLK));
    r->n = 0;
    trace_set(&r->t, CLK, false, 2000);
    trace_advance(&r->t, 3000);
    assert_int_equal(r->n, 1);
    assert_change(r, CLK, 0, false, 2000);
}

static void as_many_faults_as_there_is_room_for_and_no_more(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_INVERTED, OTHER);
    for (unsigned i = 0; i < LINE_FAULTS_MAX; i++) assert_int_equal(line_fault_add(&r->l, &f), i + 1);
    assert_int_equal(line_fault_add(&r->l, &f), 0);
    trace_advance(&r->t, 1000);
    assert_int_equal(r->n, 0); /* an even number of swaps is none */
    line_fault_end(&r->l, 3, 2000);
    line_fault_end(&r->l, LINE_FAULTS_MAX + 35, 2000);
    trace_advance(&r->t, 3000);
    assert_change(r, OTHER, 0, true, 2000);
    assert_int_equal(line_fault_add(&r->l, &f), LINE_FAULTS_MAX + 1); /* a number of its own */
    line_fault_end(&r->l, 3, 2000);                                   /* harmless */
}

/* What was reported ahead of its time goes to no one; the time of a new listener begins where the trace is. */
static void who_listens_again_hears_times_in_order(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_INVERTED, OTHER);
    const uint32_t id = line_fault_add(&r->l, &f);
    trace_advance(&r->t, 1000);
    trace_set(&r->t, CLK, true, 9000);
    trace_detach(&r->t, &r->sink);
    trace_attach(&r->t, &r->sink);
    line_fault_end(&r->l, id, 3000);
    r->n = 0;
    trace_advance(&r->t, 2000);
    assert_int_equal(r->n, 0);
    trace_set(&r->t, INT, false, 4000);
    trace_advance(&r->t, 5000);
    assert_change(r, OTHER, 0, false, 3000);
    assert_change(r, INT, 0, false, 4000);
}

static void a_fault_that_ends_before_it_begins_is_none(void **state)
{
    (void)state;
    struct bench *r = up();
    struct line_fault f = fault(LINE_STUCK_LOW, INT);
    f.from_ns = 5000;
    const uint32_t id = line_fault_add(&r->l, &f);
    line_fault_end(&r->l, id, 4000);
    trace_advance(&r->t, 9000);
    assert_int_equal(r->n, 0);
    assert_null(r->t.filter);
}

/* A line and a frame's line above the first 32. */
static void high_lines_have_faults_too(void **state)
{
    (void)state;
    struct bench *r = up();
    trace_detach(&r->t, &r->sink);
    for (unsigned i = r->t.count; i < 40; i++) (void)trace_add(&r->t, "line", i == 38);
    r->sink.mask = TRACE_FIRST(40);
    trace_attach(&r->t, &r->sink);
    r->n = 0;
    struct line_fault f = fault(LINE_MISSING_PULSE, 39);
    f.frame_line = 38;
    f.pulse = 2;
    (void)line_fault_add(&r->l, &f);
    trace_set(&r->t, 38, false, 1000);
    for (int i = 0; i < 4; i++) {
        trace_set(&r->t, 39, true, 1100 + 100 * i);
        trace_set(&r->t, 39, false, 1150 + 100 * i);
    }
    trace_advance(&r->t, 3000);
    assert_int_equal(count(r, 38), 1);
    assert_int_equal(count(r, 39), 6);
    assert_change(r, 39, 2, true, 1300);
}

/* More changes than are handed on at a time. */
static void nothing_is_lost_of_a_long_row(void **state)
{
    (void)state;
    struct bench *r = up();
    const struct line_fault f = fault(LINE_INVERTED, CLK);
    (void)line_fault_add(&r->l, &f);
    for (int i = 0; i < 100; i++) frame(r, 2000 * (i + 1));
    trace_advance(&r->t, 1000000);
    assert_int_equal(count(r, CLK), 801);
    assert_int_equal(count(r, INT), 200);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stuck_line_does_not_move_and_then_follows_again),
        cmocka_unit_test(a_fault_begins_between_steps_not_yet_delivered),
        cmocka_unit_test(swapped_wires_turn_the_level_round),
        cmocka_unit_test(a_glitch_is_one_pulse_of_its_width),
        cmocka_unit_test(what_happens_at_one_instant_is_one_change),
        cmocka_unit_test(the_nth_pulse_of_each_frame_is_missing),
        cmocka_unit_test(a_pulse_too_many_follows_the_nth_of_each_frame),
        cmocka_unit_test(noise_has_its_rate_and_width_and_a_seed_the_same_pulses),
        cmocka_unit_test(another_seed_counts_from_its_instant_however_it_is_looked_at),
        cmocka_unit_test(who_listens_late_hears_the_faulty_levels),
        cmocka_unit_test(who_listens_late_hears_where_healthy_lines_are),
        cmocka_unit_test(as_many_faults_as_there_is_room_for_and_no_more),
        cmocka_unit_test(who_listens_again_hears_times_in_order),
        cmocka_unit_test(a_fault_that_ends_before_it_begins_is_none),
        cmocka_unit_test(high_lines_have_faults_too),
        cmocka_unit_test(nothing_is_lost_of_a_long_row),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
