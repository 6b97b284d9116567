/* The arithmetic of a profile, and what is refused. */
#include "rig.h"

#include "board/pik/profile.h"

#include <math.h>
#include <string.h>

static bool near(double a, double b, double relative)
{
    return fabs(a - b) <= relative * fabs(b);
}

/* K = Rr/(RIN UREF TCLK), 1/K, F at most, and the scale of an accelerometer that makes a pulse 60e-3 and 5e-3 m/s. */
static void figures_of_the_article(void **state)
{
    (void)state;
    static const struct {
        unsigned clock_hz;
        double k_hz_per_v, quantum_vs, limit_hz, pulse_mps, ma_v_per_g, ra_ohm;
    } rows[] = {{3480, 174.0, 5.747e-3, 3480.0 * 16 / 31, 60e-3, 0.939, 735.0},
                {40000, 2000.0, 0.5e-3, 40e3 * 16 / 31, 5e-3, 0.980, 768.0}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct pik_profile p;
        fields_default(&pik_fields, &p);
        p.clock_hz = rows[i].clock_hz;
        assert_true(near(pik_profile_k_hz_per_v(&p), rows[i].k_hz_per_v, 1e-12));
        assert_true(near(pik_profile_quantum_vs(&p), rows[i].quantum_vs, 1e-4));
        assert_true(near(pik_profile_limit_hz(&p), rows[i].limit_hz, 1e-12));
        const double ma_v_per_g = 9.8 * pik_profile_quantum_vs(&p) / rows[i].pulse_mps; /* Ma K SV = 1 */
        assert_true(near(ma_v_per_g, rows[i].ma_v_per_g, 1e-3));
        assert_true(near(rows[i].ra_ohm * 1.28e-3, ma_v_per_g, 4e-3));
    }
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    assert_true(near(pik_profile_step_v(&p), 10.0 / 3480.0 / (10e3 * 56e-9), 1e-12));
    assert_true(near(p.uc_v / pik_profile_step_v(&p), 3.75 / 5.1314, 1e-4)); /* pulses at which a reset begins */
    assert_int_equal(pik_profile_period_ns(&p), 10000000);
    p.recovery_ticks = 0;
    assert_true(near(pik_profile_limit_hz(&p), 3480.0, 1e-12));
}

static void bad_profiles_are_refused_in_words(void **state)
{
    (void)state;
    static const struct {
        const char *key, *value, *why;
    } rows[] = {
        {"uc_v", "2.5", "uc_v: expected 2.591 V or more"},
        {"uc_v", "2.6", NULL},
        {"rail_v", "9", "rail_v: expected more than Uc"},
        {"rail_v", "100", "rail_v: expected 16 steps"},
        {"c_int_nf", "560", "rail_v: expected 16 steps"},
        {"c_int_nf", "73", NULL},
        {"c_int_nf", "39.5", NULL},
        {"rr_ohm", "3e6", "rr_ohm: expected K"},
        {"rr_ohm", "50", "rr_ohm: expected K"},
        {"look_ticks", "12", "look_ticks: expected pulses 190 us late at most, got 198 us"},
        {"look_ticks", "11", NULL},
        {"look_ticks", "1", "look_ticks: expected 50000"},
        {"look_ticks", "2", NULL},
        {"switch_on_ns", "300000", "switch_on_ns: expected less"},
        {"switch_off_ns", "300000", "switch_off_ns: expected less"},
        {"input_off_ns", "300000", "input_off_ns: expected up to"},
        {"latch_us", "199", "latch_us: expected 0 or at least 200, got 199"},
        {"latch_us", "0", NULL},
        {"latch_ns", "1000000", NULL},
        {"strobe_ns", "100", "strobe_ns: expected strobe_min_ns"},
    };
    char why[300];
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct pik_profile p;
        fields_default(&pik_fields, &p);
        if (!fields_set(&pik_fields, &p, rows[i].key, 0, rows[i].value, why, sizeof why))
            fail_msg("row %u: %s", i, why);
        const bool ok = pik_profile_check(&p, why, sizeof why);
        if (ok != !rows[i].why) fail_msg("row %u: %s", i, ok ? "taken" : why);
        if (!ok && strncmp(why, rows[i].why, strlen(rows[i].why)) != 0) fail_msg("row %u: %s", i, why);
    }
}

/* Of fields that only together are wrong. */
static void bad_together(void **state)
{
    (void)state;
    char why[300];
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    p.grid = 64;
    p.clock_hz = 20000;
    p.c_int_nf = 10.0;
    assert_false(pik_profile_check(&p, why, sizeof why));
    assert_non_null(strstr(why, "grid: expected 990000"));
    fields_default(&pik_fields, &p);
    p.clock_hz = 60000;
    p.c_int_nf = 3.3;
    p.look_ticks = 19;
    assert_false(pik_profile_check(&p, why, sizeof why));
    assert_non_null(strstr(why, "look_ticks: expected 50000"));
    p.look_ticks = 20;
    p.recovery_ticks = 0;
    p.latch_us = 600000;
    assert_false(pik_profile_check(&p, why, sizeof why));
    assert_non_null(strstr(why, "got up to 36000 pulses in 600000 us"));
    fields_default(&pik_fields, &p);
    p.latch_us = 200;
    p.latch_ns = 200000;
    assert_false(pik_profile_check(&p, why, sizeof why));
    assert_non_null(strstr(why, "latch_ns: expected less than the period, got 200000"));
    fields_default(&pik_fields, &p);
    p.zero_v = 2.0;
    assert_false(pik_profile_check(&p, why, sizeof why));
    assert_non_null(strstr(why, "zero_v"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_of_the_article),
        cmocka_unit_test(bad_profiles_are_refused_in_words),
        cmocka_unit_test(bad_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
