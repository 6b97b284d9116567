/* Radii of curvature of the WGS 84 ellipsoid (sources 5.1) with their derivatives. Pure. */
#ifndef PSABENCH_PHYS_FLIGHT_ELLIPSOID_H
#define PSABENCH_PHYS_FLIGHT_ELLIPSOID_H

#define ELLIPSOID_SEMI_MAJOR_M 6378137.0
#define ELLIPSOID_FLATTENING   (1.0 / 298.257223563)

struct radii {
    double meridian_m, vertical_m;                 /* M, N: on the ellipsoid, add the height */
    double meridian_m_per_rad, vertical_m_per_rad; /* by the latitude */
};

struct radii ellipsoid_radii(double sin_lat, double cos_lat);

#endif
