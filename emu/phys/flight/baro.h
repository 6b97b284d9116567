/* Barometric altimeter: height with a lag of first order, a scale error, an offset that drifts. Pure.
 *
 * lag y' = h - y; shown: (1 + scale) y + offset + drift t. No weather: pressure height is height. The lagged height of a polynomial
 * is one: sum of (-lag)^k h^(k); what is left of the pieces before decays by exp(-t / lag). */
#ifndef PSABENCH_PHYS_FLIGHT_BARO_H
#define PSABENCH_PHYS_FLIGHT_BARO_H

#include "phys/flight/channel.h"

struct baro_cfg {
    double lag_s, scale_ppm, offset_m, drift_m_per_h;
};

struct baro {
    struct baro_cfg cfg;
    double rest_m[CHANNEL_PIECES]; /* at a piece's beginning: lagged height less the polynomial's */
};

/* At rest before the first piece. */
void baro_init(struct baro *b, const struct baro_cfg *cfg, const struct channel *height_m);

double baro_shown_m(const struct baro *b, const struct channel *height_m, int64_t t_ns);

#endif
