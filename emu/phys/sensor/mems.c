#include "phys/sensor/mems.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>
#include <stdlib.h>

#define SAME_DT_NS    1     /* steps of a clock that is no whole number of ns differ by this */
#define FIRST_PULL_NS 31250 /* interval assumed before the first pull: one block of the converter at 1000 SPS */

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

void mems_init(struct mems *m, const struct mems_cfg *cfg, struct rng noise)
{
    struct rng seed = noise; /* the white noise keeps its stream whether there is slow noise or not */
    *m = (struct mems){.cfg = *cfg, .temp_degc = MEMS_REFERENCE_DEGC, .noise = noise, .t_ns = -1};
    noise_init(&m->slow, &cfg->slow, rng_stream(rng_u64(&seed), 0, "slow"));
}

/* At the reference temperature. */
static double model_v(const struct mems_cfg *cfg, const double a_mps2[3], int64_t t_ns)
{
    const double ax = a_mps2[0];
    const double ay = a_mps2[1];
    const double *k = cfg->k_v_per_mps2;
    return cfg->u0_v + k[0] * ax + k[1] * ay + k[2] * a_mps2[2] + cfg->kxy_v_per_mps2_2 * ax * ay +
           cfg->kxx_v_per_mps2_2 * ax * ax + cfg->kyy_v_per_mps2_2 * ay * ay +
           cfg->drift_v_per_s * ((double)t_ns / (double)NS_PER_S);
}

/* White noise of one-sided density d, averaged over dt, has the variance d^2 / (2 dt). */
static double noise_v(struct mems *m, int64_t t_ns)
{
    const int64_t dt_ns = m->t_ns < 0 ? FIRST_PULL_NS : t_ns - m->t_ns;
    if (dt_ns <= 0) return m->held_v;
    if (llabs(dt_ns - m->dt_ns) > SAME_DT_NS) {
        m->dt_ns = dt_ns;
        m->scale_v = m->cfg.noise_v_rthz * sqrt((double)NS_PER_S / (2.0 * (double)dt_ns));
    }
    m->t_ns = t_ns;
    m->held_v = m->scale_v * rng_gauss(&m->noise);
    return m->held_v;
}

/* Without limits. Terms that are not there are not added: zero coefficients leave every bit as the model gives it. */
static double warm_v(const struct mems *m, const double a_mps2[3], int64_t t_ns)
{
    const double u_v = model_v(&m->cfg, a_mps2, t_ns);
    if (m->cfg.u0_tc_v_per_k == 0.0 && m->cfg.k_tc_per_k == 0.0) return u_v;
    const double warmer_k = m->temp_degc - MEMS_REFERENCE_DEGC;
    const double *k = m->cfg.k_v_per_mps2;
    const double linear_v = k[0] * a_mps2[0] + k[1] * a_mps2[1] + k[2] * a_mps2[2];
    return u_v + (m->cfg.u0_tc_v_per_k + m->cfg.k_tc_per_k * linear_v) * warmer_k;
}

static double limited_v(const struct mems_cfg *cfg, double u_v)
{
    return cfg->low_v < cfg->high_v ? fmin(fmax(u_v, cfg->low_v), cfg->high_v) : u_v;
}

double mems_true_v(const struct mems *m, const double a_mps2[3], int64_t t_ns)
{
    return limited_v(&m->cfg, warm_v(m, a_mps2, t_ns));
}

double mems_out_v(struct mems *m, const double a_mps2[3], int64_t t_ns)
{
    double u_v = warm_v(m, a_mps2, t_ns);
    if (m->cfg.noise_v_rthz > 0.0) u_v += noise_v(m, t_ns);
    if (m->slow.moves) u_v += noise_slow_u(&m->slow, t_ns);
    return limited_v(&m->cfg, noise_quantise_u(&m->slow, u_v));
}
