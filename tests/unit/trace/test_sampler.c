#include "rig.h"

#include "base/rng.h"
#include "trace/sampler.h"

#include <string.h>

#define I 1
#define D 2
#define C 4

static const char *const names[] = {"Int", "Data", "CLK", NULL};

static struct trace trace;
static struct sampler sampler;
static uint8_t ring[SAMPLER_RING], buf[SAMPLER_RING + 16];

static const struct clk mhz8 = {.t0_ns = 0, .hz = 8000000, .div = 1}; /* 125 ns */

static int fresh(void **state)
{
    (void)state;
    memset(&trace, 0, sizeof trace);
    trace_add(&trace, "Res", true);
    trace_add(&trace, "Data", false);
    trace_add(&trace, "CLK", false);
    trace_add(&trace, "Int", true);
    return 0;
}

static bool start_port(const char *const *lines, const struct clk *clock)
{
    const struct sampler_cfg cfg = sampler_line_port(clock, lines, ring);
    return sampler_start(&sampler, &trace, &cfg);
}

/* Instant of the n-th sample that is still to be made. */
static int64_t next_ns(size_t n)
{
    return clk_edge_ns(&sampler.clock, sampler.next + (int64_t)n);
}

static void assert_bytes(const uint8_t *want, size_t n)
{
    assert_int_equal(sampler_take(&sampler, buf, sizeof buf), n);
    assert_memory_equal(buf, want, n);
}

static void a_sample_is_the_level_valid_from_its_instant_on(void **state)
{
    (void)state;
    assert_true(start_port(names, &mhz8));
    trace_set(&trace, 3, false, 250); /* exactly sample 2 */
    trace_set(&trace, 1, true, 251);  /* just after it */
    trace_set(&trace, 2, true, 500);
    trace_set(&trace, 0, false, 600); /* Res: not ours */
    trace_set(&trace, 2, false, 750);
    trace_set(&trace, 3, true, 750);
    trace_advance(&trace, 1000); /* sample 8 itself may still change */
    const uint8_t want[] = {I, I, 0, D, D | C, D | C, I | D, I | D};
    assert_bytes(want, sizeof want);
    assert_int_equal(sampler_take(&sampler, buf, sizeof buf), 0);
}

static void pulses_between_two_samples_are_not_seen(void **state)
{
    (void)state;
    assert_true(start_port(names, &mhz8));
    trace_set(&trace, 2, true, 130);
    trace_set(&trace, 2, false, 249);
    trace_advance(&trace, 375);
    const uint8_t want[] = {I, I, I};
    assert_bytes(want, sizeof want);
}

static void the_first_sample_has_a_known_instant(void **state)
{
    (void)state;
    const struct {
        struct clk clock;
        int64_t start_ns, t0_ns;
    } row[] = {
        {{0, 8000000, 1}, 0, 0},
        {{0, 8000000, 1}, 1, 125},
        {{40, 8000000, 1}, 1000, 1040}, /* the adapter's own phase */
        {{0, 4096000, 3}, 1000000000, 1000000488},
    };
    for (size_t i = 0; i < COUNT(row); i++) {
        fresh(NULL);
        trace_advance(&trace, row[i].start_ns);
        assert_true(start_port(names, &row[i].clock));
        assert_int_equal(next_ns(0), row[i].t0_ns);
        trace_set(&trace, 3, false, row[i].t0_ns + 1);
        trace_advance(&trace, row[i].t0_ns + 1);
        const uint8_t want[] = {I};
        assert_bytes(want, sizeof want);
    }
}

static void a_slow_reader_loses_the_newest_samples_and_can_see_it(void **state)
{
    (void)state;
    assert_true(start_port(names, &mhz8));
    assert_int_equal(next_ns(SAMPLER_RING - sampler.len), (int64_t)SAMPLER_RING * 125);
    trace_advance(&trace, next_ns(SAMPLER_RING - sampler.len));
    assert_int_equal(sampler.dropped, 0);
    assert_int_equal(sampler.len, SAMPLER_RING);
    trace_advance(&trace, next_ns(SAMPLER_RING - sampler.len) + 7 * 125);
    assert_int_equal(sampler.dropped, 7);
    assert_int_equal(sampler_take(&sampler, buf, 2), 2);
    trace_advance(&trace, trace.done_ns + 3 * 125); /* two fit, the third is lost again */
    assert_int_equal(sampler.dropped, 8);
    assert_int_equal(sampler_take(&sampler, buf, sizeof buf), SAMPLER_RING);
    assert_int_equal(buf[SAMPLER_RING - 3], I);
    assert_int_equal(buf[SAMPLER_RING - 2], I | SAMPLER_GAP);
    assert_int_equal(buf[SAMPLER_RING - 1], I);
    trace_advance(&trace, trace.done_ns + 2 * 125);
    const uint8_t want[] = {I | SAMPLER_GAP, I};
    assert_bytes(want, sizeof want);
}

