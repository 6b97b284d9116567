/* PMKA: beats tau1..tau5, who serves whom, and how the one out of work is calibrated. */
#include "pmka_rig.h"

static struct rig rig;

static struct pmka_profile short_beats(enum pmka_mode mode)
{
    struct pmka_profile p = rig_ideal();
    p.rotation = (int)mode;
    p.beat_periods = 12;
    p.zero_periods = 5;
    return p;
}

/* Integrator out of work in a beat. */
static unsigned resting(unsigned tau)
{
    return tau >= 2 && tau <= 4 ? tau - 2 : PMKA_K;
}

static void every_beat_has_its_length_and_the_five_follow_each_other(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_AUTONOMOUS);
    rig_up(&rig, &p);
    rig_readings(&rig, 400);
    assert_int_equal(rig.reading[0].tau, 0);
    for (unsigned k = 1; k < 400; k++) {
        assert_int_equal(rig.reading[k].tau, (k - 1) / 12 % 5 + 1);
        assert_true(rig.reading[k].autonomous);
    }
    assert_int_equal(rig.events[PMKA_EV_TAU], rig.b.counters.beats);
    assert_int_equal(rig.event_ns[PMKA_EV_TAU] % 4800000, (10000000 + 300000 - 20000) % 4800000);
}

/* In the k-th period of a beat, from 0 on: the hand-over, five for the zero, resets, and the last for nothing. */
static void calibration_of_a_beat(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_AUTONOMOUS);
    rig_up(&rig, &p);
    for (unsigned a = 0; a < 3; a++) rig.input[a].mean_v = 2.0;
    rig_readings(&rig, 400);
    unsigned forced = 0;
    for (unsigned k = 1; k < 400; k++) {
        const struct pmka_reading *r = &rig.reading[k];
        const unsigned age = (k - 1) % 12, i = resting(r->tau);
        const enum pmka_cal want = age == 0 || age == 11 ? PMKA_CAL_NONE : age <= 5 ? PMKA_CAL_ZERO : PMKA_CAL_RESET;
        assert_int_equal(r->cal, want);
        if (want == PMKA_CAL_NONE) continue;
        assert_int_equal(r->serves[i], 0);
        const int step = r->code[i] - rig.reading[k - 1].code[i];
        if (r->reset[i] == 0) assert_in_range(step + 1, 0, 2);
        else assert_in_range(abs(step), 16732, 16734);
        if (want == PMKA_CAL_RESET) {
            forced++;
            assert_int_equal(r->reset[i], rig.reading[k - 1].code[i] >= 0 ? 1 : -1);
        }
    }
    assert_true(forced > 150);
    assert_in_range(rig.b.counters.calibration_resets, forced / 2, forced); /* the others: beyond Uc */
}

static void each_axis_has_an_integrator_and_each_integrator_one_axis_at_most(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_AUTONOMOUS);
    rig_up(&rig, &p);
    rig_readings(&rig, 200);
    for (unsigned k = 1; k < 200; k++) {
        const struct pmka_reading *r = &rig.reading[k];
        const unsigned age = (k - 1) % 12;
        unsigned served[4] = {0};
        for (unsigned i = 0; i < PMKA_INTS; i++) {
            assert_true(i == PMKA_K || r->serves[i] == i + 1 || r->serves[i] == 0);
            served[r->serves[i]]++;
        }
        for (unsigned axis = 1; axis <= 3; axis++) {
            const bool taken = age == 0 && r->tau == axis + 1; /* by K: two serve it in this period */
            assert_int_equal(served[axis], taken ? 2 : 1);
        }
        if (age > 0) assert_int_equal(r->serves[resting(r->tau)], 0);
        if (age > 0 && resting(r->tau) != PMKA_K) assert_int_equal(r->serves[PMKA_K], resting(r->tau) + 1);
    }
    const unsigned beats = rig.b.counters.beats;
    assert_in_range(rig.b.counters.handovers, beats * 6 / 5 - 3, beats * 6 / 5 + 3); /* six in five beats */
}

