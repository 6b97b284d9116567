#include "phys/motion/follow.h"

#include "base/detmath.h"

#include <math.h>

#define PIECES 8u /* of the motor's law in a step: more than a law of five can go through */

/* The motor's law on one side of the dead zone, x from its edge: gain x, up to a limit. */
struct side {
    double gain_per_s, limit_radps, rate_radps; /* rate: of x without the motor */
};

/* x after *left_s, or the edge of the piece that it comes to, and the time then left. */
static double in_limit(const struct side *k, double x_rad, double *left_s)
{
    const double rate_radps = k->rate_radps - k->limit_radps, edge_rad = k->limit_radps / k->gain_per_s,
                 t_s = (edge_rad - x_rad) / rate_radps;
    if (rate_radps >= 0.0 || t_s >= *left_s) {
        x_rad += rate_radps * *left_s;
        *left_s = 0.0;
        return x_rad;
    }
    *left_s -= t_s;
    return edge_rad;
}

static double in_proportion(const struct side *k, double x_rad, double *left_s)
{
    const double end_rad = k->rate_radps / k->gain_per_s, edge_rad = k->limit_radps / k->gain_per_s;
    const double then_rad = end_rad + (x_rad - end_rad) * det_exp(-fmin(k->gain_per_s * *left_s, 700.0));
    if (then_rad >= 0.0 && then_rad <= edge_rad) {
        *left_s = 0.0;
        return then_rad;
    }
    const double border_rad = then_rad < 0.0 ? 0.0 : edge_rad;
    const double t_s = x_rad == border_rad ? 0.0 : det_log((x_rad - end_rad) / (border_rad - end_rad)) / k->gain_per_s;
    *left_s = fmax(*left_s - t_s, 0.0);
    return border_rad;
}

static double in_dead_zone(double now_rad, double dead_rad, double rate_radps, double *left_s)
{
    const double border_rad = rate_radps > 0.0 ? dead_rad : -dead_rad;
    const double t_s = rate_radps == 0.0 ? *left_s : (border_rad - now_rad) / rate_radps;
    if (t_s >= *left_s) {
        now_rad += rate_radps * *left_s;
        *left_s = 0.0;
        return now_rad;
    }
    *left_s -= t_s;
    return border_rad;
}

/* +1, -1: on that side of the dead zone, or at its edge and leaving it; 0: in it. */
static double side_of(double now_rad, double dead_rad, double rate_radps)
{
    if (now_rad > dead_rad || (now_rad == dead_rad && rate_radps > 0.0)) return 1.0;
    if (now_rad < -dead_rad || (now_rad == -dead_rad && rate_radps < 0.0)) return -1.0;
    return 0.0;
}

double follow_after(const struct follow_cfg *cfg, double e_rad, double rotor_radps, double carrier_radps, double h_s)
{
    const double dead_rad = cfg->dead_arcsec * RAD_PER_ARCSEC, rate_radps = rotor_radps - carrier_radps;
    double now_rad = e_rad, left_s = h_s;
    for (unsigned i = 0; i < PIECES && left_s > 0.0; i++) {
        const double sign = side_of(now_rad, dead_rad, rate_radps);
        if (sign == 0.0) {
            now_rad = in_dead_zone(now_rad, dead_rad, rate_radps, &left_s);
            continue;
        }
        const struct side k = {TURN_RAD * cfg->hz, cfg->limit_dps * RAD_PER_DEG, sign * rate_radps};
        const double x_rad = sign * now_rad - dead_rad, edge_rad = k.limit_radps / k.gain_per_s;
        const double further_rad =
            x_rad > edge_rad || (x_rad > edge_rad * (1.0 - 1e-12) && k.rate_radps > k.limit_radps)
                ? in_limit(&k, x_rad, &left_s)
                : in_proportion(&k, fmin(x_rad, edge_rad), &left_s);
        now_rad = sign * (dead_rad + further_rad);
    }
    return now_rad;
}
