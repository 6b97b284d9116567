/* The charge balance of one channel: pulses in closed form are those that come one by one, and their number is the charge. */
#include "rig.h"

#include "board/pik/converter.h"

#include "base/rng.h"

enum { PULSE_TICKS = 16, RECOVERY_TICKS = 16 };

static const struct pik_drive nominal = {.plus = PIK_PULSE,
                                         .minus = PIK_PULSE,
                                         .threshold = PIK_PULSE / 4 * 3,
                                         .rail = PIK_PULSE * 9 / 4,
                                         .pulse_ticks = PULSE_TICKS,
                                         .recovery_ticks = RECOVERY_TICKS};

/* duty: charge in pulses that the input brings in TCLK; 0.5 is full scale. */
static struct pik_drive driven(struct pik_drive d, double duty)
{
    d.per_tick = (int64_t)(duty * (double)(PIK_PULSE / PULSE_TICKS));
    return d;
}

/* The definition, tick by tick. */
struct plain {
    struct pik_drive d;
    int64_t tick, charge, begun_tick;
    int sign;
    uint64_t plus, minus;
};

static bool plain_may(const struct plain *p, int sign)
{
    const int64_t recovery = p->sign == sign ? p->d.recovery_ticks : 0;
    return p->sign == 0 || p->tick >= p->begun_tick + p->d.pulse_ticks + recovery;
}

static void plain_advance(struct plain *p, int64_t tick)
{
    while (p->tick < tick) {
        p->tick++;
        p->charge += p->d.per_tick;
        const int sign = p->charge >= p->d.threshold ? 1 : p->charge <= -p->d.threshold ? -1 : 0;
        if (sign == 0 || !plain_may(p, sign)) continue;
        *(sign > 0 ? &p->plus : &p->minus) += 1;
        p->charge -= sign > 0 ? p->d.plus : -p->d.minus;
        p->begun_tick = p->tick;
        p->sign = sign;
    }
}

static void assert_same(const struct pik_axis *a, const struct plain *p)
{
    assert_int_equal(a->tick, p->tick);
    assert_int_equal(a->plus, p->plus);
    assert_int_equal(a->minus, p->minus);
    assert_int_equal(a->charge, p->charge);
}

/* Up minus down. */
static int64_t net_count(const struct pik_axis *a)
{
    return (int64_t)(a->plus - a->minus);
}

static void a_pulse_comes_at_the_first_tick_at_or_beyond_the_threshold(void **state)
{
    (void)state;
    struct pik_drive d = nominal;
    d.per_tick = PIK_PULSE / 64; /* the threshold of 3/4 is reached at tick 48 exactly */
    struct pik_axis a = pik_axis_at(0, &d);
    assert_int_equal(pik_axis_next(&a), 48);
    pik_axis_advance(&a, 47);
    assert_int_equal(net_count(&a), 0);
    pik_axis_advance(&a, 48);
    assert_int_equal(net_count(&a), 1);
    assert_int_equal(a.begun_tick, 48);
    assert_int_equal(pik_axis_next(&a), 48 + 64); /* one more pulse of charge */
    d.per_tick = -PIK_PULSE / 64;
    a = pik_axis_at(0, &d);
    pik_axis_advance(&a, 48 + 64);
    assert_int_equal(a.minus, 2);
    assert_int_equal(a.plus, 0);
    d.per_tick = 0;
    a = pik_axis_at(5, &d);
    assert_true(pik_axis_next(&a) == PIK_NEVER);
    pik_axis_advance(&a, 1000000);
    assert_int_equal(net_count(&a), 0);
}

/* Exactly at the threshold when its reference is ready again, and no input any more. */
static void a_waiting_pulse_needs_no_input(void **state)
{
    (void)state;
    struct pik_drive d = nominal;
    d.per_tick = PIK_PULSE / 64;
    struct pik_axis a = pik_axis_at(0, &d);
    pik_axis_advance(&a, 48); /* a quarter of a pulse below zero now */
    d.per_tick = PIK_PULSE / 16;
    pik_axis_look(&a, 48, &d);
    d.per_tick = 0;
    pik_axis_look(&a, 64, &d);
    assert_true(a.charge == nominal.threshold);
    assert_int_equal(pik_axis_next(&a), 48 + PULSE_TICKS + RECOVERY_TICKS);
    pik_axis_advance(&a, 1000);
    assert_int_equal(a.plus, 2);
}

static void closed_form_equals_the_definition(void **state)
{
    (void)state;
    struct rng r = {{rig_seed(4711), 2, 3, 4}};
    for (unsigned run = 0; run < 400; run++) {
        struct pik_drive d = nominal;
        d.plus += (int64_t)(rng_uniform(&r) * 1e-2 * (double)PIK_PULSE);
        d.minus -= (int64_t)(rng_uniform(&r) * 1e-2 * (double)PIK_PULSE);
        d.threshold = (int64_t)((0.2 + rng_uniform(&r)) * (double)PIK_PULSE); /* below 0.5 resets chase each other */
        d.recovery_ticks = (int64_t)(rng_u64(&r) % 33);
        d = driven(d, 0.0);
        struct pik_axis a = pik_axis_at(0, &d), fine = a;
        struct plain p = {.d = d};
        for (unsigned look = 0; look < 12; look++) {
            const int64_t to = a.tick + 1 + (int64_t)(rng_u64(&r) % 2000);
            while (fine.tick < to) { /* the same in small pieces */
                const int64_t step = fine.tick + 1 + (int64_t)(rng_u64(&r) % 40);
                pik_axis_advance(&fine, step < to ? step : to);
            }
            const double duty = run % 4 == 0 ? rng_uniform(&r) * 0.04 - 0.02 : rng_uniform(&r) * 1.6 - 0.8;
            d = driven(d, duty);
            pik_axis_advance(&a, to);
            plain_advance(&p, to);
            assert_same(&a, &p);
            assert_memory_equal(&a, &fine, sizeof a);
            p.charge = p.charge > d.rail ? d.rail : p.charge < -d.rail ? -d.rail : p.charge;
            p.d = d;
            pik_axis_look(&a, to, &d);
            pik_axis_look(&fine, to, &d);
            assert_int_equal(a.charge, p.charge);
        }
    }
}

