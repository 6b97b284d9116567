#include "phys/sensor/cvg.h"

#include "base/detmath.h"
#include "phys/sensor/mems.h"

#include <math.h>

void cvg_init(struct cvg *c, const struct cvg_dps *cfg, double g_mps2, struct draws noise, struct draws slow)
{
    const double v_per_dps = fabs(cfg->scale_v_per_dps);
    const struct noise_cfg n = {.bias_instability_u = cfg->bias_instability_dps * v_per_dps,
                                .walk_u_rts = cfg->walk_dps_rts * v_per_dps,
                                .ramp_u_per_s = cfg->ramp_dps_per_s * v_per_dps,
                                .quantum_u = cfg->quantum_v};
    *c = (struct cvg){.cfg = *cfg, .g_mps2 = g_mps2, .temp_degc = MEMS_REFERENCE_DEGC, .noise = noise};
    noise_init(&c->slow, &n, slow);
}

/* W, degrees a second. */
static double sensed_dps(const struct cvg *c, const double w_radps[3], const double a_mps2[3])
{
    const struct cvg_dps *p = &c->cfg;
    const double turn_radps = w_radps[0] + p->cross_y * w_radps[1] + p->cross_z * w_radps[2];
    const double pull_dps = p->gx_dps_per_g * a_mps2[0] + p->gy_dps_per_g * a_mps2[1] + p->gz_dps_per_g * a_mps2[2];
    return turn_radps / RAD_PER_DEG + pull_dps / c->g_mps2;
}

static double limited_v(const struct cvg_dps *p, double u_v)
{
    if (p->low_v >= p->high_v) return u_v;
    return u_v < p->low_v ? p->low_v : u_v > p->high_v ? p->high_v : u_v;
}

static double model_v(const struct cvg *c, const double w_radps[3], const double a_mps2[3])
{
    const struct cvg_dps *p = &c->cfg;
    const double warmer_k = c->temp_degc - MEMS_REFERENCE_DEGC;
    const double rate_dps = sensed_dps(c, w_radps, a_mps2);
    const double bent_dps = rate_dps * (1.0 + rate_dps * (p->square_per_dps + rate_dps * p->cube_per_dps2));
    const struct det_pair phase = det_sin_cos((p->phase_deg + p->phase_tc_deg_per_k * warmer_k) * RAD_PER_DEG);
    const double scale_v_per_dps = p->scale_v_per_dps * (1.0 + p->scale_tc_ppm_per_k * 1e-6 * warmer_k);
    return p->u0_v + p->u0_tc_v_per_k * warmer_k +
           scale_v_per_dps * (phase.cos * bent_dps + phase.sin * p->quadrature_dps);
}

double cvg_true_v(const struct cvg *c, const double w_radps[3], const double a_mps2[3])
{
    return limited_v(&c->cfg, model_v(c, w_radps, a_mps2));
}

double cvg_zero_moved_v(const struct cvg *c, int64_t t_ns)
{
    struct noise slow = c->slow;
    return noise_slow_u(&slow, t_ns);
}

double cvg_out_v(struct cvg *c, const double w_radps[3], const double a_mps2[3], int64_t t_ns, int64_t every_ns)
{
    const double density_v_rthz = c->cfg.noise_dps_rthz * fabs(c->cfg.scale_v_per_dps);
    double u_v = model_v(c, w_radps, a_mps2) + noise_slow_u(&c->slow, t_ns);
    if (density_v_rthz > 0.0) u_v += looks_white_rms(density_v_rthz, every_ns) * draws_gauss(&c->noise, t_ns);
    if (c->cfg.quantum_v > 0.0) u_v = noise_quantise_u(&c->slow, u_v);
    return limited_v(&c->cfg, u_v);
}
