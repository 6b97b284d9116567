/* The board PIK: what its counters say of its inputs, by the article's formulas, and what its specimens are off by. */
#include "pik_rig.h"

#include <math.h>

static struct rig r, other;

static uint64_t minus_of(const struct pik_channel *c)
{
    return c->minus_from + c->axis.minus;
}

/* F = K Ua with K = Rr/(RIN UREF TCLK): 174 and 2000 Hz/V. */
static void frequency_is_the_coefficient_times_the_input(void **state)
{
    (void)state;
    static const struct {
        bool six;
        double v, hz;
    } rows[] = {{false, 1.0, 174.0}, {false, -1.0, -174.0}, {false, 10.0, 1740.0}, {false, 0.0, 0.0},
                {true, 1.0, 2000.0}, {true, -0.5, -1000.0}, {true, 10.0, 20000.0}, {true, -10.0, -20000.0}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct pik_profile p = rows[i].six ? rig_pik6() : rig_pik();
        rig_up(&r, &p, 1);
        r.input[1].v = rows[i].v;
        rig_run_until(&r, 10 * NS_PER_S);
        assert_true(fabs(rig_count(&r, 1) - 10.0 * rows[i].hz) <= 1.0);
        assert_true(rig_count(&r, 0) == 0.0);
        assert_int_equal(r.b.channel[1].axis.saturated, 0);
    }
}

/* The same readings, bit for bit, but for a pulse that comes a little sooner or later. */
static void capacitor_changes_nothing(void **state)
{
    (void)state;
    struct pik_profile p = rig_pik6();
    p.c_int_nf *= 0.7;
    rig_up(&r, &p, 1);
    p.c_int_nf *= 1.3 / 0.7;
    rig_up(&other, &p, 1);
    for (unsigned i = 0; i < PIK_AXES; i++)
        r.input[i] = other.input[i] = (struct rig_input){.v = 1.0 - i, .sines = 1, .sine = {{.v = 3.0, .hz = 0.7 + i}}};
    rig_run_until(&r, 20 * NS_PER_S);
    rig_run_until(&other, 20 * NS_PER_S);
    assert_int_equal(r.readings, other.readings);
    for (unsigned n = 0; n < r.readings; n++) {
        for (unsigned i = 0; i < PIK_AXES; i++)
            assert_in_range(r.reading[n].total[i] - other.reading[n].total[i] + 1, 0, 2);
    }
}

static void watched_or_heard_the_counts_are_the_same(void **state)
{
    (void)state;
    struct pik_profile p = rig_pik6();
    p.noise_v_rthz = 1e-3;
    p.clock_tol_ppm = 20.0;
    rig_up(&r, &p, 5);
    rig_up(&other, &p, 5);
    trace_attach(&r.b.base.trace, &r.sink);
    for (unsigned i = 0; i < PIK_AXES; i++)
        r.input[i] = other.input[i] =
            (struct rig_input){.v = 0.4 * i, .sines = 1, .sine = {{.v = 4.0, .hz = 3.0 + 150.0 * i}}};
    for (unsigned step = 1; step <= 40; step++) {
        const int64_t t_ns = step * INT64_C(7654321);
        pik_observe(&r.b, step % 3 == 0);
        if (step == 20) trace_detach(&r.b.base.trace, &r.sink);
        if (step == 30) trace_attach(&r.b.base.trace, &r.sink);
        if (step % 7 == 0) {
            pik_sample_until(&r.b, r.s.now_ns);
            pik_sample_until(&other.b, other.s.now_ns);
        }
        rig_run_until(&r, t_ns);
        rig_run_until(&other, t_ns);
    }
    assert_int_equal(r.readings, other.readings);
    assert_memory_equal(r.reading, other.reading, r.readings * sizeof *r.reading);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        assert_memory_equal(&r.b.channel[i].axis, &other.b.channel[i].axis, sizeof r.b.channel[i].axis);
    }
    assert_true(r.event[PIK_EV_FX] > 100 && r.event[PIK_EV_LATCH] > 5);
    assert_int_equal(other.event[PIK_EV_FX], 0);
}