static void a_trace_without_the_lines_is_refused(void **state)
{
    (void)state;
    memset(&trace, 0, sizeof trace);
    trace_add(&trace, "Int", true);
    trace_add(&trace, "CLK", false);
    assert_false(start_port(names, &mhz8));
    assert_null(trace.sinks);
    sampler_stop(&sampler);
}

/* As many as a byte has bits beside the gap's. */
static void a_board_chooses_up_to_seven_lines(void **state)
{
    static const char *const eight[] = {"a", "b", "c", "d", "e", "f", "g", "h", NULL};
    static const char *const back[] = {"g", "f", "e", "d", "c", "b", "a", NULL};
    static const uint8_t want[] = {0x2A, 0x6A, 0x68};
    (void)state;
    memset(&trace, 0, sizeof trace);
    for (unsigned i = 0; i < 8; i++) trace_add(&trace, eight[i], i % 2);
    assert_false(start_port(eight, &mhz8));
    assert_null(trace.sinks);
    assert_true(start_port(back, &mhz8));
    trace_set(&trace, 0, true, 125);  /* a: bit 6 */
    trace_set(&trace, 7, false, 125); /* not ours */
    trace_set(&trace, 5, false, 250); /* f: bit 1 */
    trace_advance(&trace, 375);
    assert_bytes(want, sizeof want);
    sampler_stop(&sampler);
}

static void nothing_is_watched_once_stopped_and_what_waits_stays(void **state)
{
    (void)state;
    assert_true(start_port(names, &mhz8));
    trace_advance(&trace, 250);
    sampler_stop(&sampler);
    assert_false(trace_watched(&trace, UINT64_MAX));
    const uint8_t want[] = {I, I};
    assert_bytes(want, sizeof want);
}

static void a_new_reader_starts_afresh_on_the_same_clock(void **state)
{
    (void)state;
    assert_true(start_port(names, &mhz8));
    trace_advance(&trace, next_ns(SAMPLER_RING - sampler.len) + 125);
    assert_int_equal(sampler.dropped, 1);
    sampler_stop(&sampler);
    trace_advance(&trace, 1000000000);
    assert_true(start_port(names, &sampler.clock));
    assert_int_equal(next_ns(0), 1000000000);
    assert_int_equal(sampler.dropped, 0);
    trace_advance(&trace, 1000000126);
    const uint8_t want[] = {I, I};
    assert_bytes(want, sizeof want);
}

/* Random edges, random takes, an odd clock: the same bytes as asking for the level at every sample. */
static void random_edges_equal_the_definition(void **state)
{
    (void)state;

    struct rng rng = rng_stream(rig_seed(5), 2, "test");
    const struct clk clock = {.t0_ns = 17, .hz = 7372800, .div = 1};
    trace_advance(&trace, 20);
    assert_true(start_port(names, &clock));
    static uint8_t got[400000], want[400000];
    static const uint8_t bit[4] = {0, D, C, I};
    uint8_t level = I;
    size_t made = 0, taken = 0;
    int64_t t_ns = 20;
    for (int i = 0; i < 100000; i++) {
        t_ns += (int64_t)(rng_u64(&rng) % 300);
        for (; clk_edge_ns(&clock, (int64_t)made + 1) < t_ns; made++) want[made] = level;
        const unsigned sig = (unsigned)(rng_u64(&rng) % 4);
        const bool up = rng_u64(&rng) & 1;
        level = (uint8_t)(up ? level | bit[sig] : level & ~bit[sig]);
        trace_set(&trace, sig, up, t_ns);
        trace_advance(&trace, t_ns);
        if (rng_u64(&rng) % 64 == 0) taken += sampler_take(&sampler, got + taken, (size_t)(rng_u64(&rng) % 200));
    }
    taken += sampler_take(&sampler, got + taken, sizeof got - taken);
    assert_int_equal(taken, made);
    assert_memory_equal(got, want, made);
    assert_int_equal(sampler.dropped, 0);
}

