/* Strapdown integration over the WGS 84 ellipsoid (docs/procedures/strapdown.md).
 *
 * Frames. n: local level, east, north, up, at the present place. b: the unit's axes. C_nb takes coordinates in b to coordinates
 * in n. Angles in rad, longitude without bounds. Increments are integrals over one interval of what the sensors measure: of the
 * rate of b in inertial space and of the specific force, in b.
 * Algorithm: Savage, Journal of Guidance, Control, and Dynamics 21 (1998), 1 and 2: coning and sculling from this interval and
 * the one before, which take rate and force as linear in time over both. Pure functions: no state but what the caller
 * gives, no allocation, any thread; the same bytes on every machine. */
#ifndef PSABENCH_STRAPDOWN_H
#define PSABENCH_STRAPDOWN_H

#include "nav/nav.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is known at one instant. */
struct nav_state {
    double lat_rad, lon_rad, h_m;
    double v_n_mps[3]; /* east, north, up, against the Earth */
    double C_nb[9];    /* row-major */
};
#define NAV_STATE_DOUBLES 15 /* of a row, where arrays hold such structures */

enum nav_vertical {
    NAV_VERTICAL_FREE,  /* as the sensors say: it diverges, e-fold in 9.5 min */
    NAV_VERTICAL_FIXED, /* height stays as it is and the vertical velocity 0: the horizontal channel alone */
};

struct nav_strapdown {
    struct nav_state at;
    double dtheta_rad[3]; /* of the interval before; all zero: none, and the first one has no coning and no sculling */
    double dv_mps[3];
    int vertical; /* enum nav_vertical */
};

/* Gravity on the ellipsoid and near it, m/s^2: Somigliana (NIMA TR8350.2, 4-1), linear in height. */
NAV_API double nav_gravity_mps2(double lat_rad, double h_m);

/* Radii of curvature plus height, m: of the meridian and of the prime vertical. */
NAV_API void nav_radii_m(double lat_rad, double h_m, double *meridian_m, double *vertical_m);

/* Of roll about y (forward), pitch about x (right) and heading clockwise from north, rad: b right, forward, up. */
NAV_API void nav_dcm(double heading_rad, double pitch_rad, double roll_rad, double C_nb[9]);
NAV_API void nav_dcm_angles(const double C_nb[9], double *heading_rad, double *pitch_rad, double *roll_rad);

/* n intervals of dt_s: dtheta_rad[n][3] and dv_mps[n][3], raw increments. `s` goes on from call to call: n calls of one interval
 * are one call of n. path[n]: the state after each interval; NULL: only the last one is of interest.
 * Returns NAV_OK; NAV_RANGE: n < 0, dt_s not in (0, 1], unknown vertical, latitude beyond 89.9 deg at the start or on the way;
 * NAV_NOT_FINITE: a number of the state or an increment. Then `s` is as it was, *done (not NULL) is the number of the interval,
 * and of `path` the rows before it are valid. */
NAV_API int nav_integrate(struct nav_strapdown *s, const double *dtheta_rad, const double *dv_mps, int64_t n,
                          double dt_s, struct nav_state *path, int64_t *done);

#ifdef __cplusplus
}
#endif

#endif
