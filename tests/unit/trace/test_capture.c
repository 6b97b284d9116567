/* Ring capture: pre-trigger, post-trigger, triggers of lines and from outside, a bounded ring. */
#include "rig.h"

#include "base/rng.h"
#include "trace/capture.h"

#include <string.h>

#define INT 0
#define CLK 1

static struct trace trace;
static struct capture capture;
static struct trace_step ring[5000];
static struct trace copy;
static char text[1 << 16];

static int fresh(void **state)
{
    (void)state;
    capture_off(&capture);
    memset(&trace, 0, sizeof trace);
    trace_add(&trace, "Int", true);
    trace_add(&trace, "CLK", false);
    return 0;
}

static void arm(enum capture_when when, unsigned sig, int64_t pre_ns, int64_t post_ns, unsigned steps_max)
{
    const struct capture_cfg cfg = {.pre_ns = pre_ns,
                                    .post_ns = post_ns,
                                    .mask = 3,
                                    .sig = sig,
                                    .when = when,
                                    .ring = ring,
                                    .steps_max = steps_max,
                                    .copy = &copy};
    capture_arm(&capture, &trace, &cfg);
}

/* An edge of CLK every 100 ns from from_ns on, n of them, delivered. */
static void run_clock(int64_t from_ns, unsigned n)
{
    for (unsigned i = 0; i < n; i++) trace_set(&trace, CLK, !(i & 1), from_ns + (int64_t)i * 100);
    trace_advance(&trace, from_ns + (int64_t)n * 100 - 1);
}

static FILE *begin_file(void)
{
    FILE *f = tmpfile();
    assert_non_null(f);
    capture_begin(&capture, &(struct vcd_cfg){.out = f, .scope = "u", .unit_ns = 1});
    return f;
}

/* What follows the header. */
static const char *edges_of(FILE *f)
{
    rewind(f);
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    const char *const end = strstr(text, "$enddefinitions $end\n");
    assert_non_null(end);
    return end + strlen("$enddefinitions $end\n");
}

static void a_trigger_from_outside_has_what_was_before_it_and_what_comes(void **state)
{
    (void)state;
    arm(CAPTURE_OUTSIDE, 0, 250, 150, 1000);
    run_clock(1000, 10); /* 1000 .. 1900 */
    assert_int_equal(capture.state, CAPTURE_ARMED);
    capture_trigger(&capture, 2000);
    assert_int_equal(capture.state, CAPTURE_TRIGGERED);
    FILE *f = begin_file();
    assert_int_equal(capture.from_ns, 1750);
    assert_int_equal(capture.state, CAPTURE_WRITING);
    run_clock(2000, 1);
    capture_drain(&capture);
    assert_int_equal(capture.state, CAPTURE_WRITING); /* up to 2099 */
    trace_set(&trace, INT, false, 2150);              /* its last instant is in */
    trace_set(&trace, INT, true, 2151);
    trace_advance(&trace, 2200);
    capture_drain(&capture);
    assert_int_equal(capture.state, CAPTURE_FULL);
    capture_end(&capture);
    assert_string_equal(edges_of(f),
                        "#1750\n$dumpvars\n1!\n0\"\n$end\n#1800\n1\"\n#1900\n0\"\n#2000\n1\"\n#2150\n0!\n#2151\n");
    assert_int_equal(capture.state, CAPTURE_ARMED);
    assert_int_equal(capture.lost, 0);
}

