#include "phys/earth.h"

#include "base/detmath.h"

#include <math.h>

/* WGS 84: NIMA TR8350.2, third edition, tables 3.1, 3.3 and 3.4 (sources 5.1) */
#define SEMI_MAJOR_M      6378137.0
#define FLATTENING        (1.0 / 298.257223563)
#define ECCENTRICITY2     0.00669437999014
#define GRAVITY_EQUATOR   9.7803253359
#define SOMIGLIANA_K      0.00193185265241
#define CENTRIFUGAL_RATIO 0.00344978650684 /* m = omega^2 a^2 b / GM */

/* TR8350.2 (4-1) and (4-3) */
double earth_gravity_mps2(double latitude_rad, double height_m)
{
    const double s = det_sin(latitude_rad);
    const double s2 = s * s;
    const double ground = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA_K * s2) / sqrt(1.0 - ECCENTRICITY2 * s2);
    const double h = height_m / SEMI_MAJOR_M;
    return ground * (1.0 - 2.0 * (1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * s2) * h + 3.0 * h * h);
}

struct site earth_site(double latitude_rad, double longitude_rad, double height_m, double azimuth_rad)
{
    return (struct site){.g_mps2 = earth_gravity_mps2(latitude_rad, height_m),
                         .latitude_rad = latitude_rad,
                         .longitude_rad = longitude_rad,
                         .height_m = height_m,
                         .azimuth_rad = azimuth_rad,
                         .placed = true};
}

void earth_rate_n(const struct site *s, double w_ie_n_radps[3])
{
    const double rate_radps = s->placed ? EARTH_RATE_RADPS : 0.0;
    w_ie_n_radps[0] = rate_radps * det_cos(s->latitude_rad);
    w_ie_n_radps[1] = 0.0;
    w_ie_n_radps[2] = -rate_radps * det_sin(s->latitude_rad);
}
