/* Events of the board, power that fails in the middle of things, and a controller that does its work wrong. */
#include "base/rng.h"
#include "board/psa2/event.h"
#include "psa2_rig.h"

#define EVENTS_MAX 4096u

struct told {
    enum psa2_event e;
    int64_t t_ns;
};

static struct rig rig;
static struct told told[EVENTS_MAX];
static unsigned tolds;

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    (void)ctx;
    assert_int_equal(t_ns, rig.s.now_ns); /* at the very instant */
    if (tolds < EVENTS_MAX) told[tolds++] = (struct told){(enum psa2_event)e, t_ns};
}

static void init(bool watched, bool events)
{
    const struct psa2_profile p = psa2_profile_file("article");
    rig_init(&rig, &p, 1.0);
    tolds = 0;
    rig.b.base.io.event = on_event;
    rig.b.base.observed = events;
    if (watched) trace_attach(&rig.b.base.trace, &rig.sink);
    rig.edges = 0; /* without the levels at the beginning */
}

static void up_to(int64_t t_ns)
{
    rig_run(&rig, t_ns - rig.s.now_ns);
}

static void await_frames(unsigned frames)
{
    for (int ms = 0; ms < 500 && rig.frames < frames; ms++) rig_run(&rig, 1000000);
    assert_true(rig.frames >= frames);
}

static unsigned events(enum psa2_event e)
{
    unsigned n = 0;
    for (unsigned i = 0; i < tolds; i++) n += told[i].e == e;
    return n;
}

/* Each event has its edge and each edge its event, up to an instant that the trace has delivered. */
static void match(enum psa2_event e, enum psa2_line line, bool level, int64_t until_ns)
{
    unsigned i = 0, n = 0;
    for (unsigned k = 0; k < rig.edges; k++) {
        const struct rig_edge *at = &rig.edge[k];
        if (at->sig != line || at->level != level || at->t_ns >= until_ns) continue;
        while (i < tolds && told[i].e != e) i++;
        assert_true(i < tolds);
        assert_int_equal(told[i++].t_ns, at->t_ns);
        n++;
    }
    while (i < tolds && (told[i].e != e || told[i].t_ns >= until_ns)) i++;
    assert_int_equal(i, tolds);
    if (n == 0) fail_msg("no %s", psa2_events[e]);
}

/* ---- events */

static void each_event_is_told_at_its_edge(void **state)
{
    (void)state;
    init(true, true);
    psa2_power_up(&rig.b, 0);
    rig_run(&rig, 200000000);
    psa2_reset(&rig.b, rig.s.now_ns);
    rig_run(&rig, 200000000);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    const int64_t end_ns = rig.s.now_ns - 100000; /* the start of a frame was reported, and its fall is drawn later */
    match(PSA2_EV_RES, PSA2_LINE_RES, false, end_ns);
    match(PSA2_EV_SYNC_A, PSA2_LINE_SYNC_A, true, end_ns);
    match(PSA2_EV_SYNC_T, PSA2_LINE_SYNC_T, true, end_ns);
    match(PSA2_EV_DRD_A, PSA2_LINE_DRD_A, false, end_ns);
    match(PSA2_EV_DRD_T, PSA2_LINE_DRD_T, false, end_ns);
    match(PSA2_EV_INT_FALL, PSA2_LINE_INT, false, end_ns);
    match(PSA2_EV_INT_RISE, PSA2_LINE_INT, true, end_ns);
    assert_int_equal(events(PSA2_EV_POWER_UP), 1);
    assert_int_equal(events(PSA2_EV_SETUP_DONE), 2);
    assert_int_equal(events(PSA2_EV_INT_RISE), rig.frames);
    assert_int_equal(told[0].e, PSA2_EV_POWER_UP);
}

static void events_and_frames_are_the_same_unwatched_and_unheard(void **state)
{
    (void)state;
    static struct told watched[EVENTS_MAX];
    static struct psa2_frame frame[64];
    unsigned n = 0, frames = 0;
    for (int k = 0; k < 3; k++) {
        init(k == 0, k < 2);
        psa2_power_up(&rig.b, 0);
        rig_run(&rig, 160000000);
        if (k == 0) {
            memcpy(watched, told, sizeof watched);
            memcpy(frame, rig.frame, sizeof frame);
            n = tolds;
            frames = rig.frames;
        }
        assert_int_equal(tolds, k < 2 ? n : 0);
        for (unsigned i = 0; i < tolds; i++) {
            assert_int_equal(told[i].e, watched[i].e);
            assert_int_equal(told[i].t_ns, watched[i].t_ns);
        }
        assert_int_equal(rig.frames, frames);
        for (unsigned i = 0; i < frames && i < COUNT(frame); i++) {
            assert_memory_equal(rig.frame[i].word, frame[i].word, sizeof frame[i].word);
            assert_int_equal(rig.frame[i].t_int_fall_ns, frame[i].t_int_fall_ns);
        }
    }
}

