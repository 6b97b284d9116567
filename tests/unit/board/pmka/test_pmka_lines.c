/* PMKA: its lines beside its readings, a late look, and that looking changes nothing. */
#include "pmka_rig.h"

#include "base/rng.h"

#define EDGES 200000u

struct edge {
    int64_t t_ns;
    unsigned line;
    bool level;
};

static struct rig rig, other;
static struct edge edge[EDGES];
static unsigned edges;

static void on_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    (void)ctx;
    if (edges < EDGES) edge[edges++] = (struct edge){t_ns, sig, level};
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, UINT64_MAX, on_change, ctx);
}

static struct trace_sink sink = {.mask = UINT64_MAX, .steps = on_steps};

static void inputs(struct rig *r)
{
    for (unsigned a = 0; a < 3; a++)
        r->input[a] = (struct rig_input){.mean_v = 1.0, .amp_v = {5.0}, .hz = {1.0 + a}, .phase = {a}};
}

static struct pmka_profile short_beats(void)
{
    struct pmka_profile p = rig_profile();
    p.beat_periods = 12;
    p.zero_periods = 5;
    return p;
}

static unsigned next_edge(unsigned line, unsigned from)
{
    while (from < edges && edge[from].line != line) from++;
    return from;
}

static void watch(struct rig *r)
{
    const struct pmka_profile p = short_beats();
    rig_init(r, &p);
    inputs(r);
    trace_attach(&r->b.base.trace, &sink);
    edges = 0; /* the levels it was given first */
    pmka_board.power_up(&r->b.base, 0);
}

/* SH: 50 us from each sampling instant on; CONV: its last 48 us. The multiplexer moves when the sample is held. */
static void the_converter_on_its_lines(void **state)
{
    (void)state;
    watch(&rig);
    rig_run(&rig, 200 * INT64_C(4800000) + 10000000);
    const struct {
        unsigned line;
        int64_t up_ns, down_ns;
    } rows[] = {{PMKA_LINE_SH, 0, 50000}, {PMKA_LINE_CONV, 2000, 50000}};
    for (size_t k = 0; k < COUNT(rows); k++) {
        unsigned at = 0;
        for (unsigned n = 0; n < 4 * 199; n++) {
            const int64_t t_ns = 10000000 + n / 4 * INT64_C(4800000) + n % 4 * 100000;
            at = next_edge(rows[k].line, at);
            assert_true(edge[at].level);
            assert_int_equal(edge[at].t_ns, t_ns + rows[k].up_ns);
            at = next_edge(rows[k].line, at + 1);
            assert_false(edge[at].level);
            assert_int_equal(edge[at++].t_ns, t_ns + rows[k].down_ns);
        }
    }
    unsigned at = 0;
    for (unsigned n = 0; n < 199; n++) { /* MUX1 falls when K is held: a frame of faults begins */
        at = next_edge(PMKA_LINE_MUX1, at);
        assert_int_equal(edge[at].t_ns, 10000000 + n * INT64_C(4800000) + 100000);
        at = next_edge(PMKA_LINE_MUX1, at + 1);
        assert_int_equal(edge[at++].t_ns, 10000000 + n * INT64_C(4800000) + 300000);
    }
    assert_int_equal(rig.b.base.trace.late, 0);
}

/* Each reset that a reading tells is a pulse of half a period on its line, from the sampling instant before. */
static void resets_on_their_lines(void **state)
{
    (void)state;
    watch(&rig);
    rig_run(&rig, 200 * INT64_C(4800000) + 10000000);
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        for (int sign = 1; sign >= -1; sign -= 2) {
            const unsigned line = PMKA_LINE_RP1 + 2 * i + (sign < 0);
            unsigned at = 0, found = 0;
            for (unsigned k = 1; k < rig.readings; k++) {
                if (rig.reading[k].reset[i] != sign) continue;
                const int64_t t_ns = rig.reading[k - 1].t_ns + i * 100000;
                at = next_edge(line, at);
                assert_true(edge[at].level && edge[at].t_ns == t_ns);
                at = next_edge(line, at + 1);
                assert_true(!edge[at].level && edge[at].t_ns == t_ns + 2400000);
                at++;
                found++;
            }
            assert_true(found > 10);
        }
    }
}

/* KL1..4 say who is on a sensor, TAU which beat it is. */
static void keys_and_beats_on_their_lines(void **state)
{
    (void)state;
    watch(&rig);
    rig_run(&rig, 100 * INT64_C(4800000) + 10000000);
    bool level[PMKA_LINES];
    for (unsigned n = 0; n < PMKA_LINES; n++) level[n] = pmka_lines[n].level;
    unsigned at = 0;
    for (unsigned k = 0; k + 1 < rig.readings; k++) {
        const int64_t t_ns = rig.reading[k].t_ns + 1000000; /* in the period that the next reading ends */
        for (; at < edges && edge[at].t_ns <= t_ns; at++) level[edge[at].line] = edge[at].level;
        const unsigned tau = level[PMKA_LINE_TAU0] + 2u * level[PMKA_LINE_TAU1] + 4u * level[PMKA_LINE_TAU2];
        assert_int_equal(tau, rig.reading[k + 2 < rig.readings ? k + 1 : k].tau);
        const unsigned resting = tau >= 2 && tau <= 4 ? tau - 2 : 3;
        for (unsigned i = 0; i < PMKA_INTS; i++) assert_int_equal(level[PMKA_LINE_KL1 + i], i != resting);
    }
    assert_true(at > 1000);
}

