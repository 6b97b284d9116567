/* Quartz accelerometer: scale, zero signal against temperature, play, and the answer of its loop. */
#include "rig.h"

#include "base/sched.h"
#include "phys/sensor/quartz.h"
#include "unit/unit.h"

#include <math.h>
#include <string.h>

#define G      9.81
#define ARCSEC 4.84813681109536e-6

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

static struct quartz up(const struct quartz_g *cfg)
{
    struct quartz q;
    quartz_init(&q, cfg, G, draws_of(1, 1, "quartz.x"), draws_of(1, 1, "quartz.start.x"));
    return q;
}

static double out_a(struct quartz *q, const double a_mps2[3], int64_t t_ns, int64_t every_ns)
{
    double a;
    quartz_out_row_a(q, a_mps2, 1, &(struct looks){&t_ns, 1, every_ns}, &a);
    return a;
}

static void each_term_of_the_model(void **state)
{
    (void)state;
    const struct {
        struct quartz_g cfg;
        double a_g[3], degc, current_a;
    } rows[] = {
        {{.scale_a_per_g = 1.28e-3}, {1, 1, 1}, 70, 1.28e-3},
        {{.scale_a_per_g = 1e-3, .zero_ug = 50}, {0, 0, 0}, 70, 50e-9},
        {{.scale_a_per_g = 1e-3, .slope_ug_per_k = 2}, {0, 0, 0}, 40, 20e-9},
        {{.scale_a_per_g = 1e-3, .scale_tc_ppm_per_k = 100}, {-1, 0, 0}, 40, -1.001e-3},
        {{.scale_a_per_g = 1e-3, .tilt_y_mrad = 2, .tilt_z_mrad = -1}, {0, 0.5, 1}, 30, 0},
        {{.scale_a_per_g = 1e-3, .tilt_y_mrad = 2}, {0, 0.5, 1}, 30, 1e-6},
        {{.scale_a_per_g = 1e-3, .square_ug_per_g2 = 30}, {-2, 0, 0}, 30, -2e-3 + 120e-9},
        {{.scale_a_per_g = 1e-3, .limit_a = 1.5e-3}, {2, 0, 0}, 30, 1.5e-3},
        {{.scale_a_per_g = 1e-3, .curve_ug = 300, .curve_centre_degc = 10, .curve_width_k = 25},
         {0, 0, 0},
         60,
         600e-9 * 0.22313016014842982},
        {{.scale_a_per_g = 1e-3, .curve_ug = 300, .curve_centre_degc = 10, .curve_width_k = 50}, {0, 0, 0}, 60, 300e-9},
        {{.scale_a_per_g = 1e-3, .curve_ug = 300, .curve_centre_degc = 10, .curve_width_k = 50},
         {0, 0, 0},
         -40,
         -300e-9},
        {{.scale_a_per_g = 1e-3, .curve_ug = 300, .curve_centre_degc = 10, .curve_width_k = 50}, {0, 0, 0}, 10, 0},
        {{.scale_a_per_g = 1e-3, .scale_curve_ppm = 200, .curve_centre_degc = 10, .curve_width_k = 50},
         {-1, 0, 0},
         60,
         -1.0002e-3},
        {{.scale_a_per_g = 1e-3, .base_slope_arcsec_per_k = 0.5}, {0, 1, 0}, 70, 20e-3 * ARCSEC},
        {{.scale_a_per_g = 1e-3, .base_curve_arcsec = 4, .curve_centre_degc = 10, .curve_width_k = 50},
         {0, 1, 0},
         -40,
         -4e-3 * ARCSEC},
        {{.scale_a_per_g = 1e-3, .glue_ug = 80, .glue_keep = 0.5, .cycles = 2}, {0, 0, 0}, 85, 20e-9},
        {{.scale_a_per_g = 1e-3, .glue_ppm = 80, .glue_keep = 0.5}, {1, 0, 0}, -60, 1.00008e-3},
        {{.scale_a_per_g = 1e-3, .glue_arcsec = 8, .glue_keep = 0.5, .cycles = 3}, {0, -1, 0}, 30, -1e-3 * ARCSEC},
        {{.scale_a_per_g = 1e-3, .position_urad = 3, .hinge_ug_per_urad = 48}, {0, 0, 1}, 30, 144e-9},
        {{.scale_a_per_g = 1e-3, .position_urad = 3}, {0, 1, 0}, 30, 3e-9},
        {{.scale_a_per_g = 1e-3, .pendulous_ug_per_g2 = 188}, {2, 0, 1}, 30, 2e-3},
        {{.scale_a_per_g = 1e-3, .pendulous_ug_per_g2 = 188}, {2, 1, 0}, 30, 2e-3 / (1 - 188e-6)},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct quartz q = up(&rows[i].cfg);
        q.case_degc = q.element_degc = q.felt_degc = rows[i].degc;
        const double a[3] = {rows[i].a_g[0] * G, rows[i].a_g[1] * G, rows[i].a_g[2] * G};
        near(quartz_true_a(&q, a), rows[i].current_a, 1e-17);
        near(out_a(&q, a, 1000, 31250), rows[i].current_a, 1e-17);
    }
}

