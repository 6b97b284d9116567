/* Bias instability of the inertial unit's gyros and accelerometers: its Allan deviation, axes of their own, seeds. */
#include "bins_rig.h"

#include <stdlib.h>

#define SECONDS      512u
#define GYRO_DEGPH   20.0
#define ACCEL_MPS2   0.02
#define FLICKER      0.66428 /* sqrt(2 ln 2 / pi): Allan deviation of flicker over its B, IEEE Std 952-1997 C.1.3 */
#define READINGS_A_S 100u

static struct rig r;

/* Means of a second, in units of B. */
static struct means {
    double value[SECONDS][6];
    unsigned n, in;
} means[2];

static void add_mean(struct rig *rig, const struct bins_reading *g)
{
    struct means *m = rig->own;
    const double of[2] = {0.01 * RAD_PER_ARCSEC / (GYRO_DEGPH * DEGPH),
                          bins_accel_mps_per_code(rig_bins(rig)) / ACCEL_MPS2};
    if (m->n == SECONDS) return;
    for (unsigned i = 0; i < 6; i++) m->value[m->n][i] += (i < 3 ? g->gyro[i] : g->accel[i - 3]) * of[i / 3];
    if (++m->in < READINGS_A_S) return;
    m->in = 0;
    m->n++;
}

static struct bins_profile unstable(void)
{
    struct bins_profile p = rig_ideal();
    p.gyro_instability_degph = GYRO_DEGPH;
    p.accel_instability_mps2 = ACCEL_MPS2;
    return p;
}

static void record(struct means *m, const struct bins_profile *p, uint64_t seed, double seconds)
{
    memset(m, 0, sizeof *m);
    rig_up(&r, p, false, seed);
    rig_run(&r, 0.5);
    r.own = m;
    r.on_reading = add_mean;
    rig_run(&r, seconds);
}

static double allan_deviation(const struct means *m, unsigned channel, unsigned tau_s)
{
    double before = 0.0, sum2 = 0.0;
    const unsigned count = SECONDS / tau_s;
    for (unsigned k = 0; k < count; k++) {
        double mean = 0.0;
        for (unsigned i = 0; i < tau_s; i++) mean += m->value[k * tau_s + i][channel] / tau_s;
        if (k > 0) sum2 += (mean - before) * (mean - before);
        before = mean;
    }
    return sqrt(sum2 / (2.0 * (count - 1)));
}

/* Flat from 1 s to 300 s within 3 %; of n averages the deviation is known to sqrt(3/(4 n)) at most, of three axes to 0.58 of
 * it: three of those. */
static void its_allan_deviation_is_that_of_flicker(void **state)
{
    const struct bins_profile p = unstable();
    (void)state;
    record(&means[0], &p, 1, SECONDS + 1.0);
    assert_int_equal(means[0].n, SECONDS);
    for (unsigned tau_s = 1; tau_s <= 16; tau_s *= 4) {
        const double span = 0.03 + 3.0 * 0.58 * sqrt(0.75 * tau_s / SECONDS);
        for (unsigned triad = 0; triad < 2; triad++) {
            double sum2 = 0.0;
            for (unsigned i = 0; i < 3; i++) sum2 += pow(allan_deviation(&means[0], 3 * triad + i, tau_s), 2.0);
            const double ratio = sqrt(sum2 / 3.0) / FLICKER;
            if (fabs(ratio - 1.0) > span)
                fail_msg("%s, %u s: %.3f of 0.664 B, expected 1 +- %.3f", triad ? "accelerometers" : "gyros", tau_s,
                         ratio, span);
        }
    }
}

/* Correlation of what changes from a second to the next: that of values themselves is not known from a flicker. */
static double correlation(const struct means *a, unsigned i, const struct means *b, unsigned j)
{
    double ab = 0.0, aa = 0.0, bb = 0.0;
    for (unsigned k = 1; k < SECONDS; k++) {
        const double x = a->value[k][i] - a->value[k - 1][i], y = b->value[k][j] - b->value[k - 1][j];
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    return ab / sqrt(aa * bb);
}

static void each_axis_and_each_seed_has_its_own(void **state)
{
    const struct bins_profile p = unstable();
    (void)state;
    record(&means[1], &p, 2, SECONDS + 1.0); /* means[0]: of the test before */
    assert_int_equal(means[0].n, SECONDS);
    const double limit = 4.0 * sqrt(2.0 / SECONDS); /* neighbours are correlated */
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned j = 0; j < i; j++) assert_true(fabs(correlation(&means[0], i, &means[0], j)) < limit);
        assert_true(fabs(correlation(&means[0], i, &means[1], i)) < limit);
    }
}

static void the_same_seed_gives_the_same_bytes_whoever_looks(void **state)
{
    const struct bins_profile p = unstable();
    int64_t gyro[2][3], accel[2][3];
    (void)state;
    for (unsigned k = 0; k < 2; k++) {
        rig_up(&r, &p, false, 3);
        for (unsigned i = 0; i < 400; i++) {
            rig_run(&r, 0.00517);
            if (k) unit_sample_until(&r.u, r.s.now_ns);
        }
        memcpy(gyro[k], r.gyro, sizeof gyro[k]);
        memcpy(accel[k], r.accel, sizeof accel[k]);
    }
    for (unsigned i = 0; i < 3; i++) assert_true(llabs(gyro[0][i] - gyro[1][i]) <= 1 && gyro[0][i] != 0);
    assert_memory_equal(accel[0], accel[1], sizeof accel[0]);
}

/* By default there is none: an ideal unit at rest counts nothing. */
static void without_the_keys_there_is_none(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    record(&means[0], &p, 1, 20.0);
    for (unsigned k = 1; k < 19; k++)
        for (unsigned i = 0; i < 6; i++) assert_true(means[0].value[k][i] == means[0].value[0][i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(its_allan_deviation_is_that_of_flicker),
        cmocka_unit_test(each_axis_and_each_seed_has_its_own),
        cmocka_unit_test(the_same_seed_gives_the_same_bytes_whoever_looks),
        cmocka_unit_test(without_the_keys_there_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
