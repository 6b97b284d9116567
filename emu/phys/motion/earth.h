/* The Earth under the bench: normal gravity and the Earth's rate, WGS 84 (sources 5.1).
 *
 * Frames: n is north-east-down at the site; l is the bench's level frame: x towards azimuth_rad, z down, y to the right of x.
 * Pure functions. */
#ifndef PSABENCH_PHYS_MOTION_EARTH_H
#define PSABENCH_PHYS_MOTION_EARTH_H

#include <stdbool.h>

#define EARTH_RATE_RADPS 7.292115e-5 /* 15.041067 deg/h */
#define EARTH_RADIUS_M   6371008.8   /* mean radius of WGS 84: the sphere of transport rates */

struct site {
    double g_mps2; /* local gravity, along the plumb line: the Earth's own centrifugal part is in it */
    double latitude_rad, longitude_rad, height_m;
    double azimuth_rad; /* of the bench's x axis from north, clockwise seen from above */
    bool placed;        /* the place is given: the Earth turns. Else it stands still and g_mps2 is all there is */
};

/* Magnitude of the gravity of the level ellipsoid at a geodetic latitude and a height above it, in closed form. On the
 * ellipsoid it is Somigliana's formula with the published constants, to 1e-10. */
double earth_gravity_mps2(double latitude_rad, double height_m);

/* Rate of the Earth relative to inertial space, in n: zero for a site that is not placed. */
void earth_rate_n(const struct site *s, double w_ie_n_radps[3]);

#endif