static void a_case_warmer_than_the_element_shifts_the_zero(void **state)
{
    (void)state;
    struct quartz q = up(&(struct quartz_g){.scale_a_per_g = 1e-3, .gradient_ug_per_k = 1.5});
    q.case_degc = 36.0;
    near(quartz_true_a(&q, (const double[3]){0}), 9e-9, 1e-20);
}

/* Zero, scale curve and base are those of what is felt; the scale's slope and the gradient those of the element. */
static void what_is_felt_moves_the_zero(void **state)
{
    (void)state;
    struct quartz q = up(&(struct quartz_g){.scale_a_per_g = 1e-3, .slope_ug_per_k = 1.0});
    q.case_degc = q.element_degc = 40.0;
    q.felt_degc = 39.5;
    near(quartz_true_a(&q, (const double[3]){0}), 9.5e-9, 1e-20);
}

/* Step of 1 g on w = 2 pi 350, z = 0.7: 1 - exp(-z w t) (cos wd t + z/d sin wd t), however often one looks. */
static void a_step_is_answered_as_an_oscillator_does(void **state)
{
    (void)state;
    const struct quartz_g cfg = {.scale_a_per_g = 1e-3, .natural_hz = 350.0, .damping = 0.7};
    const double wd = 2.0 * acos(-1.0) * 350.0 * sqrt(1.0 - 0.49);
    const double zw = 0.7 * 2.0 * acos(-1.0) * 350.0;
    const int64_t steps_ns[] = {31250, 7000, 500000};
    for (size_t k = 0; k < COUNT(steps_ns); k++) {
        struct quartz q = up(&cfg);
        double peak = 0.0;
        near(out_a(&q, (const double[3]){0}, 0, steps_ns[k]), 0.0, 0.0);
        struct quartz resting = up(&cfg);
        near(out_a(&resting, (const double[3]){G, 0, 0}, 0, steps_ns[k]), 1e-3, 1e-18); /* it has been where it is */
        for (int64_t t_ns = steps_ns[k]; t_ns < 10000000; t_ns += steps_ns[k]) {
            const double t_s = (double)t_ns * 1e-9;
            const double want = 1.0 - exp(-zw * t_s) * (cos(wd * t_s) + 0.7 / sqrt(0.51) * sin(wd * t_s));
            const double got = out_a(&q, (const double[3]){G, 0, 0}, t_ns, steps_ns[k]) / 1e-3;
            near(got, want, 1e-12);
            if (got > peak) peak = got;
        }
        if (k < 2) near(peak, 1.046, 0.001); /* overshoot of 4.6 % */
    }
}

static bool same_loop(const struct quartz *one, const struct quartz *other)
{
    return memcmp(one->loop, other->loop, sizeof one->loop) == 0 && one->held_a == other->held_a;
}

