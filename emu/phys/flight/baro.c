#include "phys/flight/baro.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <math.h>

#define GONE 700.0 /* lags after which nothing is left; det_exp() takes no more */

/* The polynomial that satisfies the equation of the lag in the piece of t_ns, whose number is in *piece. */
static double steady_m(double lag_s, const struct channel *height_m, int64_t t_ns, unsigned *piece)
{
    double d[CHANNEL_ORDER + 1], sum = 0.0;
    *piece = channel_derivatives(height_m, t_ns, d);
    for (unsigned k = CHANNEL_ORDER + 1; k-- > 0;) sum = d[k] - lag_s * sum;
    return sum;
}

static double rest_m(const struct baro *b, unsigned piece, double since_s)
{
    const double lags = b->cfg.lag_s > 0.0 ? since_s / b->cfg.lag_s : GONE;
    return lags < GONE ? b->rest_m[piece] * det_exp(-lags) : 0.0;
}

static double lagged_m(const struct baro *b, const struct channel *height_m, int64_t t_ns)
{
    unsigned piece;
    const double steady = steady_m(b->cfg.lag_s, height_m, t_ns, &piece);
    return piece > 0 ? steady + rest_m(b, piece, sched_since_s(height_m->piece[piece].from_ns, t_ns)) : steady;
}

/* sum(k) (-lag)^k h^(k) by Horner: d[0] - lag (d[1] - lag (d[2] ...)). Continuity at each beginning gives what is left. */
void baro_init(struct baro *b, const struct baro_cfg *cfg, const struct channel *height_m)
{
    b->cfg = *cfg;
    b->rest_m[0] = 0.0;
    for (unsigned i = 1; i < height_m->count; i++) {
        const int64_t from_ns = height_m->piece[i].from_ns;
        unsigned piece;
        b->rest_m[i] = 0.0;
        b->rest_m[i] = lagged_m(b, height_m, from_ns - 1) - steady_m(cfg->lag_s, height_m, from_ns, &piece);
    }
}

double baro_shown_m(const struct baro *b, const struct channel *height_m, int64_t t_ns)
{
    const struct baro_cfg *c = &b->cfg;
    return (1.0 + 1e-6 * c->scale_ppm) * lagged_m(b, height_m, t_ns) + c->offset_m +
           c->drift_m_per_h / 3600.0 * sched_since_s(0, t_ns);
}