static void the_computer_turns_it_by_program(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_PROGRAM);
    rig_up(&rig, &p);
    rig_readings(&rig, 30);
    assert_int_equal(rig.reading[29].tau, 0);
    assert_int_equal(rig.reading[29].cal, PMKA_CAL_NONE);
    assert_int_equal(rig.b.counters.beats, 0);
    assert_true(pmka_command(&rig.b, 4, PMKA_CAL_ZERO)); /* K takes Z */
    rig_readings(&rig, 32);
    assert_int_equal(rig.reading[30].tau, 0);
    assert_int_equal(rig.reading[31].tau, 4);
    assert_int_equal(rig.reading[31].cal, PMKA_CAL_NONE); /* of the hand-over */
    assert_int_equal(rig.reading[31].serves[2], 3);
    assert_int_equal(rig.reading[31].serves[3], 3);
    rig_readings(&rig, 34);
    assert_int_equal(rig.reading[33].cal, PMKA_CAL_ZERO);
    assert_int_equal(rig.reading[33].serves[2], 0);
    assert_int_equal(rig.reading[33].reset[2], 0);
    assert_true(pmka_command(&rig.b, 0, PMKA_CAL_RESET));
    rig_readings(&rig, 37);
    assert_int_equal(rig.reading[36].cal, PMKA_CAL_RESET);
    assert_int_not_equal(rig.reading[36].reset[2], 0);
    assert_int_equal(rig.reading[36].tau, 4);
    assert_true(pmka_command(&rig.b, 2, PMKA_CAL_NONE)); /* from Z to X: both in one Ts */
    rig_readings(&rig, 39);
    assert_int_equal(rig.reading[38].serves[0], 1);
    assert_int_equal(rig.reading[38].serves[2], 3);
    assert_int_equal(rig.reading[38].serves[3], 1);
    assert_int_equal(rig.reading[37].serves[3], 3);
    assert_int_equal(rig.b.counters.handovers, 3);
    assert_false(pmka_command(&rig.b, 6, PMKA_CAL_NONE));
    pmka_set_mode(&rig.b, PMKA_AUTONOMOUS);
    assert_false(pmka_command(&rig.b, 1, PMKA_CAL_NONE));
    rig_readings(&rig, 60);
    assert_int_equal(rig.reading[59].tau, 3);
}

/* A beat asked for once more is the same beat; after the hand-over the same calibration goes on. */
static void what_is_asked_for_twice_happens_once(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_PROGRAM);
    rig_up(&rig, &p);
    assert_true(pmka_command(&rig.b, 3, PMKA_CAL_ZERO));
    rig_readings(&rig, 5);
    assert_true(pmka_command(&rig.b, 3, PMKA_CAL_ZERO));
    rig_readings(&rig, 10);
    assert_int_equal(rig.b.counters.beats, 1);
    for (unsigned k = 3; k < 10; k++) assert_int_equal(rig.reading[k].cal, PMKA_CAL_ZERO);
}

/* What is asked for with a beat is for that beat: the one that goes back to work is left in peace. */
static void a_calibration_begins_with_its_beat(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_PROGRAM);
    rig_up(&rig, &p);
    rig.input[1].mean_v = 1.0;
    assert_true(pmka_command(&rig.b, 3, PMKA_CAL_NONE));
    rig_readings(&rig, 10);
    assert_true(pmka_command(&rig.b, 4, PMKA_CAL_RESET));
    rig_readings(&rig, 14);
    for (unsigned k = 10; k < 14; k++) assert_int_equal(rig.reading[k].reset[1], 0);
    assert_int_equal(rig.reading[12].cal, PMKA_CAL_RESET);
    assert_int_not_equal(rig.reading[12].reset[2], 0);
}

/* The tau5 of the rotation calibrates K as tau1 does: keys do not move between them. */
static void no_key_moves_from_tau5_to_tau1(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_AUTONOMOUS);
    rig_up(&rig, &p);
    rig_readings(&rig, 12 * 5 - 5);
    assert_int_equal(rig.b.rotation.tau, 5);
    const unsigned before = rig.b.counters.handovers;
    assert_int_equal(before, 6);
    rig_readings(&rig, 12 * 6 - 5);
    assert_int_equal(rig.b.rotation.tau, 1);
    assert_int_equal(rig.b.counters.handovers, before);
}

/* Between which instants the axis goes: Z gives way 20 us after K was sampled. */
static void the_instant_of_a_hand_over(void **state)
{
    (void)state;
    const struct pmka_profile p = short_beats(PMKA_PROGRAM);
    rig_up(&rig, &p);
    rig_readings(&rig, 10);
    assert_true(pmka_command(&rig.b, 4, PMKA_CAL_NONE));
    const int64_t x_ns = rig.reading[9].t_ns + 4800000;
    sched_run_until(&rig.s, x_ns + 300000 + 19999);
    assert_int_equal(rig.b.channel[2].axis, 2);
    assert_int_equal(rig.b.rotation.tau, 4);
    sched_run_until(&rig.s, x_ns + 300000 + 20000);
    assert_int_equal(rig.b.channel[2].axis, -1);
    assert_int_equal(rig.b.channel[3].axis, 2);
    rig_readings(&rig, 12);
    assert_true(pmka_command(&rig.b, 5, PMKA_CAL_NONE));
    const int64_t again_ns = rig.reading[11].t_ns + 4800000;
    sched_run_until(&rig.s, again_ns + 300000 - 20001);
    assert_int_equal(rig.b.channel[3].axis, 2);
    sched_run_until(&rig.s, again_ns + 300000 - 20000);
    assert_int_equal(rig.b.channel[3].axis, -1);
    assert_int_equal(rig.b.channel[2].axis, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_beat_has_its_length_and_the_five_follow_each_other),
        cmocka_unit_test(calibration_of_a_beat),
        cmocka_unit_test(each_axis_has_an_integrator_and_each_integrator_one_axis_at_most),
        cmocka_unit_test(the_computer_turns_it_by_program),
        cmocka_unit_test(what_is_asked_for_twice_happens_once),
        cmocka_unit_test(a_calibration_begins_with_its_beat),
        cmocka_unit_test(no_key_moves_from_tau5_to_tau1),
        cmocka_unit_test(the_instant_of_a_hand_over),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