static void an_event_has_one_name_and_a_name_one_event(void **state)
{
    (void)state;
    for (unsigned e = 0; e < PSA2_EVENTS; e++)
        for (unsigned other = 0; other < e; other++) assert_string_not_equal(psa2_events[e], psa2_events[other]);
}

/* ---- power */

static void assert_dark(void)
{
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    assert_int_equal(rig.b.base.trace.level & ~rig.b.base.trace.wires, 0); /* B is the inverse of A, always */
    assert_true(sched_next_ns(&rig.s) == SCHED_NEVER);                     /* nothing goes on */
    assert_false(psa2_ready(&rig.b));
    assert_int_equal(rig.b.tadc.mode, ADS1256_OFF);
    for (int i = 0; i < 3; i++) assert_false(rig.b.adc[i].alive);
}

/* At one instant a line changes once. */
static void assert_single_changes(int64_t t_ns)
{
    uint32_t seen = 0;
    for (unsigned i = 0; i < rig.edges; i++) {
        if (rig.edge[i].t_ns != t_ns) continue;
        assert_false(seen >> rig.edge[i].sig & 1);
        seen |= UINT32_C(1) << rig.edge[i].sig;
    }
}

static void power_fails_in_the_middle_of_a_frame(void **state)
{
    (void)state;
    init(true, true);
    psa2_power_up(&rig.b, 0);
    await_frames(5);
    const unsigned falls = events(PSA2_EV_INT_FALL);
    while (events(PSA2_EV_INT_FALL) == falls) sched_run_until(&rig.s, sched_next_ns(&rig.s));
    const int64_t fall_ns = rig.s.now_ns;
    up_to(fall_ns + 30000);
    trace_advance(&rig.b.base.trace, fall_ns - 1);
    rig.edges = 0;
    const uint32_t frames = rig.b.counters.frames;
    psa2_power_down(&rig.b, rig.s.now_ns);
    assert_dark();
    assert_single_changes(fall_ns + 30000);
    unsigned pulses = 0;
    for (unsigned i = 0; i < rig.edges; i++) {
        const struct rig_edge *e = &rig.edge[i];
        pulses += e->sig == PSA2_LINE_CLK && e->level;
        assert_true(e->sig != PSA2_LINE_INT || !e->level); /* it does not rise */
        assert_true(e->t_ns <= fall_ns + 30000);
    }
    /* 8 CLK of 500 ns lead in, then a word of 32 and a gap of 4: 30 us hold 32 and 16 pulses */
    assert_int_equal(pulses, 32 + 16);
    assert_int_equal(rig.b.counters.frames, frames);
    assert_int_equal(told[tolds - 2].e, PSA2_EV_RES);
    assert_int_equal(told[tolds - 1].e, PSA2_EV_POWER_DOWN);
    rig_run(&rig, 1000000000);
    assert_dark();
    psa2_power_down(&rig.b, rig.s.now_ns); /* once more is nothing */
    psa2_reset(&rig.b, rig.s.now_ns);
    assert_dark();
}

static void after_power_up_all_begins_anew(void **state)
{
    (void)state;
    init(true, true);
    psa2_power_up(&rig.b, 0);
    await_frames(3);
    const int64_t first_ns = rig.frame[0].t_sample_ns;
    struct psa2_request q = {.group = PSA2_ACCEL, .op = PSA2_WRITE_REG, .addr = ADS1282_OFC0, .value = 0x55};
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    psa2_power_down(&rig.b, rig.s.now_ns);
    up_to(1000000000); /* the clocks' edges fall as at 0 */
    const unsigned before = rig.frames;
    rig.edges = 0;
    psa2_power_up(&rig.b, rig.s.now_ns);
    await_frames(before + 3);
    assert_int_equal(rig.edge[0].t_ns, 1000000000);
    assert_single_changes(1000000000);
    const struct psa2_frame *f = &rig.frame[before];
    assert_int_equal(f->t_sample_ns - 1000000000, first_ns);
    assert_int_equal(f->seq, rig.frame[0].seq);
    q = (struct psa2_request){.group = PSA2_ACCEL, .op = PSA2_READ_REG, .addr = ADS1282_OFC0};
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    assert_int_equal(q.answer[0], 0x00);
    assert_int_equal(rig.b.counters.resets, 0);
    assert_int_equal(rig.faults, 0);
}