static void a_line_triggers_at_its_own_instant(void **state)
{
    (void)state;
    static const struct {
        enum capture_when when;
        int64_t trigger_ns;
    } row[] = {
        {CAPTURE_RISING, 300}, {CAPTURE_FALLING, 200}, {CAPTURE_EDGE, 200}, {CAPTURE_HIGH, 100}, {CAPTURE_LOW, 200}};
    for (size_t i = 0; i < COUNT(row); i++) {
        fresh(NULL);
        trace_advance(&trace, 100);
        arm(row[i].when, INT, 50, 50, 100);
        assert_int_equal(capture.state, row[i].when == CAPTURE_HIGH ? CAPTURE_TRIGGERED : CAPTURE_ARMED);
        trace_set(&trace, CLK, true, 150); /* not the line */
        trace_set(&trace, INT, false, 200);
        trace_set(&trace, INT, true, 300);
        trace_advance(&trace, 1000); /* all in one delivery */
        assert_int_equal(capture.state, CAPTURE_TRIGGERED);
        assert_int_equal(capture.trigger_ns, row[i].trigger_ns);
        FILE *f = begin_file();
        assert_int_equal(capture.state, CAPTURE_FULL);
        assert_int_equal(capture.from_ns, row[i].trigger_ns == 100 ? 100 : row[i].trigger_ns - 50);
        capture_end(&capture);
        fclose(f);
    }
}

static void armed_again_it_has_the_end_of_the_last_capture_as_its_pre_trigger(void **state)
{
    (void)state;
    arm(CAPTURE_FALLING, INT, 250, 50, 1000);
    trace_set(&trace, INT, false, 500);
    trace_set(&trace, INT, true, 510);
    trace_set(&trace, CLK, true, 600);
    trace_advance(&trace, 650);
    FILE *first = begin_file();
    capture_end(&capture);
    fclose(first);
    trace_set(&trace, INT, false, 700);
    trace_advance(&trace, 800);
    assert_int_equal(capture.trigger_ns, 700);
    assert_int_equal(capture.triggers, 2);
    FILE *f = begin_file();
    /* what the first file took is no longer in the ring */
    assert_int_equal(capture.from_ns, 510);
    capture_end(&capture);
    assert_string_equal(edges_of(f), "#510\n$dumpvars\n1!\n0\"\n$end\n#600\n1\"\n#700\n0!\n#750\n");
}

/* The ring is small: the pre-trigger is shorter, says so, and begins with the right levels. */
static void a_small_ring_shortens_the_pre_trigger_and_says_so(void **state)
{
    (void)state;
    arm(CAPTURE_OUTSIDE, 0, 1000000, 10, 4);
    run_clock(1000, 9); /* ends high, at 1800 */
    capture_trigger(&capture, 1850);
    FILE *f = begin_file();
    assert_int_equal(capture.from_ns, 1400); /* the edge there is in the first levels */
    trace_advance(&trace, 2000);
    capture_drain(&capture);
    capture_end(&capture);
    assert_string_equal(edges_of(f),
                        "#1400\n$dumpvars\n1!\n1\"\n$end\n#1500\n0\"\n#1600\n1\"\n#1700\n0\"\n#1800\n1\"\n#1860\n");
}

static void edges_that_find_no_room_on_their_way_to_the_file_are_counted(void **state)
{
    (void)state;
    arm(CAPTURE_OUTSIDE, 0, 0, 100000, 4);
    trace_advance(&trace, 900);
    capture_trigger(&capture, 1000);
    FILE *f = begin_file();
    run_clock(1000, 10);
    assert_int_equal(capture.lost, 6);
    capture_drain(&capture);
    capture_end(&capture);
    assert_int_equal(capture.end_ns, 1999); /* ended early, by the owner */
    fclose(f);
}

static void triggers_during_a_capture_are_counted_and_change_nothing(void **state)
{
    (void)state;
    arm(CAPTURE_OUTSIDE, 0, 10, 500, 100);
    trace_advance(&trace, 1000);
    capture_trigger(&capture, 1000);
    capture_trigger(&capture, 1100);
    FILE *f = begin_file();
    capture_trigger(&capture, 1200);
    assert_int_equal(capture.trigger_ns, 1000);
    assert_int_equal(capture.triggers, 3);
    trace_advance(&trace, 2000);
    capture_drain(&capture);
    assert_int_equal(capture.state, CAPTURE_FULL);
    capture_end(&capture);
    assert_int_equal(capture.end_ns, 1500);
    fclose(f);
}