/* Whatever was before, at rest or on the move, along or across: after the stated time nothing is left of it, to the bit. */
static void two_pasts_become_one(void **state)
{
    (void)state;
    struct quartz_g fast = quartz_default(), slow = quartz_default(), across = quartz_default();
    fast.natural_hz = 3000.0;
    slow.natural_hz = 120.0;
    across.pendulous_ug_per_g2 = 188.0;
    const struct quartz_g cfgs[] = {quartz_default(), fast, slow, across};
    for (size_t i = 0; i < 2 * COUNT(cfgs); i++) {
        struct quartz one = up(&cfgs[i / 2]), other = up(&cfgs[i / 2]);
        const double moving = i % 2 ? 1e-3 : 0.0;
        const int64_t from_ns = 31250 * 777, past_ns = quartz_past_ns(&one);
        assert_in_range(past_ns, 20000000, 200000000);
        for (int64_t t_ns = 0; t_ns < from_ns; t_ns += 31250)
            (void)out_a(&one, (const double[3]){0.3 * G * sin((double)t_ns), 0, 0}, t_ns, 31250);
        quartz_skip(&other, from_ns - 31250);
        bool differed = false;
        for (int64_t t_ns = from_ns; t_ns < from_ns + past_ns + 10000000; t_ns += 31250) {
            const double a[3] = {(0.7 + moving * sin(3e-7 * (double)t_ns)) * G, 0.2 * G, 0.1 * G};
            (void)out_a(&one, a, t_ns, 31250);
            (void)out_a(&other, a, t_ns, 31250);
            differed |= !same_loop(&one, &other);
            if (t_ns - from_ns >= past_ns) assert_true(same_loop(&one, &other));
        }
        assert_true(differed);
    }
}

/* Its memory would be longer than a board cares for; and without a loop there is none. */
static void a_slow_loop_says_so(void **state)
{
    (void)state;
    const struct {
        double natural_hz, damping;
        int64_t past_ns;
    } rows[] = {{350, 0.7, 60000000}, {350, 1.5, 100000000}, {20, 0.7, -1}, {350, 0.0, -1}, {0, 0.7, 0}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct quartz_g cfg = quartz_default();
        cfg.natural_hz = rows[i].natural_hz;
        cfg.damping = rows[i].damping;
        const struct quartz q = up(&cfg);
        assert_int_equal(quartz_past_ns(&q), rows[i].past_ns);
    }
}

/* Started again each 30 ms or never (a loop of damping 0 but for the last bit has no grid): the same answer but for rounding. */
static void the_grid_changes_nothing_that_can_be_seen(void **state)
{
    (void)state;
    const struct quartz_g cfg = quartz_default();
    struct quartz grid = up(&cfg), plain = up(&cfg);
    plain.every_ns = 0;
    for (int64_t k = 0; k < 20000; k++) {
        const double a[3] = {G * sin(1e-3 * (double)k) * (k / 3000 % 2 ? 1.0 : -1.0), 0.3 * G, 0};
        const double one = out_a(&grid, a, k * 31250, 31250), other = out_a(&plain, a, k * 31250, 31250);
        near(one, other, 4e-18); /* of 1.28 mA */
    }
}

/* A hundred random sensors of each kind, driven as hard as the bound allows: none leaves it, and some come near. */
static void an_output_stays_within_its_range(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(7);
    struct rng r = rng_stream(seed, 0, "quartz.range");
    double nearest = 0.0;
    for (unsigned i = 0; i < 300; i++) {
        struct quartz_g cfg = quartz_default();
        cfg.damping = 0.05 + 1.2 * rng_uniform(&r);
        cfg.zero_ug = 2e5 * (rng_uniform(&r) - 0.5);
        cfg.curve_ug = 2e4 * (rng_uniform(&r) - 0.5);
        cfg.slope_ug_per_k = 1e3 * (rng_uniform(&r) - 0.5);
        cfg.tilt_y_mrad = 200.0 * (rng_uniform(&r) - 0.5);
        cfg.pendulous_ug_per_g2 = 1e4 * rng_uniform(&r);
        cfg.square_ug_per_g2 = 1e4 * (rng_uniform(&r) - 0.5);
        cfg.scale_tc_ppm_per_k = 500.0 * (rng_uniform(&r) - 0.5);
        cfg.limit_a = i % 3 ? 0.0 : 1.3e-3;
        struct quartz q = up(&cfg);
        q.felt_degc = q.element_degc = -100.0 + 300.0 * (double)(i % 2);
        q.case_degc = -100.0 + 300.0 * (double)(i % 4 / 2);
        const struct looks_range range = quartz_range_a(&q, G, 31250);
        const int64_t half = (int64_t)(1e9 / 350.0 / 2.0 / 31250.0) + (int64_t)(i % 20);
        double side = 1.0;
        for (int64_t k = 0; k < 3000; k++) {
            if (k % half == 0) side = -side;
            const double a = out_a(&q, (const double[3]){side * G * 0.99, 0.1 * G, 0}, k * 31250, 31250);
            if (fabs(a - range.mid) > range.off) fail_msg("TEST_SEED=%llu: %g", (unsigned long long)seed, a);
            nearest = fmax(nearest, fabs(a - range.mid) / range.off);
        }
    }
    assert_true(nearest > 0.7);
}

