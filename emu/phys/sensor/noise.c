#include "phys/sensor/noise.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

#define PI         3.141592653589793
#define SHORTEST_S 0.05 /* correlation times: 0.05 s to 5.4 h */
#define SPACING    5.0
#define LN_SPACING 1.6094379124341003
#define STEP_S     ((double)NOISE_STEP_NS / (double)NS_PER_S)

#define PER_STEP 16 /* draws set aside for a step: one a process, one for the walk */
_Static_assert(NOISE_MARKOVS < PER_STEP, "no draw belongs to two steps");

static double step_draw(const struct noise *n, unsigned which)
{
    return draws_gauss(&n->draws, n->step * PER_STEP + which);
}

/* Processes of equal variance v and times a factor r apart add up to the PSD v / (2 f ln r): B^2 / (2 pi f) wants
 * v = B^2 ln r / pi. */
void noise_init(struct noise *n, const struct noise_cfg *cfg, struct draws draws)
{
    *n = (struct noise){.cfg = *cfg, .draws = draws};
    n->moves = cfg->bias_instability_u > 0.0 || cfg->walk_u_rts > 0.0;
    n->walk_kick_u = cfg->walk_u_rts * sqrt(STEP_S);
    const double sd_u = cfg->bias_instability_u * sqrt(LN_SPACING / PI);
    double time_s = SHORTEST_S;
    for (unsigned i = 0; i < NOISE_MARKOVS; i++) {
        n->keep[i] = det_exp(-STEP_S / time_s);
        n->kick_u[i] = sd_u * sqrt(1.0 - n->keep[i] * n->keep[i]);
        n->markov_u[i] = sd_u > 0.0 ? sd_u * step_draw(n, i) : 0.0;
        time_s *= SPACING;
    }
}

static void step_noise(struct noise *n)
{
    n->step++;
    if (n->cfg.bias_instability_u > 0.0) {
        for (unsigned i = 0; i < NOISE_MARKOVS; i++) {
            n->markov_u[i] = n->keep[i] * n->markov_u[i] + n->kick_u[i] * step_draw(n, i);
        }
    }
    if (n->walk_kick_u > 0.0) n->walk_u += n->walk_kick_u * step_draw(n, NOISE_MARKOVS);
}

double noise_slow_u(struct noise *n, int64_t t_ns)
{
    double sum_u = n->cfg.ramp_u_per_s * ((double)t_ns / (double)NS_PER_S);
    if (!n->moves) return sum_u;
    while (n->step < t_ns / NOISE_STEP_NS) step_noise(n);
    for (unsigned i = 0; i < NOISE_MARKOVS; i++) sum_u += n->markov_u[i];
    return sum_u + n->walk_u;
}

double noise_quantise_u(const struct noise *n, double u)
{
    return det_quantise(u, n->cfg.quantum_u);
}
