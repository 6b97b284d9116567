/* Errors of a receiver's solutions: statistics, latency, what faults leave alone. */
#include "rig.h"

#include "base/detmath.h"
#include "phys/receiver/errors.h"

#include <math.h>
#include <string.h>

#define PERIOD_NS INT64_C(100000000)
#define NS_A_S    INT64_C(1000000000)
#define RUN       36000       /* an hour of solutions */
#define LONG      72000       /* twenty hours, one a second */
#define M_PER_RAD 6335439.327 /* meridian radius of WGS 84 at the equator: a (1 - e^2) */
#define N_PER_RAD 6378137.0

/* On the equator: it stands still, or goes north with a constant acceleration. */
struct truth {
    double accel_mps2, speed_mps;
};

static void place_at(void *ctx, int64_t t_ns, struct place *out)
{
    const struct truth *t = ctx;
    const double s = (double)t_ns * 1e-9;
    const double north_m = t->speed_mps * s + 0.5 * t->accel_mps2 * s * s;
    *out = (struct place){.lat_rad = north_m / M_PER_RAD};
    out->v_n_mps[1] = t->speed_mps + t->accel_mps2 * s;
}

static struct receiver_errors_cfg quiet(void)
{
    return (struct receiver_errors_cfg){
        .vertical_ratio = 1.5, .slow_s = 100.0, .outage_s = 1.0, .period_ns = PERIOD_NS};
}

static struct receiver_errors_cfg quiet_and_slow(void)
{
    struct receiver_errors_cfg c = quiet();
    c.period_ns = NS_A_S;
    return c;
}

static struct receiver_errors begin(const struct receiver_errors_cfg *c)
{
    struct receiver_errors e;
    receiver_errors_init(&e, c, rig_seed(7), 3);
    return e;
}

static struct receiver_solution solve(struct receiver_errors *e, struct truth *t, int k)
{
    struct receiver_solution s;
    receiver_errors_solve(e, place_at, t, (k + 1) * e->cfg.period_ns, &s);
    return s;
}

/* Of n samples: standard deviation, and correlation of neighbours so many apart. */
static double sd_of(const double *x, int n)
{
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < n; i++) sum += x[i], squares += x[i] * x[i];
    return sqrt(squares / n - sum / n * (sum / n));
}

static double correlation(const double *x, int n, int lag)
{
    double both = 0.0, own = 0.0;
    for (int i = 0; i + lag < n; i++) both += x[i] * x[i + lag], own += x[i] * x[i];
    return both / own;
}

static double north[LONG], east[LONG], up[LONG], v_north[LONG];

static void record(struct receiver_errors *e, int n)
{
    struct truth still = {0.0, 0.0};
    for (int k = 0; k < n; k++) {
        const struct receiver_solution s = solve(e, &still, k);
        assert_true(s.valid);
        north[k] = s.place.lat_rad * M_PER_RAD;
        east[k] = s.place.lon_rad * N_PER_RAD;
        up[k] = s.place.h_m;
        v_north[k] = s.place.v_n_mps[1];
    }
}