/* Who reads, and when, changes no count: registers hold what was latched. */
static void cycles_change_nothing(void **state)
{
    (void)state;
    struct pik_profile p = rig_pik6();
    p.noise_v_rthz = 1e-3;
    rig_up(&r, &p, 5);
    rig_up(&other, &p, 5);
    for (unsigned i = 0; i < PIK_AXES; i++) r.input[i] = other.input[i] = (struct rig_input){.v = 1.0 + i};
    rig_run_until(&r, 50000000);
    for (unsigned n = 0; n < 200; n++) {
        (void)rig_bus(&r, false, (uint8_t)(n % PIK_REG_LATCH), 0);
        rig_run_until(&r, r.s.now_ns + 77777);
    }
    rig_run_until(&other, r.s.now_ns);
    assert_memory_equal(r.reading, other.reading, r.readings * sizeof *r.reading);
}

/* A step of the input is seen at the next tick, not half a pace early or late. */
static void a_step_that_is_told_is_taken_where_it_is(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    const double k = pik_profile_k_hz_per_v(&p);
    rig_up(&r, &p, 1);
    double integral_vs = 0.0;
    int64_t from_ns = 0;
    for (unsigned n = 0; n < 500; n++) {
        const int64_t to_ns = from_ns + 1000000 + n * 7919;
        rig_run_until(&r, to_ns);
        integral_vs += r.input[0].v * (double)(to_ns - from_ns) * 1e-9;
        pik_sample_until(&r.b, to_ns);
        r.input[0].v = n % 2 ? 9.0 : -8.0;
        from_ns = to_ns;
    }
    rig_run_until(&r, from_ns + 1);
    const double off = rig_count(&r, 0) - k * integral_vs;
    assert_true(fabs(off) <= 1.0 + 500 * 17.0 * k / 640e3 / 2.0); /* each step is seen up to a tick late */
    assert_true(fabs(off) <= 4.0);                                /* and up as late as down */
}

/* 3 sigma of all that is drawn, and never more, is the printed error, from -10 to 60 degC and for both signs. */
static void specimens_keep_the_printed_error(void **state)
{
    (void)state;
    struct pik_profile profile;
    fields_default(&pik_fields, &profile);
    double worst = 0.0, sum2 = 0.0, last = 0.0;
    unsigned n = 0, same = 0;
    for (uint32_t serial = 1; serial <= 500; serial++) {
        rig_init(&r, &profile, serial);
        for (unsigned i = 0; i < PIK_AXES; i++) {
            for (int sign = -1; sign <= 1; sign += 2) {
                for (double degc = -10.0; degc <= 60.0; degc += 35.0) {
                    const double off = pik_true_k_hz_per_v(&r.b, i, sign, degc) / 174.0 - 1.0;
                    if (fabs(off) > worst) worst = fabs(off);
                    if (degc == 25.0 && sign > 0) {
                        sum2 += off * off;
                        n++;
                        same += off == last;
                        last = off;
                    }
                }
            }
        }
    }
    assert_true(worst <= 0.0015 && worst > 0.0014);
    assert_true(sqrt(sum2 / n) > 0.0002 && sqrt(sum2 / n) < 0.0006);
    assert_int_equal(same, 0);
    struct pik_profile any = profile;
    any.k_error_pct = 0.0;
    any.uref_tol_ppm = 5000.0;
    worst = 0.0;
    for (uint32_t serial = 1; serial <= 50; serial++) {
        rig_init(&r, &any, serial);
        const double off = fabs(pik_true_k_hz_per_v(&r.b, 0, 1, 25.0) / 174.0 - 1.0);
        if (off > worst) worst = off;
    }
    assert_true(worst > 0.005);
}

