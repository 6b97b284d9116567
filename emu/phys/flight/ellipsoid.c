#include "phys/flight/ellipsoid.h"

#include <math.h>

/* N = a / sqrt(1 - e^2 sin^2), M = N (1 - e^2) / (1 - e^2 sin^2) */
struct radii ellipsoid_radii(double sin_lat, double cos_lat)
{
    const double e2 = ELLIPSOID_FLATTENING * (2.0 - ELLIPSOID_FLATTENING);
    const double x = 1.0 - e2 * sin_lat * sin_lat;
    const double n = ELLIPSOID_SEMI_MAJOR_M / sqrt(x), m = n * (1.0 - e2) / x;
    const double slope = e2 * sin_lat * cos_lat / x;
    return (struct radii){m, n, 3.0 * m * slope, n * slope};
}