static void noise_of_a_look_follows_its_interval(void **state)
{
    (void)state;
    enum { N = 40000 };
    struct quartz q = up(&(struct quartz_g){.scale_a_per_g = 1e-3, .noise_a_rthz = 1e-8});
    const int64_t steps_ns[] = {31250, 1000000};
    int64_t t_ns = 0;
    for (size_t k = 0; k < COUNT(steps_ns); k++) {
        double sum2 = 0.0;
        for (unsigned i = 0; i < N; i++) {
            t_ns += steps_ns[k];
            const double a = out_a(&q, (const double[3]){0}, t_ns, steps_ns[k]);
            near(out_a(&q, (const double[3]){0}, t_ns, steps_ns[k]), a, 0.0);
            sum2 += i > 0 ? a * a : 0.0;
        }
        near(sqrt(sum2 / N) / (1e-8 * sqrt(1e9 / (2.0 * (double)steps_ns[k]))), 1.0, 4.0 / sqrt(2.0 * N));
    }
}

/* Each thermal cycle leaves a half, counted by the scenario or by the chamber. */
static void cycles_relax_the_glue(void **state)
{
    (void)state;
    struct quartz q =
        up(&(struct quartz_g){.scale_a_per_g = 1e-3, .glue_ug = 80, .glue_ppm = 40, .glue_keep = 0.5, .cycles = 1});
    const double at_g[3] = {G, 0, 0};
    for (int n = 0; n < 8; n++) {
        q.cycles = 0.5 * n;
        const double left = pow(0.5, 1.0 + 0.5 * n);
        near(quartz_true_a(&q, at_g), 1e-3 * (1.0 + 40e-6 * left) * (1.0 + 80e-6 * left), 1e-16);
        near(out_a(&q, at_g, (n + 1) * 1000, 1000), quartz_true_a(&q, at_g), 0.0);
    }
}

/* Zero, scale and base of 4000 starts: normal, of the given rms, independent; the same start is the same. */
static void each_start_scatters_by_itself(void **state)
{
    (void)state;
    enum { N = 4000 };
    const struct quartz_g cfg = {.scale_a_per_g = 1e-3, .start_ug = 12.6, .start_ppm = 18.7, .start_arcsec = 1.64};
    struct quartz q = up(&cfg), again = up(&cfg);
    double sum2[3] = {0}, cross[3] = {0};
    for (int n = 0; n < N; n++) {
        const double still[3] = {0}, x[3] = {G, 0, 0}, y[3] = {0, G, 0};
        const double zero = quartz_true_a(&q, still);
        const double v[3] = {zero / 1e-9 / 12.6, (quartz_true_a(&q, x) - zero - 1e-3) / 1e-9 / 18.7,
                             (quartz_true_a(&q, y) - zero) / (1e-3 * ARCSEC) / 1.64};
        assert_true(quartz_true_a(&again, x) == quartz_true_a(&q, x));
        for (int k = 0; k < 3; k++) sum2[k] += v[k] * v[k];
        for (int k = 0; k < 3; k++) cross[k] += v[k] * v[(k + 1) % 3];
        quartz_start(&q);
        quartz_start(&again);
    }
    for (int k = 0; k < 3; k++) near(sqrt(sum2[k] / N), 1.0, 4.0 / sqrt(2.0 * N));
    for (int k = 0; k < 3; k++) near(cross[k] / N, 0.0, 4.0 / sqrt(N));
    struct quartz_g older = cfg;
    older.starts = N;
    struct quartz later = up(&older);
    assert_true(quartz_true_a(&later, (const double[3]){0}) == quartz_true_a(&q, (const double[3]){0}));
}