/* What the truth says is what the counters show: coefficient of either sign, temperature, zero drift. */
static void counters_follow_the_specimen(void **state)
{
    (void)state;
    struct pik_profile p = rig_pik6();
    p.uref_tol_ppm = 3000.0;
    p.uref_tc_ppm_per_k = 30.0;
    p.asymmetry_ppm = 2000.0;
    p.clock_tol_ppm = 200.0;
    p.zero_v = 2e-3;
    p.zero_tc_v_per_k = 1e-4;
    p.k_error_pct = 0.0;
    for (int hot = 0; hot < 2; hot++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            const double degc = hot ? 60.0 : 25.0;
            rig_up(&r, &p, 9);
            r.degc = degc;
            for (unsigned i = 0; i < PIK_AXES; i++) r.input[i].v = sign * 5.0;
            rig_run_until(&r, 50 * NS_PER_S);
            for (unsigned i = 0; i < PIK_AXES; i++) {
                const struct pik_specimen *s = &r.b.specimen;
                const double u = sign * 5.0 + s->zero_v[i] + s->zero_tc[i] * (degc - 25.0);
                const double want = pik_true_k_hz_per_v(&r.b, i, sign, degc) * u * 50.0;
                if (fabs(rig_count(&r, i) - want) > 1.5)
                    fail_msg("axis %u, sign %d, %g degC: %.1f, %.1f wanted", i, sign, degc, rig_count(&r, i), want);
            }
        }
    }
    assert_true(fabs(pik_true_k_hz_per_v(&r.b, 0, 1, 25.0) / pik_true_k_hz_per_v(&r.b, 0, -1, 25.0) - 1.0) > 1e-4);
    p.c_tol_pct = 5.0;
    rig_up(&r, &p, 9);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        const double c = 1.0 + 1e-2 * r.b.specimen.c_pct[i];
        const double threshold = (double)r.b.channel[i].drive.threshold / (double)PIK_PULSE;
        assert_true(fabs(c - 1.0) > 1e-3 && fabs(threshold - c * p.uc_v / pik_profile_step_v(&p)) < 1e-9);
    }
}

/* Switching late on both edges changes no charge; a difference changes K, an input that is taken off bends the line. */
static void dead_times(void **state)
{
    (void)state;
    static const struct {
        double on_ns, off_ns, input_ns, v, hz;
    } rows[] = {{100, 100, 0, 5.0, 10000.0},
                {100, 0, 0, 5.0, 10000.0 / 0.996},         /* the pulse is 24.9 us */
                {0, 100, 0, -5.0, -10000.0 / 1.004},       /* 25.1 us */
                {0, 0, 500, 5.0, 10000.0 / (1.0 + 0.005)}, /* F = K U (1 - F t) */
                {0, 0, 500, -2.0, -4000.0 / (1.0 + 0.002)}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct pik_profile p = rig_pik6();
        p.switch_on_ns = rows[i].on_ns;
        p.switch_off_ns = rows[i].off_ns;
        p.input_off_ns = rows[i].input_ns;
        rig_up(&r, &p, 1);
        r.input[2].v = rows[i].v;
        rig_run_until(&r, 10 * NS_PER_S);
        if (fabs(rig_count(&r, 2) - 10.0 * rows[i].hz) > 1.5)
            fail_msg("row %u: %.1f pulses, %.1f wanted", i, rig_count(&r, 2), 10.0 * rows[i].hz);
    }
}