#define assert_near(a, b, within)                                                                                      \
    do {                                                                                                               \
        const double a_ = (a), b_ = (b);                                                                               \
        if (!(fabs(a_ - b_) <= (within))) fail_msg("%s: %.9g, expected %.9g +- %.3g", #a, a_, b_, (double)(within));   \
    } while (0)

static void an_ideal_receiver_says_where_it_was(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    c.position_delay_ns = 3 * PERIOD_NS;
    c.velocity_delay_ns = 2 * PERIOD_NS;
    struct receiver_errors e = begin(&c);
    struct truth t = {2.0, 100.0};
    for (int k = 0; k < 100; k++) {
        const struct receiver_solution s = solve(&e, &t, k);
        const double at_s = fmax(0.1 * (k + 1 - 3), 0.0), v_s = fmax(0.1 * (k + 1 - 5), 0.0);
        assert_near(s.place.lat_rad * M_PER_RAD, 100.0 * at_s + at_s * at_s, 1e-6);
        assert_near(s.place.v_n_mps[1], 100.0 + 2.0 * v_s, 1e-9);
        assert_near(s.place.lon_rad, 0.0, 0.0);
    }
}

static void a_velocity_may_be_younger_than_the_position(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    c.position_delay_ns = 3 * PERIOD_NS;
    c.velocity_delay_ns = -2 * PERIOD_NS;
    struct receiver_errors e = begin(&c);
    struct truth t = {2.0, 0.0};
    struct receiver_solution s;
    for (int k = 0; k < 50; k++) s = solve(&e, &t, k);
    assert_near(s.place.v_n_mps[1], 2.0 * 4.9, 1e-9);
}

/* White noise: the standard deviation of 36000 draws is known to 0.4 %. */
static void white_noise_has_its_size_and_no_memory(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    c.white_m = 2.0;
    c.white_mps = 0.1;
    struct receiver_errors e = begin(&c);
    record(&e, RUN);
    assert_near(sd_of(north, RUN), 2.0, 0.04);
    assert_near(sd_of(east, RUN), 2.0, 0.04);
    assert_near(sd_of(up, RUN), 3.0, 0.06);
    assert_near(sd_of(v_north, RUN), 0.1, 0.002);
    assert_near(correlation(north, RUN, 1), 0.0, 0.03);
}

/* Twenty hours are 720 time constants: the standard deviation is known to 3 %, a correlation to about 0.05. */
static void slow_errors_are_a_gauss_markov_process(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet_and_slow();
    c.slow_m = 2.0;
    c.slow_mps = 0.1;
    struct receiver_errors e = begin(&c);
    record(&e, LONG);
    assert_near(sd_of(north, LONG), 2.0, 0.25);
    assert_near(sd_of(up, LONG), 3.0, 0.45);
    assert_near(sd_of(v_north, LONG), 0.1, 0.015);
    assert_near(correlation(north, LONG, 100), exp(-1.0), 0.12); /* one time constant */
    assert_near(correlation(north, LONG, 1), exp(-0.01), 0.002);
}

static void outliers_come_at_their_rate_and_leave_the_next_alone(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet_and_slow();
    c.outliers_per_h = 200.0;
    c.outlier_m = 50.0;
    struct receiver_errors e = begin(&c);
    record(&e, LONG);
    int count = 0;
    for (int k = 0; k < LONG; k++) {
        const double size = hypot(north[k], east[k]);
        if (size > 0.0) assert_near(size, 50.0, 1e-3);
        assert_near(v_north[k], 0.0, 0.0);
        count += size > 0.0;
    }
    assert_near(count, 20.0 * 200.0, 280.0); /* 4.5 standard deviations */
}

static void a_jump_stays(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet_and_slow();
    c.jumps_per_h = 60.0;
    c.jump_m = 3.0;
    struct receiver_errors e = begin(&c);
    record(&e, LONG);
    int count = 0;
    double squares = 0.0;
    for (int k = 1; k < LONG; k++) {
        const double by_m = north[k] - north[k - 1];
        count += fabs(by_m) > 1e-6;
        squares += by_m * by_m;
    }
    assert_near(count, 20.0 * 60.0, 155.0);
    assert_near(sqrt(squares / count), 3.0, 0.3);
}

static void outages_have_their_rate_and_length(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet_and_slow();
    struct truth still = {0.0, 0.0};
    c.outages_per_h = 60.0;
    c.outage_s = 5.0;
    struct receiver_errors e = begin(&c);
    int invalid = 0, begun = 0;
    bool was = true;
    for (int k = 0; k < LONG; k++) {
        const bool valid = solve(&e, &still, k).valid;
        invalid += !valid;
        begun += was && !valid;
        was = valid;
    }
    assert_near(begun, 1200.0 * exp(-60.0 * 5.0 / 3600.0), 170.0); /* one may begin within another */
    assert_near((double)invalid / LONG, 1.0 - exp(-60.0 * 5.0 / 3600.0), 0.015);
}

/* Draws are by number: what a fault does leaves all noise where it is. */
static void an_offset_is_added_and_shifts_no_noise(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    struct truth still = {0.0, 0.0};
    c.white_m = 1.0;
    c.slow_m = 1.0;
    c.outages_per_h = 600.0;
    struct receiver_errors one = begin(&c), two = begin(&c);
    two.offset = (struct receiver_offset){
        .rate_mps = {0.0, 2.0}, .base_m = {7.0, 0.0}, .from_ns = 10 * PERIOD_NS, .jump_m = {0.0, 30.0}};
    for (int k = 20; k < 2000; k++) {
        const struct receiver_solution a = solve(&one, &still, k), b = solve(&two, &still, k);
        assert_int_equal(a.valid, b.valid);
        if (!a.valid) continue;
        assert_near((b.place.lat_rad - a.place.lat_rad) * M_PER_RAD, 30.0 + 2.0 * 0.1 * (k + 1 - 10), 1e-5);
        assert_near((b.place.lon_rad - a.place.lon_rad) * N_PER_RAD, 7.0, 1e-5);
        assert_near(b.place.v_n_mps[1] - a.place.v_n_mps[1], 2.0, 1e-9);
    }
}

static void the_same_seed_gives_the_same_solutions_and_a_restart_others(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    struct truth still = {0.0, 0.0};
    c.white_m = c.slow_m = 1.0;
    struct receiver_errors one = begin(&c), two = begin(&c);
    for (int k = 0; k < 100; k++)
        assert_true(solve(&one, &still, k).place.lat_rad == solve(&two, &still, k).place.lat_rad);
    receiver_errors_restart(&two);
    assert_false(solve(&one, &still, 100).place.lat_rad == solve(&two, &still, 100).place.lat_rad);
}

/* With a time constant much shorter than the period each slow error is the draw of its solution. */
static void no_draw_is_used_twice(void **state)
{
    (void)state;
    struct receiver_errors_cfg c = quiet();
    struct truth still = {0.0, 0.0};
    c.slow_s = 1e-3;
    struct receiver_errors e = begin(&c);
    (void)solve(&e, &still, 0);
    receiver_errors_restart(&e);
    const double at_start = e.slow_unit[0];
    (void)solve(&e, &still, 1);
    assert_false(e.slow_unit[0] == at_start);
}

/* ---- displacement */

static void metres_are_those_of_the_ellipsoid(void **state)
{
    static const struct {
        double lat_deg, m_per_deg_lat, m_per_deg_lon; /* NIMA TR8350.2: M pi/180, N cos(lat) pi/180 */
    } rows[] = {{0.0, 110574.2758, 111319.4908}, {45.0, 111131.7778, 78846.8351}, {60.0, 111412.2403, 55800.1694}};
    (void)state;
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct place p = {.lat_rad = rows[i].lat_deg * RAD_PER_DEG};
        place_displace(&p, (const double[]){100.0, 100.0, 5.0});
        assert_near((p.lat_rad / RAD_PER_DEG - rows[i].lat_deg) * rows[i].m_per_deg_lat, 100.0, 1e-3);
        assert_near(p.lon_rad / RAD_PER_DEG * rows[i].m_per_deg_lon, 100.0, 1e-3);
        assert_near(p.h_m, 5.0, 0.0);
    }
}

