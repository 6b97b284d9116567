/* The pendulum and its loop: equations (1) to (5) of the article, its dynamics against an integration of (2), its pickoff, and the
 * static chain through a PSA-2. */
#include "rig.h"

#include "base/sched.h"
#include "unit/unit.h"

#include <math.h>

#define G 9.81

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

/* As the article has it: an electrical spring, no hinge. */
static struct pendulum article(void)
{
    struct pendulum p = pendulum_default();
    p.hinge_n_m_per_rad = 0.0;
    return p;
}

static void figures_follow_from_the_parts(void **state)
{
    (void)state;
    const struct pendulum_law l = pendulum_law(&(struct pendulum){.mass_kg = 0.8e-3,
                                                                  .arm_m = 8e-3,
                                                                  .inertia_kg_m2 = 6.9e-8,
                                                                  .damping_n_m_s = 2.1e-4,
                                                                  .pickoff_v_per_rad = 2000,
                                                                  .amplifier_a_per_v = 3.408e-3,
                                                                  .torquer_n_m_per_a = 0.049,
                                                                  .gap_m = 20e-6,
                                                                  .electrode_arm_m = 8e-3},
                                               G);
    near(l.stiffness_n_m_per_rad, 0.334, 1e-4);
    near(l.natural_hz, 350.0, 0.5);
    near(l.damping, 0.69, 0.005);
    near(l.deflection_urad_per_g, 188.0, 0.1);
    near(l.scale_a_per_g, 0.8e-3 * 8e-3 * G / 0.049, 1e-15); /* (5): nothing of pickoff and amplifier */
    near(l.hinge_ug_per_urad, 0.0, 0.0);
    near(l.stop_a, 2000 * 3.408e-3 * 2.5e-3, 1e-12);
}

/* The hinge adds to the spring: less current for one g than by (5), by its part of the stiffness; and the position counts. */
static void a_hinge_costs_its_part_of_the_stiffness(void **state)
{
    (void)state;
    const struct pendulum stiff = pendulum_default(), soft = article();
    const struct pendulum_law a = pendulum_law(&stiff, G), b = pendulum_law(&soft, G);
    near(a.scale_a_per_g / b.scale_a_per_g, 1.0 - 3e-3 / a.stiffness_n_m_per_rad, 1e-12);
    near(a.hinge_ug_per_urad, 47.8, 0.05);
}

/* J phi'' + C phi' + K phi = m L a, from rest, by Runge and Kutta's fourth order. The current is K_DU K_U phi. */
struct pendulum_rest {
    double angle_rad, rate_radps;
};

static struct pendulum_rest slope(const struct pendulum *p, struct pendulum_rest s, double a_mps2)
{
    const double k = p->pickoff_v_per_rad * p->amplifier_a_per_v * p->torquer_n_m_per_a + p->hinge_n_m_per_rad;
    const double moment = p->mass_kg * p->arm_m * a_mps2 - p->damping_n_m_s * s.rate_radps - k * s.angle_rad;
    return (struct pendulum_rest){s.rate_radps, moment / p->inertia_kg_m2};
}

static struct pendulum_rest along(struct pendulum_rest s, struct pendulum_rest d, double dt_s)
{
    return (struct pendulum_rest){s.angle_rad + d.angle_rad * dt_s, s.rate_radps + d.rate_radps * dt_s};
}

static struct pendulum_rest integrated(const struct pendulum *p, struct pendulum_rest s, double a_mps2, double dt_s)
{
    const struct pendulum_rest k1 = slope(p, s, a_mps2), k2 = slope(p, along(s, k1, dt_s / 2), a_mps2);
    const struct pendulum_rest k3 = slope(p, along(s, k2, dt_s / 2), a_mps2), k4 = slope(p, along(s, k3, dt_s), a_mps2);
    const struct pendulum_rest sum = along(along(along(k1, k2, 2.0), k3, 2.0), k4, 1.0);
    return along(s, sum, dt_s / 6.0);
}

static struct quartz up(const struct pendulum *p)
{
    struct quartz q;
    const struct quartz_g cfg = {.pendulum_given = true, .pendulum = *p};
    quartz_init(&q, &cfg, G, draws_of(1, 1, "quartz.x"), draws_of(1, 1, "quartz.start.x"));
    return q;
}

