#include "rig.h"

#include "base/rng.h"
#include "base/sched.h"

#define EVENTS_MAX 2000

struct rig {
    struct sched s;
    struct sched_ev ev[EVENTS_MAX];
    int order[EVENTS_MAX];
    int64_t at_ns[EVENTS_MAX];
    int ran;
};

static struct rig rig; /* the event that fires finds its number by its address */

static void record(void *ctx, int64_t t_ns)
{
    struct sched_ev *e = ctx;
    rig.order[rig.ran] = (int)(e - rig.ev);
    rig.at_ns[rig.ran++] = t_ns;
}

static int fresh(void **state)
{
    (void)state;
    rig = (struct rig){0};
    sched_init(&rig.s);
    for (int i = 0; i < EVENTS_MAX; i++) sched_ev(&rig.ev[i], record, &rig.ev[i]);
    return 0;
}

static void ties_run_in_the_order_of_scheduling(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++) sched_at(&rig.s, &rig.ev[4 - i], 100);
    sched_run_until(&rig.s, 100);
    for (int i = 0; i < 5; i++) assert_int_equal(rig.order[i], 4 - i);
}

static void rearming_moves_and_cancelling_an_idle_event_is_harmless(void **state)
{
    (void)state;
    sched_at(&rig.s, &rig.ev[0], 10);
    sched_at(&rig.s, &rig.ev[1], 20);
    sched_at(&rig.s, &rig.ev[0], 30);
    sched_cancel(&rig.s, &rig.ev[7]);
    sched_run_until(&rig.s, 25);
    assert_int_equal(rig.ran, 1);
    assert_int_equal(rig.order[0], 1);
    sched_cancel(&rig.s, &rig.ev[0]);
    sched_cancel(&rig.s, &rig.ev[0]);
    sched_run_until(&rig.s, 99);
    assert_int_equal(rig.ran, 1);
    assert_int_equal(rig.s.now_ns, 99);
}

static void the_past_is_clamped_to_now(void **state)
{
    (void)state;
    sched_run_until(&rig.s, 500);
    sched_at(&rig.s, &rig.ev[3], 10);
    assert_int_equal(sched_next_ns(&rig.s), 500);
    sched_run_until(&rig.s, 500);
    assert_int_equal(rig.at_ns[0], 500);
}

static void an_event_due_exactly_at_the_limit_runs(void **state)
{
    (void)state;
    sched_at(&rig.s, &rig.ev[0], 1000);
    sched_run_until(&rig.s, 999);
    assert_int_equal(rig.ran, 0);
    sched_run_until(&rig.s, 1000);
    assert_int_equal(rig.ran, 1);
    assert_int_equal(sched_next_ns(&rig.s), SCHED_NEVER);
}

/* Random arming, moving and cancelling against the definition: sorted by (due, order of scheduling). */
static void random_schedules_come_out_in_total_order(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "sched");
    int64_t due[EVENTS_MAX];
    int64_t stamp[EVENTS_MAX];
    for (int i = 0; i < EVENTS_MAX; i++) due[i] = -1;
    for (int op = 0; op < 6 * EVENTS_MAX; op++) {
        const int i = (int)(rng_u64(&r) % EVENTS_MAX);
        if (rng_u64(&r) % 4 == 0) {
            sched_cancel(&rig.s, &rig.ev[i]);
            due[i] = -1;
        } else {
            due[i] = (int64_t)(rng_u64(&r) % 200);
            stamp[i] = op;
            sched_at(&rig.s, &rig.ev[i], due[i]);
        }
    }
    int expected = 0;
    for (int i = 0; i < EVENTS_MAX; i++) expected += due[i] >= 0;
    sched_run_until(&rig.s, 200);
    assert_int_equal(rig.ran, expected);
    for (int k = 1; k < rig.ran; k++) {
        const int a = rig.order[k - 1];
        const int b = rig.order[k];
        assert_true(due[a] < due[b] || (due[a] == due[b] && stamp[a] < stamp[b]));
    }
}