static void another_seed_is_for_the_starts_to_come(void **state)
{
    (void)state;
    const struct quartz_g cfg = {.scale_a_per_g = 1e-3, .start_ug = 12.6};
    struct quartz q = up(&cfg), again = up(&cfg), plain = up(&cfg);
    const double still[3] = {0}, now_a = quartz_true_a(&plain, still);
    quartz_reseed(&q, 7);
    quartz_reseed(&again, 7);
    assert_true(quartz_true_a(&q, still) == now_a);
    quartz_start(&q);
    quartz_start(&again);
    quartz_start(&plain);
    assert_true(quartz_true_a(&q, still) == quartz_true_a(&again, still));
    assert_true(quartz_true_a(&q, still) != quartz_true_a(&plain, still));
}

/* Two sines at 45 degrees: half the coupling times the squares, of the part of the deflection that is in phase. At the natural
 * frequency that is none; above it has the other sign. */
static void a_pendulum_rectifies_vibration_across(void **state)
{
    (void)state;
    static const double pi2 = 6.283185307179586;
    const struct {
        double hz, in_phase; /* of 1 / (1 - r^2 + 2 z r i), r = f / 350 Hz, z = 0.7 */
    } rows[] = {{35, 0.99 / (0.99 * 0.99 + 0.0196)}, {350, 0.0}, {700, -3.0 / (9.0 + 7.84)}};
    for (size_t k = 0; k < COUNT(rows); k++) {
        enum { PERIODS = 70 };
        const int64_t step_ns = 1000;
        struct quartz q = up(
            &(struct quartz_g){.scale_a_per_g = 1e-3, .pendulous_ug_per_g2 = 188, .natural_hz = 350, .damping = 0.7});
        const int64_t n = (int64_t)(PERIODS * 1e9 / rows[k].hz / (double)step_ns), from = n / 2;
        double sum = 0.0;
        for (int64_t i = 0; i < n; i++) {
            const double a = 5.0 * G * sin(pi2 * rows[k].hz * 1e-9 * (double)(i * step_ns));
            const double got = out_a(&q, (const double[3]){a, a, 0}, i * step_ns, step_ns);
            if (i >= from) sum += got / 1e-3;
        }
        near(sum / (double)(n - from), 0.5 * 188e-6 * 25.0 * rows[k].in_phase, 188e-6 * 25.0 * 0.01);
    }
}

/* Ratio and place of the extremes over -60 to +85 degC: both groups mirror each other (fig. 2). */
static void the_two_groups_mirror_each_other(void **state)
{
    (void)state;
    struct quartz_g a = quartz_default(), b;
    a.curve_ug = 400.0;
    a.zero_ug = 0.0;
    b = a;
    b.curve_ug = -a.curve_ug;
    double hot = 0.0, cold = 0.0;
    for (int i = -120; i <= 170; i++) {
        const double t = 0.5 * i;
        const double y = quartz_settled_ug(&a, t);
        near(quartz_settled_ug(&b, t), -y, 1e-12);
        hot = fmax(hot, t > 30.0 ? y : 0.0);
        cold = fmin(cold, t < 0.0 ? y : 0.0);
    }
    near(hot, 400.0, 1e-9); /* convex upward at 67 degC */
    near(cold, -400.0, 1e-9);
}

static void keep_code(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    (void)t_ns;
    *(int32_t *)ctx = f->code[0];
}