static double out_a(struct quartz *q, double a_mps2, int64_t t_ns, int64_t every_ns)
{
    double a;
    const double along_x[3] = {a_mps2, 0, 0};
    quartz_out_row_a(q, along_x, 1, &(struct looks){&t_ns, 1, every_ns}, &a);
    return a;
}

/* Damping ratios 0.14, 0.69, 1 and 3: each instant of a step of 1 g, and the figures that are read off it. */
static void a_step_swings_as_equation_2_says(void **state)
{
    (void)state;
    const double critical = 2.0 * sqrt(2000 * 3.408e-3 * 0.049 * 6.9e-8);
    const struct {
        double damping_n_m_s;
        double overshoot, settling_ms; /* to 1e-3 */
    } rows[] = {
        {0.14 * critical, 0.6413, 21.94}, {2.1e-4, 0.0494, 4.69}, {critical, 0.0, 4.19}, {3.0 * critical, 0.0, 18.37}};
    for (size_t k = 0; k < COUNT(rows); k++) {
        struct pendulum p = article();
        p.damping_n_m_s = rows[k].damping_n_m_s;
        struct quartz q = up(&p);
        struct pendulum_rest s = {0.0, 0.0};
        double peak = 0.0, settled_ms = 0.0;
        const double full_a = p.mass_kg * p.arm_m * G / p.torquer_n_m_per_a; /* (5) */
        near(out_a(&q, 0.0, 0, 10000), 0.0, 0.0);
        for (int64_t t_ns = 10000; t_ns <= 40000000; t_ns += 10000) {
            for (int i = 0; i < 10; i++) s = integrated(&p, s, G, 1e-6);
            const double got = out_a(&q, G, t_ns, 10000) / full_a;
            near(got, s.angle_rad * p.pickoff_v_per_rad * p.amplifier_a_per_v / full_a, 1e-9);
            peak = fmax(peak, got - 1.0);
            if (fabs(got - 1.0) > 1e-3) settled_ms = (double)t_ns * 1e-6;
        }
        near(peak, rows[k].overshoot, 1e-4);
        near(settled_ms, rows[k].settling_ms, 0.011);
    }
}

/* What the amplifier has before it follows the pendulum, also while it swings; its sign is the phase. */
static void the_pickoff_shows_the_difference_of_the_gaps(void **state)
{
    (void)state;
    const struct pendulum p = pendulum_default();
    const double g_rad = 0.8e-3 * 8e-3 * G / (2000.0 * 3.408e-3 * 0.049 + 3e-3);
    struct quartz q = up(&p);
    struct pickoff seen;
    const double a_g[] = {1.0, -1.0, 0.0, 7.5};
    for (size_t i = 0; i < COUNT(a_g); i++) {
        struct quartz resting = up(&p);
        const double current_a = out_a(&resting, a_g[i] * G, 0, 1000);
        assert_true(quartz_pickoff(&resting, &seen));
        near(seen.angle_rad, a_g[i] * g_rad, 1e-15);
        near(seen.delta_m, 2.0 * 8e-3 * a_g[i] * g_rad, 1e-16);
        near(seen.gap_m[0] - seen.gap_m[1], seen.delta_m, 1e-18);
        near(seen.gap_m[0] + seen.gap_m[1], 40e-6, 1e-18);
        near(seen.volt_v * 3.408e-3, current_a, 1e-15);
        assert_true(seen.current_a == current_a);
    }
    (void)out_a(&q, 0.0, 0, 1000);
    (void)out_a(&q, G, 500000, 1000);
    assert_true(quartz_pickoff(&q, &seen));
    assert_true(seen.angle_rad > 0.1 * g_rad && seen.angle_rad < 0.9 * g_rad); /* on its way */
    struct quartz unknown;
    quartz_init(&unknown, &(struct quartz_g){.scale_a_per_g = 1e-3}, G, draws_of(1, 1, "a"), draws_of(1, 1, "b"));
    assert_false(quartz_pickoff(&unknown, &seen));
}