static void over_a_pole_and_the_antimeridian(void **state)
{
    (void)state;
    struct place p = {.lat_rad = 90.0 * RAD_PER_DEG - 50.0 / 6399593.6, .lon_rad = 0.5};
    place_displace(&p, (const double[]){0.0, 100.0, 0.0});
    assert_near(p.lat_rad, 90.0 * RAD_PER_DEG - 50.0 / 6399593.6, 1e-9);
    assert_near(p.lon_rad, 0.5 - 180.0 * RAD_PER_DEG, 1e-9);
    p = (struct place){.lon_rad = 180.0 * RAD_PER_DEG};
    place_displace(&p, (const double[]){100.0, 0.0, 0.0});
    assert_near(p.lon_rad, -180.0 * RAD_PER_DEG + 100.0 / N_PER_RAD, 1e-12);
    p = (struct place){.lat_rad = -90.0 * RAD_PER_DEG};
    place_displace(&p, (const double[]){3.0, -3.0, 0.0});
    assert_true(p.lat_rad >= -90.0 * RAD_PER_DEG && fabs(p.lon_rad) <= 180.0 * RAD_PER_DEG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_ideal_receiver_says_where_it_was),
        cmocka_unit_test(a_velocity_may_be_younger_than_the_position),
        cmocka_unit_test(white_noise_has_its_size_and_no_memory),
        cmocka_unit_test(slow_errors_are_a_gauss_markov_process),
        cmocka_unit_test(outliers_come_at_their_rate_and_leave_the_next_alone),
        cmocka_unit_test(a_jump_stays),
        cmocka_unit_test(outages_have_their_rate_and_length),
        cmocka_unit_test(an_offset_is_added_and_shifts_no_noise),
        cmocka_unit_test(the_same_seed_gives_the_same_solutions_and_a_restart_others),
        cmocka_unit_test(no_draw_is_used_twice),
        cmocka_unit_test(metres_are_those_of_the_ellipsoid),
        cmocka_unit_test(over_a_pole_and_the_antimeridian),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