static void nothing_is_watched_when_it_is_off(void **state)
{
    (void)state;
    arm(CAPTURE_OUTSIDE, 0, 10, 10, 100);
    assert_true(trace_watched(&trace, 3));
    capture_off(&capture);
    assert_false(trace_watched(&trace, 3));
    capture_trigger(&capture, 5);
    assert_int_equal(capture.state, CAPTURE_OFF);
    capture_off(&capture);
}

/* Levels of both lines at each ns of a file's text, from its first time to the last. */
static int64_t levels_of(const char *edges, uint8_t *level, int64_t *first_ns)
{
    int64_t t_ns = -1;
    uint8_t now = 0;
    *first_ns = -1;
    for (const char *at = edges; *at; at += strcspn(at, "\n") + 1) {
        if (*at == '#') {
            const int64_t to_ns = strtoll(at + 1, NULL, 10);
            for (; t_ns >= 0 && t_ns < to_ns; t_ns++) level[t_ns] = now;
            t_ns = to_ns;
            if (*first_ns < 0) *first_ns = to_ns;
        } else if (*at == '0' || *at == '1') {
            const uint8_t bit = (uint8_t)(1u << (at[1] - '!'));
            now = (uint8_t)(*at == '1' ? now | bit : now & ~bit);
        }
    }
    return t_ns;
}

/* Random edges, deliveries and triggers: the file has the levels of a recording of the same lines, within its window. */
static void random_captures_equal_a_recording(void **state)
{
    (void)state;
    struct rng rng = rng_stream(rig_seed(7), 1, "test");
    static uint8_t got[20000], want[20000];
    static struct vcd vcd;
    for (int round = 0; round < 200; round++) {
        fresh(NULL);
        arm(CAPTURE_OUTSIDE, 0, 2000, 3000, 5000);
        FILE *whole = tmpfile(), *f = NULL;
        const struct vcd_cfg cfg = {.out = whole, .scope = "u", .unit_ns = 1, .mask = 3};
        assert_true(vcd_open(&vcd, &cfg, &trace));
        const int64_t trigger_ns = 3000 + (int64_t)(rng_u64(&rng) % 4000);
        for (int64_t t_ns = 0; t_ns < 12000; t_ns += (int64_t)(rng_u64(&rng) % 100)) {
            trace_set(&trace, (unsigned)(rng_u64(&rng) % 2), rng_u64(&rng) & 1, t_ns);
            if (rng_u64(&rng) % 8) continue;
            trace_advance(&trace, t_ns);
            if (!f && t_ns >= trigger_ns) {
                capture_trigger(&capture, trigger_ns);
                f = begin_file();
            }
            capture_drain(&capture);
        }
        trace_advance(&trace, 12000);
        capture_drain(&capture);
        assert_int_equal(capture.state, CAPTURE_FULL);
        capture_end(&capture);
        vcd_close(&vcd, 12000);
        int64_t from_ns, zero_ns;
        const int64_t end_ns = levels_of(edges_of(f), got, &from_ns);
        assert_int_equal(from_ns, trigger_ns - 2000);
        assert_in_range(end_ns, trigger_ns + 3000, trigger_ns + 3001);
        (void)levels_of(edges_of(whole), want, &zero_ns);
        assert_memory_equal(got + from_ns, want + from_ns, (size_t)(end_ns - from_ns));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_trigger_from_outside_has_what_was_before_it_and_what_comes, fresh),
        cmocka_unit_test(a_line_triggers_at_its_own_instant),
        cmocka_unit_test_setup(armed_again_it_has_the_end_of_the_last_capture_as_its_pre_trigger, fresh),
        cmocka_unit_test_setup(a_small_ring_shortens_the_pre_trigger_and_says_so, fresh),
        cmocka_unit_test_setup(edges_that_find_no_room_on_their_way_to_the_file_are_counted, fresh),
        cmocka_unit_test_setup(triggers_during_a_capture_are_counted_and_change_nothing, fresh),
        cmocka_unit_test_setup(nothing_is_watched_when_it_is_off, fresh),
        cmocka_unit_test(random_captures_equal_a_recording),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
