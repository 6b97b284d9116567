#include "phys/receiver/place.h"

#include "base/detmath.h"

#include <math.h>

/* WGS 84, NIMA TR8350.2, third edition, table 3.1 (sources 5.1) */
#define SEMI_MAJOR_M 6378137.0
#define FLATTENING   (1.0 / 298.257223563)
#define E2           (FLATTENING * (2.0 - FLATTENING))
#define HALF_TURN    (0.5 * TURN_RAD)
#define QUARTER_TURN (0.25 * TURN_RAD)
#define COS_LEAST    1e-9 /* at a pole: 6 mm off it, where east has no direction */

void place_displace(struct place *p, const double by_m[3])
{
    const struct det_pair lat = det_sin_cos(p->lat_rad);
    const double w2 = 1.0 - E2 * lat.sin * lat.sin;
    const double normal_m = SEMI_MAJOR_M / sqrt(w2);
    const double meridian_m = normal_m * (1.0 - E2) / w2;
    p->lat_rad += by_m[1] / (meridian_m + p->h_m);
    p->lon_rad += by_m[0] / ((normal_m + p->h_m) * fmax(lat.cos, COS_LEAST));
    p->h_m += by_m[2];
    if (fabs(p->lat_rad) > QUARTER_TURN) {
        p->lat_rad = copysign(HALF_TURN, p->lat_rad) - p->lat_rad;
        p->lon_rad += HALF_TURN;
    }
    p->lon_rad = det_wrap_rad(p->lon_rad);
}
