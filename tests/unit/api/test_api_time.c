/* libpsabench: time, and callbacks that want to move it. */
#include "api_rig.h"

#include <math.h>

static void time_moves_as_told_and_no_further(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    assert_true(psabench_now_ns(b) == 0 && psabench_next_ns(b) == INT64_MAX);
    run(b, 0);
    run(b, 5);
    good(b, psabench_run_until(b, 5));
    assert_true(psabench_now_ns(b) == 5);
    psabench_part *p = part(b, "ads1256", "u", "start=at_once");
    const int64_t next_ns = psabench_next_ns(b);
    assert_true(next_ns > 5 && next_ns < INT64_MAX);
    assert_int_equal(psabench_run_until_level(p, pin(p, "DRDY"), 0, 1000), PSABENCH_TIMEOUT);
    assert_true(psabench_now_ns(b) == 1005);
    until(p, "DRDY", 0);
    const int64_t fell_ns = psabench_now_ns(b);
    until(p, "DRDY", 0); /* at once */
    assert_true(psabench_now_ns(b) == fell_ns);
    assert_int_equal(psabench_run_until_level(p, pin(p, "CS"), 0, 10), PSABENCH_TIMEOUT);
    assert_true(psabench_now_ns(b) == fell_ns + 10);
    good(b, psabench_run_until_level(p, pin(p, "CS"), 1, 0));
    psabench_free(b);
}

static void a_watcher_hears_each_change_at_its_instant(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1256", "u", "start=at_once");
    struct rig_seen s = {.p = p, .pin = pin(p, "DRDY")};
    good(b, psabench_watch(p, s.pin, rig_note, &s));
    run(b, 1000);
    assert_int_equal(s.count, 0); /* high it was and is: no change */
    good(b, psabench_watch(p, s.pin, NULL, NULL));
    until(p, "DRDY", 0);
    const int64_t first_ns = psabench_now_ns(b);
    good(b, psabench_watch(p, s.pin, rig_note, &s));
    run(b, 10 * 33334); /* ten words at 30 kSPS */
    assert_int_equal(s.wrong, 0);
    assert_int_equal(s.count, 20); /* unread: up 16 tau before each fall */
    for (unsigned i = 0; i < s.count; i++) {
        assert_int_equal(s.level[i], !(i & 1));
        const int64_t tau = (i / 2 + 1) * 256 - (s.level[i] ? 16 : 0);
        const int64_t want_ns = first_ns + tau * S / 7680000;
        if (s.t_ns[i] < want_ns || s.t_ns[i] > want_ns + 1) fail_msg("change %u at %" PRId64, i, s.t_ns[i]);
    }
    good(b, psabench_watch(p, s.pin, NULL, NULL));
    run(b, MS);
    assert_int_equal(s.count, 20);
    psabench_free(b);
}

/* What a callback tries and what it gets: everything that moves time, makes or records is refused, the rest works. */
struct callback {
    psabench_part *p, *other;
    unsigned calls, wrong;
    int set_own, set_other;
};

static void try_all(struct callback *c)
{
    psabench *b = psabench_of(c->p);
    uint8_t byte;
    const int results[] = {
        psabench_run_for(b, 1),
        psabench_run_until(b, psabench_now_ns(b) + 1),
        psabench_run_until_level(c->p, 0, 1, 1),
        psabench_spi(c->other, NULL, &byte, 1),
        psabench_vcd(b, "/tmp/never"),
        psabench_vcd_close(b),
    };
    for (size_t i = 0; i < COUNT(results); i++) c->wrong += results[i] != PSABENCH_BAD_ARGUMENT;
    c->wrong += psabench_part_new(b, "ads1256", "late", NULL) != NULL;
    c->wrong += psabench_get(c->p, 0) < 0 || psabench_peek(c->p, 0) < 0;
    psabench_free(b); /* does nothing here */
    c->set_own = psabench_set(c->p, pin(c->p, "SYNC"), 1);
    c->set_other = psabench_set(c->other, pin(c->other, "SYNC"), (int)(c->calls & 1));
    c->calls++;
}

static void in_watch(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    (void)p;
    (void)number;
    (void)level;
    (void)t_ns;
    try_all(ctx);
}

static double in_input(void *ctx, psabench_part *p, int input, int64_t t_ns)
{
    (void)t_ns;
    struct callback *c = ctx;
    try_all(c);
    c->wrong += psabench_set_volts(p, input, 1.0) != PSABENCH_BAD_ARGUMENT;
    c->wrong += psabench_set_input(p, NULL, NULL) != PSABENCH_BAD_ARGUMENT;
    return 0.5;
}

static void callbacks_may_look_and_set_pins_but_not_move_time(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    struct callback c = {.p = part(b, "ads1256", "u", "start=at_once"),
                         .other = part(b, "ads1256", "v", "start=at_once")};
    run(b, MS);
    good(b, psabench_watch(c.p, pin(c.p, "DRDY"), in_watch, &c));
    run(b, MS);
    assert_true(c.calls > 10);
    assert_int_equal(c.wrong, 0);
    assert_int_equal(c.set_own, PSABENCH_OK);
    assert_int_equal(c.set_other, PSABENCH_OK);
    assert_true(counter(c.other, "restarts") > 10);
    good(b, psabench_watch(c.p, pin(c.p, "DRDY"), NULL, NULL));
    c.calls = 0;
    good(b, psabench_set_input(c.p, in_input, &c));
    run(b, MS);
    assert_true(c.calls > 10);
    assert_int_equal(c.wrong, 0);
    assert_int_equal(c.set_own, PSABENCH_BAD_ARGUMENT); /* it waits for the volts */
    assert_int_equal(c.set_other, PSABENCH_OK);
    psabench_free(b);
}

/* D1 as an output follows its register; a watcher that answers each change with another must come to an end. */
static void answer(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    (void)p;
    (void)number;
    (void)t_ns;
    psabench_part **parts = ctx;
    for (int i = 0; i < 2; i++) (void)psabench_set(parts[i], pin(parts[i], "D1"), !level);
}

static void watchers_that_answer_each_other_for_ever_are_stopped(void **state)
{
    (void)state;
    psabench *b = psabench_new(1);
    psabench_part *parts[2] = {part(b, "ads1256", "u", NULL), part(b, "ads1256", "v", NULL)};
    for (int i = 0; i < 2; i++) good(b, psabench_watch(parts[i], pin(parts[i], "D1"), answer, parts));
    set(parts[0], "D1", 1);
    assert_non_null(strstr(psabench_error_text(b), "D1: expected a call outside nested callbacks of psabench_set()"));
    psabench_free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(time_moves_as_told_and_no_further),
        cmocka_unit_test(a_watcher_hears_each_change_at_its_instant),
        cmocka_unit_test(callbacks_may_look_and_set_pins_but_not_move_time),
        cmocka_unit_test(watchers_that_answer_each_other_for_ever_are_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
