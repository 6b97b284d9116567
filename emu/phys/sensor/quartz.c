#include "phys/sensor/quartz.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>
#include <stdlib.h>

#define SAME_DT_NS    1     /* steps of a clock that is no whole number of ns differ by this */
#define FIRST_LOOK_NS 31250 /* interval assumed before the first look, as in mems.c */
#define GONE          700.0 /* exponents past which nothing is left */

struct quartz_g quartz_default(void)
{
    return (struct quartz_g){
        .scale_a_per_g = 1.28e-3,
        .zero_ug = 60.0,
        .curve_ug = 300.0,
        .curve_centre_degc = 12.0,
        .curve_width_k = 55.0,
        .play_k = 0.3,
        .gradient_ug_per_k = 1.0,
        .glue_keep = 0.5,
        .hinge_ug_per_urad = 48.0,
        .pendulum = pendulum_default(),
        .natural_hz = 350.0,
        .damping = 0.7,
    };
}

struct quartz_g quartz_with_pendulum(const struct quartz_g *cfg, double g_mps2)
{
    struct quartz_g c = *cfg;
    if (!cfg->pendulum_given) return c;
    const struct pendulum_law law = pendulum_law(&cfg->pendulum, g_mps2);
    c.scale_a_per_g = law.scale_a_per_g;
    c.natural_hz = law.natural_hz;
    c.damping = law.damping;
    c.pendulous_ug_per_g2 = law.deflection_urad_per_g;
    c.hinge_ug_per_urad = law.hinge_ug_per_urad;
    c.limit_a = c.limit_a > 0.0 ? fmin(c.limit_a, law.stop_a) : law.stop_a;
    return c;
}

void quartz_init(struct quartz *q, const struct quartz_g *cfg, double g_mps2, struct draws noise, struct draws scatter)
{
    *q = (struct quartz){.cfg = quartz_with_pendulum(cfg, g_mps2),
                         .g_mps2 = g_mps2,
                         .case_degc = QUARTZ_REFERENCE_DEGC,
                         .element_degc = QUARTZ_REFERENCE_DEGC,
                         .terms.start = -1,
                         .noise = noise,
                         .scatter = scatter,
                         .t_ns = -1};
}

void quartz_start(struct quartz *q)
{
    q->starts++;
}

/* ---- temperature */

/* x and exp((1 - x^2) / 2): a curve of amplitude A is A x e. */
struct hump {
    double x, e;
};

static struct hump hump_at(const struct quartz_g *cfg, double felt_degc)
{
    if (cfg->curve_width_k <= 0.0) return (struct hump){0.0, 0.0};
    if (cfg->curve_ug == 0.0 && cfg->scale_curve_ppm == 0.0 && cfg->base_curve_arcsec == 0.0)
        return (struct hump){0.0, 0.0};
    const double x = (felt_degc - cfg->curve_centre_degc) / cfg->curve_width_k;
    return (struct hump){x, x * x < GONE ? det_exp(0.5 * (1.0 - x * x)) : 0.0};
}

static double zero_ug_at(const struct quartz_g *cfg, double felt_degc)
{
    const struct hump h = hump_at(cfg, felt_degc);
    return cfg->zero_ug + cfg->slope_ug_per_k * (felt_degc - QUARTZ_REFERENCE_DEGC) + cfg->curve_ug * h.x * h.e;
}

double quartz_settled_ug(const struct quartz_g *cfg, double degc)
{
    return zero_ug_at(cfg, degc) + cfg->position_urad * cfg->hinge_ug_per_urad;
}

/* The play drags what is felt behind the element. */
static double felt_degc(const struct quartz *q)
{
    if (q->t_ns < 0) return q->element_degc;
    return fmin(fmax(q->terms.felt_degc, q->element_degc - q->cfg.play_k), q->element_degc + q->cfg.play_k);
}

/* ---- the two causes */

/* Of the glue's stress, after so many cycles. */
static double left_of_glue(const struct quartz_g *cfg, double cycles)
{
    if (cycles <= 0.0 || cfg->glue_keep <= 0.0 || cfg->glue_keep >= 1.0) return 1.0;
    return det_exp(fmax(cycles * det_log(cfg->glue_keep), -GONE));
}

enum scattered { SCATTERED_ZERO, SCATTERED_SCALE, SCATTERED_BASE, SCATTERED };

/* What a start adds; k says to what. */
static double scatter_of(const struct quartz *q, enum scattered k, double rms, int64_t start)
{
    return rms > 0.0 ? rms * draws_gauss(&q->scatter, start * SCATTERED + k) : 0.0;
}

/* Everything but the acceleration. */
static void find_terms(const struct quartz *q, struct quartz_terms *t)
{
    const struct quartz_g *c = &q->cfg;
    const struct hump h = hump_at(c, t->felt_degc);
    const double glue = left_of_glue(c, t->cycles);
    const double warmer_k = t->element_degc - QUARTZ_REFERENCE_DEGC;
    const double felt_warmer_k = t->felt_degc - QUARTZ_REFERENCE_DEGC;
    const double ppm =
        c->scale_curve_ppm * h.x * h.e + c->glue_ppm * glue + scatter_of(q, SCATTERED_SCALE, c->start_ppm, t->start);
    const double arcsec = c->base_slope_arcsec_per_k * felt_warmer_k + c->base_curve_arcsec * h.x * h.e +
                          c->glue_arcsec * glue + scatter_of(q, SCATTERED_BASE, c->start_arcsec, t->start);
    const double causes_ug = c->position_urad * c->hinge_ug_per_urad + c->glue_ug * glue +
                             scatter_of(q, SCATTERED_ZERO, c->start_ug, t->start);
    t->scale_a_per_g = c->scale_a_per_g * (1.0 + c->scale_tc_ppm_per_k * 1e-6 * warmer_k + ppm * 1e-6);
    t->zero_ug = zero_ug_at(c, t->felt_degc) + causes_ug + c->gradient_ug_per_k * (t->case_degc - t->element_degc);
    t->tilt_y_mrad = c->tilt_y_mrad + c->position_urad * 1e-3 + arcsec * RAD_PER_ARCSEC * 1e3;
}