static void a_request_under_way_ends_with_the_power(void **state)
{
    (void)state;
    init(false, false);
    psa2_power_up(&rig.b, 0);
    await_frames(2);
    struct psa2_request q = {.group = PSA2_TEMP, .op = PSA2_READ_REG, .addr = 0, .done = rig_done, .ctx = &rig};
    assert_int_equal(psa2_submit(&rig.b, &q, rig.s.now_ns), PSA2_OK);
    psa2_power_down(&rig.b, rig.s.now_ns);
    assert_true(rig.answered);
    assert_int_equal(rig.result, PSA2_TIMEOUT);
    assert_int_equal(psa2_submit(&rig.b, &q, rig.s.now_ns), PSA2_BUSY);
}

/* In bursts, pulses, frames and waits of set-up, scan and stream, watched and not. */
static void power_may_fail_at_any_instant(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(5), 0, "power");
    for (int k = 0; k < 60; k++) {
        init(k & 1, k & 2);
        psa2_power_up(&rig.b, 0);
        const bool setup = k % 3 == 0;
        if (!setup) up_to(126000000);
        up_to(rig.s.now_ns + (int64_t)(rng_u64(&r) % (setup ? 126000000 : 14000000)));
        psa2_power_down(&rig.b, rig.s.now_ns);
        assert_dark();
        if (k & 1) assert_single_changes(rig.s.now_ns);
        const unsigned frames = rig.frames;
        rig_run(&rig, 1000000);
        psa2_power_up(&rig.b, rig.s.now_ns);
        if (k % 6 == 0) await_frames(frames + 2);
        else assert_int_equal(rig.b.mode, PSA2_IN_RESET);
    }
}

static void power_may_fail_in_reset_and_before_a_frame_begins(void **state)
{
    (void)state;
    init(true, true);
    psa2_power_up(&rig.b, 0);
    up_to(5000); /* Res is low */
    psa2_power_down(&rig.b, rig.s.now_ns);
    assert_dark();
    up_to(1000000);
    assert_dark();
    psa2_power_up(&rig.b, rig.s.now_ns);
    await_frames(2);
    while (!rig.b.out.fall.queued) sched_run_until(&rig.s, sched_next_ns(&rig.s));
    const unsigned falls = events(PSA2_EV_INT_FALL);
    psa2_power_down(&rig.b, rig.s.now_ns); /* between the read and the edge of the line's clock */
    assert_dark();
    assert_int_equal(events(PSA2_EV_INT_FALL), falls);
}

/* ---- the controller */

static void without_sync_t_the_pin_rests_and_the_scan_goes_on(void **state)
{
    (void)state;
    init(true, true);
    psa2_power_up(&rig.b, 0);
    await_frames(20);
    assert_true(events(PSA2_EV_SYNC_T) > 0);
    rig.b.base.faults = PSA2_FAULT_SKIP_SYNC_T;
    rig_run(&rig, 1000000); /* a pulse that had begun ends */
    const unsigned pulses = events(PSA2_EV_SYNC_T), words = events(PSA2_EV_DRD_T);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    rig.edges = 0;
    rig_run(&rig, 300000000);
    assert_int_equal(events(PSA2_EV_SYNC_T), pulses);
    assert_true(events(PSA2_EV_DRD_T) >= words + 20);
    for (unsigned i = 0; i < rig.edges; i++) assert_int_not_equal(rig.edge[i].sig, PSA2_LINE_SYNC_T);
    rig.b.base.faults = 0;
    rig_run(&rig, 100000000);
    assert_true(events(PSA2_EV_SYNC_T) > pulses);
    assert_int_equal(rig.faults, 0);
}

