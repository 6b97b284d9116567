/* A first look at the PSA-2's lines, at any instant: the levels are those that a listener from power-on knows. */
#include "psa2_rig.h"

#include "base/rng.h"

#define LOOKS     1000
#define ALL_LINES ((UINT32_C(1) << PSA2_LINES) - 1)
#define OUT_LINES (UINT32_C(1) << PSA2_LINE_INT | UINT32_C(1) << PSA2_LINE_DATA | UINT32_C(1) << PSA2_LINE_CLK)

static struct rig watched, fresh;

/* As the command `lines` takes them: what was delivered and what is due. */
static uint64_t levels(const struct rig *r)
{
    const struct trace *t = &r->b.base.trace;
    uint64_t level = t->level;
    for (unsigned i = t->first; i < t->first + t->pending_count && t->pending[i].t_ns <= r->s.now_ns; i++) {
        level = (level & ~t->pending[i].lines) | (t->pending[i].level & t->pending[i].lines);
    }
    return level;
}

static void start(const char *profile)
{
    const struct psa2_profile p = psa2_profile_file(profile);
    struct rig *const rigs[] = {&watched, &fresh};
    for (int i = 0; i < 2; i++) {
        struct rig *r = rigs[i];
        rig_init(r, &p, 1.0);
        r->volts[0] = 2.4882;
        r->volts[1] = -7.0;
        r->volts[2] = 9.9;
        if (i == 0) trace_attach(&r->b.base.trace, &r->sink);
        psa2_power_up(&r->b, 0);
    }
}

static void both_run(int64_t ns)
{
    rig_run(&watched, ns);
    rig_run(&fresh, ns);
}

static void same_levels(const char *profile, uint64_t lines)
{
    const uint64_t want = levels(&watched) & lines, got = levels(&fresh) & lines;
    for (unsigned i = 0; i < PSA2_LINES; i++) {
        if ((want ^ got) >> i & 1) {
            fail_msg("%s: at %lld ns %s is %u, told %u", profile, (long long)watched.s.now_ns, psa2_lines[i].name,
                     (unsigned)(want >> i & 1), (unsigned)(got >> i & 1));
        }
    }
}

/* All lines but those that a byte just ended still moves, within a period of SClk. */
static uint64_t settled(void)
{
    const struct trace *t = &watched.b.base.trace;
    uint64_t lines = ALL_LINES;
    for (unsigned i = t->first; i < t->first + t->pending_count; i++) {
        if (t->pending[i].t_ns > watched.s.now_ns) lines &= ~t->pending[i].lines;
    }
    return lines;
}

/* At once and, since the looking goes on for a while, up to the end of a frame; then no one looks again. */
static void look(struct rng *rng, const char *profile)
{
    trace_attach(&fresh.b.base.trace, &fresh.sink);
    same_levels(profile, settled());
    for (int k = 0; k < 4; k++) {
        both_run((int64_t)(rng_uniform(rng) * 40000));
        same_levels(profile, settled());
    }
    trace_detach(&fresh.b.base.trace, &fresh.sink);
    assert_int_equal(fresh.b.base.trace.late, 0);
    assert_int_equal(fresh.b.base.trace.dropped, 0);
}

/* Between two bytes of a command. */
static bool in_burst(void)
{
    return watched.b.spi.phase == PSA2_SPI_FIRST && watched.b.spi.at > 0;
}

/* Resets, and power that fails for two looks. */
static void disturb(int i)
{
    struct rig *const rigs[] = {&watched, &fresh};
    for (int k = 0; k < 2; k++) {
        const int64_t t_ns = rigs[k]->s.now_ns;
        if (i % 400 == 300) psa2_reset(&rigs[k]->b, t_ns);
        if (i == 500) psa2_power_down(&rigs[k]->b, t_ns);
        if (i == 502) psa2_power_up(&rigs[k]->b, t_ns);
    }
}

