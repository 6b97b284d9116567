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

/* The definition, written down: an array that is searched for the least (due, order of scheduling). */
enum { NAIVE_EVENTS = 400, NAIVE_OPS = 6000 };

static struct {
    struct rng r;
    int64_t due[NAIVE_EVENTS], stamp[NAIVE_EVENTS]; /* due -1: idle */
    int64_t ops;
    int fired;
    bool spread; /* few events at an instant; else many */
    int64_t until_ns;
} naive;

static int naive_first(void)
{
    int first = -1;
    for (int i = 0; i < NAIVE_EVENTS; i++) {
        if (naive.due[i] < 0) continue;
        if (first < 0 || naive.due[i] < naive.due[first] ||
            (naive.due[i] == naive.due[first] && naive.stamp[i] < naive.stamp[first]))
            first = i;
    }
    return first;
}

/* Arms or cancels some event, both here and there: near, far, at an instant that others have, in the past. */
static void touch_any(int64_t now_ns)
{
    static const int64_t reach_ns[] = {3, 20, 20, 1000, 100000, 2};
    const int i = (int)(rng_u64(&naive.r) % NAIVE_EVENTS);
    const uint64_t what = rng_u64(&naive.r) % 7;
    const int64_t grid_ns = naive.spread ? 1 : 500;
    if (what == 6) {
        sched_cancel(&rig.s, &rig.ev[i]);
        naive.due[i] = -1;
        return;
    }
    const int64_t ahead_ns = (int64_t)(rng_u64(&naive.r) % (uint64_t)(reach_ns[what] * grid_ns)) - (what == 5);
    const int64_t due_ns = (now_ns + ahead_ns) / grid_ns * grid_ns;
    sched_at(&rig.s, &rig.ev[i], due_ns);
    naive.due[i] = due_ns < now_ns ? now_ns : due_ns;
    naive.stamp[i] = naive.ops++;
}

static void fire_as_defined(void *ctx, int64_t t_ns)
{
    const int i = (int)((struct sched_ev *)ctx - rig.ev);
    assert_int_equal(i, naive_first());
    assert_int_equal(t_ns, naive.due[i]);
    naive.due[i] = -1;
    naive.fired++;
    const int64_t on_ns = t_ns + (int64_t)(rng_u64(&naive.r) % 40), limit_ns = naive.until_ns;
    const int first = naive_first();
    if (sched_go_on(&rig.s, on_ns)) {
        assert_true(on_ns <= limit_ns && (first < 0 || naive.due[first] > on_ns));
        t_ns = on_ns;
    }
    for (uint64_t n = rng_u64(&naive.r) % 3; n > 0 && naive.ops < 10 * NAIVE_OPS; n--) touch_any(t_ns);
}

static void naive_run(bool spread)
{
    fresh(NULL);
    naive.r = rng_stream(rig_seed(1), spread, "naive");
    naive.spread = spread;
    naive.ops = naive.fired = 0;
    for (int i = 0; i < NAIVE_EVENTS; i++) {
        sched_ev(&rig.ev[i], fire_as_defined, &rig.ev[i]);
        naive.due[i] = -1;
    }
    for (int op = 0; op < NAIVE_OPS; op++) {
        touch_any(rig.s.now_ns);
        const int first = naive_first();
        assert_int_equal(sched_next_ns(&rig.s), first < 0 ? SCHED_NEVER : naive.due[first]);
        naive.until_ns = rig.s.now_ns + (int64_t)(rng_u64(&naive.r) % 300);
        if (op % 1000 > NAIVE_EVENTS) sched_run_until(&rig.s, naive.until_ns);
    }
    assert_true(naive.fired > NAIVE_OPS / 2);
    naive.until_ns = INT64_MAX;
    sched_run_until(&rig.s, naive.until_ns);
    assert_int_equal(naive_first(), -1);
}

static void random_events_that_arm_and_cancel_others_run_as_defined(void **state)
{
    (void)state;
    naive_run(true);
    naive_run(false);
}

static void assert_ran_in_order(int n)
{
    assert_int_equal(rig.ran, n);
    for (int k = 1; k < n; k++) {
        assert_true(rig.at_ns[k - 1] <= rig.at_ns[k]);
        assert_true(rig.at_ns[k - 1] < rig.at_ns[k] || rig.order[k - 1] < rig.order[k]);
    }
}

/* Equal events on both sides of where the list was cut: still in the order of scheduling. */
static void equal_events_stay_in_order_when_the_list_is_cut(void **state)
{
    (void)state;
    enum { HALF = 200 };
    for (int i = 0; i < HALF; i++) sched_at(&rig.s, &rig.ev[i], 1000 * (1 + i / 40));
    for (int i = HALF; i < 2 * HALF; i++) sched_at(&rig.s, &rig.ev[i], 1000 * (1 + i % 5));
    sched_run_until(&rig.s, 1000);
    for (int i = 2 * HALF; i < 3 * HALF; i++) sched_at(&rig.s, &rig.ev[i], 1000 * (2 + i % 4));
    sched_run_until(&rig.s, 9000);
    assert_ran_in_order(3 * HALF);
}

