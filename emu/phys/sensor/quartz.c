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

/* ---- the loop's memory */

#define DECAYED       40.0              /* time constants that leave 4e-18 */
#define PERIOD_UNIT   INT64_C(10000000) /* ns, as the temperature of the element (unit.c) */
#define PERIOD_MAX_NS INT64_C(100000000)

/* Of the slower of its two time constants; 0: it lasts longer than PERIOD_MAX_NS. */
static int64_t loop_period_ns(const struct quartz_g *cfg)
{
    const double z = cfg->damping, w = TURN_RAD * cfg->natural_hz;
    const double decay_ps = z < 1.0 ? z * w : w / (z + sqrt(z * z - 1.0));
    const double least_ns = DECAYED * (double)NS_PER_S;
    if (!(decay_ps * (double)PERIOD_MAX_NS > least_ns)) return 0;
    return (int64_t)ceil(least_ns / decay_ps / (double)PERIOD_UNIT) * PERIOD_UNIT;
}

void quartz_init(struct quartz *q, const struct quartz_g *cfg, double g_mps2, struct draws noise, struct draws scatter)
{
    *q = (struct quartz){.cfg = quartz_with_pendulum(cfg, g_mps2),
                         .g_mps2 = g_mps2,
                         .case_degc = QUARTZ_REFERENCE_DEGC,
                         .element_degc = QUARTZ_REFERENCE_DEGC,
                         .felt_degc = QUARTZ_REFERENCE_DEGC,
                         .terms.start = -1,
                         .noise = noise,
                         .scatter = scatter,
                         .later_scatter = scatter,
                         .t_ns = -1};
    q->every_ns = loop_period_ns(&q->cfg);
}

void quartz_start(struct quartz *q)
{
    q->starts++;
    q->scatter = q->later_scatter;
}