/* Those of now; computed again only if something has changed since the last look. */
static struct quartz_terms terms_of(const struct quartz *q)
{
    const struct quartz_terms *was = &q->terms;
    struct quartz_terms now = {.felt_degc = felt_degc(q),
                               .element_degc = q->element_degc,
                               .case_degc = q->case_degc,
                               .cycles = q->cfg.cycles + q->cycles,
                               .start = (int64_t)q->cfg.starts + q->starts};
    if (now.felt_degc == was->felt_degc && now.element_degc == was->element_degc && now.case_degc == was->case_degc &&
        now.cycles == was->cycles && now.start == was->start)
        return *was;
    find_terms(q, &now);
    return now;
}

/* ---- the current */

/* What the torquer has to balance, in g, beside what the deflected pendulum feels. */
static double load_g(const struct quartz *q, const struct quartz_terms *t, const double a_mps2[3])
{
    const struct quartz_g *c = &q->cfg;
    const double x_g = a_mps2[0] / q->g_mps2;
    const double across_g = (t->tilt_y_mrad * a_mps2[1] + c->tilt_z_mrad * a_mps2[2]) * 1e-3 / q->g_mps2;
    return x_g + across_g + (c->square_ug_per_g2 * x_g * x_g + t->zero_ug) * 1e-6;
}

/* Of the acceleration along y the pendulum feels this part for each g that deflects it. */
static double coupling_of(const struct quartz *q, const double a_mps2[3])
{
    return q->cfg.pendulous_ug_per_g2 * 1e-6 * (a_mps2[1] / q->g_mps2);
}

/* At rest the deflection d is that of load + coupling d. */
static double balanced_g(const struct quartz *q, const struct quartz_terms *t, const double a_mps2[3])
{
    return load_g(q, t, a_mps2) / (1.0 - coupling_of(q, a_mps2));
}

static double limited_a(const struct quartz *q, double a)
{
    return q->cfg.limit_a > 0.0 ? fmin(fmax(a, -q->cfg.limit_a), q->cfg.limit_a) : a;
}

double quartz_true_a(const struct quartz *q, const double a_mps2[3])
{
    const struct quartz_terms t = terms_of(q);
    return limited_a(q, t.scale_a_per_g * balanced_g(q, &t, a_mps2));
}

static void set_step(struct quartz *q, int64_t dt_ns)
{
    q->dt_ns = dt_ns;
    pendulum_step(q->cfg.natural_hz, q->cfg.damping, (double)dt_ns / (double)NS_PER_S, q->step);
}

/* What is less is gone: without it, two pasts could differ in the last bit of a loop at rest for good. */
#define GONE_G 1e-15

/* Deflection in g of a loop whose input has been `load` since the last look. */
static double answer_g(struct quartz *q, double load)
{
    const double off_g = q->input_g + q->loop_g[0] - load;
    const double rate = q->loop_g[1];
    q->input_g = load;
    q->loop_g[0] = q->step[0][0] * off_g + q->step[0][1] * rate;
    q->loop_g[1] = q->step[1][0] * off_g + q->step[1][1] * rate;
    if (fabs(q->loop_g[0]) < GONE_G && fabs(q->loop_g[1]) < GONE_G) q->loop_g[0] = q->loop_g[1] = 0.0;
    return load + q->loop_g[0];
}

/* What deflects the loop now: the deflection of the last look counts. */
static double input_g(const struct quartz *q, const double a_mps2[3])
{
    return load_g(q, &q->terms, a_mps2) + coupling_of(q, a_mps2) * (q->input_g + q->loop_g[0]);
}

static double quiet_a(struct quartz *q, const double a_mps2[3], int64_t t_ns)
{
    const bool first = q->t_ns < 0;
    const int64_t dt_ns = first ? FIRST_LOOK_NS : t_ns - q->t_ns;
    if (dt_ns <= 0) return q->held_a;
    if (llabs(dt_ns - q->dt_ns) > SAME_DT_NS) set_step(q, dt_ns);
    q->terms = terms_of(q);
    q->t_ns = t_ns;
    double load = balanced_g(q, &q->terms, a_mps2);
    if (first) q->input_g = load; /* it has been at rest */
    if (q->cfg.natural_hz > 0.0) load = answer_g(q, input_g(q, a_mps2));
    return q->held_a = q->terms.scale_a_per_g * load;
}

bool quartz_pickoff(const struct quartz *q, struct pickoff *out)
{
    if (!q->cfg.pendulum_given) return false;
    *out = pendulum_pickoff(&q->cfg.pendulum, limited_a(q, q->held_a));
    return true;
}

void quartz_out_row_a(struct quartz *q, const double *a_mps2, unsigned felt, const struct looks *at, double *out_a)
{
    const double rms_a = looks_white_rms(q->cfg.noise_a_rthz, at->every_ns);
    for (unsigned i = 0; i < at->n; i++) {
        double a = quiet_a(q, a_mps2 + (felt == 1 ? 0 : 3 * i), at->t_ns[i]);
        if (rms_a > 0.0) a += rms_a * draws_gauss(&q->noise, at->t_ns[i]);
        out_a[i] = limited_a(q, a);
    }
}
