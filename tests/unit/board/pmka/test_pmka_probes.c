/* PMKA: the voltages of its integrators as real-valued channels: the waveforms of figures 4 and 5 of the article. */
#include "pmka_rig.h"

#define PROBES 20000u
#define TS_NS  INT64_C(4800000)

struct probe {
    int64_t t_ns;
    unsigned channel;
    double v;
};

static struct rig rig, other;
static struct probe probe[PROBES];
static unsigned probes;

static void on_value(void *ctx, unsigned channel, double v, int64_t t_ns)
{
    (void)ctx;
    assert_true(probes == 0 || t_ns >= probe[probes - 1].t_ns);
    assert_true(probes < PROBES);
    probe[probes++] = (struct probe){t_ns, channel, v};
}

/* Beats of four machine cycles of 3 Ts, as ours are in figure 5. */
static struct pmka_profile beats(struct pmka_profile p)
{
    p.beat_periods = 12;
    p.zero_periods = 3;
    return p;
}

static void up(struct rig *r, struct pmka_profile p)
{
    p = beats(p);
    rig_init(r, &p);
    r->input[0].mean_v = 2.6;
    r->input[1].mean_v = -1.7;
    r->input[2].mean_v = 1.1;
    pmka_board.power_up(&r->b.base, 0);
}

static void watch(struct rig *r)
{
    probes = 0;
    r->b.base.trace.reals->value = on_value;
}

static const struct probe *find(unsigned channel, int64_t t_ns)
{
    for (unsigned k = 0; k < probes; k++)
        if (probe[k].channel == channel && probe[k].t_ns == t_ns) return &probe[k];
    fail_msg("no value of channel %u at %lld ns", channel, (long long)t_ns);
    return NULL;
}

static void each_sample_is_its_code(void **state)
{
    (void)state;
    up(&rig, rig_ideal());
    watch(&rig);
    rig_readings(&rig, 100);
    assert_int_equal(rig.b.reals.count, PMKA_INTS);
    assert_string_equal(rig.b.reals.name[PMKA_K], "U_K");
    for (unsigned k = 0; k < 100; k++)
        for (unsigned i = 0; i < PMKA_INTS; i++) {
            const int64_t t_ns = rig.reading[k].t_ns + i * (int64_t)rig.b.profile.mux_step_ns;
            assert_int_equal((int)floor(find(i, t_ns)->v * 3276.8 + 0.5), rig.reading[k].code[i]);
        }
}

/* 2.6 V on X: half a period brings 0.6915 V, a reset takes Ur = 5.106 V meanwhile. */
static void a_reset_ends_half_a_period_after_its_sample(void **state)
{
    (void)state;
    unsigned seen = 0;
    up(&rig, rig_ideal());
    watch(&rig);
    rig_readings(&rig, 100);
    const double half_s = 0.5e-9 * (double)TS_NS, ur_v = 10.0 * half_s / (10e3 * 0.47e-6),
                 half_v = 2.6 * half_s / (20e3 * 0.47e-6);
    for (unsigned k = 1; k < 100; k++) {
        const struct pmka_reading *r = &rig.reading[k];
        if (r->reset[0] == 0 || r->serves[0] != 1 || rig.reading[k - 1].serves[0] != 1) continue;
        const double from_v = find(0, r->t_ns - TS_NS)->v, to_v = find(0, r->t_ns - TS_NS / 2)->v;
        assert_true(fabs(to_v - from_v - (half_v - ur_v)) < 1e-6);
        seen++;
    }
    assert_true(seen > 5);
}

/* Keys move 20 us before and after K is sampled: at t1, t2, t3 the levels of both are there, U_X1 and U_K1 and so on; they
 * differ by volts, and each goes on from its own level. */
static void both_levels_at_a_hand_over(void **state)
{
    (void)state;
    up(&rig, rig_ideal());
    watch(&rig);
    rig_readings(&rig, 80);
    double most_v = 0.0;
    for (unsigned k = 1; k + 1 < 80; k++) {
        const unsigned tau = rig.reading[k + 1].tau;
        if (tau == rig.reading[k].tau || tau < 2 || tau > 4) continue;
        const int64_t t_ns = rig.reading[k].t_ns + 3 * (int64_t)rig.b.profile.mux_step_ns + rig.b.profile.key_gap_ns;
        const double axis_v = find(tau - 2, t_ns)->v, k_v = find(PMKA_K, t_ns)->v;
        /* K rested since its sample 20 us before: its level is that of its code */
        assert_int_equal((int)floor(k_v * 3276.8 + 0.5), rig.reading[k].code[PMKA_K]);
        most_v = fmax(most_v, fabs(axis_v - k_v));
    }
    assert_true(most_v > 1.0);
}

static void digest(struct rig *r, char hex[SHA256_HEX])
{
    struct sha256 s;
    pmka_sample_until(&r->b, r->s.now_ns);
    sha256_init(&s);
    pmka_board.digest(&r->b.base, &s);
    sha256_hex(&s, hex);
}

/* At an instant within a reset, too. */
static void probing_changes_nothing(void **state)
{
    (void)state;
    char a[SHA256_HEX], b[SHA256_HEX];
    for (unsigned watched = 0; watched < 2; watched++) {
        struct rig *r = watched ? &other : &rig;
        up(r, rig_profile());
        r->input[0] = (struct rig_input){.mean_v = 1.0, .amp_v = {5.0}, .hz = {13.0}};
        if (watched) watch(r);
        rig_run(r, 300 * TS_NS + 3100000);
    }
    assert_true(probes > 1000);
    assert_int_equal(rig.readings, other.readings);
    for (unsigned k = 0; k < rig.readings; k++) assert_memory_equal(rig.reading[k].code, other.reading[k].code, 8);
    digest(&rig, a);
    digest(&other, b);
    assert_string_equal(a, b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_sample_is_its_code),
        cmocka_unit_test(a_reset_ends_half_a_period_after_its_sample),
        cmocka_unit_test(both_levels_at_a_hand_over),
        cmocka_unit_test(probing_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