/* White noise of 1 mV/rtHz makes the integral of a second random by 1e-3 sqrt(1/2) V s; scaled by the unit's noise scale. */
static void noise_walks(void **state)
{
    (void)state;
    struct pik_profile p = rig_pik6();
    p.noise_v_rthz = 20e-3;
    rig_up(&r, &p, 3);
    for (unsigned i = 0; i < PIK_AXES; i++) r.input[i].v = 2.0;
    double sum2 = 0.0, before[PIK_AXES] = {0};
    for (unsigned s = 1; s <= 100; s++) {
        rig_run_until(&r, s * NS_PER_S);
        for (unsigned i = 0; i < PIK_AXES; i++) {
            const double off = rig_count(&r, i) - before[i] - 4000.0;
            before[i] = rig_count(&r, i);
            sum2 += off * off;
        }
    }
    const double sd_vs = sqrt(sum2 / 300.0) / 2000.0;
    assert_true(fabs(sd_vs / (20e-3 * sqrt(0.5)) - 1.0) < 0.15);
    rig_up(&r, &p, 3);
    r.b.base.cfg.adc_noise_scale = 0.0;
    r.input[0].v = 2.0;
    rig_run_until(&r, 10 * NS_PER_S);
    assert_true(fabs(rig_count(&r, 0) - 40000.0) <= 1.0);
}

/* After a power cycle it takes another way. */
static void noise_does_not_repeat(void **state)
{
    (void)state;
    enum { N = 3000 };
    static double z[2][N];
    struct pik_profile p = rig_pik6();
    p.noise_v_rthz = 20e-3;
    rig_init(&r, &p, 3);
    for (unsigned life = 0; life < 2; life++) {
        pik_power_up(&r.b, r.s.now_ns);
        for (unsigned k = 0; k < N; k++) {
            rig_run_until(&r, r.b.look.due_ns + 1);
            z[life][k] = r.b.channel[1].noise_v / r.b.noise_v;
        }
        pik_power_down(&r.b, r.s.now_ns);
    }
    double sum = 0.0, squares = 0.0;
    for (unsigned k = 0; k < N; k++) {
        sum += z[0][k] * z[1][k];
        squares += z[0][k] * z[0][k];
    }
    assert_true(fabs(squares / N - 1.0) < 4.0 * sqrt(2.0 / N));
    assert_true(fabs(sum) < 5.0 * sqrt((double)N));
}

/* 1796 Hz, at 10.32 V, is the most; beyond it pulses are lost, and told: flag of the reading, counters, event, and the end of it. */
static void saturation_is_counted_and_told(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_up(&r, &p, 1);
    pik_observe(&r.b, true);
    r.input[0].v = -10.49; /* below the clip of the chain */
    r.input[1].v = 9.9;
    rig_run_until(&r, NS_PER_S);
    assert_in_range(1796 + (int64_t)rig_count(&r, 0), 0, 3);
    assert_true(r.b.channel[0].saturated_looks > 100 && r.b.channel[1].saturated_looks == 0);
    assert_in_range(r.b.channel[0].lost, 24, 29); /* 0.167 V s times 174 */
    assert_int_equal(r.reading[90].status, PIK_ST_NEW | PIK_ST_SATURATED_X);
    assert_int_equal(r.event[PIK_EV_SATURATED], 1);
    assert_int_equal(r.b.counters.readings, r.event[PIK_EV_LATCH]);
    assert_int_equal(r.saturations, 1);
    assert_int_equal(r.ends, 0);
    pik_sample_until(&r.b, r.s.now_ns);
    r.input[0].v = 0.0;
    rig_run_until(&r, NS_PER_S + 80000000);
    assert_int_equal(r.ends, 0);
    rig_run_until(&r, NS_PER_S + 120000000);
    assert_int_equal(r.ends, 1);
    assert_int_equal(r.reading[r.readings - 1].status, PIK_ST_NEW);
    assert_int_equal(r.saturations, 1);
}

/* TCLK longer by 1000 ppm makes pulses heavier: fewer of them, at once, and as before when it is over. */
static void clock_fault_changes_the_weight_of_a_pulse(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_up(&r, &p, 1);
    r.input[0].v = 5.0;
    rig_run_until(&r, 2 * NS_PER_S + 1111);
    const double before = rig_count(&r, 0);
    pik_clock(&r.b, -1000, r.s.now_ns);
    rig_run_until(&r, 12 * NS_PER_S + 1111);
    assert_true(fabs(rig_count(&r, 0) - before - 100000.0 * 0.999) <= 2.0);
    pik_clock(&r.b, 0, r.s.now_ns);
    const double after = rig_count(&r, 0);
    rig_run_until(&r, 14 * NS_PER_S + 1111);
    assert_true(fabs(rig_count(&r, 0) - after - 20000.0) <= 2.0);
    pik_power_down(&r.b, r.s.now_ns);
    pik_clock(&r.b, 500, r.s.now_ns);
    assert_true(fabs(pik_true_k_hz_per_v(&r.b, 0, 1, 25.0) - 2000.0 * 1.0005) < 0.01);
}