/* 20 um of gap on 8 mm: 2.5 mrad, 13 g. Beyond, the current is that of a pendulum on its stop, the gap closed. */
static void an_electrode_stops_the_pendulum(void **state)
{
    (void)state;
    const struct pendulum p = pendulum_default();
    struct quartz q = up(&p);
    struct pickoff seen;
    near(out_a(&q, 12.0 * G, 0, 1000), 12.0 * pendulum_law(&p, G).scale_a_per_g, 1e-12);
    near(out_a(&q, -20.0 * G, 1000000000, 1000), -2000.0 * 3.408e-3 * 2.5e-3, 1e-12);
    assert_true(quartz_pickoff(&q, &seen));
    near(seen.gap_m[0], 0.0, 1e-18);
    near(seen.gap_m[1], 40e-6, 1e-18);
}

enum { FRAMES = 400, SKIPPED = 100 };

struct mean {
    unsigned n;
    double sum, sum2;
};

static void add_code(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct mean *m = ctx;
    (void)t_ns;
    if (m->n++ < SKIPPED) return;
    const double v = (double)f->code[0] * 1.25 / 8388608.0 * 8.0;
    m->sum += v;
    m->sum2 += v * v;
}

/* Volts at the load by the codes of a PSA-2 with its converters' noise, and their standard error; x at an angle on the head. */
static double volts_at(double head_deg, double load_ohm, double *error_v)
{
    static struct unit u;
    static struct lab lab;
    struct sched s;
    struct mean m = {0};
    sched_init(&s);
    struct lab_cfg laboratory = lab_default();
    laboratory.site.g_mps2 = G;
    lab_init(&lab, &laboratory, 1);
    head_turn(&lab.head, head_deg, 0);
    struct unit_cfg cfg = unit_default("u");
    cfg.board.afe[0] = afe_nominal(AFE_CURRENT);
    cfg.board.afe[0].load_ohm = load_ohm;
    cfg.axis[0].sensor = UNIT_QUARTZ;
    cfg.axis[0].quartz = (struct quartz_g){.pendulum_given = true, .pendulum = article()};
    unit_init(&u, &cfg, &lab, &s);
    u.store.psa2.host = (struct psa2_host){.ctx = &m, .frame = add_code};
    psa2_power_up(&u.store.psa2, 0);
    sched_run_until(&s, NS_PER_S * (SKIPPED + FRAMES) / 1000 + NS_PER_S / 10);
    const double n = m.n - SKIPPED, mean = m.sum / n;
    *error_v = sqrt((m.sum2 / n - mean * mean) / n);
    return mean;
}

/* U = mLR/K_DM a with the three loads of the article's converters. One gain of the converter's filters for all, 1.00017. (5) has
 * no deflection: 188 urad/g of gravity along y are 49 ppm 15 degrees off the vertical. What is left is the noise. */
static void the_static_chain_is_equation_5_to_the_noise(void **state)
{
    (void)state;
    const double gain = 1.00017, loads_ohm[] = {735, 768, 938}, volts_per_g[] = {0.941, 0.983, 1.201};
    for (size_t i = 0; i < COUNT(loads_ohm); i++) {
        const double law_v = 0.8e-3 * 8e-3 * loads_ohm[i] / 0.049 * G;
        near(law_v, volts_per_g[i], 1.5e-3);
        for (int deg = 0; deg < 360; deg += 90 - 15 * (deg == 180)) {
            double error_v;
            const double got_v = volts_at(deg, loads_ohm[i], &error_v);
            const double rad = deg * 0.017453292519943295;
            const double x_g = -sin(rad), y_g = -cos(rad);
            const double want_v = law_v * x_g / (1.0 - 188e-6 * y_g);
            assert_true(error_v < 2e-6);
            near(got_v, gain * want_v, 5.0 * error_v + 5e-6 * fabs(want_v) + 1.2e-6);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_follow_from_the_parts),
        cmocka_unit_test(a_hinge_costs_its_part_of_the_stiffness),
        cmocka_unit_test(a_step_swings_as_equation_2_says),
        cmocka_unit_test(the_pickoff_shows_the_difference_of_the_gaps),
        cmocka_unit_test(an_electrode_stops_the_pendulum),
        cmocka_unit_test(the_static_chain_is_equation_5_to_the_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