/* Four events with periods of 3, 4, 6 and 7 ns: ties, and stretches in which one of them is alone. */
static bool going_on;

static void tick(void *ctx, int64_t t_ns)
{
    static const int64_t period_ns[] = {3, 4, 6, 7};
    struct sched_ev *e = ctx;
    do {
        assert_int_equal(rig.s.now_ns, t_ns);
        record(e, t_ns);
        t_ns += t_ns % 50 < 40 ? 1 : period_ns[e - rig.ev];
    } while (going_on && sched_go_on(&rig.s, t_ns));
    sched_at(&rig.s, e, t_ns);
}

static void run_ticks(bool go_on)
{
    fresh(NULL);
    going_on = go_on;
    for (int i = 0; i < 4; i++) {
        sched_ev(&rig.ev[i], tick, &rig.ev[i]);
        sched_at(&rig.s, &rig.ev[i], 10 * i);
    }
    for (int64_t t_ns = 0; t_ns <= 400; t_ns += 17) {
        sched_run_until(&rig.s, t_ns);
        assert_int_equal(rig.s.now_ns, t_ns);
        for (int i = 0; i < 4; i++) assert_true(rig.ev[i].queued && rig.ev[i].due_ns > t_ns);
    }
}

static void going_on_is_what_arming_does(void **state)
{
    (void)state;
    static struct rig armed;
    run_ticks(false);
    armed = rig;
    run_ticks(true);
    assert_int_equal(rig.ran, armed.ran);
    assert_true(rig.ran > 400);
    for (int i = 0; i < rig.ran; i++) {
        assert_int_equal(rig.order[i], armed.order[i]);
        assert_int_equal(rig.at_ns[i], armed.at_ns[i]);
    }
    assert_false(sched_go_on(&rig.s, rig.s.now_ns)); /* outside a run nothing moves */
}

static void stop(void *ctx, int64_t t_ns)
{
    record(ctx, t_ns);
    sched_stop(&rig.s);
    assert_false(sched_go_on(&rig.s, t_ns + 1));
}

static void a_run_that_is_stopped_ends_as_if_asked_for_that_instant(void **state)
{
    (void)state;
    sched_stop(&rig.s); /* outside a run: not remembered */
    assert_false(sched_go_on(&rig.s, 0));
    for (int i = 0; i < 5; i++) sched_at(&rig.s, &rig.ev[i], i < 4 ? 10 + 10 * (i > 0) : 21);
    sched_ev(&rig.ev[5], stop, &rig.ev[5]);
    sched_at(&rig.s, &rig.ev[5], 15);
    sched_run_until(&rig.s, 100);
    assert_int_equal(rig.s.now_ns, 15);
    assert_int_equal(rig.ran, 2);
    sched_at(&rig.s, &rig.ev[5], 20);
    sched_at(&rig.s, &rig.ev[6], 20);
    sched_run_until(&rig.s, 100);
    assert_int_equal(rig.s.now_ns, 20);
    assert_int_equal(rig.ran, 7); /* 1, 2, 3, then the one that stops, then one more of 20 ns */
    assert_int_equal(rig.order[6], 6);
    assert_true(rig.ev[4].queued);
    sched_run_until(&rig.s, 100);
    assert_int_equal(rig.s.now_ns, 100);
    assert_int_equal(rig.ran, 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(ties_run_in_the_order_of_scheduling, fresh),
        cmocka_unit_test_setup(rearming_moves_and_cancelling_an_idle_event_is_harmless, fresh),
        cmocka_unit_test_setup(the_past_is_clamped_to_now, fresh),
        cmocka_unit_test_setup(an_event_due_exactly_at_the_limit_runs, fresh),
        cmocka_unit_test_setup(going_on_is_what_arming_does, fresh),
        cmocka_unit_test_setup(a_run_that_is_stopped_ends_as_if_asked_for_that_instant, fresh),
        cmocka_unit_test_setup(random_schedules_come_out_in_total_order, fresh),
    };
    return cmocka_run_group_tests_name("sched", tests, NULL, NULL);
}