/* They come back from the heap, and some of them go there again. */
static void equal_events_stay_in_order_when_they_go_to_and_fro(void **state)
{
    (void)state;
    enum { EQUAL = 100, BEFORE = 80 };
    for (int i = 0; i < EQUAL; i++) sched_at(&rig.s, &rig.ev[i], 10000);
    for (int round = 0; round < 3; round++) {
        const int first = EQUAL + round * BEFORE;
        for (int i = 0; i < BEFORE; i++) sched_at(&rig.s, &rig.ev[first + i], 1000 * round + 1 + i * 37 % BEFORE);
        sched_run_until(&rig.s, 1000 * round + 500);
    }
    assert_int_equal(rig.ran, 3 * BEFORE);
    sched_run_until(&rig.s, 10000);
    assert_ran_in_order(3 * BEFORE + EQUAL);
}

static void the_next_event_is_found_when_the_list_is_cancelled(void **state)
{
    (void)state;
    enum { MANY = 200 };
    int near = 0;
    for (int i = 0; i < MANY; i++) sched_at(&rig.s, &rig.ev[i], 1000 + i * 37 % MANY);
    for (int i = 0; i < MANY; i++) {
        if (rig.ev[i].queued != SCHED_NEAR) continue;
        sched_cancel(&rig.s, &rig.ev[i]);
        near++;
    }
    assert_in_range(near, 1, MANY - 1);
    const int64_t next_ns = sched_next_ns(&rig.s);
    assert_int_equal(next_ns, 1000 + near); /* those before it were in the list */
    sched_run_until(&rig.s, next_ns);
    assert_int_equal(rig.ran, 1);
}

/* A fleet: what is searched one by one does not grow with what is queued. */
static void of_thousands_of_events_few_are_in_the_list(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "many");
    for (int i = 0; i < EVENTS_MAX; i++) sched_at(&rig.s, &rig.ev[i], (int64_t)(rng_u64(&r) % 1000000));
    for (int op = 0; op < 10 * EVENTS_MAX; op++) {
        int listed = 0;
        for (const struct sched_ev *e = rig.s.first; e; e = e->next) listed++;
        assert_in_range(listed, 0, 100);
        sched_at(&rig.s, &rig.ev[op % EVENTS_MAX], rig.s.now_ns + (int64_t)(rng_u64(&r) % 1000000));
        rig.ran = 0;
        sched_run_until(&rig.s, rig.s.now_ns + 100);
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

/* ---- the next look ---- */

enum { LOOKERS = 300, LOOKS_END_NS = 100000 };

static struct {
    struct sched s;
    struct sched_ev step, ev[LOOKERS];
    struct rng r;
    unsigned far; /* times that the next look was in the heap */
} looks;

static void do_nothing(void *ctx, int64_t t_ns)
{
    (void)ctx, (void)t_ns;
}

static void check_look(void *ctx, int64_t t_ns)
{
    (void)ctx;
    int64_t next_ns = LOOKS_END_NS;
    for (unsigned i = 0; i < LOOKERS; i++) {
        const struct sched_ev *e = &looks.ev[i];
        if (e->inner || !e->queued || e->due_ns >= next_ns) continue;
        next_ns = e->due_ns;
        looks.far += e->queued == SCHED_FAR;
    }
    assert_int_equal(sched_look_ns(&looks.s), next_ns);
    looks.s.any_time = 1;
    assert_int_equal(sched_look_ns(&looks.s), t_ns);
    looks.s.any_time = 0;
    for (unsigned n = 0; n < 5; n++) {
        struct sched_ev *e = &looks.ev[rng_u64(&looks.r) % LOOKERS];
        if (rng_u64(&looks.r) % 2) sched_cancel(&looks.s, e);
        else sched_at(&looks.s, e, t_ns + (int64_t)(rng_u64(&looks.r) % 40000));
    }
    sched_at(&looks.s, &looks.step, t_ns + 10);
}

static void the_next_look_is_the_first_event_that_is_not_inner_wherever_it_waits(void **state)
{
    (void)state;
    looks.r = rng_stream(rig_seed(1), 0, "looks");
    sched_init(&looks.s);
    sched_ev_inner(&looks.step, check_look, NULL);
    for (unsigned i = 0; i < LOOKERS; i++) (i % 30 ? sched_ev_inner : sched_ev)(&looks.ev[i], do_nothing, NULL);
    sched_at(&looks.s, &looks.step, 0);
    sched_run_until(&looks.s, LOOKS_END_NS);
    assert_true(looks.far > 100);
    assert_int_equal(sched_look_ns(&looks.s), LOOKS_END_NS); /* outside of a run: now */
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
        cmocka_unit_test_setup(equal_events_stay_in_order_when_the_list_is_cut, fresh),
        cmocka_unit_test_setup(equal_events_stay_in_order_when_they_go_to_and_fro, fresh),
        cmocka_unit_test_setup(the_next_event_is_found_when_the_list_is_cancelled, fresh),
        cmocka_unit_test_setup(of_thousands_of_events_few_are_in_the_list, fresh),
        cmocka_unit_test(the_next_look_is_the_first_event_that_is_not_inner_wherever_it_waits),
        cmocka_unit_test_setup(random_events_that_arm_and_cancel_others_run_as_defined, fresh),
    };
    return cmocka_run_group_tests_name("sched", tests, NULL, NULL);
}
