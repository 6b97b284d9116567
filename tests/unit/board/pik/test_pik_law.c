/* The law of the article, N = Ent[K integral U dt]: within a pulse, over any run, for any input to full scale, on any specimen. */
#include "pik_rig.h"

#include "base/rng.h"
#include "board/pik/internal.h"

#include <math.h>

static struct rig r;

/* Up to 10 V in all: a constant, and sines up to top_hz. */
static struct rig_input drawn_input(struct rng *draw, double top_hz)
{
    struct rig_input in = {.sines = (unsigned)(rng_u64(draw) % (RIG_SINES + 1))};
    const double full_v = rng_u64(draw) % 2 ? 10.0 : 10.0 * rng_uniform(draw);
    double sum = in.v = in.sines > 0 ? 0.5 * rng_uniform(draw) : 1.0;
    for (unsigned k = 0; k < in.sines; k++) {
        in.sine[k] = (struct rig_sine){.v = 0.1 + rng_uniform(draw),
                                       .hz = rng_u64(draw) % 4 == 0 ? top_hz : 0.1 + (top_hz - 0.1) * rng_uniform(draw),
                                       .turns = rng_uniform(draw)};
        sum += in.sine[k].v;
    }
    in.v *= (rng_u64(draw) % 2 ? 1.0 : -1.0) * full_v / sum;
    for (unsigned k = 0; k < in.sines; k++) in.sine[k].v *= full_v / sum;
    return in;
}

/* |N - K integral U dt| <= 1 at every reading of a run, by the period or by a strobe at any instant, whatever the capacitor and
 * whatever the input up to 10 V and 400 Hz. */
static void count_is_the_integral_within_a_pulse_over_any_run(void **state)
{
    (void)state;
    struct rng draw = {{rig_seed(174), 1, 2, 3}};
    const double capacitor[] = {1.0, 0.7, 1.3};
    double worst = 0.0;
    for (unsigned run = 0; run < 120; run++) {
        struct pik_profile p = run % 2 ? rig_pik6() : rig_pik();
        const double k = pik_profile_k_hz_per_v(&p);
        p.c_int_nf *= capacitor[run / 2 % 3];
        rig_up(&r, &p, 1);
        for (unsigned i = 0; i < PIK_AXES; i++) r.input[i] = drawn_input(&draw, 400.0);
        while (r.s.now_ns < 2 * NS_PER_S) {
            rig_run_until(&r, r.s.now_ns + 1 + (int64_t)(rng_u64(&draw) % 20000000));
            pik_latch_now(&r.b, r.s.now_ns);
        }
        assert_true(r.readings >= 350);
        for (unsigned n = 0; n < r.readings; n++) {
            for (unsigned i = 0; i < PIK_AXES; i++) {
                const double off = r.reading[n].total[i] - k * rig_integral_vs(&r.input[i], r.reading[n].t_ns);
                if (fabs(off) > 1.0) fail_msg("run %u, reading %u, axis %u: off by %.3f pulses", run, n, i, off);
                worst = fabs(off) > worst ? fabs(off) : worst;
            }
        }
        for (unsigned i = 0; i < PIK_AXES; i++) assert_int_equal(r.b.channel[i].axis.saturated, 0);
    }
    assert_true(worst > 0.9); /* Uc is 0.95 of a pulse for the largest capacitor */
}

/* What the integral over a look is off by does not add up: a minute at the edge of the band. */
static void a_minute_of_full_scale_vibration(void **state)
{
    (void)state;
    static const double hz[PIK_AXES] = {400.0, 397.3, 50.0};
    const struct pik_profile p = rig_pik6();
    rig_up(&r, &p, 1);
    for (unsigned i = 0; i < PIK_AXES; i++)
        r.input[i] = (struct rig_input){.sines = 1, .sine = {{.v = 10.0, .hz = hz[i], .turns = 0.1 * i}}};
    for (unsigned s = 1; s <= 60; s++) {
        rig_run_until(&r, s * NS_PER_S - 123456);
        for (unsigned i = 0; i < PIK_AXES; i++) {
            const double off = rig_count(&r, i) - 2000.0 * rig_integral_vs(&r.input[i], r.s.now_ns);
            if (fabs(off) > 1.0) fail_msg("after %u s, axis %u: off by %.3f pulses", s, i, off);
        }
    }
}

/* All that a specimen and the temperature are off by, and 10 V on top: no channel loses a pulse. */
static void no_specimen_saturates_at_full_scale(void **state)
{
    (void)state;
    for (uint32_t serial = 1; serial <= 100; serial++) {
        struct pik_profile p;
        fields_default(&pik_fields, &p);
        if (serial % 2) p.clock_hz = 40000, p.c_int_nf = 4.7, p.uc_v = 3.9, p.look_ticks = 112;
        rig_up(&r, &p, serial);
        r.degc = serial % 3 == 0 ? -10.0 : serial % 3 == 1 ? 25.0 : 60.0;
        for (unsigned i = 0; i < PIK_AXES; i++) r.input[i].v = (serial / 6 + i) % 2 ? 10.0 : -10.0;
        rig_run_until(&r, 10 * NS_PER_S);
        for (unsigned i = 0; i < PIK_AXES; i++) {
            const int sign = r.input[i].v > 0.0 ? 1 : -1;
            const double k = pik_true_k_hz_per_v(&r.b, i, sign, r.degc);
            const double zero_v = r.b.specimen.zero_v[i] + r.b.specimen.zero_tc[i] * (r.degc - 25.0);
            const double off = rig_count(&r, i) - k * 10.0 * (r.input[i].v + zero_v);
            if (r.b.channel[i].axis.saturated > 0 || fabs(off) > 1.5 + 5.0 * k * p.noise_v_rthz * sqrt(5.0))
                fail_msg("serial %u, axis %u: %u looks, off by %.2f", serial, i, r.b.channel[i].axis.saturated, off);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(count_is_the_integral_within_a_pulse_over_any_run),
        cmocka_unit_test(a_minute_of_full_scale_vibration),
        cmocka_unit_test(no_specimen_saturates_at_full_scale),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