/* 1 g at 48 degC: current, 1 kohm, 1 : 8, 1.25 V for 2^23 codes. The zero signal and the scale are those of the element. */
static void a_board_reads_its_current(void **state)
{
    (void)state;
    static struct unit u;
    static struct lab lab;
    struct sched s;
    int32_t code = 0;
    sched_init(&s);
    struct lab_cfg laboratory = lab_default();
    laboratory.site.g_mps2 = G;
    laboratory.chamber.present = true;
    laboratory.chamber.start_degc = 48.0;
    lab_init(&lab, &laboratory, 1);
    head_turn(&lab.head, 270.0, 0); /* x down */
    struct unit_cfg cfg = unit_default("u");
    cfg.board.adc_noise_scale = 0.0;
    cfg.board.afe[0] = afe_nominal(AFE_CURRENT);
    cfg.axis[0].sensor = UNIT_QUARTZ;
    cfg.axis[0].quartz =
        (struct quartz_g){.scale_a_per_g = 1.28e-3, .slope_ug_per_k = 1000.0, .scale_tc_ppm_per_k = 500};
    unit_init(&u, &cfg, &lab, &s);
    u.store.psa2.host = (struct psa2_host){.ctx = &code, .frame = keep_code};
    psa2_power_up(&u.store.psa2, 0);
    sched_run_until(&s, NS_PER_S / 2);
    near(unit_sensor_out(&u, 0, NS_PER_S / 2), 1.28e-3 * 1.009 * 1.018, 1e-15);
    near((double)code * 1.25 / 8388608.0, 1.28e-3 * 1.009 * 1.018 * 1000.0 / 8.0,
         3.4e-5); /* 2e-4: the FIR filter's own gain is 1.00017 */
}

/* A unit that the chamber cycles, powered or not, and that is switched on again. */
static void a_unit_counts_its_cycles_and_starts(void **state)
{
    (void)state;
    static struct unit u;
    static struct lab lab;
    struct sched s;
    sched_init(&s);
    struct lab_cfg laboratory = lab_default();
    laboratory.chamber.present = true;
    lab_init(&lab, &laboratory, 1);
    struct unit_cfg cfg = unit_default("u");
    cfg.board.afe[0] = afe_nominal(AFE_CURRENT);
    cfg.axis[0].sensor = UNIT_QUARTZ;
    cfg.axis[0].quartz = (struct quartz_g){.scale_a_per_g = 1e-3, .glue_ug = 800, .glue_keep = 0.25};
    unit_init(&u, &cfg, &lab, &s);
    const int64_t hour_ns = 3600 * NS_PER_S;
    const double before_a = unit_sensor_out(&u, 0, 0);
    assert_int_equal(chamber_set(&lab.chamber, -60.0, 0), CHAMBER_OK);
    assert_int_equal(chamber_set(&lab.chamber, 85.0, 4 * hour_ns), CHAMBER_OK);
    near(before_a - unit_sensor_out(&u, 0, 8 * hour_ns), 600e-9, 1e-15);
    assert_int_equal(u.quartz[0].starts, 0);
    unit_power_up(&u, 8 * hour_ns);
    assert_int_equal(u.quartz[0].starts, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_term_of_the_model),
        cmocka_unit_test(a_case_warmer_than_the_element_shifts_the_zero),
        cmocka_unit_test(what_is_felt_moves_the_zero),
        cmocka_unit_test(a_step_is_answered_as_an_oscillator_does),
        cmocka_unit_test(a_board_reads_its_current),
        cmocka_unit_test(a_unit_counts_its_cycles_and_starts),
        cmocka_unit_test(two_pasts_become_one),
        cmocka_unit_test(a_slow_loop_says_so),
        cmocka_unit_test(the_grid_changes_nothing_that_can_be_seen),
        cmocka_unit_test(an_output_stays_within_its_range),
        cmocka_unit_test(noise_of_a_look_follows_its_interval),
        cmocka_unit_test(cycles_relax_the_glue),
        cmocka_unit_test(each_start_scatters_by_itself),
        cmocka_unit_test(another_seed_is_for_the_starts_to_come),
        cmocka_unit_test(a_pendulum_rectifies_vibration_across),
        cmocka_unit_test(the_two_groups_mirror_each_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