/* Any input up to full scale, any capacitor within 30 %: the count is the charge within one pulse, from an empty one. */
static void count_is_the_charge_within_one_pulse(void **state)
{
    (void)state;
    struct rng r = {{rig_seed(815), 2, 3, 4}};
    const double capacitor[] = {0.7, 1.0, 1.3};
    for (unsigned run = 0; run < 300; run++) {
        struct pik_drive d = nominal;
        d.threshold = (int64_t)(0.7307 * capacitor[run % 3] * (double)PIK_PULSE);
        struct pik_axis a = pik_axis_at(0, &d);
        long double charge = 0.0L;
        for (unsigned look = 0; look < 200; look++) {
            d = driven(d, run % 2 ? rng_uniform(&r) - 0.5 : rng_uniform(&r) < 0.5 ? -0.5 : 0.5);
            pik_axis_look(&a, a.tick, &d);
            const int64_t ticks = 1 + (int64_t)(rng_u64(&r) % 700);
            charge += (long double)d.per_tick * (long double)ticks;
            pik_axis_advance(&a, a.tick + ticks);
            const double error = (double)net_count(&a) - (double)(charge / (long double)PIK_PULSE);
            if (error < -1.0 || error > 1.0) fail_msg("run %u, look %u: off by %.3f pulses", run, look, error);
        }
        assert_int_equal(a.saturated, 0);
    }
}

/* The most it can is a pulse every 32 ticks; what is beyond stays on the capacitor up to the rail, then is lost. */
static void beyond_full_scale_it_saturates_and_says_so(void **state)
{
    (void)state;
    const struct pik_drive d = driven(nominal, 0.75), rest = driven(nominal, 0.0);
    struct pik_axis a = pik_axis_at(0, &d);
    pik_axis_look(&a, 3200, &d);
    assert_int_equal(a.plus, 100); /* the first at tick 16, then every 32 ticks */
    assert_int_equal(a.saturated, 1);
    assert_int_equal(a.charge, d.rail);
    assert_int_equal(a.lost, d.per_tick * 3200 - 100 * PIK_PULSE - d.rail);
    pik_axis_look(&a, 3200 + 320, &rest);
    const uint64_t before = a.plus;
    pik_axis_look(&a, a.tick + 320, &rest); /* what is left on the capacitor comes later */
    assert_true(a.plus > before);
    const uint32_t told = a.saturated;
    pik_axis_look(&a, a.tick + 320, &rest);
    assert_int_equal(a.saturated, told);
}

static void resets_that_chase_each_other_are_counted(void **state)
{
    (void)state;
    struct pik_drive d = driven(nominal, 0.001);
    d.threshold = PIK_PULSE * 2 / 5;
    struct pik_axis a = pik_axis_at(0, &d);
    pik_axis_advance(&a, 100000);
    assert_true(a.minus > 50 && a.opposed > 100);
    assert_in_range(net_count(&a), 5, 7);                      /* the net count is the charge all the same: 6.25 */
    d.threshold = (int64_t)(0.7 * 0.7307 * (double)PIK_PULSE); /* the smallest capacitor of a profile's */
    a = pik_axis_at(0, &d);
    pik_axis_advance(&a, 100000);
    assert_int_equal(a.minus + a.opposed, 0);
}

static void a_reset_under_way_has_been_taken_off_whole(void **state)
{
    (void)state;
    struct pik_drive d = nominal;
    d.per_tick = PIK_PULSE / 64;
    struct pik_axis a = pik_axis_at(0, &d);
    pik_axis_advance(&a, 48);
    assert_true(pik_axis_resetting(&a));
    assert_int_equal(a.charge, PIK_PULSE / 4 * 3 - PIK_PULSE);
    pik_axis_advance(&a, 56);
    assert_true(pik_axis_resetting(&a));
    assert_int_equal(a.charge, PIK_PULSE / 4 * 3 + PIK_PULSE / 64 * 8 - PIK_PULSE);
    pik_axis_advance(&a, 64);
    assert_false(pik_axis_resetting(&a));
    assert_int_equal(a.charge, PIK_PULSE / 4 * 3 + PIK_PULSE / 64 * 16 - PIK_PULSE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pulse_comes_at_the_first_tick_at_or_beyond_the_threshold),
        cmocka_unit_test(a_waiting_pulse_needs_no_input),
        cmocka_unit_test(closed_form_equals_the_definition),
        cmocka_unit_test(count_is_the_charge_within_one_pulse),
        cmocka_unit_test(beyond_full_scale_it_saturates_and_says_so),
        cmocka_unit_test(resets_that_chase_each_other_are_counted),
        cmocka_unit_test(a_reset_under_way_has_been_taken_off_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