static uint64_t levels(const struct rig *r)
{
    const struct trace *t = &r->b.base.trace;
    uint64_t level = t->level;
    for (unsigned i = t->first; i < t->first + t->pending_count && t->pending[i].t_ns <= r->s.now_ns; i++)
        level = (level & ~t->pending[i].lines) | (t->pending[i].level & t->pending[i].lines);
    return level;
}

static void disturb(unsigned n)
{
    struct rig *const rigs[] = {&rig, &other};
    for (unsigned k = 0; k < 2; k++) {
        const int64_t t_ns = rigs[k]->s.now_ns;
        if (n % 50 == 30) pmka_board.reset(&rigs[k]->b.base, t_ns);
        if (n % 100 == 60) pmka_board.power_down(&rigs[k]->b.base, t_ns);
        if (n % 100 == 62) pmka_board.power_up(&rigs[k]->b.base, t_ns);
    }
}

static void a_late_look_tells_what_an_early_one_knows(void **state)
{
    (void)state;
    struct rng rng = rng_stream(5, 0, "look");
    struct trace_sink late = {.mask = UINT64_MAX, .steps = on_steps};
    const struct pmka_profile p = short_beats();
    unsigned converting = 0, resetting = 0;
    watch(&rig);
    rig_init(&other, &p);
    inputs(&other);
    pmka_board.power_up(&other.b.base, 0);
    for (unsigned n = 0; n < 3000; n++) {
        const int64_t ns = n % 3 ? (int64_t)(rng_uniform(&rng) * 9600000) : (int64_t)(rng_uniform(&rng) * 60000);
        rig_run(&rig, ns);
        rig_run(&other, ns);
        disturb(n);
        trace_attach(&other.b.base.trace, &late);
        const uint64_t want = levels(&rig), got = levels(&other);
        if (want != got)
            fail_msg("look %u at %lld ns: %llx, not %llx", n, (long long)rig.s.now_ns, (unsigned long long)got,
                     (unsigned long long)want);
        converting += want >> PMKA_LINE_CONV & 1;
        resetting += (want >> PMKA_LINE_RP1 & 0xFF) != 0;
        edges = 0;
        trace_advance(&other.b.base.trace, other.s.now_ns);
        for (unsigned k = 1; k < edges; k++) /* no pulse that was over long ago */
            for (unsigned j = 0; j < k; j++) assert_int_not_equal(edge[k].line, edge[j].line);
        trace_detach(&other.b.base.trace, &late);
        edges = 0;
    }
    assert_true(converting > 20 && resetting > 300);
    assert_int_equal(other.b.base.trace.late, 0);
    assert_int_equal(rig.b.base.trace.late, 0);
}

static void looking_changes_nothing(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats();
    watch(&rig);
    rig_run(&rig, 600 * INT64_C(4800000));
    rig_init(&other, &p);
    other.b.base.observed = false;
    inputs(&other);
    pmka_board.power_up(&other.b.base, 0);
    rig_run(&other, 600 * INT64_C(4800000));
    assert_int_equal(rig.readings, other.readings);
    for (unsigned k = 0; k < rig.readings; k++) assert_memory_equal(rig.reading[k].code, other.reading[k].code, 8);
    struct sha256 a, b;
    char hex_a[SHA256_HEX], hex_b[SHA256_HEX];
    sha256_init(&a);
    sha256_init(&b);
    pmka_board.digest(&rig.b.base, &a);
    pmka_board.digest(&other.b.base, &b);
    sha256_hex(&a, hex_a);
    sha256_hex(&b, hex_b);
    assert_string_equal(hex_a, hex_b);
    assert_int_equal(other.events[PMKA_EV_READING], 0);
}

/* Every line falls with the power; those that rest high rise with it. */
static void power_on_the_lines(void **state)
{
    (void)state;
    watch(&rig);
    rig_run(&rig, 53 * INT64_C(4800000) + 1000);
    pmka_board.power_down(&rig.b.base, rig.s.now_ns);
    assert_int_equal(levels(&rig), 0);
    rig_run(&rig, 20000000);
    assert_int_equal(levels(&rig), 0);
    assert_false(pmka_board.ready(&rig.b.base));
    pmka_board.power_up(&rig.b.base, rig.s.now_ns);
    assert_int_equal(levels(&rig), 7 | TRACE_BIT(PMKA_LINE_CS) | TRACE_BIT(PMKA_LINE_RW));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_converter_on_its_lines),    cmocka_unit_test(resets_on_their_lines),
        cmocka_unit_test(keys_and_beats_on_their_lines), cmocka_unit_test(a_late_look_tells_what_an_early_one_knows),
        cmocka_unit_test(looking_changes_nothing),       cmocka_unit_test(power_on_the_lines),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
