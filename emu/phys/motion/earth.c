#include "phys/motion/earth.h"

#include "base/detmath.h"

#include <math.h>

/* WGS 84: the four defining constants, NIMA TR8350.2, third edition, table 3.1 (sources 5.1) */
#define SEMI_MAJOR_M 6378137.0
#define FLATTENING   (1.0 / 298.257223563)
#define GM_M3PS2     3986004.418e8
#define SEMI_MINOR_M (SEMI_MAJOR_M * (1.0 - FLATTENING))
#define FOCAL2_M2    (SEMI_MAJOR_M * SEMI_MAJOR_M - SEMI_MINOR_M * SEMI_MINOR_M) /* E^2: linear eccentricity squared */

/* Heiskanen and Moritz (2-57) and (2-67), q and q', as series of x2 = (E/u)^2 = 0.0067: q = (E/u)^3 times the first. The
 * printed closed forms lose seven digits to cancellation. */
static void spin_functions(double x2, double *q_over_x3, double *q_prime)
{
    double q = 0.0;
    double prime = 0.0;
    for (int n = 9; n >= 1; n--) {
        const double term = 1.0 / (double)((2 * n + 1) * (2 * n + 3));
        q = (double)n * term - x2 * q;
        prime = term - x2 * prime;
    }
    *q_over_x3 = 2.0 * q;
    *q_prime = 6.0 * x2 * prime;
}

/* Heiskanen and Moritz (2-66), in ellipsoidal coordinates u and the reduced latitude beta. */
double earth_gravity_mps2(double latitude_rad, double height_m)
{
    const double sin_lat = det_sin(latitude_rad);
    const double e2 = FOCAL2_M2 / (SEMI_MAJOR_M * SEMI_MAJOR_M);
    const double n = SEMI_MAJOR_M / sqrt(1.0 - e2 * sin_lat * sin_lat);
    const double r = (n + height_m) * det_cos(latitude_rad);
    const double z = (n * (1.0 - e2) + height_m) * sin_lat;
    const double rest = r * r + z * z - FOCAL2_M2;
    const double u2 = 0.5 * rest * (1.0 + sqrt(1.0 + 4.0 * FOCAL2_M2 * (z / rest) * (z / rest)));
    const double u = sqrt(u2);
    const double v2 = u2 + FOCAL2_M2;
    const double v = sqrt(v2);
    const double sin_beta = z / u;
    const double cos_beta = r / v;
    double q0, q, prime;
    spin_functions(FOCAL2_M2 / (SEMI_MINOR_M * SEMI_MINOR_M), &q0, &prime);
    spin_functions(FOCAL2_M2 / u2, &q, &prime);
    const double w2 = EARTH_RATE_RADPS * EARTH_RATE_RADPS;
    const double spin =
        w2 * SEMI_MAJOR_M * SEMI_MAJOR_M * (SEMI_MINOR_M * SEMI_MINOR_M * SEMI_MINOR_M); /* E^3 cancels */
    const double down = GM_M3PS2 / v2 +
                        spin / (FOCAL2_M2 * v2) * (prime / q0) * (0.5 * sin_beta * sin_beta - 1.0 / 6.0) -
                        w2 * u * cos_beta * cos_beta;
    const double along = (spin / (v * u2 * u) * (q / q0) - w2 * v) * sin_beta * cos_beta;
    return sqrt(down * down + along * along) / sqrt((u2 + FOCAL2_M2 * sin_beta * sin_beta) / v2);
}

void earth_rate_n(const struct site *s, double w_ie_n_radps[3])
{
    const double rate_radps = s->placed ? EARTH_RATE_RADPS : 0.0;
    w_ie_n_radps[0] = rate_radps * det_cos(s->latitude_rad);
    w_ie_n_radps[1] = 0.0;
    w_ie_n_radps[2] = -rate_radps * det_sin(s->latitude_rad);
}