/* ---- the logic analyser's: two bytes a sample, holes of whole blocks */

static bool start_words(const char *const *lines, uint32_t block, size_t ring_bytes)
{
    const struct sampler_cfg cfg = {
        .clock = mhz8, .names = lines, .bytes = 2, .block = block, .ring = ring, .ring_bytes = ring_bytes};
    return sampler_start(&sampler, &trace, &cfg);
}

static void sixteen_lines_are_words_low_byte_first(void **state)
{
    static const char *const all[] = {"a", "b", "c", "d", "e", "f", "g", "h", "i",
                                      "j", "k", "l", "m", "n", "o", "p", "q", NULL};
    static const uint8_t want[] = {0x01, 0x00, 0x01, 0x80, 0x00, 0x81};
    (void)state;
    memset(&trace, 0, sizeof trace);
    for (unsigned i = 0; i < 17; i++) trace_add(&trace, all[i], i == 0);
    assert_false(start_words(all, 1, 64));
    assert_null(trace.sinks);
    trace.name[16] = "z";
    static const char *const sixteen[] = {"a", "b", "c", "d", "e", "f", "g", "h", "i",
                                          "j", "k", "l", "m", "n", "o", "p", NULL};
    assert_true(start_words(sixteen, 1, 64));
    trace_set(&trace, 15, true, 125);
    trace_put(&trace, TRACE_BIT(0) | TRACE_BIT(8), TRACE_BIT(8), 250);
    trace_advance(&trace, 375);
    assert_bytes(want, sizeof want);
    sampler_stop(&sampler);
}

/* What is taken is whole samples, whatever the room of who takes them. */
static void words_are_never_cut(void **state)
{
    (void)state;
    assert_true(start_words(names, 1, 64));
    trace_advance(&trace, 5 * 125);
    assert_int_equal(sampler_take(&sampler, buf, 1), 0);
    assert_int_equal(sampler_take(&sampler, buf, 5), 4);
    assert_int_equal(sampler_take(&sampler, buf, 99), 6);
    sampler_stop(&sampler);
}

static void a_hole_is_whole_blocks_and_the_time_axis_goes_on_behind_it(void **state)
{
    (void)state;
    assert_true(start_words(names, 8, 32)); /* room for 16 samples */
    trace_advance(&trace, 17 * 125);        /* the 17th begins a hole of 8 */
    assert_int_equal(sampler.dropped, 1);
    assert_int_equal(sampler.skip, 7);
    assert_int_equal(sampler_take(&sampler, buf, 32), 32);
    trace_set(&trace, 2, true, 20 * 125); /* within the hole: seen behind it */
    trace_advance(&trace, 26 * 125);
    assert_int_equal(sampler.dropped, 8);
    assert_int_equal(sampler.holes, 1);
    assert_int_equal(sampler.kept, 18);
    static const uint8_t want[] = {I | C, 0, I | C, 0};
    assert_bytes(want, sizeof want);
    trace_advance(&trace, (26 + 16 + 20) * 125); /* a long one: 20 lost make 24 */
    assert_int_equal(sampler_take(&sampler, buf, 32), 32);
    trace_advance(&trace, (26 + 16 + 24 + 1) * 125);
    assert_int_equal(sampler.dropped, 32);
    assert_int_equal(sampler.holes, 2);
    assert_int_equal(sampler.kept, 35);
    sampler_stop(&sampler);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_sample_is_the_level_valid_from_its_instant_on, fresh),
        cmocka_unit_test_setup(pulses_between_two_samples_are_not_seen, fresh),
        cmocka_unit_test(the_first_sample_has_a_known_instant),
        cmocka_unit_test_setup(a_slow_reader_loses_the_newest_samples_and_can_see_it, fresh),
        cmocka_unit_test(a_trace_without_the_lines_is_refused),
        cmocka_unit_test(a_board_chooses_up_to_seven_lines),
        cmocka_unit_test_setup(nothing_is_watched_once_stopped_and_what_waits_stays, fresh),
        cmocka_unit_test_setup(a_new_reader_starts_afresh_on_the_same_clock, fresh),
        cmocka_unit_test_setup(random_edges_equal_the_definition, fresh),
        cmocka_unit_test(sixteen_lines_are_words_low_byte_first),
        cmocka_unit_test_setup(words_are_never_cut, fresh),
        cmocka_unit_test_setup(a_hole_is_whole_blocks_and_the_time_axis_goes_on_behind_it, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