/* Words come every data period of 10 ms, and not 10.18 ms (t18 of 100 SPS) after each pulse. */
static void without_sync_t_nothing_waits_for_the_filter(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        init(false, true);
        psa2_power_up(&rig.b, 0);
        await_frames(20);
        rig.b.base.faults = k == 1 ? PSA2_FAULT_SKIP_SYNC_T : 0;
        rig_run(&rig, 30000000);
        tolds = 0;
        rig_run(&rig, 100000000);
        int64_t was_ns = 0;
        for (unsigned i = 0; i < tolds; i++) {
            if (told[i].e != PSA2_EV_DRD_T) continue;
            if (was_ns && k == 0) assert_true(told[i].t_ns - was_ns > 10150000);
            if (was_ns && k == 1) assert_in_range(told[i].t_ns - was_ns, 9999999, 10000001);
            was_ns = told[i].t_ns;
        }
        assert_true(was_ns > 0);
    }
}

static void the_wrong_way_round_the_last_step_comes_first(void **state)
{
    (void)state;
    static struct rig_byte bytes[4096];
    static const uint8_t want[] = {0x53, 0x00, 0x82, 0x50, 0x00, 0x04, 0x50, 0x00, 0x02, 0x41, 0x00, 0x56};
    init(true, true);
    rig.b.base.faults = PSA2_FAULT_SETUP_ORDER;
    psa2_power_up(&rig.b, 0);
    await_frames(1);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    const unsigned n = rig_decode_spi(&rig, bytes, COUNT(bytes));
    assert_true(n > COUNT(want));
    for (size_t i = 0; i < COUNT(want); i++) assert_int_equal(bytes[i].mosi, want[i]);
    unsigned a = 0, t = 0;
    while (told[a].e != PSA2_EV_SYNC_A) a++;
    while (told[t].e != PSA2_EV_SYNC_T) t++;
    assert_true(told[a].t_ns < told[t].t_ns); /* both before the first byte */
    assert_true(told[t].t_ns < bytes[0].first_rise_ns);
    struct psa2_request q = {.group = PSA2_TEMP, .op = PSA2_READ_REG, .addr = ADS1256_STATUS};
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    assert_int_equal(q.answer[0] & 0x06, ADS1256_STATUS_BUFEN); /* and not ACAL */
    rig.b.base.faults = 0;
    psa2_reset(&rig.b, rig.s.now_ns);
    rig_run(&rig, 200000000);
    assert_int_equal(rig_request(&rig, &q), PSA2_OK);
    assert_int_equal(q.answer[0] & 0x06, ADS1256_STATUS_ACAL);
}

static void frozen_words_stay_while_numbers_go_on(void **state)
{
    (void)state;
    init(false, false);
    rig.volts[0] = 1.0;
    psa2_power_up(&rig.b, 0);
    await_frames(70);
    rig.b.base.faults = PSA2_FAULT_FROZEN_WORDS;
    const unsigned from = rig.frames;
    rig.volts[0] = 2.0;
    await_frames(from + 100);
    for (unsigned i = from; i < rig.frames; i++) {
        assert_memory_equal(rig.frame[i].code, rig.frame[from - 1].code, sizeof rig.frame[i].code);
        assert_memory_equal(rig.frame[i].word, rig.frame[from - 1].word, 3 * sizeof rig.frame[i].word[0]);
        assert_int_equal(rig.frame[i].temp_code, rig.frame[from - 1].temp_code);
        assert_int_equal(rig.frame[i].seq, rig.frame[i - 1].seq + 1);
    }
    rig.b.base.faults = 0;
    await_frames(rig.frames + 2);
    assert_true(rig.frame[rig.frames - 1].code[0] > rig.frame[from - 1].code[0] + 100000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_event_is_told_at_its_edge),
        cmocka_unit_test(events_and_frames_are_the_same_unwatched_and_unheard),
        cmocka_unit_test(an_event_has_one_name_and_a_name_one_event),
        cmocka_unit_test(power_fails_in_the_middle_of_a_frame),
        cmocka_unit_test(after_power_up_all_begins_anew),
        cmocka_unit_test(a_request_under_way_ends_with_the_power),
        cmocka_unit_test(power_may_fail_at_any_instant),
        cmocka_unit_test(power_may_fail_in_reset_and_before_a_frame_begins),
        cmocka_unit_test(without_sync_t_the_pin_rests_and_the_scan_goes_on),
        cmocka_unit_test(without_sync_t_nothing_waits_for_the_filter),
        cmocka_unit_test(the_wrong_way_round_the_last_step_comes_first),
        cmocka_unit_test(frozen_words_stay_while_numbers_go_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