/* Each change of pace begins at a tick that was: no time is lost between two. */
static void a_clock_that_changes_often_loses_nothing(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik6();
    rig_up(&r, &p, 1);
    r.input[0].v = 9.0;
    for (int n = 1; n <= 2000; n++) {
        rig_run_until(&r, n * INT64_C(500077));
        pik_clock(&r.b, n % 2 ? 1 : -1, r.s.now_ns);
    }
    assert_true(fabs(rig_count(&r, 0) - 18000.0 * 1.000154) <= 2.0);
}

/* A reading tells of all looks since the one before. */
static void a_short_saturation_shows_in_one_reading(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_up(&r, &p, 1);
    r.input[1].v = 1.0;
    rig_run_until(&r, 31000000);
    pik_sample_until(&r.b, r.s.now_ns);
    r.input[1].v = 10.49;
    r.b.channel[1].axis.charge = PIK_PULSE * 3; /* as a longer overload would leave it */
    rig_run_until(&r, 33000000);
    pik_sample_until(&r.b, r.s.now_ns);
    r.input[1].v = -5.0;
    rig_run_until(&r, 55000000);
    assert_int_equal(r.reading[2].status, PIK_ST_NEW);
    assert_int_equal(r.reading[3].status, PIK_ST_NEW | PIK_ST_SATURATED_Y);
    assert_int_equal(r.reading[4].status, PIK_ST_NEW);
}

static void stuck_outputs_are_not_counted(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_up(&r, &p, 1);
    for (unsigned i = 0; i < PIK_AXES; i++) r.input[i].v = 5.0;
    rig_run_until(&r, NS_PER_S + 1);
    const int32_t at = r.reading[r.readings - 1].total[1];
    pik_stick(&r.b, 1, &(struct chip_fault){.dout = CHIP_STUCK_LOW}, r.s.now_ns);
    rig_run_until(&r, 2 * NS_PER_S + 1);
    assert_in_range(r.reading[r.readings - 1].total[1], at, at + 1);
    assert_int_equal(r.reading[r.readings - 1].increment[1], 0);
    assert_in_range(r.reading[r.readings - 1].total[0], 1739, 1741);
    pik_stick(&r.b, 1, &(struct chip_fault){.dout = CHIP_FREE}, r.s.now_ns);
    rig_run_until(&r, 3 * NS_PER_S + 1);
    assert_in_range(r.reading[r.readings - 1].total[1], at + 869, at + 872);
}

static void a_flipped_bit_stays_in_the_counter(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_up(&r, &p, 1);
    r.input[2].v = -5.0;
    rig_run_until(&r, NS_PER_S + 1);
    const int32_t at = r.reading[r.readings - 1].total[2];
    assert_true(pik_flip(&r.b, 2, 1, 0x80, r.s.now_ns)); /* bit 15 of the up counter */
    rig_run_until(&r, r.s.now_ns + 10000000);
    assert_in_range(r.reading[r.readings - 1].total[2] - at - 32768 + 10, 0, 10);
    rig_run_until(&r, r.s.now_ns + 10000000);
    assert_in_range(-r.reading[r.readings - 1].increment[2], 7, 10); /* jumped once */
    assert_true(pik_flip(&r.b, 2, 2, 0x01, r.s.now_ns)); /* bit 0 of the down counter: one more or one less */
    const uint64_t minus = minus_of(&r.b.channel[2]);
    assert_true(pik_flip(&r.b, 2, 2, 0x01, r.s.now_ns));
    assert_int_equal(minus_of(&r.b.channel[2]) ^ 1, minus);
    pik_power_down(&r.b, r.s.now_ns);
    assert_false(pik_flip(&r.b, 0, 0, 1, r.s.now_ns));
}