static void a_late_look_tells_what_an_early_one_knows(void **state)
{
    (void)state;
    const char *const profiles[] = {"article", "ungated", "w24", "w16", "lab32"};
    unsigned in_frames = 0, in_bursts = 0, high[PSA2_LINES] = {0};
    for (size_t p = 0; p < COUNT(profiles); p++) {
        struct rng rng = rng_stream(17, (uint32_t)p, "look");
        start(profiles[p]);
        for (int i = 0; i < LOOKS; i++) {
            both_run((int64_t)(rng_uniform(&rng) * 2000000));
            disturb(i);
            for (int us = 0; i % 10 == 0 && us < 2000 && !in_burst(); us++) both_run(1000);
            in_frames += watched.b.out.busy;
            in_bursts += in_burst();
            for (unsigned k = 0; k < PSA2_LINES; k++) high[k] += (unsigned)(levels(&watched) >> k & 1);
            look(&rng, profiles[p]);
            watched.edges = 0;
        }
    }
    assert_true(in_frames > 50 && in_bursts > 20); /* or nothing has been shown */
    assert_true(high[PSA2_LINE_DOUTX] > 50 && high[PSA2_LINE_DOUTY] > 50 && high[PSA2_LINE_DOUTZ] > 50);
}

/* The frame under way at a first look is reported whole: Int, and every bit of it that comes after what the trace has closed. */
static void a_frame_under_way_is_told_from_its_beginning(void **state)
{
    (void)state;
    start("article");
    both_run(200000000);
    const unsigned frames = watched.frames;
    while (!fresh.b.out.busy || fresh.s.now_ns < fresh.b.out.f.t_int_fall_ns + 30000) both_run(1000);
    fresh.edges = 0;
    const int64_t from_ns = fresh.b.out.f.t_int_fall_ns;
    trace_attach(&fresh.b.base.trace, &fresh.sink);
    const unsigned levels_told = fresh.edges;
    both_run(500000);
    assert_true(watched.frames > frames);
    unsigned at = 0, compared = 0;
    for (unsigned i = levels_told; i < fresh.edges; i++) {
        const struct rig_edge *e = &fresh.edge[i];
        if (!(OUT_LINES >> e->sig & 1)) continue;
        while (at < watched.edges && (watched.edge[at].t_ns < from_ns || !(OUT_LINES >> watched.edge[at].sig & 1)))
            at++;
        assert_true(at < watched.edges);
        assert_int_equal(e->t_ns, watched.edge[at].t_ns);
        assert_int_equal(e->sig, watched.edge[at].sig);
        assert_int_equal(e->level, watched.edge[at].level);
        at++;
        compared++;
    }
    assert_true(compared > 2 + 4 * 64);
}

/* The trace has closed part of the frame: nothing comes late, the words that follow are whole. */
static void a_frame_that_is_closed_in_part_goes_on(void **state)
{
    (void)state;
    start("article");
    both_run(200000000);
    while (!fresh.b.out.busy || fresh.s.now_ns < fresh.b.out.f.t_int_fall_ns + 30000) both_run(1000);
    const struct psa2_frame f = fresh.b.out.f;
    trace_advance(&fresh.b.base.trace, fresh.s.now_ns); /* in the second word: 22 ... 38 us */
    trace_attach(&fresh.b.base.trace, &fresh.sink);
    assert_int_equal(levels(&fresh) & OUT_LINES, 0);
    fresh.edges = 0;
    both_run(500000);
    assert_int_equal(fresh.b.base.trace.late, 0);
    unsigned clocks = 0;
    for (unsigned i = 0; i < fresh.edges; i++) {
        const struct rig_edge *e = &fresh.edge[i];
        clocks += e->sig == PSA2_LINE_CLK && e->level && e->t_ns < f.t_int_rise_ns;
        if (e->sig == PSA2_LINE_INT && e->t_ns < f.t_int_rise_ns) fail_msg("Int moves at %lld", (long long)e->t_ns);
    }
    assert_int_equal(clocks, 64);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_late_look_tells_what_an_early_one_knows),
        cmocka_unit_test(a_frame_under_way_is_told_from_its_beginning),
        cmocka_unit_test(a_frame_that_is_closed_in_part_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
