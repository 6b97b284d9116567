/* The unit's own navigation: alignment at rest, Schuler's oscillation under a zero of an accelerometer, turns of the table. */
#include "bins_rig.h"

#include "phys/motion/earth.h"

#define COUNT_RAD  1e-15
#define CODE_MPS   1e-10
#define STEP_NS    INT64_C(10000000)
#define SCHULER_S  5068.0 /* 2 pi sqrt(N/g) at 55.7 deg north, 9.815 m/s^2 */
#define G_MPS2     9.815
#define VERTICAL_M 6392737.0 /* N of WGS 84 there */

static struct rig r;
static struct bins b;

/* A unit without converters: b along east, north, up, of a fine resolution. */
static void bare(bool aligned)
{
    memset(&b, 0, sizeof b);
    b.nav.set = b.nav.taken = (struct bins_nav_settings){.lat_rad = RIG_LATITUDE, .alignment_s = 10.0};
    b.profile.nav_every = 20;
    b.nav.state = aligned ? BINS_NAV_RUNNING : BINS_NAV_ALIGNING;
    b.nav.every = 20;
    b.nav.gyro_rad = COUNT_RAD;
    b.nav.accel_mps = CODE_MPS;
    b.nav.lat_rad = RIG_LATITUDE;
    b.nav.q[0] = 1.0;
}

/* A reading at rest in the attitude whose rows are east, north, up in b, with a force that the accelerometers add. */
static bool still(const double c[3][3], const double extra_mps2[3])
{
    struct bins_reading g = {.t_ns = b.nav.t_ns + STEP_NS};
    const double u[3] = {0.0, EARTH_RATE_RADPS * det_cos(RIG_LATITUDE), EARTH_RATE_RADPS * det_sin(RIG_LATITUDE)};
    for (unsigned i = 0; i < 3; i++) {
        const double w = c[1][i] * u[1] + c[2][i] * u[2], f = c[2][i] * G_MPS2 + extra_mps2[i];
        g.gyro[i] = (int32_t)floor(w * 0.01 / COUNT_RAD + 0.5);
        g.accel[i] = (int32_t)floor(f * 0.01 / CODE_MPS + 0.5);
    }
    return bins_nav_take(&b.nav, &g);
}

