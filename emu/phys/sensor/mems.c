#include "phys/sensor/mems.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

double mems_density_v_rthz(double reading_noise_v, double data_hz)
{
    return reading_noise_v / sqrt(MEMS_ENBW * data_hz);
}

struct mems_cfg mems_cfg_si(const struct mems_g *p, double g_mps2)
{
    const double g2 = g_mps2 * g_mps2;
    return (struct mems_cfg){
        .u0_v = p->u0_v,
        .k_v_per_mps2 = {p->kx_v_per_g / g_mps2, p->ky_v_per_g / g_mps2, p->kz_v_per_g / g_mps2},
        .kxy_v_per_mps2_2 = p->kxy_v_per_g2 / g2,
        .kxx_v_per_mps2_2 = p->kxx_v_per_g2 / g2,
        .kyy_v_per_mps2_2 = p->kyy_v_per_g2 / g2,
        .alpha0_rad = p->alpha0_deg * RAD_PER_DEG,
        .drift_v_per_s = p->drift_v_per_s,
        .noise_v_rthz = p->noise_v_rthz > 0.0 ? p->noise_v_rthz : mems_density_v_rthz(p->reading_noise_v, 1000.0),
        .u0_tc_v_per_k = p->u0_tc_v_per_k,
        .k_tc_per_k = p->k_tc_ppm_per_k * 1e-6,
        .slow = {.bias_instability_u = p->bias_instability_v, .walk_u_rts = p->walk_v_rts, .quantum_u = p->quantum_v},
        .low_v = p->low_v,
        .high_v = p->high_v,
    };
}

void mems_init(struct mems *m, const struct mems_cfg *cfg, struct draws noise, struct draws slow)
{
    *m = (struct mems){.cfg = *cfg, .temp_degc = MEMS_REFERENCE_DEGC, .noise = noise};
    noise_init(&m->slow, &cfg->slow, slow);
}

/* At the reference temperature, without drift. */
static double still_v(const struct mems_cfg *cfg, const double a_mps2[3])
{
    const double ax = a_mps2[0];
    const double ay = a_mps2[1];
    const double *k = cfg->k_v_per_mps2;
    return cfg->u0_v + k[0] * ax + k[1] * ay + k[2] * a_mps2[2] + cfg->kxy_v_per_mps2_2 * ax * ay +
           cfg->kxx_v_per_mps2_2 * ax * ax + cfg->kyy_v_per_mps2_2 * ay * ay;
}

static double drift_v(const struct mems_cfg *cfg, int64_t t_ns)
{
    return cfg->drift_v_per_s * ((double)t_ns / (double)NS_PER_S);
}

/* What the temperature adds. */
static double warm_v(const struct mems *m, const double a_mps2[3])
{
    if (m->cfg.u0_tc_v_per_k == 0.0 && m->cfg.k_tc_per_k == 0.0) return 0.0;
    const double warmer_k = m->temp_degc - MEMS_REFERENCE_DEGC;
    const double *k = m->cfg.k_v_per_mps2;
    const double linear_v = k[0] * a_mps2[0] + k[1] * a_mps2[1] + k[2] * a_mps2[2];
    return (m->cfg.u0_tc_v_per_k + m->cfg.k_tc_per_k * linear_v) * warmer_k;
}

static double limited_v(const struct mems_cfg *cfg, double u_v)
{
    if (cfg->low_v >= cfg->high_v) return u_v;
    return u_v < cfg->low_v ? cfg->low_v : u_v > cfg->high_v ? cfg->high_v : u_v;
}

/* Adding a zero changes no bit: terms that are not there leave what the model gives. */
double mems_true_v(const struct mems *m, const double a_mps2[3], int64_t t_ns)
{
    return limited_v(&m->cfg, still_v(&m->cfg, a_mps2) + drift_v(&m->cfg, t_ns) + warm_v(m, a_mps2));
}

double mems_zero_moved_v(const struct mems *m, int64_t t_ns)
{
    struct noise slow = m->slow;
    return drift_v(&m->cfg, t_ns) + noise_slow_u(&slow, t_ns);
}

static void model_row_v(const struct mems *m, const double *a_mps2, unsigned felt, const struct looks *at,
                        double *out_v)
{
    double still = 0.0, warm = 0.0;
    for (unsigned i = 0; i < at->n; i++) {
        if (i < felt) {
            still = still_v(&m->cfg, a_mps2 + 3 * i);
            warm = warm_v(m, a_mps2 + 3 * i);
        }
        out_v[i] = still + drift_v(&m->cfg, at->t_ns[i]) + warm;
    }
}

static void add_noise_v(const struct mems *m, const struct looks *at, double *out_v)
{
    const double rms_v = looks_white_rms(m->cfg.noise_v_rthz, at->every_ns);
    for (unsigned i = 0; i < at->n; i++) out_v[i] += rms_v * draws_gauss(&m->noise, at->t_ns[i]);
}

void mems_out_row_v(struct mems *m, const double *a_mps2, unsigned felt, const struct looks *at, double *out_v)
{
    model_row_v(m, a_mps2, felt, at, out_v);
    if (m->cfg.noise_v_rthz > 0.0) add_noise_v(m, at, out_v);
    for (unsigned i = 0; m->slow.moves && i < at->n; i++) out_v[i] += noise_slow_u(&m->slow, at->t_ns[i]);
    for (unsigned i = 0; m->slow.cfg.quantum_u > 0.0 && i < at->n; i++) out_v[i] = noise_quantise_u(&m->slow, out_v[i]);
    for (unsigned i = 0; i < at->n; i++) out_v[i] = limited_v(&m->cfg, out_v[i]);
}

#define WARMER_MAX_K                                                                                                   \
    175.0 /* from the reference temperature: -100 to 200 degC is the widest that a scenario may ask for */

struct looks_range mems_range_v(const struct mems *m, double a_max_mps2, int64_t every_ns, int64_t until_ns)
{
    const struct mems_cfg *c = &m->cfg;
    const double a = a_max_mps2, *k = c->k_v_per_mps2;
    const double linear_v = (fabs(k[0]) + fabs(k[1]) + fabs(k[2])) * a;
    const double square_v = (fabs(c->kxy_v_per_mps2_2) + fabs(c->kxx_v_per_mps2_2) + fabs(c->kyy_v_per_mps2_2)) * a * a;
    const double warm_v = (fabs(c->u0_tc_v_per_k) + fabs(c->k_tc_per_k) * linear_v) * WARMER_MAX_K;
    const double noise_v = DRAWS_GAUSS_MAX * looks_white_rms(c->noise_v_rthz, every_ns) + c->slow.quantum_u;
    const double off_v = linear_v + square_v + warm_v + fabs(drift_v(c, until_ns)) + noise_v;
    return (struct looks_range){c->u0_v, m->slow.moves ? INFINITY : off_v};
}
