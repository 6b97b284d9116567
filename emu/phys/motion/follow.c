#include "phys/motion/follow.h"

#include "base/detmath.h"

#include <math.h>

#define PIECES 8u /* of the motor's law in a step: more than a law of five can go through */

/* The motor's law on one side of the dead zone, x from its edge: gain x, up to a limit. */
struct side {
    double gain, limit, rate; /* rate: of x without the motor */
};

/* x after *left_s, or the edge of the piece that it comes to, and the time then left. */
static double in_limit(const struct side *k, double x, double *left_s)
{
    const double rate = k->rate - k->limit, edge = k->limit / k->gain, t_s = (edge - x) / rate;
    if (rate >= 0.0 || t_s >= *left_s) {
        x += rate * *left_s;
        *left_s = 0.0;
        return x;
    }
    *left_s -= t_s;
    return edge;
}

static double in_proportion(const struct side *k, double x, double *left_s)
{
    const double end = k->rate / k->gain, edge = k->limit / k->gain;
    const double then = end + (x - end) * det_exp(-fmin(k->gain * *left_s, 700.0));
    if (then >= 0.0 && then <= edge) {
        *left_s = 0.0;
        return then;
    }
    const double border = then < 0.0 ? 0.0 : edge;
    const double t_s = x == border ? 0.0 : det_log((x - end) / (border - end)) / k->gain;
    *left_s = fmax(*left_s - t_s, 0.0);
    return border;
}

static double in_dead_zone(double e, double dead, double rate, double *left_s)
{
    const double border = rate > 0.0 ? dead : -dead;
    const double t_s = rate == 0.0 ? *left_s : (border - e) / rate;
    if (t_s >= *left_s) {
        e += rate * *left_s;
        *left_s = 0.0;
        return e;
    }
    *left_s -= t_s;
    return border;
}

/* +1, -1: on that side of the dead zone, or at its edge and leaving it; 0: in it. */
static double side_of(double e, double dead, double rate)
{
    if (e > dead || (e == dead && rate > 0.0)) return 1.0;
    if (e < -dead || (e == -dead && rate < 0.0)) return -1.0;
    return 0.0;
}

double follow_after(const struct follow_cfg *cfg, double e_rad, double rotor_radps, double carrier_radps, double h_s)
{
    const double dead = cfg->dead_arcsec * RAD_PER_ARCSEC, rate = rotor_radps - carrier_radps;
    double e = e_rad, left_s = h_s;
    for (unsigned i = 0; i < PIECES && left_s > 0.0; i++) {
        const double sign = side_of(e, dead, rate);
        if (sign == 0.0) {
            e = in_dead_zone(e, dead, rate, &left_s);
            continue;
        }
        const struct side k = {TURN_RAD * cfg->hz, cfg->limit_dps * RAD_PER_DEG, sign * rate};
        const double x = sign * e - dead, edge = k.limit / k.gain;
        const double further = x > edge || (x > edge * (1.0 - 1e-12) && k.rate > k.limit)
                                   ? in_limit(&k, x, &left_s)
                                   : in_proportion(&k, fmin(x, edge), &left_s);
        e = sign * (dead + further);
    }
    return e;
}
