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
        .natural_hz = 350.0,
        .damping = 0.7,
    };
}

void quartz_init(struct quartz *q, const struct quartz_g *cfg, double g_mps2, struct draws noise)
{
    *q = (struct quartz){.cfg = *cfg,
                         .g_mps2 = g_mps2,
                         .case_degc = QUARTZ_REFERENCE_DEGC,
                         .element_degc = QUARTZ_REFERENCE_DEGC,
                         .noise = noise,
                         .t_ns = -1};
}

/* At the temperature that is felt. */
static double zero_ug_at(const struct quartz_g *cfg, double felt_degc)
{
    const double line_ug = cfg->zero_ug + cfg->slope_ug_per_k * (felt_degc - QUARTZ_REFERENCE_DEGC);
    if (cfg->curve_ug == 0.0 || cfg->curve_width_k <= 0.0) return line_ug;
    const double x = (felt_degc - cfg->curve_centre_degc) / cfg->curve_width_k;
    return line_ug + (x * x < GONE ? cfg->curve_ug * x * det_exp(0.5 * (1.0 - x * x)) : 0.0);
}

/* The play drags what is felt behind the element. */
static double felt_degc(const struct quartz *q)
{
    if (q->t_ns < 0) return q->element_degc;
    return fmin(fmax(q->felt_degc, q->element_degc - q->cfg.play_k), q->element_degc + q->cfg.play_k);
}

/* What the torquer has to balance, in g. */
static double load_g(const struct quartz *q, const double a_mps2[3])
{
    const struct quartz_g *c = &q->cfg;
    const double x_g = a_mps2[0] / q->g_mps2;
    const double across_g = (c->tilt_y_mrad * a_mps2[1] + c->tilt_z_mrad * a_mps2[2]) * 1e-3 / q->g_mps2;
    const double zero_ug = zero_ug_at(c, felt_degc(q)) + c->gradient_ug_per_k * (q->case_degc - q->element_degc);
    return x_g + across_g + (c->square_ug_per_g2 * x_g * x_g + zero_ug) * 1e-6;
}

static double current_a(const struct quartz *q, double load)
{
    const double warmer_k = q->element_degc - QUARTZ_REFERENCE_DEGC;
    return q->cfg.scale_a_per_g * (1.0 + q->cfg.scale_tc_ppm_per_k * 1e-6 * warmer_k) * load;
}

static double limited_a(const struct quartz *q, double a)
{
    return q->cfg.limit_a > 0.0 ? fmin(fmax(a, -q->cfg.limit_a), q->cfg.limit_a) : a;
}

double quartz_true_a(const struct quartz *q, const double a_mps2[3])
{
    return limited_a(q, current_a(q, load_g(q, a_mps2)));
}

/* The free oscillator over dt: e'' + 2 z w e' + w^2 e = 0 for the deviation e and r = e' / w; z below 1. */
static void set_step(struct quartz *q, int64_t dt_ns)
{
    const double dt_s = (double)dt_ns / (double)NS_PER_S;
    const double z = fmin(q->cfg.damping, 0.999);
    const double wt = TURN_RAD * q->cfg.natural_hz * dt_s;
    const double d = sqrt(1.0 - z * z);
    q->dt_ns = dt_ns;
    if (z * wt > GONE) {
        q->step[0][0] = q->step[0][1] = q->step[1][0] = q->step[1][1] = 0.0;
        return;
    }
    const double keep = det_exp(-z * wt);
    const double turns = d * wt / TURN_RAD;
    const struct det_pair a = det_sin_cos(TURN_RAD * (turns - floor(turns)));
    const double c = a.cos, s = a.sin;
    q->step[0][0] = keep * (c + z / d * s);
    q->step[0][1] = keep * s / d;
    q->step[1][0] = -keep * s / d;
    q->step[1][1] = keep * (c - z / d * s);
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

static double quiet_a(struct quartz *q, const double a_mps2[3], int64_t t_ns)
{
    const bool first = q->t_ns < 0;
    const int64_t dt_ns = first ? FIRST_LOOK_NS : t_ns - q->t_ns;
    if (dt_ns <= 0) return q->held_a;
    if (llabs(dt_ns - q->dt_ns) > SAME_DT_NS) set_step(q, dt_ns);
    q->felt_degc = felt_degc(q);
    double load = load_g(q, a_mps2);
    if (first) q->input_g = load; /* it has been at rest */
    q->t_ns = t_ns;
    if (q->cfg.natural_hz > 0.0) load = answer_g(q, load);
    return q->held_a = current_a(q, load);
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
