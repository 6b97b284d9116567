/* MEMS accelerometer: model (1) of the calibration article, and what its noise becomes behind the converter. */
#include "rig.h"

#include "phys/sensor/mems.h"
#include "unit/unit.h"

#include <math.h>

#define G 9.81

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.12g, want %.12g within %g", got, want, tol);
}

static double out_v(struct mems *m, const double a_mps2[3], int64_t t_ns, int64_t every_ns)
{
    double v;
    mems_out_row_v(m, a_mps2, 1, &(struct looks){&t_ns, 1, every_ns}, &v);
    return v;
}

/* Rows: one term of the model at a time; acceleration in g, volts out. */
static void each_term_of_the_model(void **state)
{
    (void)state;
    const struct {
        struct mems_g p;
        double a_g[3];
        int64_t t_ns;
        double v;
    } rows[] = {
        {{.u0_v = 2.5}, {1, 2, 3}, 0, 2.5},
        {{.kx_v_per_g = 1.0}, {-0.5, 2, 3}, 0, -0.5},
        {{.ky_v_per_g = 0.0098}, {1, -1, 3}, 0, -0.0098},
        {{.kz_v_per_g = 0.003}, {1, 2, 0.5}, 0, 0.0015},
        {{.kxy_v_per_g2 = 0.0010}, {0.5, -1, 3}, 0, -0.0005},
        {{.kxx_v_per_g2 = 0.002}, {-0.5, 2, 3}, 0, 0.0005},
        {{.kyy_v_per_g2 = 0.004}, {1, -0.5, 3}, 0, 0.001},
        {{.drift_v_per_s = 1e-3}, {1, 2, 3}, 2500000000, 2.5e-3},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct mems_cfg cfg = mems_cfg_si(&rows[i].p, G);
        const double a[3] = {rows[i].a_g[0] * G, rows[i].a_g[1] * G, rows[i].a_g[2] * G};
        struct mems m;
        mems_init(&m, &cfg, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
        near(mems_true_v(&m, a, rows[i].t_ns), rows[i].v, 1e-15);
    }
}

static void a_second_look_at_one_instant_sees_the_same(void **state)
{
    (void)state;
    const struct mems_cfg cfg = mems_cfg_si(&(struct mems_g){.noise_v_rthz = 1e-4}, G);
    const double a[3] = {0};
    struct mems m;
    mems_init(&m, &cfg, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
    const double v = out_v(&m, a, 31250, 31250);
    near(out_v(&m, a, 31250, 31250), v, 0.0);
    assert_true(out_v(&m, a, 62500, 31250) != v);
}

/* White: the rms of a pull goes as 1 / sqrt(interval); 1e-4 V/rtHz at 31.25 us is 1e-4 sqrt(16 kHz) = 12.65 mV. */
static void noise_of_a_pull_follows_its_interval(void **state)
{
    (void)state;
    enum { N = 20000 };
    const struct {
        int64_t dt_ns;
        double rms_v;
    } rows[] = {{31250, 12.649e-3}, {7812, 25.3e-3}, {1000000, 2.236e-3}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const struct mems_cfg cfg = mems_cfg_si(&(struct mems_g){.noise_v_rthz = 1e-4}, G);
        const double a[3] = {0};
        struct mems m;
        double sum2 = 0.0;
        mems_init(&m, &cfg, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
        for (int64_t k = 1; k <= N; k++) {
            const double v = out_v(&m, a, k * rows[i].dt_ns, rows[i].dt_ns);
            sum2 += v * v;
        }
        near(sqrt(sum2 / N), rows[i].rms_v, 0.02 * rows[i].rms_v);
    }
}

/* White and slow noise, drift and quantum: a row, its looks one by one, and looks among which others come. */
static void no_look_changes_what_another_sees(void **state)
{
    (void)state;
    enum { N = 32, ROWS = 50 };
    const struct mems_g g = {.u0_v = 2.5,
                             .kx_v_per_g = 1.0,
                             .noise_v_rthz = 1e-4,
                             .drift_v_per_s = 1e-3,
                             .bias_instability_v = 1e-4,
                             .walk_v_rts = 1e-5,
                             .quantum_v = 1e-6};
    const struct mems_cfg cfg = mems_cfg_si(&g, G);
    struct mems row, one, often;
    const double a[3] = {1.0, 2.0, 3.0};
    mems_init(&row, &cfg, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
    one = often = row;
    for (unsigned k = 0; k < ROWS; k++) {
        int64_t t_ns[N];
        double v[N];
        for (unsigned i = 0; i < N; i++) t_ns[i] = (int64_t)(k * N + i) * 31250;
        mems_out_row_v(&row, a, 1, &(struct looks){t_ns, N, 31250}, v);
        for (unsigned i = 0; i < N; i++) {
            (void)out_v(&often, a, t_ns[i], 7000);
            if (out_v(&one, a, t_ns[i], 31250) != v[i] || out_v(&often, a, t_ns[i], 31250) != v[i])
                fail_msg("row %u, look %u", k, i);
            (void)out_v(&often, a, t_ns[i] + 11, 100);
            (void)mems_zero_moved_v(&often, t_ns[i] + 40000000);
        }
    }
}

/* Drift, walk and flicker are what the output has more than without them. */
static void the_zero_moves_as_the_output_does(void **state)
{
    (void)state;
    const struct mems_g still = {.u0_v = 2.5, .kx_v_per_g = 1.0};
    struct mems_g g = still;
    g.drift_v_per_s = 1e-3;
    g.walk_v_rts = 1e-3;
    g.bias_instability_v = 1e-4;
    const struct mems_cfg cfg = mems_cfg_si(&g, G), none = mems_cfg_si(&still, G);
    struct mems m, fixed;
    const double a[3] = {1.0, 2.0, 3.0};
    mems_init(&m, &cfg, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
    mems_init(&fixed, &none, draws_of(1, 1, "mems.x"), draws_of(1, 1, "mems.slow.x"));
    for (int64_t t_ns = 0; t_ns < 20000000000; t_ns += 1234567890) {
        const double moved_v = mems_zero_moved_v(&m, t_ns);
        near(out_v(&m, a, t_ns, 0) - out_v(&fixed, a, t_ns, 0), moved_v, 1e-12);
        if (t_ns > 0 && fabs(moved_v - 1e-3 * (double)t_ns / 1e9) < 1e-6) fail_msg("no slow noise in %g", moved_v);
    }
}

struct readings {
    unsigned n;
    double sum, sum2, lag1, last;
};

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    (void)t_ns;
    struct readings *r = ctx;
    const double v = f->code[0] * (1.25 * 8.0 / 8388608.0);
    if (r->n) r->lag1 += v * r->last;
    r->n++;
    r->sum += v;
    r->sum2 += v * v;
    r->last = v;
}

/* reading_noise_v is the rms of settled readings at 1000 SPS, minimum phase, at the sensor's output. The chain's 10 kHz
 * filter takes 0.1 % of it. Neighbouring readings correlate by 0.20 (from the published coefficients). */
static void reading_noise_is_what_the_wire_shows(void **state)
{
    (void)state;
    static struct unit u;
    static struct lab h;
    struct sched s;
    sched_init(&s);
    struct lab_cfg lab = lab_default();
    lab.site.g_mps2 = G;
    lab_init(&h, &lab, 1);
    struct unit_cfg cfg = unit_default("u");
    cfg.board.adc_noise_scale = 0.0;
    cfg.axis[0] = (struct unit_axis_cfg){.sensor = UNIT_MEMS, .mems = {.reading_noise_v = 1e-3}};
    unit_init(&u, &cfg, &h, &s);
    struct readings r = {0};
    u.store.psa2.host = (struct psa2_host){.ctx = &r, .frame = on_frame};
    psa2_power_up(&u.store.psa2, 0);
    sched_run_until(&s, 20 * NS_PER_S);
    assert_true(r.n > 19000);
    near(sqrt(r.sum2 / r.n), 1e-3, 0.02e-3);
    near(r.lag1 / r.sum2, 0.197, 0.03);
    near(r.sum / r.n, 0.0, 4e-3 / sqrt(r.n));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_term_of_the_model),
        cmocka_unit_test(a_second_look_at_one_instant_sees_the_same),
        cmocka_unit_test(noise_of_a_pull_follows_its_interval),
        cmocka_unit_test(no_look_changes_what_another_sees),
        cmocka_unit_test(the_zero_moves_as_the_output_does),
        cmocka_unit_test(reading_noise_is_what_the_wire_shows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