static const double level[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

static void a_zero_of_an_accelerometer_swings_with_schuler_s_period(void **state)
{
    const double zero[3] = {1e-3, 0.0, 0.0}, w = 2.0 * 3.141592653589793 / SCHULER_S;
    double most_m = 0.0;
    (void)state;
    bare(true);
    for (int k = 1; k <= 506800; k++) {
        (void)still(level, zero);
        const double t_s = 0.01 * k, due_m = 1e-3 / (w * w) * (1.0 - det_cos(w * t_s));
        const double east_m = b.nav.lon_rad * VERTICAL_M * det_cos(RIG_LATITUDE);
        most_m = fmax(most_m, fabs(east_m - due_m));
    }
    /* 1.3 km there and back; the Earth's turn moves the plane of the swing by some 9 deg in the hour and a half */
    assert_in_range((unsigned)most_m, 0, 130);
    assert_true(fabs(b.nav.v_mps[0]) < 0.02 * 1e-3 / w);
    assert_int_equal(b.nav.state, BINS_NAV_RUNNING);
}

/* In a second at 200 m/s to the east, then to the north: the Coriolis force, the turn of the meridian, the way. */
static void a_unit_under_way_is_turned_and_carried(void **state)
{
    const double none[3] = {0.0, 0.0, 0.0}, u_up = EARTH_RATE_RADPS * det_sin(RIG_LATITUDE);
    const double turn = 200.0 / VERTICAL_M * det_sin(RIG_LATITUDE) / det_cos(RIG_LATITUDE);
    (void)state;
    bare(true);
    b.nav.v_mps[0] = 200.0;
    for (int k = 0; k < 100; k++) (void)still(level, none);
    assert_true(fabs(b.nav.v_mps[1] / (-200.0 * (2.0 * u_up + turn)) - 1.0) < 0.01);
    assert_true(fabs(b.nav.lon_rad * VERTICAL_M * det_cos(RIG_LATITUDE) - 200.0) < 0.05);
    bare(true);
    b.nav.v_mps[1] = 200.0;
    for (int k = 0; k < 100; k++) (void)still(level, none);
    assert_true(fabs(b.nav.v_mps[0] / (200.0 * 2.0 * u_up) - 1.0) < 0.01);
    assert_true(fabs((b.nav.lat_rad - RIG_LATITUDE) * 6379200.0 - 200.0) < 0.05); /* M of WGS 84 there */
}

static void at_rest_nothing_moves(void **state)
{
    const double none[3] = {0.0, 0.0, 0.0};
    unsigned outputs = 0;
    (void)state;
    bare(true);
    for (int k = 0; k < 360000; k++) outputs += still(level, none);
    assert_int_equal(outputs, 18000);
    assert_true(fabs(b.nav.v_mps[0]) < 1e-6 && fabs(b.nav.v_mps[1]) < 1e-6);
    assert_true(fabs(b.nav.lat_rad - RIG_LATITUDE) * 6.4e6 < 5e-3 && fabs(b.nav.lon_rad) * 6.4e6 < 5e-3);
}

static void aligns_in_any_attitude(void **state)
{
    const double none[3] = {0.0, 0.0, 0.0};
    const double rows[3][3][3] = {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
                                  {{0.6, -0.8, 0}, {-0.8, -0.6, 0}, {0, 0, -1}},
                                  {{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}};
    (void)state;
    for (unsigned k = 0; k < 3; k++) {
        bare(false);
        bool due = false;
        for (int i = 0; i < 1000; i++) {
            assert_false(due);
            due = still(rows[k], none);
        }
        assert_true(due); /* the first outputs are of the end of the alignment */
        assert_int_equal(b.nav.state, BINS_NAV_RUNNING);
        const double *q = b.nav.q;
        const double up[3] = {2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                              1 - 2 * (q[1] * q[1] + q[2] * q[2])};
        const double north[3] = {2 * (q[1] * q[2] + q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]),
                                 2 * (q[2] * q[3] - q[0] * q[1])};
        for (unsigned i = 0; i < 3; i++) {
            assert_true(fabs(up[i] - rows[k][2][i]) < 1e-8);
            assert_true(fabs(north[i] - rows[k][1][i]) < 1e-6);
        }
    }
}

static void what_moves_does_not_align(void **state)
{
    struct bins_reading g = {.t_ns = STEP_NS, .gyro = {(int32_t)(0.11 * RAD_PER_DEG * 0.01 / 1e-14)}};
    (void)state;
    bare(false);
    b.nav.gyro_rad = 1e-14;
    assert_false(bins_nav_take(&b.nav, &g));
    assert_int_equal(b.nav.state, BINS_NAV_FAILED);
    assert_false(bins_nav_take(&b.nav, &g));
}

static void start_navigation(void)
{
    struct bins *u = rig_bins(&r);
    bins_nav_start(&u->nav, &u->latest, u->profile.nav_every, u->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC,
                   bins_accel_mps_per_code(u));
}

static unsigned shown;

static void on_navigated(void *ctx, int64_t t_ns)
{
    double w[3];
    (void)ctx;
    (void)t_ns;
    bins_nav_rates(&rig_bins(&r)->nav, w);
    shown++;
    if (shown == 30) assert_true(fabs(w[0] / RAD_PER_DEG - 10.0) < 0.01);
}

/* Sixty seconds of alignment, a turn by 360 deg about x, and back at rest: the unit is where it was. */
static void it_follows_the_table(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    shown = 0;
    rig_up(&r, &p, true, 1);
    rig_bins(&r)->host = (struct bins_host){.ctx = &r, .reading = rig_take, .navigated = on_navigated};
    rig_bins(&r)->nav.set.lat_rad = RIG_LATITUDE;
    rig_run(&r, 1.0);
    rig_bins(&r)->nav.set.alignment_s = 60.0;
    start_navigation();
    rig_run(&r, 60.5);
    struct bins_nav *n = &rig_bins(&r)->nav;
    assert_int_equal(n->state, BINS_NAV_RUNNING);
    double q[4];
    memcpy(q, n->q, sizeof q);
    rig_position(&r, 0, 360.0, 10.0);
    rig_run(&r, 40.0);
    double same = 0.0;
    for (unsigned i = 0; i < 4; i++) same += q[i] * n->q[i];
    assert_true(fabs(same) > 1.0 - 1e-9);
    assert_true(fabs(n->v_mps[0]) < 0.01 && fabs(n->v_mps[1]) < 0.01);
    assert_true(shown > 190);
}

/* What is written while it aligns or navigates is for the next start (proto/bins.yaml, 2212h). */
static void settings_are_taken_at_the_start(void **state)
{
    const double none[3] = {0.0, 0.0, 0.0};
    double lat_rad[2];
    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        bare(false);
        bins_nav_start(&b.nav, &(struct bins_reading){.t_ns = 0}, 20, COUNT_RAD, CODE_MPS);
        if (i) b.nav.set.alignment_s = 5.0;
        for (unsigned k = 0; k < 999; k++) (void)still(level, none);
        assert_int_equal(b.nav.state, BINS_NAV_ALIGNING);
        assert_true(still(level, none));
        if (i) b.nav.set.h_m = 20000.0;
        b.nav.v_mps[1] = 200.0;
        for (unsigned k = 0; k < 1000; k++) (void)still(level, none);
        lat_rad[i] = b.nav.lat_rad;
    }
    assert_true(lat_rad[0] == lat_rad[1] && lat_rad[0] > RIG_LATITUDE);
}

static void a_reset_ends_it(void **state)
{
    const struct bins_profile p = rig_ideal();
    (void)state;
    rig_up(&r, &p, true, 1);
    rig_run(&r, 1.0);
    start_navigation();
    rig_run(&r, 1.0);
    assert_int_equal(rig_bins(&r)->nav.state, BINS_NAV_ALIGNING);
    bins_reset(rig_bins(&r), r.s.now_ns);
    assert_int_equal(rig_bins(&r)->nav.state, BINS_NAV_OFF);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_zero_of_an_accelerometer_swings_with_schuler_s_period),
        cmocka_unit_test(a_unit_under_way_is_turned_and_carried),
        cmocka_unit_test(at_rest_nothing_moves),
        cmocka_unit_test(aligns_in_any_attitude),
        cmocka_unit_test(what_moves_does_not_align),
        cmocka_unit_test(it_follows_the_table),
        cmocka_unit_test(settings_are_taken_at_the_start),
        cmocka_unit_test(a_reset_ends_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