static void frozen_words_repeat_while_time_goes_on(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_up(&r, &p, 1);
    r.input[0].v = 5.0;
    rig_run_until(&r, 100000001);
    r.b.base.faults = PIK_FAULT_FROZEN_WORDS;
    rig_run_until(&r, 200000001);
    const struct pik_reading *a = &r.reading[9], *b = &r.reading[19];
    assert_int_equal(a->total[0], b->total[0]);
    assert_int_equal(a->increment[0], b->increment[0]);
    assert_int_equal(b->seq, 20);
    assert_int_equal(b->t_ns - a->t_ns, 100000000);
}

static void power_and_reset(void **state)
{
    (void)state;
    const struct pik_profile p = rig_pik();
    rig_init(&r, &p, 1);
    pik_reset(&r.b, 0); /* without power it does nothing */
    pik_power_down(&r.b, 0);
    pik_observe(&r.b, true);
    rig_run_until(&r, 5000000);
    assert_int_equal(r.b.counters.resets, 0);
    pik_power_up(&r.b, 5000000);
    r.input[0].v = 10.0;
    rig_run_until(&r, 105000001);
    assert_int_equal(r.readings, 10);
    assert_int_equal(r.reading[0].t_ns, 15000000);
    assert_in_range(r.reading[9].total[0], 173, 175);
    pik_reset(&r.b, r.s.now_ns);
    rig_run_until(&r, r.s.now_ns + 10000000);
    assert_int_equal(r.reading[10].seq, 1);
    assert_in_range(r.reading[10].total[0], 16, 19);
    assert_int_equal(r.b.counters.resets, 1);
    pik_power_down(&r.b, r.s.now_ns);
    pik_power_down(&r.b, r.s.now_ns);
    const unsigned readings = r.readings;
    rig_run_until(&r, r.s.now_ns + 100000000);
    assert_int_equal(r.readings, readings);
    pik_power_up(&r.b, r.s.now_ns);
    pik_power_up(&r.b, r.s.now_ns);
    rig_run_until(&r, r.s.now_ns + 10000000);
    assert_int_equal(r.reading[readings].seq, 1);
    assert_in_range(r.reading[readings].total[0], 16, 18);
    assert_int_equal(r.event[PIK_EV_POWER_UP], 2);
    assert_int_equal(r.event[PIK_EV_POWER_DOWN], 1);
    assert_int_equal(r.event[PIK_EV_RES], 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frequency_is_the_coefficient_times_the_input),
        cmocka_unit_test(capacitor_changes_nothing),
        cmocka_unit_test(watched_or_heard_the_counts_are_the_same),
        cmocka_unit_test(cycles_change_nothing),
        cmocka_unit_test(a_step_that_is_told_is_taken_where_it_is),
        cmocka_unit_test(specimens_keep_the_printed_error),
        cmocka_unit_test(counters_follow_the_specimen),
        cmocka_unit_test(dead_times),
        cmocka_unit_test(noise_walks),
        cmocka_unit_test(noise_does_not_repeat),
        cmocka_unit_test(saturation_is_counted_and_told),
        cmocka_unit_test(clock_fault_changes_the_weight_of_a_pulse),
        cmocka_unit_test(a_clock_that_changes_often_loses_nothing),
        cmocka_unit_test(a_short_saturation_shows_in_one_reading),
        cmocka_unit_test(stuck_outputs_are_not_counted),
        cmocka_unit_test(a_flipped_bit_stays_in_the_counter),
        cmocka_unit_test(frozen_words_repeat_while_time_goes_on),
        cmocka_unit_test(power_and_reset),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