void quartz_reseed(struct quartz *q, uint64_t seed)
{
    draws_reseed(&q->noise, seed);
    draws_reseed(&q->later_scatter, seed);
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
    struct quartz_terms now = {.felt_degc = q->felt_degc,
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

/* What is less is gone: a loop at rest has the very value of its balance. */
#define GONE_G 1e-15

/* Deflection in g of a loop whose input has been `load` since the last look. */
static inline double answer_g(struct quartz_loop *l, double step[2][2], double load)
{
    const double off_g = l->input_g + l->off_g[0] - load;
    const double rate = l->off_g[1];
    l->input_g = load;
    l->off_g[0] = step[0][0] * off_g + step[0][1] * rate;
    l->off_g[1] = step[1][0] * off_g + step[1][1] * rate;
    if (fabs(l->off_g[0]) < GONE_G && fabs(l->off_g[1]) < GONE_G) l->off_g[0] = l->off_g[1] = 0.0;
    return load + l->off_g[0];
}

/* Of the first look in a period: the loop that was started a period ago answers from now on, and another one is started. After a
 * gap, and without a grid at the first look of all, both are. */
static void start_period(struct quartz *q, const double a_mps2[3], int64_t t_ns)
{
    const bool next = q->end_ns > 0 && t_ns < q->end_ns + q->every_ns;
    const struct quartz_loop rest = {.input_g = balanced_g(q, &q->terms, a_mps2)};
    q->loop[0] = next ? q->loop[1] : rest;
    q->loop[1] = rest;
    q->end_ns = q->every_ns > 0 ? (t_ns / q->every_ns + 1) * q->every_ns : INT64_MAX;
}

/* What deflects each loop now is the load and, of the coupling, its deflection at the last look. */
static double swing_g(struct quartz *q, const double a_mps2[3], int64_t t_ns)
{
    if (t_ns >= q->end_ns) start_period(q, a_mps2, t_ns);
    const double load = load_g(q, &q->terms, a_mps2), coupling = coupling_of(q, a_mps2);
    double out_g[2];
    for (unsigned i = 0; i < 2; i++) {
        struct quartz_loop *l = &q->loop[i];
        out_g[i] = answer_g(l, q->step, load + coupling * (l->input_g + l->off_g[0]));
    }
    return out_g[0];
}

static double quiet_a(struct quartz *q, const double a_mps2[3], int64_t t_ns)
{
    const int64_t dt_ns = q->t_ns < 0 ? FIRST_LOOK_NS : t_ns - q->t_ns;
    if (dt_ns <= 0) return q->held_a;
    if (llabs(dt_ns - q->dt_ns) > SAME_DT_NS) set_step(q, dt_ns);
    q->t_ns = t_ns;
    const double g = q->cfg.natural_hz > 0.0 ? swing_g(q, a_mps2, t_ns) : balanced_g(q, &q->terms, a_mps2);
    return q->held_a = q->terms.scale_a_per_g * g;
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
    q->terms = terms_of(q);
    for (unsigned i = 0; i < at->n; i++) {
        double a = quiet_a(q, a_mps2 + (felt == 1 ? 0 : 3 * i), at->t_ns[i]);
        if (rms_a > 0.0) a += rms_a * draws_gauss(&q->noise, at->t_ns[i]);
        out_a[i] = limited_a(q, a);
    }
}

/* ---- looks left out */

int64_t quartz_past_ns(const struct quartz *q)
{
    if (q->cfg.natural_hz <= 0.0) return 0;
    return q->every_ns > 0 ? 2 * q->every_ns : -1;
}

void quartz_skip(struct quartz *q, int64_t t_ns)
{
    q->t_ns = t_ns;
    q->end_ns = 0;
}

#define WARMER_MAX_K                                                                                                   \
    170.0 /* off the reference temperature: -100 to 200 degC is the widest that a scenario may ask for */
#define GRADIENT_MAX_K 300.0

/* Integral of the magnitude of the loop's impulse response: no input of magnitude 1 deflects it more. */
static double loop_gain_max(const struct quartz_g *c)
{
    if (c->natural_hz <= 0.0 || c->damping >= 1.0) return 1.0;
    const double x = 0.5 * TURN_RAD * c->damping / sqrt(1.0 - c->damping * c->damping);
    if (x <= 0.0) return INFINITY;
    const double left = x < GONE ? det_exp(-x) : 0.0;
    return (1.0 + left) / (1.0 - left);
}

static double tilt_max_rad(const struct quartz_g *c)
{
    const double arcsec = fabs(c->base_slope_arcsec_per_k) * WARMER_MAX_K + fabs(c->base_curve_arcsec) +
                          fabs(c->glue_arcsec) + DRAWS_GAUSS_MAX * c->start_arcsec;
    return (fabs(c->tilt_y_mrad) + fabs(c->tilt_z_mrad) + fabs(c->position_urad) * 1e-3) * 1e-3 +
           arcsec * RAD_PER_ARCSEC;
}

static double zero_max_ug(const struct quartz_g *c)
{
    return fabs(c->zero_ug) + fabs(c->slope_ug_per_k) * WARMER_MAX_K + fabs(c->curve_ug) +
           fabs(c->position_urad * c->hinge_ug_per_urad) + fabs(c->glue_ug) + DRAWS_GAUSS_MAX * c->start_ug +
           fabs(c->gradient_ug_per_k) * GRADIENT_MAX_K;
}

/* x exp((1 - x^2) / 2) is 1 at most; of the glue no more is left than there was. */
struct looks_range quartz_range_a(const struct quartz *q, double a_max_mps2, int64_t every_ns)
{
    const struct quartz_g *c = &q->cfg;
    const double a_g = a_max_mps2 / q->g_mps2, gain = loop_gain_max(c);
    const double load_max_g =
        a_g * (1.0 + tilt_max_rad(c)) + (fabs(c->square_ug_per_g2) * a_g * a_g + zero_max_ug(c)) * 1e-6;
    const double fed_back = gain * fabs(c->pendulous_ug_per_g2) * 1e-6 * a_g;
    const double ppm = fabs(c->scale_tc_ppm_per_k) * WARMER_MAX_K + fabs(c->scale_curve_ppm) + fabs(c->glue_ppm) +
                       DRAWS_GAUSS_MAX * c->start_ppm;
    const double scale = fabs(c->scale_a_per_g) * (1.0 + ppm * 1e-6);
    const double noise_a = DRAWS_GAUSS_MAX * looks_white_rms(c->noise_a_rthz, every_ns);
    const double off_a = fed_back < 1.0 ? scale * gain * load_max_g / (1.0 - fed_back) + noise_a : INFINITY;
    return (struct looks_range){0.0, c->limit_a > 0.0 ? fmin(off_a, c->limit_a) : off_a};
}
